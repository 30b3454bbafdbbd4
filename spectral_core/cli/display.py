"""Commands of ``spectral-booth`` about displays: characterise, convert."""

from __future__ import annotations

import csv
import io
import sys
from pathlib import Path

import click
import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.cli.console import emit, rounded, table
from spectral_core.cli.options import as_json, observer_option, profile_option
from spectral_core.cli.profile import profile as profile_group
from spectral_core.display import DisplayProfile, load_profile, write_profile
from spectral_core.display.characterise import characterise as choose
from spectral_core.display.fitting import MODEL_KINDS
from spectral_core.display.measurements import read_measurements
from spectral_core.display.profile import in_gamut
from spectral_core.documents import characterise_document
from spectral_core.errors import DisplayError
from spectral_core.files import read_text

_PATH = click.Path(path_type=Path)
_HEADERS = {"xyz": ["R", "G", "B"], "codes": ["X", "Y", "Z"]}


@click.command()
@click.argument("file", type=_PATH)
@click.option("-o", "--output", type=_PATH, help="write the profile as JSON")
@click.option(
    "--model", type=click.Choice([kind.name for kind in MODEL_KINDS]), help="use this one instead of the best"
)
@observer_option
@as_json
def characterise(file: Path, output: Path | None, model: str | None, observer: str, json: bool) -> None:
    """Choose a model for a display measured in FILE, by its error on colours held out.

    FILE is Argyll's .ti3, or CSV: R,G,B,X,Y,Z or R,G,B,x,y,Y or rows Red, Green, Blue, White, Black.
    """
    measured = read_measurements(file, observer)
    found = choose(measured, model)
    document = characterise_document(found, measured)
    if output is not None:
        source = f"characterised from {file.name}, {len(found.measured.codes)} patches, {measured.instrument}".rstrip(
            ", "
        )
        write_profile(DisplayProfile(output.stem, found.chosen.model, source, float(measured.white_XYZ[1])), output)
        document["file"] = str(output)
    rows = []
    for each in document["models"]:
        held_out = each["held_out"] or {"mean": None, "p95": None, "max": None}
        mark = "*" if each["name"] == document["model"] else ""
        figures = [held_out[key] for key in ("mean", "p95", "max")] + [each["fit"]["mean"]]
        rows.append(
            [f"{each['name']} {mark}".strip(), *rounded(figures, 3), *rounded([each["nanoseconds_per_pixel"]], 0)]
        )
    columns = ("model (* chosen)", "held out: mean", "95 %", "max dE00", "fit: mean", "ns/pixel")
    emit(document, json, lambda console: console.print(table(columns, rows)))


@click.command()
@profile_option
@click.option("--to", "target", type=click.Choice(["xyz", "codes"]), required=True)
@click.option("--keep", is_flag=True, help="do not clip codes that are out of gamut")
@click.argument("file", type=_PATH, required=False)
def convert(profile: str, target: str, keep: bool, file: Path | None) -> None:
    """Convert a CSV (standard input without FILE) between codes R,G,B (0..1) and X,Y,Z.

    XYZ is in the units of the profile's measurements. Codes out of gamut are clipped channel by
    channel, and counted on standard error.
    """
    display = load_profile(profile)
    values = _read(file, _HEADERS[target])
    if target == "xyz":
        result = display.to_XYZ(values) * display.white_Y
    else:
        result = display.to_codes(values / display.white_Y)
        outside = int((~in_gamut(result)).sum())
        if outside:
            print(f"warning: {outside} of {len(result)} colours are out of gamut", file=sys.stderr)
        result = result if keep else np.clip(result, 0.0, 1.0)
    writer = csv.writer(sys.stdout, lineterminator="\n")
    writer.writerow(_HEADERS["codes" if target == "xyz" else "xyz"])
    writer.writerows([f"{value:.9g}" for value in row] for row in result)


def add_display_commands(group: click.Group) -> None:
    """Add this module's commands to the program."""
    group.add_command(characterise)
    group.add_command(convert)
    group.add_command(profile_group)


def _read(file: Path | None, header: list[str]) -> Float64Array:
    """The three columns (n, 3) under a header."""
    where = file or Path("standard input")
    text = sys.stdin.read() if file is None else read_text(file, DisplayError, "give a CSV of colours")
    rows = [[cell.strip() for cell in row] for row in csv.reader(io.StringIO(text)) if row]
    if not rows or rows[0][:3] != header:
        raise DisplayError(f"does not begin with the header {','.join(header)}", where=where, remedy="add it")
    values = np.empty((len(rows) - 1, 3))
    for index, row in enumerate(rows[1:]):
        try:
            values[index] = [float(cell) for cell in row[:3]]
        except ValueError:
            values[index] = np.nan
        if not np.isfinite(values[index]).all():
            raise DisplayError("no three finite numbers", where=f"{where}, line {index + 2}", remedy="correct the row")
    return values
