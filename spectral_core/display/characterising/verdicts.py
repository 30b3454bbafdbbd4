"""Verdicts on single ramps and on mixed colours: what was found, its limit, what to do."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from spectral_core import standards
from spectral_core.arrays import BoolArray, Float64Array
from spectral_core.display.characterising.noise import noisy
from spectral_core.display.measuring.measurements import SAME_CODE, Measurements
from spectral_core.display.models.fitting import channel_lut
from spectral_core.display.models.tone_models import LutMatrix

_NO_RAMPS = "measure ramps of each channel and of grey to learn of their shape"
CHANNELS = ("red", "green", "blue")
# In percent of white: channels that sum to within this are additive as far as instruments tell (1 % in Y).
ADDITIVE_PERCENT = 2.0
# A step down a ramp larger than this share of white is no noise, whatever the instrument.
_RAMP_PERCENT = 0.2
# Ramps of fewer levels than this say nothing between their levels.
_FEWEST_LEVELS = 5
# Six terms are estimated from three numbers a mix; with fewer mixes their errors are not known.
_FEWEST_MIXES = 8
# Two patches side by side whose difference an eye just sees.
_JUST_SEEN_DE00 = 1.0
# A saturated code rises by less than this share of what a straight line through black would give;
# displays are steeper than the line, and a headset that dims at high loads keeps three quarters of it.
_SATURATED_SLOPE = 0.25
_SATURATED_CODES = 0.03
# Simulated, to know the noise of one to 5 %.
_READINGS = 200


@dataclass(frozen=True)
class Verdict:
    """One check.

    Attributes
    ----------
    name
        What was checked.
    value, unit
        What was found; None if the measurements cannot tell.
    limit, limit_from
        What the value (its size) may be at most, and why; None if the check has no limit.
    passed
        None if the measurements cannot tell.
    advice
        One sentence: what it means and what to do.
    details
        Other figures of the same check, units in their names.
    """

    name: str
    value: float | None
    unit: str
    limit: float | None
    limit_from: str
    passed: bool | None
    advice: str
    details: dict[str, float] = field(default_factory=dict)


def untold(name: str, unit: str, advice: str) -> Verdict:
    """A check that the measurements cannot decide."""
    return Verdict(name, None, unit, None, "", None, advice)


def ramps(measured: Measurements) -> tuple[tuple[str, Measurements], ...]:
    """Red, green, blue and grey patches by rising code; black belongs to grey."""
    chosen = (*(measured.channel(index) for index in range(3)), measured.grey)
    named = zip((*CHANNELS, "grey"), chosen, strict=True)
    return tuple((name, _by_code(measured.subset(which))) for name, which in named)


def _by_code(ramp: Measurements) -> Measurements:
    return ramp.subset(np.argsort(ramp.codes.max(axis=1), kind="stable"))


def _has_ramps(measured: Measurements) -> bool:
    """Whether a ramp has a level between black and full drive."""
    return any(bool(((codes := ramp.codes.max(axis=1)) * (1 - codes) > SAME_CODE).any()) for _, ramp in ramps(measured))


def monotonic(measured: Measurements, noise_percent: float | None) -> Verdict:
    """Whether luminance rises along every ramp.

    A step down is judged against 0.2 % of white, or three standard deviations of the difference of
    two readings if the instrument is noisier than that.
    """
    if not _has_ramps(measured):
        return untold("ramps rise", "% of white", _NO_RAMPS)
    white_Y = measured.white_XYZ[1]
    worst, advice = 0.0, ""
    for name, ramp in ramps(measured):
        Y = ramp.XYZ[:, 1]
        if len(Y) and (drop := np.maximum.accumulate(Y) - Y).max() / white_Y * 100 > worst:
            at = int(drop.argmax())
            worst = float(drop[at] / white_Y * 100)
            code = ramp.codes[at].max()
            advice = f"the {name} ramp falls at code {code:.3f} by {worst:.2f} % of white: measure it there again"
    allowed = float(3 * np.sqrt(2) * (noise_percent or 0.0))
    limit, why = max((_RAMP_PERCENT, "less is rounding and noise"), (allowed, "3 sd of two readings' difference"))
    passed = bool(worst <= limit)
    return Verdict(
        "ramps rise", worst, "% of white", limit, why, passed, "the ramps rise with the code" if passed else advice
    )


def saturation(measured: Measurements) -> Verdict:
    """Top codes of a ramp, or of grey, that read the same although the code rises."""
    if not _has_ramps(measured):
        return untold("saturated codes", "of 255 codes", _NO_RAMPS)
    widest, named = 0.0, ""
    for name, ramp in ramps(measured):
        codes, Y = ramp.codes.max(axis=1), ramp.XYZ[:, 1]
        if not len(codes) or codes[-1] < 1 - SAME_CODE:
            continue
        rise = 1 - Y / Y[codes > 1 - SAME_CODE].mean()
        far = codes < 1 - _SATURATED_CODES
        rising = far & (rise >= _SATURATED_SLOPE * (1 - codes))
        flat = far & ~(np.cumsum(rising[::-1])[::-1] > 0)
        if flat.any() and 255 * (1 - codes[flat].min()) > widest:
            widest, named = float(255 * (1 - codes[flat].min())), name
    advice = f"the {named} ramp does not rise over its last {widest:.0f} of 255 codes: lower the display's contrast"
    return Verdict(
        "saturated codes", widest, "of 255 codes", 255 * _SATURATED_CODES, "finer steps are lost in noise",
        not named, advice if named else "the ramps rise up to their last codes",
    )  # fmt: skip


def mixes_add_up(measured: Measurements, noise: tuple[float, float] | None) -> tuple[Verdict, ...]:
    """Mixed colours against the sum of their channels' own ramps at the same codes; and independence."""
    testable = _testable(measured)
    mixed = measured.subset(testable)
    if not testable.any():
        advice = "measure ramps of each channel, and mixes of two and of three, to learn whether mixes add up"
        return untold("additivity of mixes", "dE00, mean", advice), untold("channel independence", "% of white", advice)
    summed = channel_lut(measured)
    return _sums(mixed, summed, measured.white_XYZ, noise), _independence(mixed, summed, measured.white_XYZ, noise)


