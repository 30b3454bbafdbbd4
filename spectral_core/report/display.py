"""The report of `characterise`: one self-contained HTML file about a display or both eyes of a headset."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any

import spectral_core
from spectral_core.chromaticities import XYZ_to_xy, xy_to_uv
from spectral_core.display.characterising.characterise import Characterisation
from spectral_core.display.characterising.verdicts import ADDITIVE_PERCENT
from spectral_core.display.judging.eyes import eye_difference
from spectral_core.display.measuring.measurements import Measurements
from spectral_core.report import display_findings, display_plots, display_tables
from spectral_core.report.display_data import DARK_GREY, held_out, ramps, visible_greys
from spectral_core.report.extras import extra
from spectral_core.report.pages import write_page
from spectral_core.standards import cct_and_duv, srgb_to_XYZ_matrix

_FEWEST_GREYS = 3


@dataclass(frozen=True)
class Eye:
    """A display, or one eye of a headset.

    Attributes
    ----------
    name
        What the page calls it.
    file
        Name of the file of measurements.
    read
        The measurements in the file's units.
    found
        What `characterise` made of them.
    """

    name: str
    file: str
    read: Measurements
    found: Characterisation


@dataclass(frozen=True)
class DisplayReport:
    """What a report is made of: one eye or two, the command that makes it, and the day it was made."""

    eyes: Sequence[Eye]
    command: str
    made: date


def write_display_report(path: Path, report: DisplayReport) -> None:
    """Write the report as one HTML file without external resources, the same bytes for the same input.

    Raises
    ------
    MissingExtraError
        If matplotlib or jinja2 is not installed.
    OutputError
        If the file cannot be written.
    """
    extra("matplotlib")
    extra("jinja2")
    write_page(path, "display.html", _context(report))


def _context(report: DisplayReport) -> dict[str, Any]:
    eyes = report.eyes
    greys = {each.name: visible_greys(each.found.measured) for each in eyes}
    greys = {name: grey for name, grey in greys.items() if len(grey.codes) >= _FEWEST_GREYS}
    found = {each.name: each.found for each in eyes}
    return {
        "title": f"Display characterisation: {eyes[0].file if len(eyes) == 1 else 'both eyes'}",
        "eyes": [_eye(each) for each in eyes],
        "gamut_plot": display_plots.gamut_plot({each.name: each.read for each in eyes}),
        "grey_plot": display_plots.grey_plot(greys, found) if greys else None,
        "dark_grey": DARK_GREY,
        "both": _both(eyes[0], eyes[1]) if len(eyes) > 1 else None,
        "command": report.command,
        "made": report.made.isoformat(),
        "version": spectral_core.__version__,
    }


def _eye(eye: Eye) -> dict[str, Any]:
    """What the template shows of one eye."""
    found, read = eye.found, eye.read
    held = held_out(found)
    curves = ramps(found)
    names = [each.name for each in found.models]
    return {
        "name": eye.name,
        "file": eye.file,
        "instrument": read.instrument,
        "created": read.date or "",
        "unit": read.unit,
        "patches": len(read.codes),
        "mixed": int(read.mixed.sum()),
        "additive": abs(100 * found.checks.additivity_error) <= ADDITIVE_PERCENT,
        "left_out": len(read.codes) - len(found.measured.codes),
        "chosen": found.chosen,
        "tested": len(found.chosen.held_out_errors),
        "published": next((each for each in found.models if each.name == "gamma-matrix-black"), None),
        "why": display_findings.why_chosen(found),
        "checks": found.checks,
        "contrast": 1 / found.checks.black_share if found.checks.black_share > 0 else None,
        "black_measured": read.at(0, 0, 0) is not None,
        "warnings": found.warnings,
        "missing": display_findings.what_is_missing(found, read),
        "white": _white(read),
        "coverage": display_tables.coverages(read),
        "gamut_table": display_tables.gamut_table(found, read),
        "primaries_table": display_tables.primaries_table(found, read),
        "ramps": [each.name for each in curves],
        "unlit": sum(each.unlit for each in curves),
        "ramp_plot": display_plots.ramp_plot(curves, names, found.chosen.name) if curves else None,
        "models_table": display_tables.models_table(found),
        "error_plot": display_plots.error_plot(held) if held else None,
        "held": held,
        "worst_table": display_tables.worst_table(held) if held else None,
        "additivity_plot": display_plots.additivity_plot(read),
    }


def _white(read: Measurements) -> dict[str, float]:
    """Colour temperature of white, and how far it is from D65 in u', v'."""
    xy = XYZ_to_xy(read.white_XYZ)
    cct, duv = cct_and_duv(xy)
    d65 = XYZ_to_xy(srgb_to_XYZ_matrix().sum(axis=1))
    du, dv = xy_to_uv(xy) - xy_to_uv(d65)
    return {"Y": float(read.white_XYZ[1]), "cct_K": cct, "duv": duv, "from_D65": float((du**2 + dv**2) ** 0.5)}


def _both(left: Eye, right: Eye) -> dict[str, Any]:
    difference = eye_difference(left.found, right.found, left.read, right.read)
    names = (left.name, right.name)
    made = display_tables.eyes_table(names, (left.found, right.found), (left.read, right.read), difference)
    return {"difference": difference, "table": made}
