"""Commands of ``spectral-booth`` about displays: characterise, convert."""

from __future__ import annotations

import csv
import io
import sys
from pathlib import Path

import click
import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.cli.console import emit, progress_bar
from spectral_core.cli.display_tables import show_advice, show_characterisation
from spectral_core.cli.options import FiniteRange, as_json, observer_option, profile_option
from spectral_core.display import DisplayProfile, load_profile, write_profile
from spectral_core.display.advice import LARGEST, advise
from spectral_core.display.characterise import characterise as choose
from spectral_core.display.fitting import MODEL_KINDS
from spectral_core.display.measurements import Measurements, read_measurements
from spectral_core.display.profile import in_gamut
from spectral_core.documents import advice_document, characterise_document
from spectral_core.errors import DisplayError
from spectral_core.files import atomic_path, read_text

_PATH = click.Path(path_type=Path)
_HEADERS = {"xyz": ["R", "G", "B"], "codes": ["X", "Y", "Z"]}


@click.command()
@click.argument("file", type=_PATH, required=False)
@click.option("-o", "--output", type=_PATH, help="write the profile as JSON; with --advise, the patches as CSV")
@click.option(
    "--model", type=click.Choice([kind.name for kind in MODEL_KINDS]), help="use this one instead of the best"
)
@click.option(
    "--advise", "wants_advice", is_flag=True, help="propose the next patches to measure; FILE may be left out"
)
@click.option("--accuracy", type=FiniteRange(min=0, min_open=True), help="with --advise: mean dE00 to reach")
@click.option("--patches", type=click.IntRange(1, LARGEST), help="with --advise: propose so many")
@observer_option
@as_json
def characterise(
    file: Path | None,
    output: Path | None,
    model: str | None,
    wants_advice: bool,
    accuracy: float | None,
    patches: int | None,
    observer: str,
    json: bool,
) -> None:
    """Choose a model for a display measured in FILE, by its error on colours held out.

    FILE is Argyll's .ti3, or CSV: R,G,B,X,Y,Z or R,G,B,x,y,Y or R,G,B and a spectrum, or rows Red,
    Green, Blue, White, Black. With --advise, say what to measure next and what that promises.
    """
    if wants_advice:
        if model is not None:
            raise click.UsageError("--advise chooses the model itself; leave --model out")
        _advise(None if file is None else read_measurements(file, observer), output, accuracy, patches, json)
        return
    if file is None:
        raise click.UsageError("give a FILE of measurements, or --advise")
    if accuracy is not None or patches is not None:
        raise click.UsageError("--accuracy and --patches belong to --advise")
    measured = read_measurements(file, observer)
    found = choose(measured, model)
    document = characterise_document(found, measured)
    if output is not None:
        source = f"characterised from {file.name}, {len(found.measured.codes)} patches, {measured.instrument}".rstrip(
            ", "
        )
        write_profile(DisplayProfile(output.stem, found.chosen.model, source, float(measured.white_XYZ[1])), output)
        document["file"] = str(output)
    emit(document, json, lambda console: show_characterisation(console, document))


def _advise(
    measured: Measurements | None, output: Path | None, accuracy: float | None, patches: int | None, json: bool
) -> None:
    with progress_bar("simulating") as report:
        found = advise(measured, accuracy, patches, report)
    document = advice_document(found)
    if output is not None:
        if not len(found.codes):
            raise DisplayError(
                "there is nothing to measure: what is measured is enough", where=output, remedy=found.why
            )
        lines = ["R,G,B", *(",".join(repr(value) for value in row) for row in found.codes.tolist())]
        with atomic_path(output) as temporary:
            temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
        document["file"] = str(output)
    emit(document, json, lambda console: show_advice(console, document))


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
