"""Commands of ``spectral-booth`` about displays: characterise, convert."""

from __future__ import annotations

import csv
import shlex
import sys
from dataclasses import asdict, replace
from datetime import date
from pathlib import Path
from typing import Any

import click

from spectral_core.arrays import Float64Array
from spectral_core.cli.console import Document, emit, naming, progress_bar
from spectral_core.cli.display_tables import show_advice, show_characterisation
from spectral_core.cli.options import FiniteRange, as_json, observer_option, profile_option
from spectral_core.cli.profile import make_profile, profile_warnings, state_options
from spectral_core.display import load_profile, write_profile
from spectral_core.display.characterising.advice import LARGEST, advise
from spectral_core.display.characterising.characterise import Characterisation
from spectral_core.display.characterising.characterise import characterise as choose
from spectral_core.display.judging.eyes import eye_difference
from spectral_core.display.limits.gamut import GAMUT_RULES, GamutCounts, map_to_gamut
from spectral_core.display.measuring.measurements import Measurements, read_measurements
from spectral_core.display.measuring.tables import parse_table
from spectral_core.display.models.fitting import MODEL_KINDS
from spectral_core.documents import advice_document, characterise_document
from spectral_core.errors import DisplayError
from spectral_core.files import atomic_path, read_text
from spectral_core.report.display import DisplayReport, Eye, write_display_report
from spectral_core.standards import DEFAULT_OBSERVER

_PATH = click.Path(path_type=Path)
_HEADERS = {"xyz": ["R", "G", "B"], "codes": ["X", "Y", "Z"]}


@click.command()
@click.argument("file", type=_PATH, required=False)
@click.option("-o", "--output", type=_PATH, help="write the profile as JSON; with --advise, the patches as CSV")
@click.option(
    "--model", type=click.Choice([kind.name for kind in MODEL_KINDS]), help="use this one instead of the best"
)
@state_options
@click.option("--report", type=_PATH, help="write an HTML report there")
@click.option(
    "--right", type=_PATH, metavar="FILE", help="the right eye, FILE is then the left: both go into the report"
)
@click.option(
    "--advise", "wants_advice", is_flag=True, help="propose the next patches to measure; FILE may be left out"
)
@click.option("--accuracy", type=FiniteRange(min=0, min_open=True), help="with --advise: mean dE00 to reach")
@click.option("--patches", type=click.IntRange(1, LARGEST), help="with --advise: propose so many")
@observer_option
@as_json
def characterise(
    file: Path | None, output: Path | None, model: str | None, report: Path | None, right: Path | None,
    wants_advice: bool, accuracy: float | None, patches: int | None, observer: str, json: bool, **given: Any,
) -> None:  # fmt: skip
    """Choose a model for a display measured in FILE, by its error on colours held out.

    FILE is Argyll's .ti3, or CSV: R,G,B,X,Y,Z or R,G,B,x,y,Y or R,G,B and a spectrum, or rows Red,
    Green, Blue, White, Black. With --advise, say what to measure next and what that promises.
    """
    if wants_advice:
        if model is not None:
            raise click.UsageError("--advise chooses the model itself; leave --model out")
        if report is not None or right is not None or any(value is not None for value in given.values()):
            raise click.UsageError("--advise writes patches only; leave --report, --right and the state out")
        _advise(None if file is None else read_measurements(file, observer), output, accuracy, patches, json)
        return
    if file is None:
        raise click.UsageError("give a FILE of measurements, or --advise")
    if accuracy is not None or patches is not None:
        raise click.UsageError("--accuracy and --patches belong to --advise")
    if right is not None and report is None:
        raise DisplayError("--right is for a report of both eyes", remedy="give --report FILE.html as well")
    if output is None and any(value is not None for value in given.values()):
        raise click.UsageError("the state of the headset is kept in a profile; give -o FILE.json as well")
    measured, found = _characterised(file, model, observer)
    document = characterise_document(found, measured)
    profile = None
    if output is not None:
        source = f"characterised from {file.name}, {len(found.measured.codes)} patches, {measured.instrument}".rstrip(
            ", "
        )
        profile = make_profile(output.stem, found.chosen.model, source, measured, given)
    # Nothing is written before everything is known to be right.
    if report is not None:
        document |= _write_report(report, Eye("display", file.name, measured, found), right, model, observer)
    if output is not None and profile is not None:
        write_profile(profile, output)
        document["file"] = str(output)
        document["warnings"] += profile_warnings(profile, measured)
    emit(document, json, lambda console: show_characterisation(console, document))


