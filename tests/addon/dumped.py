"""Everything that a file holds of a scene's materials, lamps, images and properties, as plain values to compare."""

from __future__ import annotations

import hashlib
from typing import Any

import bpy
import numpy as np

from spectral_core.arrays import Float32Array

# What Blender computes or keeps for its windows, and says nothing of what is shown.
_OF_WINDOWS = {
    "rna_type", "select", "show_preview", "dimensions", "id_data", "original", "is_evaluated", "session_uid", "tag",
    "preview", "location_absolute", "bindcode", "is_dirty", "has_data", "is_updated", "is_updated_data", "users",
    "depth", "channels", "frame_duration", "packed_file", "size", "asset_data", "library_weak_reference",
    "is_runtime_data", "use_nodes", "node_tree", "pixels", "animation_data", "is_active_output",
}  # fmt: skip
_DEEPEST = 2

Dump = dict[str, Any]


def everything() -> Dump:
    """All of the open file."""
    return {**materials(), **lights(), **properties()}


def materials() -> Dump:
    """Materials, node groups and images: what a change of light must leave alone in an encoded scene."""
    data = bpy.data
    return {
        "materials": {each.name: {**_owned(each), **tree(each.node_tree)} for each in data.materials},
        "groups": {each.name: {**_owned(each), **tree(each)} for each in data.node_groups},
        "images": {each.name: {**_owned(each), "size": tuple(each.size), "pixels": _digest(each)} for each in images()},
    }


def lights() -> Dump:
    """Lamps and objects, with their own properties."""
    return {
        "lamps": {each.name: _owned(each) for each in bpy.data.lights},
        "objects": {each.name: _custom(each) for each in bpy.data.objects},
    }


def properties() -> Dump:
    """Properties of the scenes, and which texts there are."""
    return {
        "scenes": {each.name: {**_custom(each), "kept": _values(each.spectral_booth, 0)} for each in bpy.data.scenes},
        "lights of scenes": {each.name: [light.name for light in each.spectral_booth.lights] for each in _scenes()},
        "texts": {each.name: each.as_string() for each in bpy.data.texts},
    }


def images() -> list[bpy.types.Image]:
    """The images of the file, without the one of the last render."""
    return [each for each in bpy.data.images if each.type != "RENDER_RESULT"]


def pixels(image: bpy.types.Image) -> Float32Array:
    """All numbers of an image."""
    found = np.empty(len(image.pixels), dtype=np.float32)
    image.pixels.foreach_get(found)
    return found


def tree(owner: bpy.types.NodeTree | None) -> Dump:
    """Nodes with all of their properties and inputs, and links."""
    if owner is None:
        return {}
    return {
        "nodes": {each.name: _node(each) for each in owner.nodes},
        "links": sorted(
            (each.from_node.name, each.from_socket.identifier, each.to_node.name, each.to_socket.identifier)
            for each in owner.links
        ),
    }


def differences(one: Any, other: Any, at: str = "") -> list[str]:
    """Where two dumps differ: what an assertion shows instead of both."""
    if isinstance(one, dict) and isinstance(other, dict):
        keys = dict.fromkeys([*one, *other])
        return [
            found
            for key in keys
            for found in differences(one.get(key, "(absent)"), other.get(key, "(absent)"), f"{at}/{key}")
        ]
    return [] if one == other else [f"{at}: {str(one)[:200]} became {str(other)[:200]}"]


def _node(node: bpy.types.Node) -> Dump:
    return {
        **_owned(node),
        "kind": node.bl_idname,
        "inputs": [(each.identifier, _plain(getattr(each, "default_value", None)), each.hide) for each in node.inputs],
        "outputs": [each.identifier for each in node.outputs],
    }


def _owned(owner: Any) -> Dump:
    return {**_values(owner, 0), **_custom(owner)}


def _custom(owner: Any) -> Dump:
    # Blender 4.5 lists an add-on's own group among them; its values are dumped as such.
    return {f"[{key}]": _plain(owner[key]) for key in owner.keys() if key != "spectral_booth"}  # noqa: SIM118


def _values(owner: Any, depth: int) -> Dump:
    found = {}
    for each in owner.bl_rna.properties:
        if each.identifier in _OF_WINDOWS or each.type == "COLLECTION":
            continue
        value = getattr(owner, each.identifier)
        if each.type == "POINTER" and value is not None and not isinstance(value, bpy.types.ID):
            if depth < _DEEPEST and not isinstance(value, bpy.types.Node):
                found[each.identifier] = _values(value, depth + 1)
            continue
        found[each.identifier] = _plain(value)
    return found


def _plain(value: Any) -> Any:
    if isinstance(value, bpy.types.ID):
        return f"{type(value).__name__} {value.name}"
    if isinstance(value, (str, bytes, int, float, bool)) or value is None:
        return value
    if hasattr(value, "to_dict"):
        return value.to_dict()
    return tuple(_plain(each) for each in value)


def _digest(image: bpy.types.Image) -> str:
    return hashlib.sha256(pixels(image).tobytes()).hexdigest()[:16]


def _scenes() -> list[bpy.types.Scene]:
    return list(bpy.data.scenes)
