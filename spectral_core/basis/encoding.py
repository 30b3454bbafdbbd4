"""Textures as coefficients: one streamed pass, four coefficients to an image, every pixel's error measured."""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from spectral_core.arrays import Float32Array, Float64Array, IntArray, frozen
from spectral_core.baking.dead_bands import without_dead_bands
from spectral_core.baking.pixels import BadPixels, PixelCounts, pixel_warnings
from spectral_core.baking.products import Product, one_blas_thread
from spectral_core.baking.projection import (
    Projection,
    Rows,
    grid_warnings,
    in_order,
    level2_weights,
    project_rows,
    projection,
)
from spectral_core.baking.strips import check_reflectance
from spectral_core.basis.metric import BLOCK, differences
from spectral_core.basis.spectral_basis import BasisError, SpectralBasis
from spectral_core.errors import TextureError
from spectral_core.steps import finished
from spectral_core.textures import HyperspectralTexture

CHANNELS = 4
# Edges of the histogram that the 95th percentile is taken from: 1 % apart, so it is at most 1 % too large.
_EDGES = np.geomspace(1e-6, 1e3, 2084)
_WORST_OF_BLOCK, _WORST = 4, 64


@dataclass(frozen=True, eq=False)
class PackedTexture:
    """A texture's coefficients in images.

    Attributes
    ----------
    images
        ceil(K / 4) arrays (height, width, 4), float16 or float32, rows from the top: coefficients in their order,
        each divided by its scale; 0 in channels that are left over.
    scale
        (K,), powers of two: 1 unless a pixel has a larger coefficient than all samples, so stored values are
        within -1 to 1.
    errors
        (L,), dE00 of every pixel as it is stored; the 95th percentile is up to 1 % too large.
    worst
        (m, L, 3), XYZ of the pixels that are worst, the worst first.
    counts, warnings
        What was wrong with the pixels, and what a user should know.
    """

    images: tuple[npt.NDArray[Any], ...]
    scale: Float64Array
    errors: tuple[BasisError, ...]
    worst: Float64Array
    counts: PixelCounts
    warnings: tuple[str, ...]

    @property
    def largest_error(self) -> float:
        """The largest dE00 of all pixels under all lights."""
        return max(each.max for each in self.errors)

    def coefficients(self) -> Float64Array:
        """(height, width, K), as stored, times their scale."""
        stored = np.concatenate(self.images, axis=2)[:, :, : len(self.scale)]
        return np.asarray(stored.astype(np.float64) * self.scale)


def encode_texture(
    texture: HyperspectralTexture,
    basis: SpectralBasis,
    half: bool = True,
    progress: Callable[[float, str], None] | None = None,
    bad_pixels: BadPixels = "repair",
) -> PackedTexture:
    """A texture's coefficients as half or single floats, and their errors.

    Raises
    ------
    TextureError
        If the texture is not reflectance or damaged, or far brighter than white.
    """
    steps = encoding_steps(texture, basis, half, bad_pixels)
    return finished(steps, progress and (lambda fraction: progress(fraction, f"encoding {texture.name}")))


