"""What a basis is fitted to: the surfaces of a scene, and pixels of its textures."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.baking.dead_bands import without_dead_bands
from spectral_core.baking.projection import level2_weights
from spectral_core.basis.spectral_basis import check_lights
from spectral_core.errors import SpectrumError
from spectral_core.lights import Light
from spectral_core.standards import DEFAULT_OBSERVER
from spectral_core.surfaces import Surface
from spectral_core.textures import HyperspectralTexture

# Pixels that are looked at for each that is taken, and rows that they lie in.
_LOOKED_AT = 16
_ROWS = 64
# Darker than this share of white a pixel's hue is noise.
_DARK = 0.01


def surface_samples(
    surfaces: Iterable[Surface], lights: Sequence[Light], observer: str = DEFAULT_OBSERVER, count: int = 200
) -> Float64Array:
    """XYZ (n, L, 3) under all lights: one of each uniform surface, at most `count` pixels of each texture.

    Raises
    ------
    SpectrumError, TextureError
        If there is no surface, or a texture cannot be used.
    """
    check_lights(lights, observer)
    found = [
        np.stack([surface.XYZ(light, observer) for light in lights])[None]
        if surface.texture is None
        else texture_samples(surface.texture, lights, observer, count)
        for surface in surfaces
    ]
    if not found:
        raise SpectrumError("no surface to fit a spectral basis to", remedy="give at least one")
    return np.concatenate(found)


def texture_samples(
    texture: HyperspectralTexture, lights: Sequence[Light], observer: str = DEFAULT_OBSERVER, count: int = 200
) -> Float64Array:
    """XYZ (n, L, 3) of at most `count` pixels: some all over the image, and the extremes of those looked at.

    Pixels with values that are no numbers are left out.
    """
    texture = without_dead_bands(texture)
    weights = level2_weights(texture, lights, observer)
    wanted = _LOOKED_AT * count
    rows = np.unique(np.linspace(0, texture.height - 1, min(_ROWS, texture.height)).round().astype(int))
    step = max(1, texture.width * len(rows) // wanted)
    # Not the same columns in all rows: patterns repeat.
    values = [texture.rows(int(row), 1)[0, (index % step) :: step] for index, row in enumerate(rows)]
    texture.close()
    spectra = np.concatenate(values).astype(np.float64)
    spectra[:, ~texture.good] = 0.0
    looked_at = spectra[np.isfinite(spectra).all(axis=1)] @ weights
    chosen = _spread(looked_at, count)
    return np.asarray(looked_at[chosen].reshape(-1, len(lights), 3))


def _spread(XYZ: Float64Array, count: int) -> list[int]:
    """Indices of at most `count` of (n, 3 L): the extremes along principal axes, of colours and of colours as bright
    as each other, then evenly.
    """
    if len(XYZ) <= count:
        return list(range(len(XYZ)))
    lightness = np.abs(XYZ).mean(axis=1, keepdims=True)
    chosen: list[int] = []
    for each in (XYZ, XYZ / np.maximum(lightness, _DARK)):
        centred = each - each.mean(axis=0)
        along = centred @ np.linalg.svd(centred, full_matrices=False)[2].T
        chosen += [*along.argmax(axis=0).tolist(), *along.argmin(axis=0).tolist()]
    extremes = list(dict.fromkeys(chosen))[: count // 2]
    evenly = np.linspace(0, len(XYZ) - 1, count - len(extremes)).round().astype(int).tolist()
    return sorted({*extremes, *evenly})
