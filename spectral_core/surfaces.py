"""Surfaces of a scene: what reflects, as one spectrum or as a hyperspectral texture."""

from __future__ import annotations

import csv
from dataclasses import dataclass, field
from functools import cache, lru_cache
from importlib import resources
from pathlib import Path

import numpy as np

from spectral_core import standards
from spectral_core.arrays import Float64Array, frozen
from spectral_core.baking import level2_weights, project
from spectral_core.display import srgb, srgb_decode, srgb_encode
from spectral_core.errors import SceneError
from spectral_core.lights import Light
from spectral_core.scene import SceneDescription, SurfaceSource
from spectral_core.spectra import Spectra, read_spectra
from spectral_core.standards import DEFAULT_OBSERVER
from spectral_core.textures import HyperspectralTexture, open_texture
from spectral_core.textures.synthetic.pigments import pigment_texture

# A constant reflectance needs two bands to say so.
_CONSTANT_GRID_NM = (380.0, 780.0)


@dataclass(frozen=True)
class Surface:
    """A surface with its reflectance: either one spectrum (bands,) or a texture.

    Attributes
    ----------
    name
        As in the scene description.
    wavelengths_nm, reflectance
        (bands,) of a uniform surface; empty for a textured one.
    texture
        Of a textured surface, else None.
    maker_rgb
        (3,) linear sRGB that its maker states, else None.
    gloss, roughness
        Neutral gloss at normal incidence, 0..1.
    """

    name: str
    wavelengths_nm: Float64Array
    reflectance: Float64Array
    texture: HyperspectralTexture | None
    maker_rgb: Float64Array | None
    gloss: float
    roughness: float

    @property
    def uniform(self) -> bool:
        """One spectrum for the whole surface: a constant, not an image."""
        return self.texture is None

    def XYZ(self, light: Light, observer: str = DEFAULT_OBSERVER) -> Float64Array:
        """XYZ under a light, perfect diffuser Y = 1: (3,), or (height, width, 3) from the top row."""
        if self.texture is None:
            return np.asarray(self.reflectance @ light.weighting_factors(self.wavelengths_nm, observer).matrix)
        weights = level2_weights(self.texture, [light], observer)
        return project(self.texture, weights).astype(np.float64)

    def reference_rgb(self, reference: Light) -> Float64Array:
        """Linear sRGB that an RGB pipeline has for it: the maker's, else its colour under the
        reference light, clipped and rounded to 8 bits as in any RGB texture.
        """
        if self.maker_rgb is not None:
            return self.maker_rgb
        codes = np.clip(srgb_encode(srgb().to_linear(self.XYZ(reference))), 0, 1)
        return srgb_decode(np.round(codes * 255) / 255)

    def extended(self, light: Light) -> float:
        """Share of the white under `light` that rests on extended ends of the reflectance."""
        grid = self.wavelengths_nm if self.texture is None else self.texture.wavelengths_nm
        return light.weighting_factors(grid).extended


@dataclass(frozen=True)
class _Described:
    """The surfaces of a description: its text says all of them, so that not each need be compared."""

    text: str
    folder: Path
    sources: dict[str, SurfaceSource] = field(compare=False)


@lru_cache(maxsize=8)
def _surfaces(described: _Described) -> dict[str, Surface]:
    return {name: resolve_surface(source, described.folder) for name, source in described.sources.items()}


def scene_surfaces(scene: SceneDescription) -> dict[str, Surface]:
    """All surfaces of a scene by name; kept for the scenes used last.

    Raises
    ------
    SceneError, SpectrumError, TextureError
        If one cannot be resolved.
    """
    return _surfaces(_Described(scene.text, scene.folder, scene.surfaces))


def resolve_surface(source: SurfaceSource, folder: Path) -> Surface:
    """The surface a scene description speaks of; file names are relative to `folder`."""
    texture: HyperspectralTexture | None = None
    maker: Float64Array | None = None
    wavelengths, reflectance = frozen([]), frozen([])
    if source.source == "colorchecker":
        wavelengths, reflectance, maker = _colorchecker_patch(source)
    elif source.source == "reflectance":
        wavelengths, reflectance = frozen(_CONSTANT_GRID_NM), frozen([source.constant] * 2)
    elif source.source == "file":
        wavelengths, reflectance = _from_library(read_spectra(folder / source.value, "reflectance"), source, folder)
    elif source.source == "texture":
        texture = open_texture(folder / source.value, source.reading.relative_to(folder))
    else:
        texture = pigment_texture(source.value)
    return Surface(source.name, wavelengths, reflectance, texture, maker, source.gloss, source.roughness)


@cache
def colorchecker_maker_srgb() -> Float64Array:
    """(24, 3) 8-bit sRGB of the ColorChecker under D65 as its maker states them (X-Rite; published
    with Diaz-Barrancas et al. 2020, Table 2).
    """
    table = resources.files("spectral_core").joinpath("data/colorchecker_srgb_d65.csv").read_text(encoding="utf-8")
    return frozen([[float(row[f"ref_{channel}"]) for channel in "RGB"] for row in csv.DictReader(table.splitlines())])


def _colorchecker_patch(source: SurfaceSource) -> tuple[Float64Array, Float64Array, Float64Array]:
    names, wavelengths, values = standards.colorchecker()
    if source.value not in names:
        raise SceneError(
            f"the ColorChecker has no patch '{source.value}'",
            where=f"surfaces.{source.name}",
            remedy=f"it has {', '.join(names)}",
        )
    index = names.index(source.value)
    return wavelengths, frozen(values[index]), frozen(srgb_decode(colorchecker_maker_srgb()[index] / 255))


def _from_library(library: Spectra, source: SurfaceSource, folder: Path) -> tuple[Float64Array, Float64Array]:
    name = source.spectrum or library.names[0]
    if name not in library.names or (not source.spectrum and len(library.names) > 1):
        problem = f"has no spectrum '{name}'" if source.spectrum else f"holds {len(library.names)} spectra"
        raise SceneError(
            problem, where=folder / source.value, remedy=f"set 'spectrum' to one of {', '.join(library.names[:12])}"
        )
    return library.wavelengths_nm, frozen(library.values[library.names.index(name)])
