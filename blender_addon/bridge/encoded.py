"""A scene's spectral basis: fitted to its lights and surfaces, kept in the file, encoded into its materials."""

from __future__ import annotations

import json
from collections.abc import Generator
from dataclasses import dataclass
from functools import lru_cache

import bpy
import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.basis import (
    CodeTolerance,
    PackedTexture,
    SpectralBasis,
    extend,
    packing_steps,
    stored_error,
    surface_samples,
    with_light,
)
from spectral_core.errors import SpectrumError
from spectral_core.lights import Light
from spectral_core.scene import SceneDescription, light_parts, resolve_light
from spectral_core.surfaces import Surface

from . import shading, state
from .images import empty_image, write_image

# In 8-bit levels of sRGB: with what the renderer adds, at most 0.1, no code of a window is off by more than rounding.
LARGEST_CODE_DIFFERENCE = 0.4
# Set on images of coefficients; those without it hold colours.
COEFFICIENTS_KEY = "spectral_booth_coefficients"


@dataclass(frozen=True)
class Encoding:
    """A scene's basis and the images of its textured surfaces, not yet shown; what the user asked for, and should know
    of the textures.
    """

    basis: SpectralBasis
    images: dict[str, list[bpy.types.Image]]
    tolerance: float
    half: bool
    largest_error: float
    notes: tuple[str, ...]


def basis_of(scene: bpy.types.Scene) -> SpectralBasis | None:
    """The basis that a scene's materials are encoded in; None where their colours are baked."""
    text = scene.spectral_booth.basis
    return None if text is None else _parsed(text.as_string())


@lru_cache(maxsize=8)
def _parsed(text: str) -> SpectralBasis:
    try:
        document = json.loads(text)
    except ValueError:
        document = None
    if not isinstance(document, dict):
        raise SpectrumError("the scene's spectral basis is no JSON any more", remedy="undo the change of its text")
    return SpectralBasis.from_json(document)


