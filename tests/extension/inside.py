"""Runs inside Blender with a clean user folder: ``inside.py STEP RESULT.json ARGUMENTS...``.

It must find nothing of the project but what the extension brings, so that it imports no test code
and runs from a folder without the sources.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

import bpy

# isort: split
import addon_utils  # on the path once bpy is loaded

MODULE = "bl_ext.user_default.spectral_booth"
LIGHTS = ("D50", "A", "FL11")
LEVELS = (0, 1, 2)


def install(archive: str, blend: str) -> dict[str, object]:
    """Install the zip, build, light, save."""
    bpy.ops.extensions.package_install_files(filepath=archive, repo="user_default", enable_on_install=True)
    before = sorted({name.split(".")[0] for name in sys.modules} & {"spectral_core", "colour", "OpenImageIO"})
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.spectral_booth.build(preset="colorchecker", calibrate=False)
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y, scene.eevee.taa_render_samples = 160, 120, 1
    bpy.ops.spectral_booth.set_light(light="A")
    bpy.ops.spectral_booth.verify(lights="CURRENT")
    shown = {}
    for light in LIGHTS:
        for level in LEVELS:
            bpy.ops.spectral_booth.set_light(light=light)
            bpy.ops.spectral_booth.set_level(level=level)
            shown[f"{light} {level}"] = [_colours(scene), _theory(scene, light, level)]
    bpy.ops.wm.save_as_mainfile(filepath=blend)
    return {
        "imported_at_registration": before,
        "modules": _modules(),
        "verified": scene.spectral_booth.result,
        "shown": shown,
        "last": _state(scene),
    }


def reopen(blend: str) -> dict[str, object]:
    """In a new process, with the extension enabled again: what the saved file holds; then one light more."""
    addon_utils.enable(MODULE)
    bpy.ops.wm.open_mainfile(filepath=blend)
    scene = bpy.context.scene
    last = _state(scene)
    bpy.ops.spectral_booth.set_light(light="D50")
    return {"last": last, "again": [_colours(scene), _theory(scene, "D50", 2)]}


def register() -> dict[str, object]:
    """How long enabling takes in a new process, in milliseconds."""
    started = time.perf_counter()
    module = addon_utils.enable(MODULE)
    seconds = time.perf_counter() - started
    assert module is not None
    addon_utils.disable(MODULE)
    traces = [name for name in dir(bpy.types) if name.startswith("SPECTRAL_BOOTH")]
    addon_utils.enable(MODULE)
    return {"milliseconds": 1e3 * seconds, "traces": traces, "again": hasattr(bpy.types, "SPECTRAL_BOOTH_OT_build")}


def _modules() -> dict[str, dict[str, str]]:
    import importlib.metadata

    from spectral_core.imaging import oiio

    distributions = {"colour": "colour-science", "spectral_core": "spectral-booth-core"}
    found = {
        name: {"path": str(sys.modules[name].__file__), "version": importlib.metadata.version(distribution)}
        for name, distribution in distributions.items()
    }
    found["numpy"] = {"path": str(sys.modules["numpy"].__file__), "version": sys.modules["numpy"].__version__}
    found["OpenImageIO"] = {"path": str(oiio().__file__), "version": oiio().VERSION_STRING}
    found["blender"] = {"path": str(bpy.utils.resource_path("USER")), "version": bpy.app.version_string}
    found["addon"] = {"path": str(sys.modules[MODULE].__file__), "version": ""}
    found["matplotlib"] = {"path": str(type(sys.modules.get("matplotlib"))), "version": ""}
    return found


def _state(scene: bpy.types.Scene) -> dict[str, object]:
    state = scene.spectral_booth
    return {"light": state.light, "level": state.level, "colours": _colours(scene)}


def _colours(scene: bpy.types.Scene) -> dict[str, list[float]]:
    """What materials and lamps carry."""
    found = {}
    for item in scene.objects:
        if item.type == "LIGHT":
            found[item.name] = list(item.data.color)
        for slot in item.material_slots:
            for node in slot.material.node_tree.nodes:
                if node.type == "BSDF_DIFFUSE":
                    found[slot.material["spectral_booth_surface"]] = list(node.inputs["Color"].default_value[:3])
    return found


def _theory(scene: bpy.types.Scene, light: str, level: int) -> dict[str, list[float]]:
    """What they should carry, by the core alone."""
    from spectral_core.lighting import make_lighting
    from spectral_core.lights import Light
    from spectral_core.scene import parse_scene
    from spectral_core.surfaces import scene_surfaces

    state = scene.spectral_booth
    description = parse_scene(state.description.as_string(), Path(state.folder))
    lighting = make_lighting(Light.load(light), level, description.white.luminance)
    reference = Light.load(description.reference)
    expected = {
        name: lighting.material_rgb(surface, reference).clip(min=0).tolist()
        for name, surface in scene_surfaces(description).items()
    }
    expected.update({lamp.name: lighting.lamp_rgb.tolist() for lamp in description.lamps})
    return expected


if __name__ == "__main__":
    # The application leaves its own arguments before the two dashes.
    arguments = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
    result = globals()[arguments[0]](*arguments[2:])
    Path(arguments[1]).write_text(json.dumps(result), encoding="utf-8")