def _testable(measured: Measurements) -> BoolArray:
    """Mixes (n,) whose channels' ramps say what each gives: at a level of the ramp, or within a fine one."""
    result = measured.mixed
    for index in range(3):
        levels = np.unique(np.append(measured.codes[measured.channel(index), index], 0.0))
        at_level = (np.abs(measured.codes[:, index, None] - levels) < SAME_CODE).any(axis=1)
        result = result & (at_level if len(levels) < _FEWEST_LEVELS else True)
    return np.asarray(result)


def _sums(
    mixed: Measurements, summed: LutMatrix, white_XYZ: Float64Array, noise: tuple[float, float] | None
) -> Verdict:
    predicted = summed.forward(mixed.codes)
    percent = 100 * np.abs((mixed.XYZ - predicted) / white_XYZ).max(axis=1)
    dE00 = standards.dE00(predicted, mixed.XYZ, white_XYZ)
    details = {
        "mean_percent": float(percent.mean()), "max_percent": float(percent.max()),
        "mean_dE00": float(dE00.mean()), "max_dE00": float(dE00.max()), "mixes": float(len(dE00)),
    }  # fmt: skip
    # A reading's noise, and as much again for the sum's.
    expected = np.sqrt(2) * _noise_dE00(mixed.XYZ, noise, white_XYZ) if noise else 0.0
    limit, why = max((_JUST_SEEN_DE00, "just seen side by side"), (expected, "noise of two readings"))
    passed = bool(dE00.mean() <= limit)
    found = (
        f"differ from the sum of their channels by {details['mean_percent']:.2g} % of white on average, "
        f"{details['max_percent']:.2g} % at most (dE00 {details['mean_dE00']:.2f}, {details['max_dE00']:.2f})"
    )
    advice = f"mixes {found}" + ("" if passed else ": use a model with a correction, which learns from many mixes")
    return Verdict("additivity of mixes", details["mean_dE00"], "dE00, mean", limit, why, passed, advice, details)


def _noise_dE00(XYZ: Float64Array, noise: tuple[float, float], white_XYZ: Float64Array) -> float:
    """Mean dE00 that an instrument's noise alone gives these readings."""
    read = noisy(XYZ, noise, np.random.default_rng(0))
    return float(standards.dE00(read, XYZ, white_XYZ).mean())


def _independence(
    mixed: Measurements, summed: LutMatrix, white_XYZ: Float64Array, noise: tuple[float, float] | None
) -> Verdict:
    """How much of white a channel's light changes when another is fully driven as well.

    Regression of what mixes have beyond their sum, in X, Y and Z over white, on the products of two
    drives and of three; the largest of the pairs' coefficients. Its error has that of the two
    primaries' readings in it, which shift all sums alike.
    """
    name, unit = "channel independence", "% of white"
    drive = summed.decode(mixed.codes)
    pairs = drive[:, [0, 0, 1]] * drive[:, [1, 2, 2]]
    terms = np.column_stack([pairs, drive.prod(axis=1)])
    used = (terms > 0.01).sum(axis=0) >= 2
    if len(mixed.codes) < _FEWEST_MIXES or not used[:3].all() or np.linalg.matrix_rank(terms[:, used]) < used.sum():
        return untold(name, unit, "measure mixes of each two channels at several codes")
    terms = terms[:, used]
    beyond = 100 * (mixed.XYZ - summed.forward(mixed.codes)) / white_XYZ
    inverse = np.linalg.inv(terms.T @ terms)
    slopes = inverse @ terms.T @ beyond
    scatter = ((beyond - terms @ slopes) ** 2).sum(axis=0) / (len(terms) - terms.shape[1])
    error = np.sqrt(np.diag(inverse)[:, None] * scatter)
    own = _primary_error_percent(summed, white_XYZ, noise) if noise else np.zeros((3, 3))
    error[:3] = np.sqrt(error[:3] ** 2 + own[[0, 0, 1]] ** 2 + own[[1, 2, 2]] ** 2)
    pair, axis = np.unravel_index(np.abs(slopes[:3]).argmax(), (3, 3))
    value, uncertainty = float(slopes[pair, axis]), float(error[pair, axis])
    a, b = (("red", "green"), ("red", "blue"), ("green", "blue"))[pair]
    found = f"{a} and {b} together give {value:+.1f} +- {uncertainty:.1f} % of white's {'XYZ'[axis]} beyond their sum"
    passed = abs(value) <= max(ADDITIVE_PERCENT, 3 * uncertainty)
    advice = found if passed else f"{found}: the channels depend on each other, so measure many mixes"
    limit, why = max((ADDITIVE_PERCENT, "as for white"), (3 * uncertainty, "three standard errors"))
    return Verdict(name, value, unit, limit, why, passed, advice, {"standard_error_percent": uncertainty})


def _primary_error_percent(summed: LutMatrix, white_XYZ: Float64Array, noise: tuple[float, float]) -> Float64Array:
    """Standard deviation (3 primaries, XYZ) of one reading of each, in percent of white."""
    repeated = np.repeat(summed.matrix.T, _READINGS, axis=0)
    read = noisy(repeated, noise, np.random.default_rng(0)) - repeated
    return np.asarray(100 * read.reshape(3, _READINGS, 3).std(axis=1) / white_XYZ)