def _characterised(file: Path, model: str | None, observer: str) -> tuple[Measurements, Characterisation]:
    """The measurements of a file and its models."""
    measured = read_measurements(file, observer)
    with naming(file):
        return measured, choose(measured, model)


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
@click.option(
    "--gamut", type=click.Choice(GAMUT_RULES), default="clip", show_default=True, help="what becomes of other colours"
)
@click.option("--keep", is_flag=True, help="the same as --gamut keep")
@click.argument("file", type=_PATH, required=False)
def convert(profile: str, target: str, gamut: Any, keep: bool, file: Path | None) -> None:
    """Convert a CSV (standard input without FILE) between codes R,G,B (0..1) and X,Y,Z.

    XYZ is in the units of the profile's measurements. Colours out of gamut are clipped channel by
    channel, or keep their chromaticity and lose luminance (`chromaticity`), or give codes outside
    0..1 (`keep`); they are counted on standard error.
    """
    if keep and gamut == "chromaticity":
        raise click.UsageError("--keep and --gamut chromaticity exclude each other")
    display = load_profile(profile)
    values = _read(file, _HEADERS[target])
    if target == "xyz":
        beyond = int(((values < 0) | (values > 1)).any(axis=1).sum())
        if beyond:
            print(
                f"warning: {beyond} of {len(values)} codes are outside 0..1: the model is extrapolated", file=sys.stderr
            )
        result = display.to_XYZ(values) * display.white_Y
    else:
        result, counts = map_to_gamut(display, values / display.white_Y, "keep" if keep else gamut)
        if counts.outside:
            print(f"warning: {_told(counts)}", file=sys.stderr)
    writer = csv.writer(sys.stdout, lineterminator="\n")
    writer.writerow(_HEADERS["codes" if target == "xyz" else "xyz"])
    writer.writerows([f"{value:.9g}" for value in row] for row in result)


def _write_report(report: Path, eye: Eye, right: Path | None, model: str | None, observer: str) -> Document:
    """Write the report of a display, or of both eyes, and return what the document says of it."""
    options = {"--model": model, "--observer": observer if observer != DEFAULT_OBSERVER else None}
    options |= {"--right": right.name if right else None, "--report": report.name}
    given = [part for option, value in options.items() if value for part in (option, value)]
    document: Document = {"report": str(report)}
    eyes = [eye]
    if right is not None:
        measured, found = _characterised(right, model, observer)
        eyes = [replace(eye, name="left eye"), Eye("right eye", right.name, measured, found)]
        difference = eye_difference(eye.found, found, eye.read, measured)
        document |= {"right": characterise_document(found, measured), "eyes": asdict(difference)}
    command = shlex.join(["spectral-booth", "characterise", eye.file, *given])
    write_display_report(report, DisplayReport(eyes, command, date.today()))
    return document


def add_display_commands(group: click.Group) -> None:
    """Add this module's commands to the program."""
    group.add_command(characterise)
    group.add_command(convert)


def _told(counts: GamutCounts) -> str:
    return (
        f"{counts.outside} of {counts.total} colours are out of gamut: {counts.luminance} by luminance, "
        f"{counts.chromaticity} by chromaticity, {counts.black} too dark for the display's black"
    )


def _read(file: Path | None, header: list[str]) -> Float64Array:
    """The three columns (n, 3) under a header."""
    path = file or Path("standard input")
    text = _standard_input(path) if file is None else read_text(file, DisplayError, "give a CSV of colours")
    missing = DisplayError(f"does not begin with the header {','.join(header)}", where=path, remedy="add it")
    if not text.strip():
        raise missing
    table = parse_table(text, path, "give a CSV of colours", least=0)
    if list(table.header[:3]) != header:
        raise missing
    return table.numbers_at(range(3))


def _standard_input(path: Path) -> str:
    try:
        return sys.stdin.read().removeprefix("\ufeff")
    except UnicodeDecodeError:
        raise DisplayError("is not a text in UTF-8", where=path, remedy="give a CSV of colours") from None
