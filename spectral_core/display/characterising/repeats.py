"""What repeated patches say: the instrument's noise, drift, readings that do not fit; and clipped ones."""

from __future__ import annotations

import numpy as np

from spectral_core import standards
from spectral_core.arrays import Float64Array, IntArray
from spectral_core.chromaticities import XYZ_to_xy
from spectral_core.display.characterising.verdicts import Verdict, untold
from spectral_core.display.measuring.measurements import SAME_CODE, Measurements

# Of white's luminance: darker patches are read too coarsely for a trend.
_BRIGHT = 0.01
# In percent over the sequence: what instruments reproduce.
_DRIFT_PERCENT = 1.0
_SIGNIFICANT = 3.0
# Degrees of freedom: a trend takes one, and its error two.
_FEWEST_FREE = 3
# In dE00: a reading this many times further from its repeats than is usual does not belong to them.
_OUTLYING, _OUTLYING_DE00 = 6.0, 0.5
# Distinct codes with one same reading: two may coincide by rounding.
_COINCIDENCES = 2
_SAME_READING = 1e-6
# Fits over many patches average noise; 1 % in luminance and 0.0015 in x and y, which they bear, is 1.5.
_NOISE_DE00 = 2.5
_REPEAT = "repeat white first, last and twice between to learn of noise and drift"


def noise(measured: Measurements) -> float | None:
    """Mean dE00 of repeated patches from their own mean; None if no patch was repeated."""
    group, count = _groups(measured.codes)
    repeated = count[group] > 1
    if not repeated.any():
        return None
    means = np.stack([np.bincount(group, measured.XYZ[:, axis]) / count for axis in range(3)], axis=1)
    return float(standards.dE00(measured.XYZ[repeated], means[group[repeated]], measured.white_XYZ).mean())


def reading_noise(measured: Measurements) -> tuple[float, float] | None:
    """Standard deviations of one reading, of ln Y and of x and y, from repeats; None with too few."""
    deviation, freedom = _bright_repeats(measured)
    if freedom < _FEWEST_FREE:
        return None
    ln_Y, x, y = (deviation[:, :3] ** 2).sum(axis=0) / freedom
    return float(np.sqrt(ln_Y)), float(np.sqrt((x + y) / 2))


def instrument_noise(measured: Measurements) -> Verdict:
    """The noise as a verdict."""
    found, name = noise(measured), "instrument noise"
    if found is None:
        return untold(name, "dE00, mean", _REPEAT)
    passed = found <= _NOISE_DE00
    advice = f"repeats differ from their mean by {found:.2f} dE00"
    advice += "" if passed else ": integrate longer, or average several readings"
    return Verdict(name, found, "dE00, mean", _NOISE_DE00, "what fits average away", passed, advice)


def drift(measured: Measurements) -> Verdict:
    """The trend of repeated patches' luminance over the sequence, in file order.

    Regression of ln Y on the place in the sequence, with a level of its own for each repeated
    code; significant from three standard errors on.
    """
    name, unit = "drift", "% over the sequence"
    repeated, freedom = _bright_repeats(measured)
    if freedom < _FEWEST_FREE:
        return untold(name, unit, _REPEAT)
    deviation, place = repeated[:, 0], repeated[:, 3]
    spread = float((place**2).sum())
    slope = float((place * deviation).sum()) / spread
    error = float(np.sqrt(((deviation - slope * place) ** 2).sum() / (freedom - 1) / spread))
    value, uncertainty = 100 * float(np.expm1(slope)), 100 * error
    significant = abs(value) > _SIGNIFICANT * uncertainty
    found = f"luminance changes by {value:+.2f} +- {uncertainty:.2f} % from the first patch to the last"
    found += ", significantly" if significant else ", not significantly"
    passed = not (significant and abs(value) > _DRIFT_PERCENT)
    return Verdict(
        name, value, unit, _DRIFT_PERCENT, "what instruments reproduce", passed,
        found if passed else f"{found}: let the display warm up, then measure again",
        {"standard_error_percent": uncertainty, "significant": float(significant)},
    )  # fmt: skip


def duplicates(measured: Measurements) -> Verdict:
    """Repeats that disagree far more than the other repeats do."""
    group, count = _groups(measured.codes)
    name, unit = "duplicates agree", "dE00 at most"
    repeated = np.flatnonzero(count[group] > 1)
    if not len(repeated):
        return untold(name, unit, _REPEAT)
    medians = np.stack([np.median(measured.XYZ[group == group[index]], axis=0) for index in repeated])
    distance = standards.dE00(measured.XYZ[repeated], medians, measured.white_XYZ)
    usual = _OUTLYING * float(np.median(distance))
    limit, why = max((_OUTLYING_DE00, "half of what is just seen"), (usual, "6 times the median of all repeats"))
    outlying = repeated[distance > limit]
    named = ", ".join(dict.fromkeys(code_name(measured.codes[index]) for index in outlying))
    advice = f"readings of {named} disagree with their repeats: measure them again, or drop the wrong one"
    return Verdict(
        name, float(distance.max()), unit, limit, why, not len(outlying),
        advice if len(outlying) else "repeated patches agree",
    )  # fmt: skip


def clipping(measured: Measurements) -> Verdict:
    """Different codes that have one same reading: an instrument at its end, or a table that was copied."""
    bright = measured.XYZ[:, 1] > _BRIGHT * measured.white_XYZ[1]
    same = np.round(measured.XYZ[bright] / measured.white_XYZ[1] / _SAME_READING).astype(np.int64)
    code = np.round(measured.codes[bright] / SAME_CODE).astype(np.int64)
    distinct = np.unique(np.concatenate([same, code], axis=1), axis=0)
    readings, count = np.unique(distinct[:, :3], axis=0, return_counts=True)
    most, at = int(count.max()), int(count.argmax())
    passed = most <= _COINCIDENCES
    advice = (
        f"{most} different codes read exactly {readings[at, 1] * _SAME_READING:.1%} of white's luminance: "
        "the instrument or the display clips; shorten the integration or lower the brightness"
    )
    return Verdict(
        "clipped readings", float(most), "codes of one reading", float(_COINCIDENCES), "two may coincide by rounding",
        passed, "different codes read differently" if passed else advice,
    )  # fmt: skip


def code_name(code: Float64Array) -> str:
    """A code as people write it."""
    return "/".join(f"{value:.2f}" for value in code)


def _bright_repeats(measured: Measurements) -> tuple[Float64Array, int]:
    """Of repeated bright patches: ln Y, x, y and the place in the sequence (0..1), each less its
    group's mean, (n, 4); and the degrees of freedom.
    """
    bright = measured.XYZ[:, 1] > _BRIGHT * measured.white_XYZ[1]
    group, count = _groups(measured.codes[bright])
    XYZ = measured.XYZ[bright]
    place = np.linspace(0.0, 1.0, len(measured.codes))[bright]
    values = np.column_stack([np.log(XYZ[:, 1]), XYZ_to_xy(XYZ), place])
    means = np.stack([np.bincount(group, column) / count for column in values.T], axis=1)
    return np.asarray((values - means[group])[count[group] > 1]), int((count - 1).sum())


def _groups(codes: Float64Array) -> tuple[IntArray, IntArray]:
    """Group (n,) of each patch, patches of one code together, and the size (groups,) of each."""
    keys = np.round(codes / SAME_CODE).astype(int)
    _, group, count = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    return np.asarray(group.ravel()), count
