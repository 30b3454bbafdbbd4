"""Show a managed scene through a display's profile in the materials themselves, each eye through its own.

In a headset Blender ignores colour management, so every managed material turns the light that
leaves it into device codes after lighting: its shader's colour goes through the node group of
`display_nodes`. Which eye is being drawn is told to the shaders by a property of the scene: after each
eye a draw handler sets it for the next one.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import bpy

from spectral_core.display import DisplayProfile, load_profile
from spectral_core.display.limits.luminance import eye_scene_whites, scene_white
from spectral_core.errors import BlenderError
from spectral_core.standards import srgb_to_XYZ_matrix

from ..eyes import EYE_PROPERTY
from . import display_nodes, state

GROUP = "Spectral Headset"
_NODES = ("Spectral Lit", "Spectral Display", "Spectral Emission")


@dataclass(frozen=True)
class Shown:
    """A scene's display: one profile, or one per eye, and what the scene's white is shown at, of the display's own."""

    eyes: tuple[DisplayProfile, ...]
    scene_whites: tuple[float, ...]

    @property
    def notes(self) -> list[str]:
        """What a user should know, one sentence each."""
        names = ("Left", "Right") if len(self.eyes) == 2 else ("Both eyes",)
        notes = [
            f"{name}: {profile.name}, scene white at {scale:.3f} of the display's"
            for name, profile, scale in zip(names, self.eyes, self.scene_whites, strict=True)
        ]
        if len(self.eyes) == 2 and None in [profile.white_luminance_cd_m2 for profile in self.eyes]:
            notes.append("The profiles do not say their luminance: the eyes may differ in brightness")
        return notes


def apply(scene: bpy.types.Scene, left: str, right: str = "") -> Shown:
    """Show a managed scene through a profile (built-in name or file), or through one per eye.

    Raises
    ------
    DisplayError
        If a profile cannot be read, or its display cannot show the scene's white.
    """
    eyes = tuple(load_profile(bpy.path.abspath(each)) for each in (left, right) if each)
    if not eyes:
        raise BlenderError("no profile was given", remedy="name a profile's JSON or a built-in one")
    whites = eye_scene_whites(*eyes) if len(eyes) == 2 else (scene_white(eyes[0]),)
    shown = Shown(eyes, whites)
    if not state.managed_materials(scene):
        raise BlenderError(f"'{scene.name}' has no spectral materials", remedy="build a scene first")
    remove(scene)
    tree = _group(scene, shown)
    for material in state.managed_materials(scene).values():
        _insert(material, tree)
    scene[EYE_PROPERTY] = 0.0
    kept = scene.spectral_booth
    kept.display_left, kept.display_right, kept.display_notes = left, right, "; ".join(shown.notes)
    return shown


def remove(scene: bpy.types.Scene) -> None:
    """Show the scene's own colours again."""
    groups = set()
    for material in state.managed_materials(scene).values():
        nodes = material.node_tree.nodes
        if _NODES[0] not in nodes:
            continue
        groups.add(nodes[_NODES[1]].node_tree)
        _link(material, nodes[_NODES[0]].inputs[0].links[0].from_socket)
        for name in _NODES:
            nodes.remove(nodes[name])
    for tree in groups:
        parts = {node.node_tree for node in tree.nodes if node.type == "GROUP"}
        bpy.data.node_groups.remove(tree)
        for part in parts:
            display_nodes.remove_group(part)
    kept = scene.spectral_booth
    kept.display_left = kept.display_right = kept.display_notes = ""


@contextmanager
def scene_linear(scene: bpy.types.Scene) -> Iterator[None]:
    """The scene's own colours for the block, for whoever measures them in a render."""
    shown = [
        material
        for material in state.managed_materials(scene).values()
        if _NODES[0] in material.node_tree.nodes
    ]  # fmt: skip
    for material in shown:
        _link(material, material.node_tree.nodes[_NODES[0]].inputs[0].links[0].from_socket)
    try:
        yield
    finally:
        for material in shown:
            _link(material, material.node_tree.nodes[_NODES[2]].outputs[0])


def _insert(material: bpy.types.Material, tree: bpy.types.NodeTree) -> None:
    """Between a material's shader and its output: lit colour, display, emission."""
    nodes, links = material.node_tree.nodes, material.node_tree.links
    shader = _output(material).inputs["Surface"].links[0].from_socket
    kinds = ("ShaderNodeShaderToRGB", "ShaderNodeGroup", "ShaderNodeEmission")
    lit, display, emission = (nodes.new(kind) for kind in kinds)
    for column, (node, name) in enumerate(zip((lit, display, emission), _NODES, strict=True)):
        node.name = node.label = name
        node.location = (400 + 180 * column, -240)
    display.node_tree = tree
    links.new(shader, lit.inputs[0])
    links.new(lit.outputs["Color"], display.inputs[0])
    links.new(display.outputs[0], emission.inputs["Color"])
    _link(material, emission.outputs[0])


def _output(material: bpy.types.Material) -> bpy.types.Node:
    return next(node for node in material.node_tree.nodes if node.type == "OUTPUT_MATERIAL")


def _link(material: bpy.types.Material, shader: bpy.types.NodeSocket) -> None:
    material.node_tree.links.new(shader, _output(material).inputs["Surface"])


def _group(scene: bpy.types.Scene, shown: Shown) -> bpy.types.NodeTree:
    """Scene-linear Rec.709 to what must be emitted, through one display or the one of the eye being drawn."""
    tree = bpy.data.node_groups.new(f"{GROUP} {scene.name}", "ShaderNodeTree")
    tree.interface.new_socket("Color", in_out="INPUT", socket_type="NodeSocketColor")
    tree.interface.new_socket("Emission", in_out="OUTPUT", socket_type="NodeSocketColor")
    build = display_nodes.Builder(tree)
    matrix = srgb_to_XYZ_matrix()
    emitted = []
    for profile, scale in zip(shown.eyes, shown.scene_whites, strict=True):
        XYZ = build.combine([build.dot(build.input, row) for row in matrix * scale])
        emitted.append(build.group(display_nodes.display_group(profile, profile.name), XYZ))
    if len(emitted) == 1:
        build.finish(emitted[0])
    else:
        eye = build.attribute(EYE_PROPERTY)
        build.finish(build.combine(build.mix(eye, *(build.separate(each) for each in emitted))))
    return tree
