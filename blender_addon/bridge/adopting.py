"""Users' own Principled materials with a measured surface as their base colour, and back.

Nothing of a material is changed but where its base colour comes from: roughness, specular, and textures for
normal and roughness stay. What was there is remembered in the material, so that `release` leaves it node for node
as it was.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

import bpy

from spectral_core.errors import BlenderError, SpectralBoothError
from spectral_core.scene import parse_scene
from spectral_core.steps import finished
from spectral_core.surfaces import scene_surfaces

from ..eyes import EYE_PROPERTY
from . import encoded, live, materials, shading, state, ways

# Of an adopted material: the table in the description, how it was drawn, and where its base colour came from.
_TABLE_KEY = "spectral_booth_table"
_SHOWN_KEY = "spectral_booth_shown"
_COLOUR_KEY = "spectral_booth_base_colour"
_VALUE_KEY = "spectral_booth_base_value"
_LIGHTS = ("D65", "D50", "A", "FL11", "LED-B3")


@dataclass(frozen=True)
class Source:
    """Where a material's reflectance comes from: keys of a surface's table in a scene description, see `docs/guide.md`.

    For example ``{"texture": "fruit.hdr"}``, ``{"file": "paints.csv", "spectrum": "red"}``,
    ``{"colorchecker": "cyan"}`` or ``{"reflectance": 0.5}``.
    """

    keys: dict[str, str | float | bool]

    def table(self, name: str) -> str:
        """The surface's table in TOML."""
        lines = [f"{key} = {_quoted(value)}" for key, value in self.keys.items()]
        return "\n".join([f"\n[surfaces.{_quoted(name)}]", *lines, ""])


def _quoted(value: object) -> str:
    """A value as TOML, which has no pairs of escapes for what is beyond 16 bits."""
    return json.dumps(value, ensure_ascii=False)


def adopt(scene: bpy.types.Scene, chosen: Sequence[bpy.types.Material], source: Source) -> list[str]:
    """Let materials of a scene show a measured surface; a scene that is not managed becomes so, lamps included.

    Returns what a user should know.

    Raises
    ------
    BlenderError
        If a material's surface is not a Principled shader, or it is managed already, linked, or not in the scene.
    SpectralBoothError
        If the surface cannot be read; the scene is then as it was.
    """
    if not chosen:
        raise BlenderError("no material was chosen", remedy="select objects with materials, or name some")
    chosen = list(dict.fromkeys(chosen))
    for material in chosen:
        _check(scene, material)
    new = not state.is_managed(scene)
    before = _description(scene) if new else scene.spectral_booth.description.as_string()
    folder = Path(bpy.path.abspath("//") if new else scene.spectral_booth.folder)
    taken = () if new else state.description(scene).surfaces
    names: dict[bpy.types.Material, str] = {}
    for material in chosen:
        names[material] = _free_name(material.name, (*taken, *names.values()))
    tables = {material: source.table(name) for material, name in names.items()}
    description = parse_scene(before + "".join(tables.values()), folder, scene.name)
    scene_surfaces(description)  # refused now, if a surface cannot be read
    if new:
        state.remember(scene, description)
        _adopt_lamps(scene)
    else:
        state.rewrite(scene, description.text)
    for material in chosen:
        _take(scene, material, names[material], tables[material])
    try:
        notes = _show(scene)
    except SpectralBoothError:
        for material in chosen:
            _give_back(scene, material)
        if new:
            _forget(scene)
        else:
            state.rewrite(scene, before)
            ways.drop_unused_groups()
        raise
    return [*notes, *ways.notes(scene)]


def _show(scene: bpy.types.Scene) -> tuple[str, ...]:
    """Show what was adopted as the scene is shown; returns what a user should know of textures."""
    if encoded.basis_of(scene) is None:
        ways.rebuild(scene)
        return ()
    kept = scene.spectral_booth
    steps = encoded.encoding_steps(scene, encoded.lights_of(scene), kept.basis_tolerance, kept.basis_half)
    encoding = finished(steps)
    ways.show_encoded(scene, encoding)
    return encoding.notes


def _free_name(name: str, taken: Collection[str]) -> str:
    return name if name not in taken else _free_name(f"{name} (adopted)", taken)


def adopted(scene: bpy.types.Scene) -> list[bpy.types.Material]:
    """The adopted materials of a scene."""
    return [each for each in state.all_managed_materials(scene) if materials.PRINCIPLED_KEY in each]


def release(scene: bpy.types.Scene, chosen: Sequence[bpy.types.Material]) -> list[str]:
    """Give adopted materials back as they were; a scene without any, that was not built, is no longer managed.

    Returns what could not be put back, because a user removed it meanwhile.

    Raises
    ------
    BlenderError
        If there is none, one was not adopted in this scene, or has lost its shader.
    """
    chosen, known, lost = list(dict.fromkeys(chosen)), adopted(scene), []
    if not chosen:
        raise BlenderError(f"'{scene.name}' has no adopted materials", remedy="there is nothing to release")
    for material in chosen:
        if material not in known:
            raise BlenderError(f"'{material.name}' was not adopted", remedy="choose adopted materials of this scene")
        materials.colour_socket(material)  # refused now, if it is gone
        materials.output_node(material)
    for material in chosen:
        table = material[_TABLE_KEY]
        if not _give_back(scene, material):
            lost.append(f"{material.name}: the node that gave its base colour is gone")
        state.rewrite(scene, scene.spectral_booth.description.as_string().replace(table, ""))
    if state.description(scene).adopted and not state.managed_materials(scene):
        _forget(scene)
    else:
        ways.rebuild(scene)
    return lost


