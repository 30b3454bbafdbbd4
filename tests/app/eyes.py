"""Runs in the application beside a simulated headset: ``eyes.py -- RESULT.json SCENE.toml FOLDER LEFT RIGHT``.

A scene under its light goes through a profile per eye, and the headset is photographed while it moves.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import bpy

sys.path.append(str(Path(__file__).parent))
from steps import play, view

PAUSE_S = 1.0
# In software the headset's first frames take a while: the display's shaders are compiled.
WARM_UP_S = 60.0
PHOTOGRAPHS = 5
LONGEST_S = 400.0

RESULT, SCENE, FOLDER = (Path(each) for each in sys.argv[sys.argv.index("--") + 1 :][:3])
LEFT, RIGHT = sys.argv[-2:]


def steps(found: dict[str, object]) -> Iterator[None]:
    """What a user does, a step at a time."""
    place = view()
    with bpy.context.temp_override(**place):
        bpy.ops.spectral_booth.build(filepath=str(SCENE), calibrate=False)
        bpy.ops.spectral_booth.set_display(left=LEFT, right=RIGHT)
    scene = bpy.context.window_manager.windows[0].scene
    found["notes"] = scene.spectral_booth.display_notes
    space = place["space_data"]
    space.shading.type, space.overlay.show_overlays = "RENDERED", False
    scene.eevee.taa_samples = 1
    settings = bpy.context.window_manager.xr_session_settings
    settings.base_pose_type, settings.base_pose_location = "CUSTOM", scene.camera.location
    settings.show_floor = settings.show_selection = False
    yield
    with bpy.context.temp_override(**place):
        bpy.ops.wm.xr_session_toggle()
    ready = time.perf_counter() + WARM_UP_S
    while time.perf_counter() < ready:
        yield
    found["heads"] = []
    for number in range(PHOTOGRAPHS):
        subprocess.run(["import", "-window", "root", str(FOLDER / f"eyes{number}.png")], check=True)
        found["heads"].append(list(bpy.context.window_manager.xr_session_state.viewer_pose_location))
        yield
    with bpy.context.temp_override(**place):
        bpy.ops.wm.xr_session_toggle()
    yield


if __name__ == "__main__":
    found: dict[str, object] = {}
    play(steps(found), found, RESULT, PAUSE_S, LONGEST_S)
