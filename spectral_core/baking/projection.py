"""Textures onto lights: one streamed pass, all lights in one product per tile.

The weights carry everything that is known per band: the lamp, the observer, the file's scale and
dark level, which bands are bad, and, if asked, a display's primaries. So the texture is touched
once, as it is stored, and integers are converted a tile at a time while the tile is in the cache.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import numpy as np

from spectral_core.arrays import Float32Array, Float64Array
from spectral_core.baking.pixels import BadPixels, PixelCounts, PixelRule
from spectral_core.baking.products import Product, own_threads
from spectral_core.baking.tiles import TILE_BYTES, as_float32, as_it_lies, tiles
from spectral_core.errors import TextureError
from spectral_core.lights import Light
from spectral_core.standards import DEFAULT_OBSERVER
from spectral_core.textures.base import HyperspectralTexture, Samples
from spectral_core.weights import LARGEST_AMPLIFICATION, WeightingFactors

# A strip is the work of one thread at a time: long enough that threads do not wait for each other.
_STRIP_BYTES = 16 * 1024 * 1024
# Weights below this share of the largest are left out at both ends: a million times below what
# float32 resolves, so an infrared detector need not be read at all.
_NEGLIGIBLE = 1e-12
# Captures from 400 to 700 nm rest on their end bands with 0.3 % of the white, which no eye sees.
_NOTABLE_EXTENSION = 0.01
_VISIBLE_NM = (380.0, 780.0)


Result = TypeVar("Result")


class Strip(NamedTuple):
    """Whole rows of a texture: what one thread works on at a time."""

    first: int
    height: int


class Rows(NamedTuple):
    """A strip's rows as stored (height, width, bands kept), perhaps a view of a mapped file that is read when it is
    used, and the seconds that reading took.
    """

    strip: Strip
    stored: Samples
    seconds: float


@dataclass(frozen=True)
class Projection:
    """A texture's way onto some columns, ``values @ weights``, in the units that it is stored in.

    Attributes
    ----------
    factors
        (bands kept, columns), float32.
    constant
        (columns,), float32, added: what the dark level takes away.
    bands
        The range of bands that is read.
    rule
        For bad pixels, in stored units.
    """

    factors: Float32Array
    constant: Float32Array
    bands: slice
    rule: PixelRule

    @property
    def columns(self) -> int:
        """Number of columns."""
        return self.factors.shape[1]

    @property
    def bands_used(self) -> int:
        """Number of good bands in the range: those whose values count."""
        return int(self.rule.good.sum())


def level2_weights(
    texture: HyperspectralTexture, lights: Sequence[Light], observer: str = DEFAULT_OBSERVER
) -> Float64Array:
    """Weighting factors of all lights side by side: (bands, 3 * lights), 0 for bad bands.

    Raises
    ------
    TextureError
        If no band is good or sees light that we do, or some lie so close together that errors of single
        bands would hide the colours.
    """
    if not texture.good.any():
        raise TextureError(f"'{texture.name}' has no good band", remedy="correct its list of bad bands")
    good_nm = texture.wavelengths_nm[texture.good]
    if not ((good_nm > _VISIBLE_NM[0]) & (good_nm < _VISIBLE_NM[1])).any():
        raise TextureError(
            f"'{texture.name}' has no good band of visible light, only from {good_nm.min():g} to {good_nm.max():g} nm",
            remedy="capture 400 to 700 nm: other bands have no colour",
        )
    result = np.zeros((texture.bands, 3 * len(lights)))
    factors = _factors(texture, lights, observer)
    worst = max(factors, key=lambda each: each.amplification)
    if worst.amplification > LARGEST_AMPLIFICATION:
        raise TextureError(
            f"'{texture.name}' has bands near {worst.most_weighted_nm:.6g} nm that lie too close together beside wider "
            f"gaps: errors of single bands would reach the colours up to {worst.amplification:.0f} times",
            remedy="average the bands that are nearly the same, or leave one of them out",
        )
    result[texture.good] = np.concatenate([each.matrix for each in factors], axis=1)
    return result


def grid_warnings(
    texture: HyperspectralTexture, lights: Sequence[Light], observer: str = DEFAULT_OBSERVER
) -> list[str]:
    """What the bands of a texture leave to be desired under lights: of each kind, that of the worst light."""
    factors = _factors(texture, lights, observer)
    worst = [max(factors, key=lambda each: each.extended), max(factors, key=lambda each: each.amplification)]
    return list(dict.fromkeys(text for each in worst for text in each.warnings(_NOTABLE_EXTENSION)))


def _factors(texture: HyperspectralTexture, lights: Sequence[Light], observer: str) -> list[WeightingFactors]:
    return [light.weighting_factors(texture.wavelengths_nm[texture.good], observer) for light in lights]


def projection(
    texture: HyperspectralTexture, weights: Float64Array, constant: Float64Array | None = None
) -> Projection:
    """How `texture` is multiplied by weights (bands, columns), plus a constant (columns,)."""
    in_values = _per_column(texture)
    gain = np.ones(texture.bands) if in_values else texture.gain
    dark = np.zeros(texture.bands) if in_values else texture.dark
    bands = _with_weight(weights)
    folded = (weights * gain[:, None])[bands]
    offset = (np.zeros(weights.shape[1]) if constant is None else constant) - dark[bands] @ folded
    # Values that are used instead of samples have NaN for no data.
    ignored = None if in_values else texture.ignore_value
    rule = PixelRule(dark[bands], gain[bands], texture.good[bands], texture.wavelengths_nm[bands], ignored)
    return Projection(folded.astype(np.float32), offset.astype(np.float32), bands, rule)


def project(
    texture: HyperspectralTexture,
    weights: Float64Array,
    bad_pixels: BadPixels = "refuse",
    out: Float32Array | None = None,
    threads: int | None = None,
) -> Float32Array:
    """``texture @ weights`` for weights (bands, columns): (height, width, columns), float32.

    Weights are float64 and rounded once; sums run in float32, which costs at most about 1e-6 of
    the white's Y for hundred bands.

    Parameters
    ----------
    texture, weights
        `level2_weights` gives the weights of lights: then the columns are X, Y, Z of each.
    bad_pixels
        ``refuse`` what is no number, or ``repair`` it (`spectral_core.baking.pixels`).
    out
        (height, width, columns), float32 and contiguous: where the result goes, a mapped file perhaps.
    threads
        At work at once; all processors by default.

    Raises
    ------
    TextureError
        If a pixel is no number and `bad_pixels` says refuse: the message names its row.
    """
    how = projection(texture, weights)
    shape = (texture.height, texture.width, how.columns)
    result = np.empty(shape, dtype=np.float32) if out is None else out
    if result.shape != shape or result.dtype != np.float32 or not result.flags.c_contiguous:
        raise ValueError(f"out must be contiguous float32 of shape {shape}")

    def one(rows: Rows, product: Product) -> None:
        first, height = rows.strip
        project_rows(texture, how, rows, product, result[first : first + height].reshape(-1, how.columns), bad_pixels)

    for _ in in_order(texture, how, one, threads):
        pass
    return result


def project_rows(
    texture: HyperspectralTexture,
    how: Projection,
    rows: Rows,
    product: Product,
    out: Float32Array,
    bad_pixels: BadPixels,
) -> PixelCounts:
    """Write the columns of some rows to `out` (height * width, columns); returns what was wrong with them."""
    counts, stored, rule = PixelCounts(), rows.stored, how.rule
    bands = stored.shape[2]
    size = max(1, TILE_BYTES // (4 * bands))
    scratch = np.empty(size * bands, dtype=np.float32)
    for first, tile in tiles(stored, size):
        ready = as_it_lies(tile)
        result = out[first : first + tile.shape[0] * tile.shape[1]]
        with np.errstate(over="ignore", invalid="ignore"):
            product(as_float32(tile, scratch) if ready is None else ready, how.factors, result)
        # Looked at only now: the product reads ahead in memory while it computes, and leaves the tile in the cache.
        if rule.is_whole(tile, result) if bad_pixels == "refuse" else rule.is_clean(tile):
            continue
        values = as_float32(tile, scratch if tile.size <= scratch.size else np.empty(tile.size, dtype=np.float32))
        found = rule.apply(tile.reshape(-1, bands), values)
        if bad_pixels == "refuse" and found.repaired + found.lost:
            raise _refusal(texture, rule, rows.strip, first, tile.reshape(-1, bands))
        counts += found
        with np.errstate(over="ignore", invalid="ignore"):
            product(values, how.factors, result)
        if not np.isfinite(result).all():
            raise TextureError(
                f"'{texture.name}' has values too large to add up in the rows from {rows.strip.first}",
                remedy="give the scale of the values",
            )
    if how.constant.any():
        out += how.constant
    return counts


def in_order(
    texture: HyperspectralTexture,
    how: Projection,
    work: Callable[[Rows, Product], Result],
    threads: int | None = None,
) -> Iterator[Result]:
    """Results of `work` on all strips of a texture, from the top, computed by several threads.

    At most two strips per thread are under way or wait to be fetched, so memory stays bounded
    however large the texture is.
    """
    threads = threads or os.cpu_count() or 1
    waiting: list[Future[Result]] = []
    with own_threads() as product, ThreadPoolExecutor(threads) as pool:

        def read_and_work(strip: Strip) -> Result:
            return work(read_rows(texture, how, strip), product)

        try:
            for strip in strips(texture):
                if texture.concurrent:
                    waiting.append(pool.submit(read_and_work, strip))
                else:  # one reader, from the top: this thread
                    waiting.append(pool.submit(work, read_rows(texture, how, strip), product))
                if len(waiting) >= 2 * threads:
                    yield waiting.pop(0).result()
            while waiting:
                yield waiting.pop(0).result()
        finally:
            for future in waiting:
                future.cancel()
            texture.close()


def strips(texture: HyperspectralTexture) -> list[Strip]:
    """All rows of a texture from the top, in whole tiles of its own."""
    tile = texture.rows_per_tile()
    step = max(1, _STRIP_BYTES // (texture.width * texture.bands * 4 * tile)) * tile
    return [Strip(first, min(step, texture.height - first)) for first in range(0, texture.height, step)]


def read_rows(texture: HyperspectralTexture, how: Projection, strip: Strip) -> Rows:
    """The bands that have weight of some rows."""
    started = time.perf_counter()
    stored = texture.rows(*strip) if _per_column(texture) else texture.samples(*strip)
    return Rows(strip, stored[:, :, how.bands], time.perf_counter() - started)


def _per_column(texture: HyperspectralTexture) -> bool:
    """Whether each column of the image has a gain or dark level of its own: then values are used, not samples."""
    return texture.gain.ndim > 1 or texture.dark.ndim > 1


def _with_weight(weights: Float64Array) -> slice:
    size = np.abs(weights).max(axis=1)
    used = np.flatnonzero(size > _NEGLIGIBLE * size.max())
    return slice(int(used[0]), int(used[-1]) + 1)


def _refusal(texture: HyperspectralTexture, rule: PixelRule, strip: Strip, first: int, block: Samples) -> TextureError:
    with np.errstate(over="ignore", invalid="ignore"):
        missing = ~np.isfinite(block.astype(np.float32)) & rule.good
    if rule.ignore_value is not None:
        missing |= (block == rule.ignore_value) & rule.good
    row = strip.first + (first + int(np.argmax(missing.any(axis=1)))) // texture.width
    return TextureError(
        f"'{texture.name}' has a value that is no finite number in row {row}", remedy="repair the capture"
    )
