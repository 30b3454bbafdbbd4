"""Runs in the application's window: ``window.py -- RESULT.json FOLDER``; it quits Blender at its end.

Each step runs from a timer, as a user's clicks would come: Blender draws in between.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np

sys.path.append(str(Path(__file__).parent))
from steps import play, view
from window_state import state

LIGHTS = ("D50", "A", "two-peaks-d65")
LEVELS = (0, 1, 2)
PAUSE_S = 0.5
LONGEST_S = 420.0

RESULT, FOLDER = (Path(each) for each in sys.argv[sys.argv.index("--") + 1 :])


def steps(found: dict[str, object]) -> Iterator[None]:
    """What a user does, a step at a time."""
    place = view()
    place["space_data"].show_region_ui = True
    yield  # the sidebar has its categories once it was drawn
    sidebar = next(each for each in place["area"].regions if each.type == "UI")
    sidebar.active_panel_category = "Spectral Booth"
    yield
    _photograph(found, "start")
    user = bpy.context.scene
    names = [item.name for item in user.objects]
    with bpy.context.temp_override(**place):
        bpy.ops.spectral_booth.build("INVOKE_DEFAULT", preset="booth", calibrate=False)
    scene = bpy.context.window_manager.windows[0].scene
    scene.render.resolution_percentage, scene.eevee.taa_render_samples = 25, 1
    found["scenes"] = [each.name for each in bpy.data.scenes]
    found["user_objects_kept"] = names == [item.name for item in user.objects]
    yield
    with bpy.context.temp_override(**place):
        bpy.ops.spectral_booth.calibrate_white()
    yield
    shown = {}
    for light in LIGHTS:
        for level in LEVELS:
            with bpy.context.temp_override(**place):
                bpy.ops.spectral_booth.set_light("EXEC_DEFAULT", True, light=light)
                bpy.ops.spectral_booth.set_level("EXEC_DEFAULT", True, level=level)
            yield
            shown[f"{light} {level}"] = state(scene)
    found["shown"] = shown
    with bpy.context.temp_override(**place):
        bpy.ops.ed.undo()
    yield
    scene = bpy.data.scenes["Light booth"]
    found["undone"] = state(scene)
    with bpy.context.temp_override(**view()):
        bpy.ops.ed.redo()
    yield
    scene = bpy.data.scenes["Light booth"]
    found["redone"] = state(scene)
    with bpy.context.temp_override(**view()):
        found["verify"] = sorted(bpy.ops.spectral_booth.verify("INVOKE_DEFAULT", lights="CURRENT"))
    while not scene.spectral_booth.result:
        yield
    found["result"] = scene.spectral_booth.result
    yield from _bake(found)
    # Only now: in software the viewport takes longer to draw than all else together.
    space = view()["space_data"]
    space.shading.type = "RENDERED"
    space.region_3d.view_perspective = "CAMERA"
    space.overlay.show_overlays = False
    for _ in range(6):
        yield  # the viewport settles
    _photograph(found, "panel")
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "booth.blend"))
    found["saved"] = state(scene)


def _bake(found: dict[str, object]) -> Iterator[None]:
    """A texture of one grey, as counts, into an image."""
    path = FOLDER / "grey.npz"
    grey = np.full((300, 200, 5), 2000, dtype=np.uint16)
    np.savez(path, counts=grey, wavelengths_nm=np.array([400.0, 480.0, 560.0, 640.0, 720.0]))
    with bpy.context.temp_override(**view()):
        found["bake"] = sorted(
            bpy.ops.spectral_booth.bake_texture("INVOKE_DEFAULT", filepath=str(path), lights="D65", scale=4000.0)
        )
    while "grey under D65" not in bpy.data.images:
        yield
    found["baked"] = list(bpy.data.images["grey under D65"].pixels[:3])


def _photograph(found: dict[str, object], name: str) -> None:
    path = FOLDER / f"{name}.png"
    found[name] = subprocess.run(["import", "-window", "root", str(path)], check=False).returncode


if __name__ == "__main__":
    found: dict[str, object] = {}
    play(steps(found), found, RESULT, PAUSE_S, LONGEST_S)
