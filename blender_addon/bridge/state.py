"""What a managed scene remembers: its description, its light and level, what each datum is for.

Data is found again by custom properties, never by kept pointers, so that undo, renaming and
reloading do no harm.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

import bpy

from spectral_core.errors import SceneError
from spectral_core.scene import SceneDescription, parse_scene

OBJECT_KEY = "spectral_booth_object"
SURFACE_KEY = "spectral_booth_surface"
LAMP_KEY = "spectral_booth_lamp"


def remember(scene: bpy.types.Scene, description: SceneDescription) -> None:
    """Keep the description's text in the .blend, and mark the scene as managed."""
    text = bpy.data.texts.new(f"{description.name}.toml")
    text.write(description.text)
    state = scene.spectral_booth
    state.description = text
    state.folder = str(description.folder)
    state.lights.clear()
    for light in description.lights:
        state.lights.add().name = light
    state.light = description.light
    state.level = str(description.level)


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
    """Objects with a spectral surface, in the scene's order."""
    return (each for each in scene.objects if each.type == "MESH" and SURFACE_KEY in each)


def managed_lamps(scene: bpy.types.Scene) -> Iterator[bpy.types.Object]:
    """The scene's spectral lamps."""
    return (each for each in scene.objects if each.type == "LIGHT" and LAMP_KEY in each)


def described_object(scene: bpy.types.Scene, name: str) -> bpy.types.Object | None:
    """The object that the description calls `name`: in a file with other scenes, or renamed by the
    user, it has another name.
    """
    return next((each for each in managed_objects(scene) if each.get(OBJECT_KEY) == name), None)


def surface_name(item: bpy.types.Object) -> str:
    """The surface that an object shows."""
    return str(item[SURFACE_KEY])


def managed_materials(scene: bpy.types.Scene) -> dict[str, bpy.types.Material]:
    """Materials of the scene by the surface they show."""
    found = {}
    for item in managed_objects(scene):
        for slot in item.material_slots:
            if slot.material is not None and SURFACE_KEY in slot.material:
                found[str(slot.material[SURFACE_KEY])] = slot.material
    return found


def managed_images(scene: bpy.types.Scene) -> Iterator[bpy.types.Image]:
    """Images that the scene's spectral materials show."""
    for material in managed_materials(scene).values():
        for node in material.node_tree.nodes:
            if node.type == "TEX_IMAGE" and node.image is not None:
                yield node.image