def _check(scene: bpy.types.Scene, material: bpy.types.Material) -> None:
    if state.SURFACE_KEY in material:
        raise BlenderError(f"'{material.name}' is managed already", remedy="release it first")
    if not material.is_editable:
        raise BlenderError(f"'{material.name}' is linked from another file", remedy="make it local first")
    _principled(material)
    if material not in state.unmanaged_materials(scene):
        raise BlenderError(f"no object of '{scene.name}' has the material '{material.name}'", remedy="give it to one")


def _principled(material: bpy.types.Material) -> bpy.types.Node:
    tree = material.node_tree
    if tree is not None and tree.get_output_node("EEVEE") is not None:
        links = materials.output_node(material).inputs["Surface"].links
        if links and links[0].from_node.type == "BSDF_PRINCIPLED":
            return links[0].from_node
    raise BlenderError(
        f"the surface of '{material.name}' is not one Principled BSDF", remedy="link one to the material's output"
    )


def _take(scene: bpy.types.Scene, material: bpy.types.Material, name: str, table: str) -> None:
    node = _principled(material)
    socket = node.inputs["Base Color"]
    source = socket.links[0] if socket.links else None
    material[_COLOUR_KEY] = json.dumps([source.from_node.name, source.from_socket.identifier] if source else None)
    material[_SHOWN_KEY] = json.dumps([material.surface_render_method, material.use_transparency_overlap])
    material[_VALUE_KEY] = tuple(socket.default_value)
    if source is not None:
        vector = source.from_node.inputs.get("Vector") if source.from_node.type == "TEX_IMAGE" else None
        if vector is not None and vector.links:
            origin = vector.links[0]
            material[materials.PLACE_KEY] = json.dumps([origin.from_node.name, origin.from_socket.identifier])
        material.node_tree.links.remove(source)
    material[_TABLE_KEY] = table
    material[state.SURFACE_KEY] = name
    material[materials.PRINCIPLED_KEY] = node.name
    # Full precision, as for materials of our own.
    material.surface_render_method, material.use_transparency_overlap = "BLENDED", False
    for item in scene.objects:
        if item.type == "MESH" and {slot.material for slot in item.material_slots} == {material}:
            item[state.SURFACE_KEY] = name


def _give_back(scene: bpy.types.Scene, material: bpy.types.Material) -> bool:
    """Whether all is as it was: a user may have removed what gave the base colour."""
    images = shading.images_of(material)
    shading.remove(material)
    tree = material.node_tree
    socket = materials.colour_socket(material)
    socket.default_value = tuple(material[_VALUE_KEY])
    source = json.loads(material[_COLOUR_KEY])
    output = materials.output_of(tree, *source) if source is not None else None
    if output is not None:
        tree.links.new(output, socket)
    material.surface_render_method, material.use_transparency_overlap = json.loads(material[_SHOWN_KEY])
    described = {each.name: each.surface for each in state.description(scene).objects}
    for item in scene.objects:
        if item.get(state.SURFACE_KEY) == material[state.SURFACE_KEY]:
            if item.get(state.OBJECT_KEY) in described:
                item[state.SURFACE_KEY] = described[item[state.OBJECT_KEY]]
            else:
                del item[state.SURFACE_KEY]
    for key in [each for each in material.keys() if each.startswith("spectral_booth")]:  # noqa: SIM118
        del material[key]
    for image in images:
        if not image.users:
            bpy.data.images.remove(image)
    return source is None or output is not None


def _adopt_lamps(scene: bpy.types.Scene) -> None:
    for item in scene.objects:
        if item.type == "LIGHT" and state.LAMP_KEY not in item and item.is_editable and item.data.is_editable:
            item[state.LAMP_KEY] = 1.0
            item[state.LAMP_COLOUR_KEY] = tuple(item.data.color)


def _forget(scene: bpy.types.Scene) -> None:
    """The scene is a user's own again."""
    for lamp in list(state.managed_lamps(scene)):
        if state.LAMP_COLOUR_KEY in lamp:
            lamp.data.color = tuple(lamp[state.LAMP_COLOUR_KEY])
        for key in (state.LAMP_KEY, state.LAMP_LIGHT_KEY, state.LAMP_COLOUR_KEY):
            if key in lamp:
                del lamp[key]
    scene.spectral_booth.target = "WINDOW"
    ways.choose_view(scene)
    encoded.forget(scene)
    live.forget(scene)
    if EYE_PROPERTY in scene:
        del scene[EYE_PROPERTY]
    ways.drop_unused_groups()
    state.drop_text(scene, scene.spectral_booth.description)
    scene.property_unset("spectral_booth")


def _description(scene: bpy.types.Scene) -> str:
    """A description of a user's own scene: it has no objects or lamps of ours, and lamps as bright as they are."""
    camera = scene.camera.matrix_world if scene.camera else None
    location = list(camera.translation) if camera else [0.0, -1.0, 0.0]
    target = list(camera.translation - camera.col[2].to_3d()) if camera else [0.0, 0.0, 0.0]
    return "\n".join(
        [
            "format = 1",
            "adopted = true",
            f"name = {_quoted(scene.name)}",
            f"lights = {json.dumps(_LIGHTS)}",
            "[white]",
            "luminance = 1.0",
            "[camera]",
            f"location = {location}",
            f"target = {target}",
            "[render]",
            'shading = "forward"',
            "",
        ]
    )
