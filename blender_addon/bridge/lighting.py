"""Light a managed scene: lamps and materials for a light at a level, and the white calibration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import bpy
import numpy as np

from spectral_core.arrays import BoolArray, Float64Array
from spectral_core.basis import SpectralBasis
from spectral_core.coded import CHANNELS, CodedLamps, Parts, coded_lamps
from spectral_core.display import srgb
from spectral_core.errors import BlenderError
from spectral_core.lighting import Lighting, fluorescence_notes, make_lighting
from spectral_core.lights import Light, mixed_light
from spectral_core.scene import SceneDescription, light_parts, resolve_light
from spectral_core.standards import srgb_to_XYZ_matrix
from spectral_core.surfaces import scene_surfaces

from . import encoded, live, measure, shading, state

Lamps = Sequence[tuple[bpy.types.Object, Parts]]


@dataclass(frozen=True)
class Applied:
    """A lighting as it was put into a scene; `coded` if its lamps carry channels."""

    lighting: Lighting
    coded: CodedLamps | None

    @property
    def gloss_rgb(self) -> Float64Array:
        """(3,) linear Rec.709 of neutral gloss where the perfect diffuser has the scene's luminance."""
        if self.coded is None:
            return np.asarray(self.lighting.lamp_rgb * self.lighting.gloss_rgb)
        return self.rgb(list(self.coded.white_XYZ))

    def rgb(self, colours: list[Float64Array]) -> Float64Array:
        """Linear Rec.709 (..., 3) that follows from what a surface carries, one colour or one per channel."""
        if self.coded is None:
            return np.asarray(colours[0] * self.lighting.lamp_rgb)
        code = self.coded.code(parts_of(self.lighting.light))
        return srgb().to_linear(sum(share * XYZ for share, XYZ in zip(code, colours, strict=True)))

    def linear_rgb(self, rendered: Float64Array) -> Float64Array:
        """Rendered pixels (..., 3) of what leaves the surfaces as linear Rec.709, not clipped."""
        return rendered if self.coded is None else srgb().to_linear(rendered)


@dataclass(frozen=True)
class Calibrated:
    """White's luminance before and after, and the factor on all lamps."""

    before: float
    after: float
    factor: float


def parts_of(light: Light) -> Parts:
    """A light's single lights and their shares."""
    return light.parts or ((light, 1.0),)


def lamp_lights(scene: bpy.types.Scene, light_name: str, only: bool = False) -> Lamps:
    """Each managed lamp with its lights: its own, or the scene's `light_name`, which all have if `only` is said."""
    folder = state.description(scene).folder
    known: dict[str, Parts] = {}
    found = []
    for lamp in state.managed_lamps(scene):
        name = light_name if only else str(lamp.get(state.LAMP_LIGHT_KEY) or light_name)
        if name not in known:
            known[name] = light_parts(name, folder)
        found.append((lamp, known[name]))
    return found


def channels(scene: bpy.types.Scene) -> CodedLamps:
    """The channels that coded lamps of this scene would have.

    Raises
    ------
    LightError
        If there are more than three spectra.
    """
    lamps = [parts for _, parts in lamp_lights(scene, scene.spectral_booth.light)]
    return coded_lamps(lamps, int(scene.spectral_booth.level), state.description(scene).white.luminance)


def apply(scene: bpy.types.Scene, light_name: str, level: int, only: bool = False) -> Applied:
    """Set a managed scene to a light (built-in, file or mixture) at a level.

    Lamps with a light of their own keep it, unless all lamps shall have `only` this one. With a basis this
    touches no material.

    Raises
    ------
    LightError, SpectrumError
        If the light cannot be used, or coded lamps would need more than three; nothing is changed then.
    """
    description = state.description(scene)
    light = resolve_light(light_name, description.folder)
    lamps = lamp_lights(scene, light_name, only)
    luminance = description.white.luminance
    coded = scene.spectral_booth.way == "CODED"
    channels = coded_lamps([parts for _, parts in lamps] or [parts_of(light)], level, luminance) if coded else None
    shown = light if _alike(lamps) else _average(lamps)
    applied = Applied(make_lighting(shown, level, luminance), channels)
    basis = encoded.basis_of(scene)
    baked = _baked(scene, applied, description) if basis is None else []
    _light_lamps(lamps, applied)
    _write_live(scene, applied)
    for material, colours in baked:
        shading.set_colours(material, colours)
    if basis is not None:
        _write_matrices(scene, applied, basis, description)
    scene.spectral_booth.light = light_name
    scene.spectral_booth.level = str(level)
    live.show(scene)
    notes = _notes(scene, applied, lamps, description)
    scene.spectral_booth.notes = "; ".join(notes)
    return replace(applied, lighting=replace(applied.lighting, notes=tuple(notes)))


