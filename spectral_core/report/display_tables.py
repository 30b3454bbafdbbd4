"""Tables of the display report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from spectral_core import standards
from spectral_core.arrays import Float64Array
from spectral_core.chromaticities import XYZ_to_uv, XYZ_to_xy, xy_to_uv
from spectral_core.display import srgb
from spectral_core.display.characterising.characterise import Characterisation, ModelResult
from spectral_core.display.judging.eyes import EyeDifference
from spectral_core.display.limits.coverage import (
    Coverage,
    coverage,
    reference_volume,
    reference_xy,
    volume,
)
from spectral_core.display.measuring.measurements import Measurements
from spectral_core.report.display_data import HeldOut, primaries_XYZ, worst
from spectral_core.report.numerals import NONE, fixed, percent
from spectral_core.report.tables import Row, Table, css_colour

WORST = 10
_UNITS = {"cd/m2": "cd/m²"}


def coverages(measured: Measurements) -> dict[str, tuple[Coverage, Coverage]]:
    """Of each reference gamut by the measured primaries: in x, y and in u', v'."""
    xy = XYZ_to_xy(primaries_XYZ(measured))
    return {
        name: (coverage(xy, reference_xy(name)), coverage(xy_to_uv(xy), xy_to_uv(reference_xy(name))))
        for name in standards.GAMUTS
    }


def gamut_table(found: Characterisation, measured: Measurements) -> Table:
    """Coverage, area and, where the model was tested, volume against the reference gamuts."""
    tested = found.chosen.held_out is not None
    own = volume(found.chosen.model.forward, found.measured.white_XYZ) if tested else None
    rows = []
    for name, (xy, uv) in coverages(measured).items():
        share = None if own is None else own / reference_volume(name)
        cells = [percent(each) for each in (xy.covered, xy.area, uv.covered, uv.area, share)]
        rows.append(Row((name, *cells)))
    sentence = "Volume: of CIELAB relative to each white"
    if own is None:
        sentence += "; not stated, as no model was tested on mixed colours"
    else:
        sentence += f", by the chosen model ({fixed(own / 1000, 0)} thousand cubic units; sRGB has "
        sentence += f"{fixed(reference_volume('sRGB') / 1000, 0)} thousand)"
    return Table(
        "The triangle of the measured primaries against reference gamuts (all with a D65 white). Coverage: area of "
        f"the intersection; area: of the whole triangle; both over the reference's area. {sentence}.",
        ("gamut", "coverage", "area", "coverage", "area", "volume"),
        tuple(rows),
        groups=(("", 1), ("in x, y", 2), ("in u′, v′", 2), ("CIELAB", 1)),
    )


def primaries_table(found: Characterisation, measured: Measurements) -> Table:
    """Chromaticity, luminance and gamma of the primaries, white and black."""
    white = measured.white_XYZ
    black = measured.at(0, 0, 0)
    named = dict(zip(("red", "green", "blue"), primaries_XYZ(measured), strict=True)) | {"white": white}
    named |= {} if black is None else {"black": black}
    rows = []
    for name, XYZ in named.items():
        gamma, r2 = found.gamma.get(name[0].upper(), (None, None)) if name != "black" else (None, None)
        known = XYZ.sum() > 0
        xy = XYZ_to_xy(XYZ) if known else np.full(2, np.nan)
        places = [fixed(each, 4) for each in (*xy, *xy_to_uv(xy))]
        cells = (*places, fixed(XYZ[1], 2 if XYZ[1] >= 10 else 4), percent(XYZ[1] / white[1], 2))
        # R² 0 says that there was no ramp and the gamma is assumed.
        rows.append(Row((name, *cells, *((fixed(gamma, 3), fixed(r2, 5)) if r2 else (NONE, NONE)))))
    return Table(
        f"As measured, black included. Y in {_UNITS.get(measured.unit, 'relative units of the file')}. "
        "Gamma: exponent of the channel's ramp by regression through full drive, black subtracted, and the share of "
        "variance that it explains; a dash where no ramp was measured.",
        ("", "x", "y", "u′", "v′", "Y", "Y / white", "gamma", "R²"),
        tuple(rows),
    )


def models_table(found: Characterisation) -> Table:
    """Every model: held-out and fit errors, cost, size; the chosen one stands out."""
    rows = [_model_row(each, each is found.chosen) for each in found.models]
    tested = len(found.chosen.held_out_errors)
    held = f"on {tested} mixed colours, each predicted by a fit without it (5 folds)" if tested else "not tested"
    return Table(
        f"dE00 of the models, the simplest first, the chosen one marked. Held out: {held}; ± is the standard error of "
        "the mean. Fit: over all patches, after a fit to all. Cost: codes to XYZ and back, wall clock of this machine. "
        "Numbers: how many the profile stores.",
        ("model", "mean", "95 %", "max", "mean", "max", "ns/pixel", "numbers"),
        tuple(rows),
        groups=(("", 1), ("held out", 3), ("fit", 2), ("cost", 2)),
    )


def _model_row(result: ModelResult, chosen: bool) -> Row:
    held = result.held_out
    error = standard_error(result.held_out_errors)
    mean = NONE if held is None else f"{fixed(held.mean, 3)} ± {fixed(error, 3)}"
    cells = (
        f"{result.name} ✓" if chosen else result.name,
        mean,
        fixed(held.p95 if held else None, 3),
        fixed(held.max if held else None, 3),
        fixed(result.fit.mean, 3),
        fixed(result.fit.max, 3),
        f"{result.nanoseconds:,.0f}".replace(",", " "),
        f"{_numbers(result.model):,}".replace(",", " "),
    )
    return Row(cells, strong=chosen)


def standard_error(values: Float64Array) -> float | None:
    """Of the mean of (n,); None for fewer than two."""
    return float(values.std(ddof=1) / np.sqrt(len(values))) if len(values) > 1 else None


def _numbers(value: Any) -> int:
    """How many numbers a model holds, those of its curves and of its base included."""
    if is_dataclass(value):
        return sum(_numbers(getattr(value, each.name)) for each in fields(value))
    if isinstance(value, tuple):
        return sum(_numbers(each) for each in value)
    return int(np.size(value))


def worst_table(held: HeldOut) -> Table:
    """The colours that the chosen model predicts worst when they are held out."""
    white = standards.srgb_to_XYZ_matrix().sum(axis=1)
    rows = []
    for index in worst(held, WORST):
        shown = [srgb().to_codes(each[index] * white) for each in (held.predicted_over_white, held.measured_over_white)]
        mark = " *" if any((each < -1e-3).any() or (each > 1.001).any() for each in shown) else ""
        codes = " ".join(f"{code:.3f}" for code in held.codes[index])
        cells = [fixed(each, 1) for each in held.measured[index]] + [fixed(each, 2) for each in held.change[index]]
        swatches = tuple(css_colour(255 * each) for each in shown)
        rows.append(Row((codes + mark, *cells, fixed(held.dE00[index], 2)), swatches=swatches))
    return Table(
        f"The {len(rows)} held-out colours with the largest errors. Swatches: predicted, measured, in sRGB with the "
        "display's white as the page's white; an asterisk marks a colour outside sRGB, whose swatches are clipped. "
        "Δ: predicted less measured.",
        ("codes R G B", "L*", "a*", "b*", "ΔL*", "Δa*", "Δb*", "dE00"),
        tuple(rows),
        groups=(("", 1), ("measured", 3), ("error", 4)),
    )


def eyes_table(
    names: tuple[str, str], found: tuple[Characterisation, Characterisation], read: tuple[Measurements, Measurements],
    difference: EyeDifference,
) -> Table:  # fmt: skip
    """Both eyes side by side with their differences."""
    whites = [each.white_XYZ for each in read]
    ratio = difference.luminance_ratio
    places = np.array([XYZ_to_uv(white) for white in whites])
    gammas = [[value if r2 else None for value, r2 in each.gamma.values()] for each in found]
    held = [each.chosen.held_out for each in found]
    shared = (difference.right_for_left, difference.left_for_right)
    rows = [
        Row(("white, Y", *(fixed(white[1], 2) for white in whites), percent(ratio - 1, 1, True) if ratio else NONE)),
        _compared("white, u′", places[:, 0], 4),
        _compared("white, v′", places[:, 1], 4),
        *(_compared(f"gamma {channel}", pair, 3) for channel, *pair in zip("RGB", *gammas, strict=True)),
        _compared("additivity, %", [100 * each.checks.additivity_error for each in found], 1),
        _compared("black, % of white", [100 * each.checks.black_share for each in found], 3),
        Row(("chosen model", *(each.chosen.name for each in found), "")),
        Row(("mean dE00, held out", *(fixed(each.mean if each else None, 2) for each in held), "")),
        Row(("mean dE00 with the other eye's profile", *(fixed(each.mean, 2) for each in shared), "")),
        Row(("95 %", *(fixed(each.p95, 2) for each in shared), ""), aside=True),
        Row(("largest", *(fixed(each.max, 2) for each in shared), ""), aside=True),
    ]
    return Table(
        "The two eyes, and the second less the first (white's luminance: as a share of the first). The other eye's "
        "profile: dE00 of all patches, each eye's own white at Y = 1.",
        ("", *names, "difference"),
        tuple(rows),
    )


def _compared(label: str, pair: Sequence[float | None] | Float64Array, decimals: int) -> Row:
    """A row of two numbers and the second less the first."""
    first, second = pair
    apart = None if first is None or second is None else second - first
    return Row((label, *(fixed(each, decimals) for each in (first, second, apart))))
