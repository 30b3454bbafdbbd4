"""The command ``spectral-booth compare``: predicted against measured colours."""

from __future__ import annotations

from pathlib import Path

import click
import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.cli.console import Document, emit, naming, rounded, table
from spectral_core.cli.options import as_json, observer_option
from spectral_core.display import load_profile
from spectral_core.display.judging.comparison import (
    Colours,
    Comparison,
    predict,
    read_colours,
    unit_warnings,
)
from spectral_core.display.judging.comparison import compare as pair
from spectral_core.display.measuring.tables import finite_number
from spectral_core.errors import DisplayError

_PATH = click.Path(path_type=Path)
_SHOWN = 12


@click.command()
@click.argument("first", type=_PATH)
@click.argument("second", type=_PATH, required=False)
@click.option("--profile", metavar="PROFILE", help="predict the colours of FIRST's codes instead of giving SECOND")
@click.option("--white", metavar="X,Y,Z", help="the white of L*a*b*; the measured white if left out")
@click.option("--plot", type=_PATH, help="draw the pairs to this .png or .svg")
@observer_option
@as_json
def compare(
    first: Path, second: Path | None, profile: str | None, white: str | None, plot: Path | None, observer: str,
    json: bool,
) -> None:  # fmt: skip
    """Differences (dE00) between predicted colours FIRST and measured colours SECOND.

    Each is a CSV with X,Y,Z or x,y,Y, or measurements as for `characterise`. Colours pair by codes or
    names where both have them, else by order. With --profile FIRST is measured.
    """
    if (second is None) == (profile is None):
        raise DisplayError("nothing to compare with", remedy="give either a second file or --profile, not both")
    warnings = []
    if second is not None:
        predicted, measured = read_colours(first, observer), read_colours(second, observer)
    else:
        measured = read_colours(first, observer)
        display = load_profile(str(profile))
        with naming(first):
            predicted, scaled = predict(measured, display)
        warnings += ["no absolute unit in common: the profile's white was scaled to the measured"] if scaled else []
    white_XYZ, source = _white(predicted, measured, white)
    compared = pair(predicted, measured, white_XYZ)
    document = compare_document(compared, source, [*warnings, *unit_warnings(compared)])
    if plot is not None:
        # Only a plot needs matplotlib.
        from spectral_core.report.comparison import write_comparison_plot

        write_comparison_plot(compared, plot)
        document["file"] = str(plot)
    worst = sorted(document["pairs"], key=lambda each: -each["dE00"])[:_SHOWN]
    rows = [[each["name"], *rounded([each[key] for key in ("dE00", "dL", "dC", "dh")], 2)] for each in worst]
    left = len(compared.dE00) - len(rows)
    statistics = ", ".join(f"{key} {value:.2f}" for key, value in document["dE00"].items() if value is not None)
    title = f"{len(compared.dE00)} pairs: {statistics}; {source}" + (f"; {left} smaller left out" if left else "")
    emit(
        document, json, lambda console: console.print(table(("colour", "dE00", "dL*", "dC*", "dh / deg"), rows, title))
    )


def compare_document(compared: Comparison, source: str, warnings: list[str]) -> Document:
    """`compare`: statistics and pairs; differences are measured less predicted, sd is the sample's."""
    dE00 = compared.dE00
    return {
        "dE00": {
            "mean": float(dE00.mean()),
            "sd": float(dE00.std(ddof=1)) if len(dE00) > 1 else None,
            "p95": float(np.percentile(dE00, 95)),
            "max": float(dE00.max()),
        },
        "white_XYZ": compared.white_XYZ.tolist(),
        "white": source,
        "pairs": [
            {
                "name": name,
                "predicted_XYZ": compared.predicted_XYZ[index].tolist(),
                "measured_XYZ": compared.measured_XYZ[index].tolist(),
                "dE00": float(dE00[index]),
                "dL": float(compared.dL[index]),
                "dC": float(compared.dC[index]),
                "dh": float(compared.dh[index]) if compared.hue_known[index] else None,
            }
            for index, name in enumerate(compared.labels)
        ],
        "warnings": warnings,
    }


def _white(predicted: Colours, measured: Colours, given: str | None) -> tuple[Float64Array, str]:
    """XYZ (3,) of Lab's white and where it is from."""
    if given is not None:
        return _parse_white(given), "white as given"
    for colours, source in ((measured, "measured white"), (predicted, "white of the predicted colours")):
        white = colours.white_XYZ()
        if white is not None and (white > 0).all():
            return white, source
    raise DisplayError("there is no white among the colours", remedy="give --white X,Y,Z in their unit")


def _parse_white(text: str) -> Float64Array:
    try:
        values = np.array([finite_number(part.strip(), "--white") for part in text.split(",")])
    except DisplayError:
        values = np.zeros(0)
    if values.shape != (3,) or not (values > 0).all():
        raise DisplayError(f"--white '{text}' is no white", remedy="give three numbers above 0, as 95.05,100,108.88")
    return values


def add_compare_command(group: click.Group) -> None:
    """Add this module's command to the program."""
    group.add_command(compare)
