"""Colours that a display cannot show: how bright it can be at a chromaticity, and what is shown instead.

A colour is in gamut if the linear drives that it needs lie between those of code 0 and code 1. Along
a ray of one chromaticity the drives rise with the luminance, so that a bright end is found by the
secant method; it is exact after one step for every model that is a matrix behind its curves. A
display with a black of its own light also has a dark end: near black it shows black's chromaticity
only.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from spectral_core.arrays import BoolArray, Float64Array, FloatArray, IntArray
from spectral_core.display.models import DisplayModel
from spectral_core.display.profile import GAMUT_TOLERANCE, DisplayProfile
from spectral_core.errors import DisplayError

GamutRule = Literal["clip", "chromaticity", "keep"]
GAMUT_RULES: tuple[GamutRule, ...] = get_args(GamutRule)
# In linear drive: rounding, not colour.
_ROUNDING = 1e-9
# A drive that rises by less with the luminance never gets full, and dividing by it overflows.
_FLAT = 1e-100
# Far beyond any display's white: larger colours are scaled to this, lest their sums overflow.
_LARGEST_XYZ = 1e6
# No display is brighter than this many times its white at any chromaticity.
_BRIGHTEST = 4.0
# Most steps to the largest luminance, and to grey; most colours need a few.
_SECANTS = 25
_SHARES = 60
# The way to white is searched this many colours at a time, to stay within tens of megabytes.
_BLOCK = 65_536


@dataclass(frozen=True)
class GamutCounts:
    """How many colours a display cannot show, by what is in the way.

    Attributes
    ----------
    total
        Colours asked for.
    luminance
        Too bright: their chromaticity can be shown at a lower luminance.
    chromaticity
        Outside the display's own chromaticities at any luminance.
    black
        Too dark: darker than the display's black, or so dark that its light changes their chromaticity.
    """

    total: int
    luminance: int
    chromaticity: int
    black: int

    @property
    def outside(self) -> int:
        """All that are out of gamut."""
        return self.luminance + self.chromaticity + self.black


@dataclass(frozen=True)
class Reach:
    """How a display reaches colours (n,).

    Attributes
    ----------
    scale
        Factor from each colour to the brightest of its chromaticity; meaningless where not attainable.
    attainable
        Whether its chromaticity can be shown at that luminance, and so at any.
    inside
        Whether the colour itself can be shown, but for rounding.
    """

    scale: Float64Array
    attainable: BoolArray
    inside: BoolArray


def map_to_gamut(
    display: DisplayModel | DisplayProfile, XYZ: FloatArray, rule: GamutRule
) -> tuple[Float64Array, GamutCounts]:
    """Device codes (..., 3) of XYZ (..., 3, white Y = 1), those out of gamut mapped by a rule, and counted.

    ``keep`` leaves codes outside 0..1 as they are. ``clip`` limits each channel, which changes hue,
    saturation and luminance of what is out of gamut. ``chromaticity`` keeps x and y and lowers the
    luminance until the colour fits. A chromaticity that the display does not have moves straight
    towards that of its own grey at the colour's luminance, only as far as it must (a line that is
    straight in xy is straight in u'v' too), then the luminance is lowered if it must. Colours too
    dark for their chromaticity, because black has light of its own, move so as well; what is darker
    than black becomes black. No other luminance ever rises.

    Counted is what clipping changes by more than 1e-4 of white.

    Raises
    ------
    DisplayError
        If a value of XYZ is not finite, or there is no such rule.
    """
    if rule not in GAMUT_RULES:
        raise DisplayError(f"no rule '{rule}' for colours out of gamut", remedy=f"use {', '.join(GAMUT_RULES)}")
    model = display.model if isinstance(display, DisplayProfile) else display
    wanted = _moderate(XYZ)
    codes = model.inverse(wanted)
    clipped = np.clip(codes, 0.0, 1.0)
    changed = np.abs(model.forward(clipped) - wanted).max(axis=-1) > GAMUT_TOLERANCE
    outside = np.flatnonzero(changed | (codes != clipped).any(axis=-1))
    found = reach(model, wanted[outside])
    counted = changed[outside]
    dark = wanted[outside, 1] <= model.forward(np.zeros(3))[1]
    bright = found.attainable & (found.scale < 1) & ~dark
    foreign = ~found.attainable & ~dark
    counts = GamutCounts(
        len(wanted),
        int((counted & bright).sum()),
        int((counted & foreign).sum()),
        int((counted & ~bright & ~foreign).sum()),
    )
    if rule == "clip":
        codes = clipped
    elif rule == "chromaticity":
        mapped = wanted[outside] * np.where(bright, found.scale, 1.0)[:, None]
        astray = np.flatnonzero(~bright & ~dark & ~found.inside)
        for first in range(0, len(astray), _BLOCK):
            part = astray[first : first + _BLOCK]
            mapped[part] = _towards_grey(model, mapped[part])
        clipped[outside] = np.clip(model.inverse(mapped), 0.0, 1.0)
        clipped[outside[dark]] = 0.0
        codes = clipped
    return codes.reshape(np.shape(XYZ)), counts


def peak_luminance(display: DisplayModel | DisplayProfile, XYZ: FloatArray) -> Float64Array:
    """Largest Y (...,), white Y = 1, that a display can show at the chromaticities of XYZ (..., 3).

    0 where it cannot show the chromaticity at all. X, Y and Z may have any scale; Y must be above 0.
    """
    model = display.model if isinstance(display, DisplayProfile) else display
    wanted = _moderate(XYZ)
    found = reach(model, wanted)
    return np.where(found.attainable, found.scale * wanted[:, 1], 0.0).reshape(np.shape(XYZ)[:-1])


def reach(model: DisplayModel, XYZ: Float64Array) -> Reach:
    """How a display reaches colours (n, 3): see `Reach`."""
    black, white = _ends(model)
    brightest = _BRIGHTEST * float(model.forward(np.ones(3))[1])
    # Colours of no luminance are on no ray: they are dark, whatever the factor.
    limit = brightest / np.maximum(XYZ[:, 1], brightest / _LARGEST_XYZ)
    scale = _largest_scale(model, XYZ, white, limit)
    at_peak = model.linear(XYZ * scale[:, None])
    drive = model.linear(XYZ)
    attainable = (XYZ[:, 1] > 0) & _within(at_peak, black, white)
    return Reach(scale, np.asarray(attainable), _within(drive, black, white))


def _largest_scale(model: DisplayModel, XYZ: Float64Array, white: Float64Array, limit: Float64Array) -> Float64Array:
    """The factor (n,) at which the first channel reaches full drive, at most `limit` (n,)."""
    low, high = np.zeros(len(XYZ)), limit.copy()
    before, drive_before = low.copy(), model.linear(np.zeros_like(XYZ))
    scale = limit.copy()
    waiting = np.arange(len(XYZ))
    for _ in range(_SECANTS):
        at = scale[waiting]
        drive = model.linear(XYZ[waiting] * at[:, None])
        over = (drive > white).any(axis=1)
        high[waiting], low[waiting] = np.where(over, at, high[waiting]), np.where(over, low[waiting], at)
        slope = (drive - drive_before[waiting]) / (at - before[waiting])[:, None]
        rising = slope > _FLAT
        reached = np.where(rising, at[:, None] + (white - drive) / np.where(rising, slope, 1.0), np.inf).min(axis=1)
        inside = (reached >= low[waiting]) & (reached <= high[waiting])
        before[waiting], drive_before[waiting] = at, drive
        scale[waiting] = np.where(
            inside, reached, np.where(low[waiting] == limit[waiting], at, (low + high)[waiting] / 2)
        )
        # Where the first channel is at full drive, the next step is nothing.
        waiting = waiting[np.abs(scale[waiting] - at) > _ROUNDING * at]
        if not len(waiting):
            break
    return scale


def _towards_grey(model: DisplayModel, XYZ: Float64Array) -> Float64Array:
    """XYZ (n, 3) in gamut: mixed with as little grey of the same luminance as it needs, then dimmed."""
    black, white = _ends(model)
    black_XYZ, white_XYZ = model.forward(np.zeros(3)), model.forward(np.ones(3))
    share = (XYZ[:, 1] - black_XYZ[1]) / (white_XYZ[1] - black_XYZ[1])
    grey = black_XYZ + share[:, None] * (white_XYZ - black_XYZ)

    def dimmed(chosen: IntArray, kept: Float64Array) -> Float64Array:
        mixed = grey[chosen] + kept[:, None] * (XYZ - grey)[chosen]
        return np.asarray(mixed * _largest_scale(model, mixed, white, np.ones(len(mixed)))[:, None])

    def excess(chosen: IntArray, kept: Float64Array) -> Float64Array:
        return np.asarray((black - model.linear(dimmed(chosen, kept))).max(axis=1))

    return dimmed(np.arange(len(XYZ)), _largest_share(excess, len(XYZ)))


def _largest_share(excess: Callable[[IntArray, Float64Array], Float64Array], count: int) -> Float64Array:
    """The largest share (count,) without excess, from 0, which has none, to 1, which has.

    False position and halving in turn; `excess` takes indices and their shares.
    """
    waiting = np.arange(count)
    low, high = np.zeros(count), np.ones(count)
    excess_low, excess_high = excess(waiting, low), excess(waiting, high)
    for step in range(_SHARES):
        below, above = excess_low[waiting], excess_high[waiting]
        span = np.where(above > below, above - below, 1.0)
        fraction = np.clip(-below / span, 0.0, 1.0) if step % 2 == 0 else np.full(len(waiting), 0.5)
        middle = low[waiting] + fraction * (high - low)[waiting]
        found = excess(waiting, middle)
        good = found <= _ROUNDING / 10
        for ends, values, chosen in ((low, excess_low, good), (high, excess_high, ~good)):
            ends[waiting[chosen]], values[waiting[chosen]] = middle[chosen], found[chosen]
        waiting = waiting[(np.abs(excess_low) > _ROUNDING / 10)[waiting] & ((high - low)[waiting] > _ROUNDING)]
        if not len(waiting):
            break
    return low


def _ends(model: DisplayModel) -> tuple[Float64Array, Float64Array]:
    """Linear drives (3,) of code 0 and code 1."""
    ends = model.linear(model.forward(np.stack([np.zeros(3), np.ones(3)])))
    return ends[0], ends[1]


def _within(drive: Float64Array, black: Float64Array, white: Float64Array) -> BoolArray:
    return np.asarray(((drive >= black - _ROUNDING) & (drive <= white + _ROUNDING)).all(axis=-1))


def _moderate(XYZ: FloatArray) -> Float64Array:
    """Colours (n, 3), none so large that sums of it overflow."""
    values = np.array(XYZ, dtype=np.float64).reshape(-1, 3)
    if not np.isfinite(values).all():
        raise DisplayError("XYZ holds a value that is no finite number", remedy="correct the colours")
    largest = np.maximum(np.abs(values).max(axis=1, initial=0.0, keepdims=True), _LARGEST_XYZ)
    return np.asarray(values / largest * _LARGEST_XYZ)
