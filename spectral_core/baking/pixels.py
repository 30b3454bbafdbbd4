"""The rule for pixels that a camera got wrong: repaired or passed on, and always counted.

* No number at all (NaN, infinite, the file's value for no data): replaced by the line between the
  nearest good bands of the same pixel, the end bands repeated. Counted as *repaired*.
* A pixel without one good band: 0 in all bands. Counted as *lost*.
* Negative: passed on. Noise about zero has no sign, and clipping it would brighten every shadow.
* Above 1.05: passed on. Gloss and what lies nearer to the lamp than the white reference is brighter
  than it. Up to 1.05 nothing is counted: a white tile of 0.99 with three times 2 % of noise.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from spectral_core.arrays import BoolArray, Float32Array, Float64Array, IntArray
from spectral_core.textures.base import HyperspectralTexture, Samples

BadPixels = Literal["repair", "refuse"]
TOLERANCE_ABOVE_1 = 0.05


@dataclass(frozen=True)
class PixelCounts:
    """What was found wrong: `repaired` and `lost` pixels, `negative` and `above` values."""

    repaired: int = 0
    lost: int = 0
    negative: int = 0
    above: int = 0

    def __add__(self, other: PixelCounts) -> PixelCounts:
        return PixelCounts(*(getattr(self, each.name) + getattr(other, each.name) for each in fields(self)))

    def __or__(self, other: PixelCounts) -> PixelCounts:
        """What two passes over the same pixels found: they may have read different bands."""
        return PixelCounts(*(max(getattr(self, each.name), getattr(other, each.name)) for each in fields(self)))


@dataclass(frozen=True)
class PixelRule:
    """The rule in a texture's stored units, for some of its bands.

    Attributes
    ----------
    dark, gain
        (bands,), stored value of 0, and value per stored unit.
    good
        (bands,), which bands have weight.
    wavelengths_nm
        (bands,).
    ignore_value
        Stored value that stands for no data.
    """

    dark: Float64Array
    gain: Float64Array
    good: BoolArray
    wavelengths_nm: Float64Array
    ignore_value: float | None

    @property
    def highest(self) -> Float64Array:
        """(bands,): largest stored values that are not counted."""
        # Bad bands may have no gain at all.
        span = np.divide(1 + TOLERANCE_ABOVE_1, self.gain, out=np.full(self.gain.shape, np.inf), where=self.gain > 0)
        return np.asarray(self.dark + span)

    def is_clean(self, stored: Samples) -> bool:
        """Whether nothing of a block (pixels, bands) needs the rule, seen from its extremes."""
        if self.ignore_value is not None and bool((stored == self.ignore_value).any()):
            return False
        lowest, highest = self._clean_range
        if lowest == 0 and stored.dtype.isnative and stored.dtype.kind in "iuf":
            # As unsigned integers, negative numbers and NaN are larger than all others: one pass instead of two.
            bits = np.dtype(f"u{stored.dtype.itemsize}")
            return bool(stored.view(bits).max() <= _as_stored(highest, stored.dtype).view(bits))
        # NaN is the extreme of whatever holds it, and compares as false.
        # As Python's floats: NumPy 2 would round the limit to the type of a half float.
        return float(stored.min()) >= lowest and float(stored.max()) <= highest

    def is_whole(self, stored: Samples, result: Float32Array) -> bool:
        """Whether a block (pixels, bands) holds nothing but numbers, seen from its projection (pixels, columns)."""
        if self.ignore_value is not None and bool((stored == self.ignore_value).any()):
            return False
        if stored.dtype.kind in "iu":
            return True
        # Whatever is no number spreads: into all sums of its pixel, and into the sum of these.
        with np.errstate(over="ignore", invalid="ignore"):
            return bool(np.isfinite(result.sum()))

    @cached_property
    def _clean_range(self) -> tuple[float, float]:
        return float(self.dark.max()), float(self.highest.min())

    def apply(self, stored: Samples, values: Float32Array) -> PixelCounts:
        """Mend `values`, the float32 copy of a block `stored` (pixels, bands), in place."""
        values[:, ~self.good] = 0
        missing = ~np.isfinite(values)
        if self.ignore_value is not None:
            missing |= stored == self.ignore_value
        missing[:, ~self.good] = False
        affected = np.flatnonzero(missing.any(axis=1))
        lost = 0
        if len(affected):
            lost = self._repair(values, affected, missing[affected])
        known = ~missing & self.good
        return PixelCounts(
            repaired=len(affected) - lost,
            lost=lost,
            negative=int(((values < self.dark.astype(np.float32)) & known).sum()),
            above=int(((values > self.highest.astype(np.float32)) & known).sum()),
        )

    def _repair(self, values: Float32Array, affected: IntArray, missing: BoolArray) -> int:
        """Fill what is missing in the affected pixels; returns how many had nothing to fill from."""
        order = np.flatnonzero(self.good)
        order = order[np.argsort(self.wavelengths_nm[order])]
        spectra = (values[np.ix_(affected, order)].astype(np.float64) - self.dark[order]) * self.gain[order]
        filled = interpolated(spectra, missing[:, order], self.wavelengths_nm[order])
        values[np.ix_(affected, order)] = filled / self.gain[order] + self.dark[order]
        return int(missing[:, order].all(axis=1).sum())


def _as_stored(value: float, dtype: np.dtype[Any]) -> npt.NDArray[Any]:
    """The largest number of a type that is not above a positive value."""
    if dtype.kind in "iu":
        return np.array(min(int(value), np.iinfo(dtype).max), dtype)
    with np.errstate(over="ignore"):
        nearest = np.array(value).astype(dtype)
    return np.asarray(np.nextafter(nearest, dtype.type(0)) if nearest > value else nearest)


def interpolated(spectra: Float64Array, missing: BoolArray, wavelengths_nm: Float64Array) -> Float64Array:
    """Spectra (n, bands) at ascending wavelengths with what is missing (n, bands) on the line between
    its good neighbours, the ends repeated; 0 where a spectrum has none.
    """
    count = spectra.shape[1]
    index = np.broadcast_to(np.arange(count), spectra.shape)
    before = np.maximum.accumulate(np.where(missing, -1, index), axis=1)
    after = np.minimum.accumulate(np.where(missing, count, index)[:, ::-1], axis=1)[:, ::-1]
    left = np.where(before < 0, np.minimum(after, count - 1), before)
    right = np.where(after >= count, np.maximum(before, 0), after)
    span = wavelengths_nm[right] - wavelengths_nm[left]
    share = np.divide(wavelengths_nm[index] - wavelengths_nm[left], span, out=np.zeros(spectra.shape), where=span > 0)
    known = np.where(missing, 0.0, spectra)
    low, high = np.take_along_axis(known, left, axis=1), np.take_along_axis(known, right, axis=1)
    return np.where(missing, low + share * (high - low), spectra)


def pixel_warnings(texture: HyperspectralTexture, counts: PixelCounts, bands: int) -> Iterator[str]:
    """What the rule for bad pixels did, in words; `bands` were looked at."""
    pixels = texture.width * texture.height
    values = pixels * bands
    if counts.repaired:
        yield f"{counts.repaired} of {pixels} pixels have values that are no numbers: filled in from neighbouring bands"
    if counts.lost:
        yield f"{counts.lost} of {pixels} pixels hold no number at all: black"
    if counts.negative:
        yield f"{counts.negative / values:.2%} of the values are negative: passed on, as noise about zero"
    if counts.above:
        limit = 1 + TOLERANCE_ABOVE_1
        yield f"{counts.above / values:.2%} of the values are above {limit}: passed on, as brighter than the white"