def encoding_steps(
    texture: HyperspectralTexture, basis: SpectralBasis, half: bool = True, bad_pixels: BadPixels = "repair"
) -> Generator[float, None, PackedTexture]:
    """The same a step at a time: yields the fraction done; closing it stops the work."""
    check_reflectance(texture)
    texture = without_dead_bands(texture)
    with one_blas_thread():
        how = projection(texture, level2_weights(texture, basis.lights, basis.observer))
    dtype = np.float16 if half else np.float32
    shape = (texture.height, texture.width, CHANNELS)
    images = tuple(np.zeros(shape, dtype) for _ in range(-(-basis.K // CHANNELS)))
    whites, total, rows_done = basis.whites, _Tally.empty(basis), 0

    def one(rows: Rows, product: Product) -> tuple[int, _Tally]:
        first, height = rows.strip
        parts = [image[first : first + height].reshape(-1, CHANNELS) for image in images]
        return height, _encode_rows(texture, how, rows, product, basis, whites, parts, bad_pixels)

    for height, tally in in_order(texture, how, one):
        total = total + tally
        rows_done += height
        yield rows_done / texture.height
    scale = _scale(total.peak)
    for index in np.flatnonzero(scale > 1):
        # Exact, whatever the type, but for numbers below what half floats hold: a hundred millionth of the largest.
        images[index // CHANNELS][:, :, index % CHANNELS] /= scale[index]
    warnings = (*texture.warnings, *grid_warnings(texture, basis.lights, basis.observer))
    warnings += tuple(pixel_warnings(texture, total.counts, how.bands_used))
    return PackedTexture(
        images, frozen(scale), total.errors(basis.light_names), frozen(total.worst), total.counts, warnings
    )


def _encode_rows(
    texture: HyperspectralTexture,
    how: Projection,
    rows: Rows,
    product: Product,
    basis: SpectralBasis,
    whites: Float64Array,
    parts: list[npt.NDArray[Any]],
    bad_pixels: BadPixels,
) -> _Tally:
    """Write the coefficients of some rows to parts of the images (pixels, 4)."""
    XYZ = np.empty((rows.strip.height * texture.width, how.columns), dtype=np.float32)
    tally = _Tally.empty(basis, project_rows(texture, how, rows, product, XYZ, bad_pixels))
    for first in range(0, len(XYZ), BLOCK):
        exact = _colours(XYZ[first : first + BLOCK], basis)
        coefficients = basis.coefficients(exact)
        with np.errstate(over="ignore"):
            stored = coefficients.astype(parts[0].dtype)
        if not np.isfinite(stored).all():
            raise TextureError(
                f"'{texture.name}' has coefficients up to {np.abs(coefficients).max():.3g} in the rows from "
                f"{rows.strip.first}, more than the images hold",
                remedy="check the scale of its values",
            )
        for index, part in enumerate(parts):
            channels = stored[:, CHANNELS * index : CHANNELS * (index + 1)]
            part[first : first + len(stored), : channels.shape[1]] = channels
        dE00 = differences(basis.XYZ(stored), exact, whites)
        tally = tally + _Tally.of(dE00, exact, np.abs(stored).max(axis=0).astype(np.float64))
    return tally


def _colours(columns: Float32Array, basis: SpectralBasis) -> Float64Array:
    return columns.astype(np.float64).reshape(len(columns), len(basis.lights), 3)


def _scale(peak: Float64Array) -> Float64Array:
    """(K,) powers of two that bring the largest coefficients (K,) to at most 1."""
    return np.asarray(2.0 ** np.ceil(np.log2(np.maximum(peak, 1.0))))


@dataclass(frozen=True, eq=False)
class _Tally:
    """Errors of pixels: counts (L, bins), sums and maxima (L,), the largest coefficients (K,), the worst pixels
    (m, L, 3) with their dE00 (m,), and what was wrong with them.
    """

    counted: IntArray
    sums: Float64Array
    largest: Float64Array
    peak: Float64Array
    worst: Float64Array
    worst_dE00: Float64Array
    counts: PixelCounts

    @classmethod
    def empty(cls, basis: SpectralBasis, counts: PixelCounts | None = None) -> _Tally:
        lights = len(basis.lights)
        counted = np.zeros((lights, len(_EDGES) + 1), dtype=np.int64)
        none = np.zeros((0, lights, 3))
        zeros = np.zeros(lights)
        return cls(counted, zeros, zeros, np.zeros(basis.K), none, np.zeros(0), counts or PixelCounts())

    @classmethod
    def of(cls, dE00: Float64Array, XYZ: Float64Array, peak: Float64Array) -> _Tally:
        bins = len(_EDGES) + 1
        counted = np.stack([np.bincount(np.searchsorted(_EDGES, each), minlength=bins) for each in dE00.T])
        of_each = dE00.max(axis=1)
        order = np.argsort(-of_each, kind="stable")[:_WORST_OF_BLOCK]
        return cls(
            counted, dE00.sum(axis=0), dE00.max(axis=0), peak, XYZ[order], of_each[order], PixelCounts()
        )  # fmt: skip

    def __add__(self, other: _Tally) -> _Tally:
        worst_dE00 = np.concatenate([self.worst_dE00, other.worst_dE00])
        order = np.argsort(-worst_dE00, kind="stable")[:_WORST]
        return _Tally(
            self.counted + other.counted,
            self.sums + other.sums,
            np.maximum(self.largest, other.largest),
            np.maximum(self.peak, other.peak),
            np.concatenate([self.worst, other.worst])[order],
            worst_dE00[order],
            self.counts + other.counts,
        )

    def errors(self, names: tuple[str, ...]) -> tuple[BasisError, ...]:
        found = []
        for name, counted, total, largest in zip(names, self.counted, self.sums, self.largest, strict=True):
            pixels = counted.sum()
            at = int(np.searchsorted(np.cumsum(counted), 0.95 * pixels))
            p95 = min(float(_EDGES[min(at, len(_EDGES) - 1)]), float(largest))
            found.append(BasisError(name, float(total / pixels), p95, float(largest)))
        return tuple(found)
