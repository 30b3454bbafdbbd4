"""Render a managed scene under its lights and levels, and compare the pixels with theory."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from spectral_core.arrays import Float32Array, Float64Array
from spectral_core.baking import file_name
from spectral_core.errors import BlenderError
from spectral_core.files import atomic_path
from spectral_core.imaging import write_png
from spectral_core.lighting import Lighting
from spectral_core.report.documents import Document, verify_document
from spectral_core.scene import LEVELS, SceneDescription, resolve_light
from spectral_core.steps import finished
from spectral_core.surfaces import Surface, scene_surfaces
from spectral_core.verification import (
    LevelResult,
    LightResult,
    PatchReading,
    Percentiles,
    TextureDifference,
    compare,
    conditions,
    texture_difference,
    worst_stages,
)

from . import encoded, lighting, measure, state, ways
from .render import render_linear

# Fewer pixels than this are no reading: 5 x 5 inside the border.
_FEWEST_PIXELS = 25
# Pixels of a textured object whose colour in the identity pass and in the filtered render belong
# together: the texture must vary slowly across the 1.5-pixel filter, which it does not at grazing
# angles, where irradiance is small.
_LEAST_IRRADIANCE = 0.2

Progress = Callable[[float, str], None]


@dataclass(frozen=True)
class Step:
    """What comes next, and the share that is done, 0..1."""

    fraction: float
    what: str


@dataclass(frozen=True)
class View:
    """What the camera sees: which pixels show what, and how much light falls there."""

    identity: measure.Identity
    illumination: measure.Illumination


def survey(scene: bpy.types.Scene) -> View:
    """Find out what the camera sees.

    Raises
    ------
    BlenderError
        If that is no spectral surface.
    """
    identity = measure.identify(scene)
    if not any(mask.sum() >= _FEWEST_PIXELS for mask in identity.masks.values()):
        raise BlenderError(
            f"the camera of '{scene.name}' sees no spectral surface", remedy="aim it at some, or render larger"
        )
    return View(identity, _illumination(scene, state.description(scene), identity))


def verify(
    scene: bpy.types.Scene,
    lights: Sequence[str],
    levels: Sequence[int] = LEVELS,
    images: Path | None = None,
    progress: Progress | None = None,
) -> list[LightResult]:
    """`verify_steps` in one go."""
    steps = verify_steps(scene, lights, levels, images)
    return finished(steps, progress and (lambda step: progress(step.fraction, step.what)))


def verify_steps(
    scene: bpy.types.Scene, lights: Sequence[str], levels: Sequence[int] = LEVELS, images: Path | None = None
) -> Generator[Step, None, list[LightResult]]:
    """Verify a scene under `lights` at `levels`, one render after each step; returns the results.

    The scene is left as it was found, also when the generator is closed before its end. The
    ColorChecker's patches are what is counted where the scene has one, as published; without one,
    every uniform surface. With `images`, each render is kept there as PNG.
    """
    description = state.description(scene)
    for light in lights:
        resolve_light(light, description.folder)  # refuse a wrong name before the first render
    ways.learn(scene, lights)
    with as_found(scene):
        yield Step(0.0, "what the camera sees")
        view = survey(scene)
        results = []
        for index, light in enumerate(lights):
            found: dict[int, LevelResult] = {}
            textures: dict[str, TextureDifference] = {}
            for level in levels:
                yield Step((index + levels.index(level) / len(levels)) / len(lights), f"{light}, level {level}")
                started = time.perf_counter()
                applied = ways.light(scene, light, level, only=True)
                switched = time.perf_counter() - started
                rendered = render_linear(scene)
                pixels = applied.linear_rgb(rendered.pixels).astype(np.float32)
                if images:
                    write_png(images / f"{file_name(light)}_level{level}.png", pixels)
                gloss = applied.gloss_rgb.astype(np.float32)
                diffuse = pixels - view.illumination.gloss[..., None] * gloss
                readings = read_patches(scene, applied, diffuse, view)
                found[level] = compare(readings, applied.lighting, switched, rendered.seconds)
                if level == max(levels):
                    met = conditions(applied.lighting, *_clipped_and_extended(scene, applied))
                    textures = _read_textures(scene, applied.lighting, diffuse, view)
            results.append(LightResult(light, found, textures, met))
        return results


@contextmanager
def as_found(scene: bpy.types.Scene) -> Iterator[None]:
    """The scene's own colours for the block, not a headset's codes; its light and level put back afterwards."""
    before = (scene.spectral_booth.light, int(scene.spectral_booth.level))
    with ways.scene_linear(scene):
        try:
            yield
        finally:
            ways.light(scene, *before)


def summary(results: Sequence[LightResult]) -> str:
    """A few lines for the panel: per level, dE00 over all lights."""
    lights = results[0].name if len(results) == 1 else f"{len(results)} lights"
    patches = max(level.patches for light in results for level in light.levels.values())
    lines = [f"{lights}, {patches} colours"]
    for level in sorted(results[0].levels):
        found = [light.levels[level] for light in results]
        lines.append(f"Level {level}: dE00 {_mean_and_max([each.dE00 for each in found])}")
        if level == max(LEVELS) and any(each.in_gamut < each.patches for each in found):
            lines.append(f"In gamut: dE00 {_mean_and_max([each.dE00_in_gamut for each in found])}")
    return "\n".join(lines)


def _mean_and_max(spreads: Sequence[Percentiles]) -> str:
    return f"{np.mean([each.mean for each in spreads]):.2f}, max {max(each.max for each in spreads):.2f}"


def document(scene: bpy.types.Scene, results: Sequence[LightResult], seconds: float) -> Document:
    """The JSON of `verify`."""
    description = state.description(scene)
    document = verify_document(
        results,
        worst_stages(list(results)),
        left_out(scene),
        scene=description.name,
        blender=bpy.app.version_string,
        shading="forward" if description.render.forward else "deferred",
        file=bpy.data.filepath,
        seconds=seconds,
    )
    return {**document, **shown_document(scene)}


def shown_document(scene: bpy.types.Scene) -> Document:
    """How the scene is shown, for JSON: its lamps, and its basis if it has one."""
    kept, basis = scene.spectral_booth, encoded.basis_of(scene)
    described = {"lamps": kept.way.lower(), "basis": None}
    if basis is not None:
        described["basis"] = {
            "K": basis.K,
            "lights": list(basis.light_names),
            "tolerance_dE00": round(kept.basis_tolerance, 6),
            "largest_dE00": kept.basis_error,
            "half": kept.basis_half,
        }
    return described


def json_path() -> Path:
    """Where `write_json` writes: beside the .blend."""
    if not bpy.data.filepath:
        raise BlenderError("the file was never saved, so that JSON has no place beside it", remedy="save it first")
    return Path(bpy.data.filepath).with_suffix(".verify.json")


def write_json(scene: bpy.types.Scene, results: Sequence[LightResult], seconds: float) -> Path:
    """Write the figures beside the .blend."""
    path = json_path()
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(document(scene, results, seconds), indent=2), encoding="utf-8")
    return path


def left_out(scene: bpy.types.Scene) -> list[str]:
    """What the scene does without because it does not need it."""
    description = state.description(scene)
    surfaces = scene_surfaces(description)
    uniform = sum(surface.uniform for surface in surfaces.values())
    textured = [surface for surface in surfaces.values() if surface.texture is not None]
    megabytes = sum(each.texture.width * each.texture.height for each in textured if each.texture) * 16 / 1e6
    lines = [f"images for {uniform} uniform surfaces: each is one constant"]
    if textured and encoded.basis_of(scene) is not None:
        lines.append("images for single lights: coefficients serve them all, and a switch computes none")
    elif textured:
        others = len(description.lights) - 1
        lines.append(
            f"images for the {others} lights not shown: {others * megabytes:.0f} MB; a switch computes the "
            f"{len(textured)} that are needed ({megabytes:.0f} MB)"
        )
    return lines


def _illumination(
    scene: bpy.types.Scene, description: SceneDescription, identity: measure.Identity
) -> measure.Illumination:
    """By theory where one sun lights flat, dull surfaces; otherwise from an all-white render."""
    surfaces = scene_surfaces(description)
    seen = [item for item in state.managed_objects(scene) if identity.masks[item.name].sum() >= _FEWEST_PIXELS]
    items = [item for item in seen if _is_patch(item) or not surfaces[state.surface_name(item)].uniform]
    known = all(len(item.data.polygons) == 1 and not surfaces[state.surface_name(item)].gloss for item in items)
    if not (description.single_sun and any(map(_is_patch, items)) and known):
        return measure.illumination(scene)
    sun = next(state.managed_lamps(scene))
    towards = sun.matrix_world.to_3x3().col[2].normalized()
    irradiance = np.zeros(identity.uv.shape[:2], dtype=np.float32)
    for item in items:
        normal = (item.matrix_world.to_3x3() @ item.data.polygons[0].normal).normalized()
        irradiance[identity.masks[item.name]] = sun.data.energy / math.pi * max(0.0, normal.dot(towards))
    return measure.Illumination(irradiance, np.zeros_like(irradiance))


def _clipped_and_extended(scene: bpy.types.Scene, applied: lighting.Applied) -> tuple[dict[str, int], dict[str, float]]:
    """Per surface, colours (pixels) that lose a negative channel, and the share that rests on extended ends."""
    description, shown = state.description(scene), applied.lighting
    reference = resolve_light(description.reference, description.folder)
    surfaces = {surface.name: surface for _, surface in state.shown_surfaces(scene)}
    clipped = {
        name: 0 if applied.coded else int((shown.material_rgb(surface, reference) < 0).any(axis=-1).sum())
        for name, surface in surfaces.items()
    }
    extended = {name: surface.extended(shown.light) if shown.level == 2 else 0.0 for name, surface in surfaces.items()}
    return clipped, extended


def _is_patch(item: bpy.types.Object) -> bool:
    return state.surface_name(item).startswith("colorchecker ") and len(item.data.polygons) == 1


def read_patches(
    scene: bpy.types.Scene, applied: lighting.Applied, rendered: Float32Array, view: View
) -> list[PatchReading]:
    """Mean colours of the ColorChecker's patches, of all uniform surfaces without one."""
    surfaces = scene_surfaces(state.description(scene))
    shown = state.managed_materials(scene)
    uniform = [
        item
        for item in state.managed_objects(scene)
        if surfaces[state.surface_name(item)].uniform and view.identity.masks[item.name].sum() >= _FEWEST_PIXELS
    ]
    readings = []
    for item in [each for each in uniform if _is_patch(each)] or uniform:
        mask = view.identity.masks[item.name]
        name = state.surface_name(item)
        readings.append(
            PatchReading(
                name=item.name,
                surface=name,
                rendered=rendered[mask].mean(axis=0, dtype=np.float64),
                irradiance=float(view.illumination.irradiance[mask].mean(dtype=np.float64)),
                stored=lighting.surface_rgb(scene, shown[name], applied),
                exact=applied.lighting.exact_rgb(surfaces[name]),
            )
        )
    return readings


def _read_textures(
    scene: bpy.types.Scene, applied: Lighting, rendered: Float32Array, view: View
) -> dict[str, TextureDifference]:
    """Per textured object, its pixels against the texture's exact colours at the same points."""
    surfaces = scene_surfaces(state.description(scene))
    found = {}
    for item in state.managed_objects(scene):
        surface: Surface = surfaces[state.surface_name(item)]
        mask = view.identity.masks[item.name] & (view.illumination.irradiance > _LEAST_IRRADIANCE)
        if surface.uniform or mask.sum() < _FEWEST_PIXELS:
            continue
        exact: Float64Array = measure.sample(applied.exact_rgb(surface), view.identity.uv[mask])
        found[item.name] = texture_difference(
            rendered[mask].astype(np.float64), exact * view.illumination.irradiance[mask][:, None]
        )
    return found