def surface_rgb(scene: bpy.types.Scene, material: bpy.types.Material, applied: Applied) -> Float64Array:
    """Linear Rec.709 at irradiance 1 that follows from what a surface's material and the lamps hold: (3,), or
    (height, width, 3) of a textured one.
    """
    return applied.rgb(_carried(scene, material, applied))


def calibrate_white(scene: bpy.types.Scene) -> Calibrated:
    """Scale all lamps so that the white target's rendered luminance is what the scene asks for.

    The target is rendered white under neutral lamps; the measured luminance is proportional to
    the lamps' energy, so that one step is exact.

    Raises
    ------
    BlenderError
        If no light reaches the target, or the camera does not see it.
    """
    description = state.description(scene)
    white = state.described_object(scene, description.white.object)
    if white is None and not description.white.object:
        raise BlenderError(f"'{scene.name}' has no white target", remedy="only scenes that were built have one")
    if white is None:
        raise BlenderError(
            f"the white target '{description.white.object}' is gone", remedy="give it its material again, or build anew"
        )
    mask = measure.identify(scene).masks[white.name]
    if not mask.any():
        raise BlenderError(
            f"the camera does not see the white target '{white.name}'", remedy="move the camera or the target"
        )
    before = _white_luminance(scene, description, white, mask)
    factor = description.white.luminance / before
    for lamp in state.managed_lamps(scene):
        lamp.data.energy *= factor
    return Calibrated(before, _white_luminance(scene, description, white, mask), factor)


def _white_luminance(
    scene: bpy.types.Scene, description: SceneDescription, white: bpy.types.Object, mask: BoolArray
) -> float:
    """Mean luminance of the target under neutral lamps of the scene's luminance."""
    reflectance = scene_surfaces(description)[state.surface_name(white)].XYZ(Light.load(description.reference))[1]
    irradiance = measure.illumination(scene, within=mask).irradiance
    luminance = float(np.mean(irradiance[mask]) * reflectance * description.white.luminance)
    if not luminance > 0:
        raise BlenderError(f"no light reaches the white target '{white.name}'", remedy="aim a lamp at it")
    return luminance


def _alike(lamps: Lamps) -> bool:
    """Whether all lamps have the same light."""
    shares = [{light.name: share / sum(each for _, each in parts) for light, share in parts} for _, parts in lamps]
    return all(each == shares[0] for each in shares)


def _average(lamps: Lamps) -> Light:
    """All lamps' light as if it fell everywhere alike, each by its power."""
    return mixed_light(
        [
            (light, share / sum(each for _, each in parts) * lamp.data.energy / state.unit_energy(lamp.data))
            for lamp, parts in lamps
            for light, share in parts
        ]
    )


def _light_lamps(lamps: Lamps, applied: Applied) -> None:
    shown = applied.lighting
    for lamp, parts in lamps:
        if applied.coded is not None:
            colour = applied.coded.code(parts)
        elif _alike(lamps) or shown.folded:
            colour = shown.lamp_rgb
        else:
            colour = make_lighting(_one_light(parts), min(shown.level, 1), shown.luminance).lamp_rgb
        if not np.array_equal(lamp.data.color, colour.astype(np.float32)):  # what is set anew gets new shadows
            lamp.data.color = colour.tolist()


