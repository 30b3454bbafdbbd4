"""Commands of ``spectral-booth`` about what a headset shows where and how brightly: luminance, field."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import click
import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.cli.console import Document, emit, facts, naming, rounded, table
from spectral_core.cli.options import FiniteRange, as_json, observer_option, profile_option
from spectral_core.display import load_profile
from spectral_core.display.judging.field import FieldReport, field_report, read_field
from spectral_core.display.limits.luminance import LuminanceMapping, SceneColour, map_luminance
from spectral_core.lights import Light
from spectral_core.report.field import write_field_plot
from spectral_core.spectra import Spectra, colorchecker_spectra, read_spectra

_PATH = click.Path(path_type=Path)
_MOST_SHOWN = 12


@click.command()
@profile_option
@click.option(
    "--white", type=FiniteRange(0, 1e9, min_open=True), metavar="CD_M2",
    help="luminance of the booth's white: 1000 lx on a perfect diffuser give 318",
)  # fmt: skip
@click.option(
    "--fraction", type=FiniteRange(0, 1e3, min_open=True),
    help="luminance of the scene's white, of the display's; the profile's own setting if left out",
)  # fmt: skip
@click.option("--light", "lights", metavar="LIGHT", multiple=True, default=("D65",), help="repeat for several")
@click.option("--colours", default="colorchecker", metavar="FILE", help="reflectances; the ColorChecker if left out")
@observer_option
@as_json
def luminance(
    profile: str, white: float | None, fraction: float | None, lights: Sequence[str], colours: str, observer: str,
    json: bool,
) -> None:  # fmt: skip
    """Which luminance a scene's white gets on a display, and what does not fit.

    The scene is the perfect diffuser and the reflectances under each light, all lights at the same
    luminance.
    """
    display = load_profile(profile)
    spectra = colorchecker_spectra() if colours == "colorchecker" else read_spectra(colours, "reflectance")
    chosen = {light.name: light for light in (Light.load(each) for each in lights)}
    whites = {name: light.XYZ(observer) for name, light in chosen.items()}
    scene = tuple(each for light in chosen.values() for each in _scene(spectra, light, observer))
    found = map_luminance(display, scene, whites, white, fraction)
    warnings = [*spectra.warnings, *(each for light in chosen.values() for each in light.warnings), *found.warnings]
    document: Document = {
        "profile": display.name,
        "display_white_cd_m2": display.white_luminance_cd_m2,
        "lights": list(chosen),
        "colours": len(scene) + len(whites),
        **asdict(found),
        "warnings": list(dict.fromkeys(warnings)),
    }

    emit(document, json, lambda console: console.print(facts(_told(found))))


@click.command()
@click.argument("readings", type=_PATH)
@click.option("--plot", type=_PATH, help="write a picture (PNG)")
@as_json
def field(readings: Path, plot: Path | None, json: bool) -> None:
    """How uniform a headset's field is, from READINGS at several points (CSV).

    Columns: x_deg,y_deg (right and up from the centre), then Y, or x,y,Y, or R,G,B,X,Y,Z.
    """
    with naming(readings):
        found = field_report(read_field(readings))
    if plot is not None:
        write_field_plot(found, plot)
    document: Document = {
        **field_document(found),
        **({"file": str(plot)} if plot else {}),
    }
    emit(document, json, lambda console: console.print(table(_FIELD_COLUMNS, _field_rows(found))))


def field_document(found: FieldReport) -> Document:
    """`field`."""
    return {
        "points": len(np.unique(found.patches[0].points_deg, axis=0)),
        "patches": [each.to_json() for each in found.patches],
        "warnings": list(found.warnings),
    }


def add_luminance_commands(group: click.Group) -> None:
    """Add this module's commands to the program."""
    group.add_command(luminance)
    group.add_command(field)


_FIELD_COLUMNS = ("patch", "n", "min", "mean", "max", "%/deg", "dE00", "du'v'", "map", "error")


def _field_rows(found: FieldReport) -> list[list[object]]:
    """Largest colour differences; the map's degree and its held-out error."""
    rows: list[list[object]] = []
    for each in found.patches:
        span = (each.luminance.min, each.luminance.mean, each.luminance.max, each.fall_off_percent_per_degree)
        shifts = (each.dE00.max if each.dE00 else None, each.delta_uv.max if each.delta_uv else None)
        degree, error = (each.map.degree, each.map.held_out_rms) if each.map else (None, None)
        figures = [*rounded(span, 3), *rounded(shifts[:1], 2), *rounded(shifts[1:], 4)]
        rows.append([each.name, len(each.points_deg), *figures, degree, *rounded([error], 4)])
    return rows


def _scene(spectra: Spectra, light: Light, observer: str) -> list[SceneColour]:
    XYZ: Float64Array = spectra.values @ light.weighting_factors(spectra.wavelengths_nm, observer).matrix
    return [SceneColour(name, light.name, each) for name, each in zip(spectra.names, XYZ, strict=True)]


def _told(found: LuminanceMapping) -> Document:
    """The mapping in sentences."""
    told = {"scene's white shown at": _share(found.factor, found.headset_white_cd_m2)}
    if found.booth_white_cd_m2 is not None:
        told["booth's white"] = f"{found.booth_white_cd_m2:.4g} cd/m2, asked for as it is"
    if found.largest_factor is None:
        told["largest that fits"] = "none: no colour has a chromaticity that the display can show"
    else:
        told["largest that fits"] = _share(found.largest_factor, found.largest_white_cd_m2)
    for light, limit in found.white_largest_factor.items():
        told[f"perfect diffuser under {light}"] = (
            "outside the display's chromaticities" if limit is None else f"fits up to {limit:.4f}"
        )
    told["to be dimmed by"] = (
        f"{found.dimming_percent:.2f} % ({found.dimming_stops:.2f} stops)" if found.dimming_percent else "nothing"
    )
    told["beyond the peak"] = _listed(
        [f"{each.name} under {each.light} {each.ratio:.3f} times" for each in found.beyond_peak]
    )
    told["outside whatever the luminance"] = _listed(
        [f"{each.name} under {each.light} (moves {each.delta_uv:.4f} in u'v')" for each in found.outside_chromaticity]
    )
    black = found.black
    told["darkest that can be shown"] = f"Y = {black.scene_Y:.5f} of the perfect diffuser" + (
        "" if black.luminance_cd_m2 is None else f", {black.luminance_cd_m2:.3g} cd/m2"
    )
    told["darkest in the scene"] = f"Y = {black.darkest_Y:.5f}, {black.darkest}"
    told["contrast"] = (
        f"{black.contrast_scene:.0f} : 1 in the scene, {black.contrast_shown:.0f} : 1 shown, "
        f"{black.contrast_lost_stops:.2f} stops lost"
    )
    told["shown as black"] = _listed(list(black.crushed))
    told["tinted by black's light"] = _listed(list(black.tinted))
    return told


def _share(factor: float, luminance_cd_m2: float | None) -> str:
    absolute = "" if luminance_cd_m2 is None else f", {luminance_cd_m2:.4g} cd/m2"
    return f"{factor:.4f} of the display's white{absolute}"


def _listed(names: list[str]) -> str:
    more = len(names) - _MOST_SHOWN
    return "; ".join(names[:_MOST_SHOWN]) + (f"; and {more} more" if more > 0 else "") or "none"