def quads(basis: SpectralBasis) -> int:
    """Images, or groups of four numbers, that its coefficients take."""
    return -(-basis.K // 4)


def padded(basis: SpectralBasis, values: Float64Array) -> Float64Array:
    """Numbers (..., K) with zeros up to whole groups of four."""
    missing = 4 * quads(basis) - basis.K
    return np.pad(values, [(0, 0)] * (values.ndim - 1) + [(0, missing)])


def synthesis(basis: SpectralBasis, parts: list[tuple[Light, float]]) -> Float64Array:
    """XYZ from coefficients, (3, K), under a light or a mixture of lights and shares."""
    total = sum(share for _, share in parts)
    return np.asarray(sum(basis.synthesis_of(light.name) * (share / total) for light, share in parts))


def lights_of(scene: bpy.types.Scene) -> list[Light]:
    """The single lights that all consist of that a scene offers, that it shows, and that its lamps have."""
    description = state.description(scene)
    own = [str(lamp[state.LAMP_LIGHT_KEY]) for lamp in state.managed_lamps(scene) if state.LAMP_LIGHT_KEY in lamp]
    names = (*description.lights, description.reference, scene.spectral_booth.light, *own)
    parts = [light for name in filter(None, names) for light, _ in light_parts(name, description.folder)]
    return list({light.name: light for light in parts}.values())


def encoding_steps(
    scene: bpy.types.Scene, lights: list[Light], tolerance: float, half: bool
) -> Generator[tuple[float, str], None, Encoding]:
    """Fit a basis to a scene's surfaces under lights, and encode its textures: a step at a time, nothing is shown yet.

    The tolerance is the largest dE00 of any surface and any pixel, as it is stored.
    """
    surfaces = _surfaces(scene)
    textured = [each for each in surfaces if each.texture is not None]
    uniform = [each for each in surfaces if each.uniform]
    others = surface_samples(uniform, lights) if uniform else None
    packed = yield from packing_steps(
        [each.texture for each in textured if each.texture is not None], lights, tolerance, others, half,
        codes=_codes(scene),
    )  # fmt: skip
    largest = max((each.largest_error for each in packed.textures), default=0.0)
    if others is not None:
        largest = max(largest, *(each.max for each in packed.basis.measure(others)))
    yield 1.0, "images"
    images = {
        surface.name: coefficient_images(surface.name, texture, half)
        for surface, texture in zip(textured, packed.textures, strict=True)
    }
    warnings = {each.name: texture.warnings for each, texture in zip(textured, packed.textures, strict=True)}
    notes = _told_once(warnings)
    return Encoding(packed.basis, images, tolerance, half, largest, notes)


def _told_once(warnings: dict[str, tuple[str, ...]]) -> tuple[str, ...]:
    """What is to be told of textures, each text once with the names of all that it is true of."""
    names: dict[str, list[str]] = {}
    for name, texts in warnings.items():
        for text in texts:
            names.setdefault(text, []).append(name)
    return tuple(f"{', '.join(each)}: {text}" for text, each in names.items())


def keep(scene: bpy.types.Scene, basis: SpectralBasis, tolerance: float, half: bool, largest_error: float) -> None:
    """Keep a basis in the file, with the largest dE00 of any surface and pixel."""
    kept = scene.spectral_booth
    keep_text(scene, json.dumps(basis.to_json()))
    kept.basis_tolerance, kept.basis_half, kept.basis_error = tolerance, half, largest_error
    kept.basis_notes = f"{basis.K} numbers a colour for {len(basis.lights)} lights; dE00 at most {largest_error:.2g}"


def keep_text(scene: bpy.types.Scene, text: str) -> None:
    """Keep a basis as its JSON."""
    kept = scene.spectral_booth
    if kept.basis is None:
        kept.basis = bpy.data.texts.new(f"{scene.name} basis.json")
    kept.basis = state.own_text(scene, kept.basis)
    kept.basis.clear()
    kept.basis.write(text)


def forget(scene: bpy.types.Scene) -> None:
    """The scene has no basis any more."""
    kept = scene.spectral_booth
    if kept.basis is not None:
        text, kept.basis = kept.basis, None
        state.drop_text(scene, text)
    for name in ("basis", "basis_tolerance", "basis_half", "basis_error", "basis_notes", "texture_notes"):
        kept.property_unset(name)


def unknown(scene: bpy.types.Scene, lights: list[Light]) -> list[Light]:
    """Those of `lights` that the scene's basis has no colours for."""
    basis = basis_of(scene)
    if basis is None:
        return []
    known = {light.name: light for light in basis.lights}
    return [each for each in lights if each.name not in known or not each.same_spectrum(known[each.name])]


def learn(scene: bpy.types.Scene, light: Light) -> float:
    """Add a light to the scene's basis if that shows it within its tolerances; returns the largest dE00 under it.

    That is of all surfaces, and of all pixels as they are stored.

    Images and materials stay as they are.
    """
    basis, kept = basis_of(scene), scene.spectral_booth
    assert basis is not None
    samples = surface_samples(_surfaces(scene), (*basis.lights, light))
    added = with_light(basis, light, samples[:, :-1], samples[:, -1])
    error = added.error.max
    for material, surface in state.shown_surfaces(scene):
        if surface.texture is not None and error <= kept.basis_tolerance:
            stored = shading.stored_coefficients(material)[..., : basis.K]
            error = max(error, stored_error(added, surface.texture, stored, basis.observer))
    if error <= kept.basis_tolerance and light.name not in basis.light_names:
        learnt = extend(basis, added)
        if _codes(scene).holds(learnt, samples):
            keep(scene, learnt, kept.basis_tolerance, kept.basis_half, max(kept.basis_error, error))
    return error


def _codes(scene: bpy.types.Scene) -> CodeTolerance:
    return CodeTolerance(LARGEST_CODE_DIFFERENCE, state.description(scene).white.luminance)


def _surfaces(scene: bpy.types.Scene) -> list[Surface]:
    """The surfaces that a scene shows, each once."""
    return list({surface.name: surface for _, surface in state.shown_surfaces(scene)}.values())


def coefficient_images(name: str, texture: PackedTexture, half: bool) -> list[bpy.types.Image]:
    """Images of a texture's coefficients; its scale is undone, for these floats hold more than 1."""
    found = []
    for number, stored in enumerate(texture.images):
        height, width, channels = stored.shape
        image = empty_image(f"{name} (coefficients {number + 1})", width, height, half)
        image[COEFFICIENTS_KEY] = True
        scale = np.ones(channels)
        part = texture.scale[channels * number : channels * (number + 1)]
        scale[: len(part)] = part
        write_image(image, stored.astype(np.float32) * scale.astype(np.float32))
        found.append(image)
    return found


def holds_coefficients(image: bpy.types.Image) -> bool:
    """Whether an image holds coefficients, not colours."""
    return COEFFICIENTS_KEY in image


def write_uniform(
    material: bpy.types.Material, surface: Surface, basis: SpectralBasis, description: SceneDescription
) -> None:
    """Give a uniform surface its coefficients, and its RGB for levels 0 and 1."""
    coefficients = surface.reflectance @ basis.band_analysis(surface.wavelengths_nm)
    reference = surface.reference_rgb(resolve_light(description.reference, description.folder))
    shading.set_coefficients(material, padded(basis, coefficients), reference)