def _write_live(scene: bpy.types.Scene, applied: Applied) -> None:
    coded = applied.coded
    live.set_vector(scene, live.GLOSS, applied.lighting.gloss_rgb if coded is None else np.ones(3))
    live.set_vector(scene, live.SPECTRAL, np.full(4, float(applied.lighting.level == 2)))
    if coded is not None:
        for channel, (lamp_rgb, white_XYZ) in enumerate(zip(coded.lamp_rgb, coded.white_XYZ, strict=True)):
            live.set_vector(scene, live.lamp_rgb(channel), lamp_rgb)
            live.set_vector(scene, live.white_XYZ(channel), white_XYZ)


def _write_matrices(
    scene: bpy.types.Scene, applied: Applied, basis: SpectralBasis, description: SceneDescription
) -> None:
    """From coefficients to what surfaces carry; at levels 0 and 1 to their RGB under the reference light."""
    shown, coded = applied.lighting, applied.coded
    to_rgb = np.linalg.inv(srgb_to_XYZ_matrix())
    if shown.level < 2:
        reference = to_rgb @ encoded.synthesis(basis, light_parts(description.reference, description.folder))
        matrices = [reference] if coded is None else [srgb_to_XYZ_matrix() * rgb @ reference for rgb in coded.lamp_rgb]
    elif coded is None:
        exact = to_rgb @ encoded.synthesis(basis, parts_of(shown.light)) * shown.luminance
        matrices = [exact / shown.lamp_rgb[:, None]]
    else:
        matrices = [encoded.synthesis(basis, [(light, 1.0)]) for light in coded.lights]
        matrices += [np.zeros_like(matrices[0])] * (CHANNELS - len(matrices))
    for channel, matrix in enumerate(matrices):
        live.set_matrix(scene, channel, encoded.padded(basis, matrix))


def _baked(
    scene: bpy.types.Scene, applied: Applied, description: SceneDescription
) -> list[tuple[bpy.types.Material, list[Float64Array]]]:
    """What the materials of all surfaces are to carry."""
    reference = resolve_light(description.reference, description.folder)
    shown, coded = applied.lighting, applied.coded
    return [
        (material, [shown.material_rgb(surface, reference)] if coded is None else coded.XYZ(surface, reference))
        for material, surface in state.shown_surfaces(scene)
    ]


def _carried(scene: bpy.types.Scene, material: bpy.types.Material, applied: Applied) -> list[Float64Array]:
    """What a surface carries, as its shader computes it."""
    basis, coded = encoded.basis_of(scene), applied.coded
    if basis is None:
        return shading.stored_colours(material)
    reference = shading.stored_reference(material)
    if applied.lighting.level < 2 and reference is not None:
        return [reference] if coded is None else [srgb_to_XYZ_matrix() @ (rgb * reference) for rgb in coded.lamp_rgb]
    coefficients, quads = shading.stored_coefficients(material), encoded.quads(basis)
    count = CHANNELS if coded else 1
    return [np.maximum(coefficients @ live.matrix(scene, channel, quads).T, 0.0) for channel in range(count)]


def _clipped_lamps(applied: Applied, lamps: Lamps) -> list[str]:
    """Sentences about lamps of different lights, or coded ones, that have the RGB of a light outside Rec.709."""
    shown = applied.lighting
    if applied.coded is not None:
        lights = list(applied.coded.lights) if shown.level == 1 else []
    else:
        unlike = shown.level > 0 and not shown.folded and not _alike(lamps)
        lights = [_one_light(parts) for _, parts in lamps] if unlike else []
    return list(dict.fromkeys(note for each in lights for note in make_lighting(each, 1, shown.luminance).notes))


def _one_light(parts: Parts) -> Light:
    return parts[0][0] if len(parts) == 1 else mixed_light(parts)


def _notes(scene: bpy.types.Scene, applied: Applied, lamps: Lamps, description: SceneDescription) -> list[str]:
    """What a user should know of a light as it is shown."""
    found = list(applied.lighting.notes) if applied.coded is None else []
    if applied.coded is None and not _alike(lamps):
        found.append("lamps of different lights: surfaces are exact where these mix as on average; use coded lamps")
    found += _clipped_lamps(applied, lamps)
    if applied.lighting.level == 2:
        found += fluorescence_notes(scene_surfaces(description).values())
    return found
