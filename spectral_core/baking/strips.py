"""What is made of each strip of a bake, in this process or on a worker of a cluster."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from spectral_core.arrays import Float32Array, IntArray
from spectral_core.baking.encoding import Encoding, Pixels, count_outside
from spectral_core.baking.pixels import BadPixels, PixelCounts
from spectral_core.baking.products import Product, one_blas_thread
from spectral_core.baking.projection import Projection, Rows, level2_weights, project_rows, projection
from spectral_core.display import DisplayProfile
from spectral_core.errors import TextureError
from spectral_core.lights import Light
from spectral_core.textures import HyperspectralTexture

# Beyond it images of half floats would hold infinity.
_LARGEST_HALF = 65504.0
# Pixels encoded at a time: what is in between stays in the cache, and threads seldom wait for the interpreter.
_BLOCK = 16384


@dataclass(frozen=True, eq=False)
class Picture:
    """One of the images that are made: a light and a level."""

    light: Light
    level: int


@dataclass(frozen=True)
class Recipe:
    """Everything that turns rows as stored into pixels; it can be sent to another machine.

    Attributes
    ----------
    pictures
        What is made.
    how
        Onto linear RGB of each picture's light, or onto XYZ where the display's primaries do not add up.
    folded
        Whether `how` gives linear RGB.
    sources
        (pictures,), which of the projection's colours a picture is made of.
    factors
        (pictures, 3), what its linear RGB is multiplied by: the lamp's colour at level 1.
    encoding
        Of the pixels.
    bad_pixels
        What to do with values that are no numbers.
    """

    pictures: tuple[Picture, ...]
    how: Projection
    folded: bool
    sources: tuple[int, ...]
    factors: Float32Array
    encoding: Encoding
    bad_pixels: BadPixels

    def colours(self, linear: Float32Array) -> Float32Array:
        """Linear RGB (n, pictures, 3) of the projection's colours (n, colours, 3)."""
        if self.sources == tuple(range(linear.shape[1])) and (self.factors == 1).all():
            return linear
        return np.asarray(linear[:, self.sources] * self.factors)


@dataclass(frozen=True)
class BakedStrip:
    """Pixels (rows, width, 3) of each picture, how many were out of gamut, what was wrong, and the seconds it took."""

    pixels: tuple[Pixels, ...]
    outside: IntArray
    counts: PixelCounts
    read_seconds: float
    project_seconds: float


def check_reflectance(texture: HyperspectralTexture) -> None:
    """Refuse what is no reflectance.

    Raises
    ------
    TextureError
        That says how to make it one.
    """
    if texture.kind == "reflectance":
        return
    what = {
        "radiance": "holds radiance, which is already lit",
        "counts": "holds counts of a camera",
        "unstated": "does not say whether its values are reflectance",
    }[texture.kind]
    remedy = {
        "radiance": "divide it by the radiance of a white reference (--white)",
        "counts": "give a white reference (--white), or the count that stands for reflectance 1 (--scale)",
        "unstated": "say it (--kind reflectance), or give a white reference (--white)",
    }[texture.kind]
    raise TextureError(f"'{texture.name}' {what}", remedy=remedy)


def recipe(
    texture: HyperspectralTexture,
    pictures: Sequence[Picture],
    reference: Light,
    profile: DisplayProfile,
    levels: int | None,
    observer: str,
    bad_pixels: BadPixels,
) -> Recipe:
    """How pictures of a texture are made; `reference` is the light of level 1's RGB camera."""
    lights: list[Light] = []
    sources = []
    for picture in pictures:
        seen = picture.light if picture.level == 2 else reference
        if not any(seen is each for each in lights):
            lights.append(seen)
        sources.append(next(index for index, each in enumerate(lights) if each is seen))
    encoding = Encoding(profile, levels)
    constant = None
    with one_blas_thread():
        weights = level2_weights(texture, lights, observer)
        part = encoding.linear_part()
        if part is not None:
            matrix, offset = part
            weights = (weights.reshape(-1, len(lights), 3) @ matrix).reshape(weights.shape)
            constant = np.tile(offset, len(lights))
        lamps = [
            profile.to_linear(picture.light.XYZ(observer)) if picture.level == 1 else np.ones(3) for picture in pictures
        ]
    return Recipe(
        pictures=tuple(pictures),
        how=projection(texture, weights, constant),
        folded=part is not None,
        sources=tuple(sources),
        factors=np.array(lamps, dtype=np.float32),
        encoding=encoding,
        bad_pixels=bad_pixels,
    )


def bake_rows(
    texture: HyperspectralTexture, recipe: Recipe, rows: Rows, product: Product, out: Sequence[Pixels] | None = None
) -> BakedStrip:
    """The pixels of some rows, written to `out`, (height, width, 3) of each picture, if it is given.

    Raises
    ------
    TextureError
        If values are no numbers and shall not be repaired, or far too large.
    """
    started = time.perf_counter()
    first, height = rows.strip
    values = np.empty((height * texture.width, recipe.how.columns), dtype=np.float32)
    counts = project_rows(texture, recipe.how, rows, product, values, recipe.bad_pixels)
    linear = _linear(texture, recipe, first, values)
    shape = (height, texture.width, 3)
    pixels = tuple(np.empty(shape, recipe.encoding.dtype) for _ in recipe.pictures) if out is None else tuple(out)
    flat = [each.reshape(-1, 3) for each in pixels]
    outside = np.zeros(len(pixels), dtype=np.int64)
    for start in range(0, len(linear), _BLOCK):
        colours = recipe.colours(linear[start : start + _BLOCK])
        outside += count_outside(colours)
        encoded = recipe.encoding.pixels(colours)
        for index, image in enumerate(flat):
            # Twice as fast as a copy of the slice; an index that is too large cannot be, whatever the mode.
            np.take(encoded, index, axis=1, out=image[start : start + _BLOCK], mode="clip")
    return BakedStrip(pixels, outside, counts, rows.seconds, time.perf_counter() - started)


def _linear(texture: HyperspectralTexture, recipe: Recipe, first: int, values: Float32Array) -> Float32Array:
    """Linear RGB (pixels, colours, 3), within what half floats hold."""
    colours = values.reshape(len(values), -1, 3)
    linear = colours if recipe.folded else recipe.encoding.profile.to_linear(colours).astype(np.float32)
    largest = max(float(linear.max()), -float(linear.min()))
    # Not a number is not below anything either.
    if not largest <= _LARGEST_HALF:
        raise TextureError(
            f"'{texture.name}' has values up to {largest:.3g} times white in the rows from {first}",
            remedy="divide counts by the white reference, or give the scale of the values",
        )
    return linear
