"""What a managed scene remembers: its description, its light and level, what each datum is for.

Data is found again by custom properties, never by kept pointers, so that undo, renaming and
reloading do no harm.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

import bpy

from spectral_core.errors import BlenderError, SceneError
from spectral_core.scene import SceneDescription, parse_scene
from spectral_core.surfaces import Surface, scene_surfaces

OBJECT_KEY = "spectral_booth_object"
SURFACE_KEY = "spectral_booth_surface"
LAMP_KEY = "spectral_booth_lamp"
# A light of the lamp's own; without one it has the scene's.
LAMP_LIGHT_KEY = "spectral_booth_light"
# Of a user's own lamp: the colour that it had.
LAMP_COLOUR_KEY = "spectral_booth_colour"


def remember(scene: bpy.types.Scene, description: SceneDescription) -> None:
    """Keep the description's text in the .blend, and mark the scene as managed."""
    text = bpy.data.texts.new(f"{description.name}.toml")
    state = scene.spectral_booth
    state.description = text
    rewrite(scene, description.text)
    state.folder = str(description.folder)
    state.lights.clear()
    for light in description.lights:
        state.lights.add().name = light
    state.light = description.light
    state.level = str(description.level)


def rewrite(scene: bpy.types.Scene, text: str) -> None:
    """Put another text in place of the scene's description."""
    kept = scene.spectral_booth
    kept.description = own_text(scene, kept.description)
    kept.description.clear()
    kept.description.write(text)


def own_text(scene: bpy.types.Scene, text: bpy.types.Text) -> bpy.types.Text:
    """A text that this scene alone keeps: a copied scene shares the original's until one of them changes it."""
    return text.copy() if _kept_elsewhere(scene, text) else text


def drop_text(scene: bpy.types.Scene, text: bpy.types.Text) -> None:
    """Remove a text that this scene kept, unless another one keeps it too."""
    if not _kept_elsewhere(scene, text):
        bpy.data.texts.remove(text)


def _kept_elsewhere(scene: bpy.types.Scene, text: bpy.types.Text) -> bool:
    others = [each.spectral_booth for each in bpy.data.scenes if each != scene]
    return any(text in (each.description, each.basis) for each in others)


def is_managed(scene: bpy.types.Scene) -> bool:
    """Whether this add-on built the scene."""
    return bool(scene.spectral_booth.is_managed)


def description(scene: bpy.types.Scene) -> SceneDescription:
    """The description of a managed scene.

    Raises
    ------
    SceneError
        If the scene is not managed or its description was edited into something invalid.
    """
    if not is_managed(scene):
        raise SceneError(f"'{scene.name}' is no spectral scene", remedy="build one from a TOML description first")
    state = scene.spectral_booth
    return _parsed(state.description.as_string(), state.folder, state.description.name)


@lru_cache(maxsize=8)
def _parsed(text: str, folder: str, name: str) -> SceneDescription:
    return parse_scene(text, Path(folder), name)


def managed_objects(scene: bpy.types.Scene) -> Iterator[bpy.types.Object]:
    """Objects that show a spectral surface, in the scene's order; not those that a user gave another material."""
    return (each for each in scene.objects if each.type == "MESH" and SURFACE_KEY in each and _shows_its_surface(each))


def _shows_its_surface(item: bpy.types.Object) -> bool:
    shown = [slot.material for slot in item.material_slots]
    return any(each is not None and each.get(SURFACE_KEY) == item[SURFACE_KEY] for each in shown)


def managed_lamps(scene: bpy.types.Scene) -> Iterator[bpy.types.Object]:
    """The scene's spectral lamps."""
    return (each for each in scene.objects if each.type == "LIGHT" and LAMP_KEY in each)


def unit_energy(data: bpy.types.Light) -> float:
    """Energy of power 1: irradiance 1 of a sun, about 1 at one metre of a spot or the like, before white is calibrated.

    A spot's radiant intensity is its energy over 4 pi^2.
    """
    return math.pi if data.type == "SUN" else 4 * math.pi**2


def described_object(scene: bpy.types.Scene, name: str) -> bpy.types.Object | None:
    """The object that the description calls `name`: in a file with other scenes, or renamed by the
    user, it has another name.
    """
    return next((each for each in managed_objects(scene) if each.get(OBJECT_KEY) == name), None)


def surface_name(item: bpy.types.Object | bpy.types.Material) -> str:
    """The surface that an object or a material shows."""
    return str(item[SURFACE_KEY])


def managed_materials(scene: bpy.types.Scene) -> dict[str, bpy.types.Material]:
    """A material of the scene for each surface that it shows; `all_managed_materials` has copies too."""
    return {surface_name(each): each for each in all_managed_materials(scene)}


def all_managed_materials(scene: bpy.types.Scene) -> list[bpy.types.Material]:
    """Materials of the scene that show a surface, also several that show the same: users copy materials."""
    slots = [slot.material for item in scene.objects for slot in item.material_slots]
    return list(dict.fromkeys(each for each in slots if each is not None and SURFACE_KEY in each))


def shown_surfaces(scene: bpy.types.Scene) -> list[tuple[bpy.types.Material, Surface]]:
    """Managed materials of the scene, and the surfaces that they show.

    Raises
    ------
    BlenderError
        If a material shows a surface of another scene's description.
    SpectralBoothError
        If the description or a surface cannot be read.
    """
    surfaces = scene_surfaces(description(scene))
    found = []
    for material in all_managed_materials(scene):
        if surface_name(material) not in surfaces:
            raise BlenderError(
                f"'{material.name}' shows '{surface_name(material)}', which the description of '{scene.name}' lacks",
                remedy="it is another scene's: give its objects another material",
            )
        found.append((material, surfaces[surface_name(material)]))
    return found


def unmanaged_materials(scene: bpy.types.Scene) -> list[bpy.types.Material]:
    """Materials that the scene shows and this add-on does not know."""
    slots = [slot.material for item in scene.objects for slot in item.material_slots]
    return list(dict.fromkeys(each for each in slots if each is not None and SURFACE_KEY not in each))
