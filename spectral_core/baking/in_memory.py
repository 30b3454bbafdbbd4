"""Bakes into arrays, for whoever has an image of their own to fill."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass

import numpy as np

from spectral_core.baking.dead_bands import without_dead_bands
from spectral_core.baking.encoding import Pixels
from spectral_core.baking.pixels import BadPixels, PixelCounts, pixel_warnings
from spectral_core.baking.products import Product
from spectral_core.baking.projection import Rows, grid_warnings, in_order
from spectral_core.baking.strips import BakedStrip, Picture, bake_rows, check_reflectance, recipe
from spectral_core.display import DisplayProfile, srgb
from spectral_core.imaging import LEVELS, ImageFormat
from spectral_core.lights import Light
from spectral_core.standards import DEFAULT_OBSERVER
from spectral_core.steps import finished
from spectral_core.textures import HyperspectralTexture


@dataclass(frozen=True)
class BakedArrays:
    """Images (height, width, 3), one per light, the share of pixels out of gamut in each, and warnings."""

    images: tuple[Pixels, ...]
    clipped_fractions: tuple[float, ...]
    counts: PixelCounts
    warnings: tuple[str, ...]


def bake_to_memory(
    texture: HyperspectralTexture,
    lights: Sequence[Light],
    profile: DisplayProfile | None = None,
    image_format: ImageFormat = "exr",
    observer: str = DEFAULT_OBSERVER,
    bad_pixels: BadPixels = "repair",
    progress: Callable[[float, str], None] | None = None,
) -> BakedArrays:
    """Images of `texture` under lights, as `bake` would write them.

    ``exr`` gives linear float32, ``png8`` uint8 codes, ``png16`` and ``tiff`` uint16 codes.

    Raises
    ------
    TextureError
        If the texture is not reflectance or damaged.
    """
    steps = baking_steps(texture, lights, profile, image_format, observer, bad_pixels)
    return finished(steps, progress and (lambda fraction: progress(fraction, f"baking {texture.name}")))


def baking_steps(
    texture: HyperspectralTexture,
    lights: Sequence[Light],
    profile: DisplayProfile | None = None,
    image_format: ImageFormat = "exr",
    observer: str = DEFAULT_OBSERVER,
    bad_pixels: BadPixels = "repair",
) -> Generator[float, None, BakedArrays]:
    """The same a step at a time: yields the fraction done; closing it stops the bake."""
    check_reflectance(texture)
    texture = without_dead_bands(texture)
    profile, levels = profile or srgb(), LEVELS[image_format]
    pictures = [Picture(light, 2) for light in lights]
    plan = recipe(texture, pictures, Light.builtin("D65"), profile, levels, observer, bad_pixels)
    images = tuple(np.empty((texture.height, texture.width, 3), dtype=plan.encoding.dtype) for _ in lights)
    outside, counts, rows_done = np.zeros(len(lights)), PixelCounts(), 0

    def one(rows: Rows, product: Product) -> BakedStrip:
        first, height = rows.strip
        return bake_rows(texture, plan, rows, product, [image[first : first + height] for image in images])

    for strip in in_order(texture, plan.how, one):
        outside += strip.outside
        counts += strip.counts
        rows_done += len(strip.pixels[0])
        yield rows_done / texture.height
    shares = outside / (texture.width * texture.height)
    warnings = (*texture.warnings, *grid_warnings(texture, lights, observer))
    warnings += tuple(pixel_warnings(texture, counts, plan.how.bands_used))
    return BakedArrays(images, tuple(shares.tolist()), counts, warnings)
