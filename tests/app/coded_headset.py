"""Runs in the application beside a simulated headset: ``coded_headset.py -- RESULT.json SCENE.toml FOLDER PROFILE``.

A scene is shown through a profile by coded lamps, from a spectral basis and by baked colours, then by coloured
lamps; each time its light is changed while the headset shows it, and the headset is photographed.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import bpy

sys.path.append(str(Path(__file__).parent))
from steps import play, view

PAUSE_S = 0.5
# In software the headset's first frames take a while: the shaders are compiled.
WARM_UP_S = 45.0
# New values alone are in the next frame; in software that takes some seconds of a busy machine.
SETTLE_S = 8.0
PHOTOGRAPHS = 2
LONGEST_S = 780.0

RESULT, SCENE, FOLDER, PROFILE = (Path(each) for each in sys.argv[sys.argv.index("--") + 1 :])
LIGHTS = json.loads((FOLDER / "lights.json").read_text(encoding="utf-8"))


def steps(found: dict[str, object]) -> Iterator[None]:
    """What a user does, a step at a time."""
    place = view()
    with bpy.context.temp_override(**place):
        bpy.ops.spectral_booth.build(filepath=str(SCENE), calibrate=False)
        bpy.ops.spectral_booth.set_display(left=str(PROFILE))
        bpy.ops.spectral_booth.set_way(way="CODED", target="HEADSET")
        bpy.ops.spectral_booth.encode(tolerance=0.1)
    scene = bpy.context.window_manager.windows[0].scene
    found["display_notes"] = scene.spectral_booth.display_notes
    space = place["space_data"]
    space.shading.type, space.overlay.show_overlays = "RENDERED", False
    scene.eevee.taa_samples = 1
    settings = bpy.context.window_manager.xr_session_settings
    settings.base_pose_type, settings.base_pose_location = "CUSTOM", scene.camera.location
    settings.show_floor = settings.show_selection = False
    yield
    with bpy.context.temp_override(**place):
        bpy.ops.wm.xr_session_toggle()
    found["photographs"] = {}
    yield from _lights(found, place, "encoded")
    with bpy.context.temp_override(**place):
        bpy.ops.spectral_booth.bake_colours()
    yield from _lights(found, place, "baked")
    with bpy.context.temp_override(**place):
        bpy.ops.spectral_booth.set_way(way="COLOURED", target="HEADSET")
    yield from _lights(found, place, "coloured")
    with bpy.context.temp_override(**place):
        bpy.ops.wm.xr_session_toggle()
    yield


def _lights(found: dict[str, object], place: dict[str, object], way: str) -> Iterator[None]:
    """Each light, and photographs of it."""
    yield from _wait(WARM_UP_S)
    for number, light in enumerate(LIGHTS):
        with bpy.context.temp_override(**place):
            bpy.ops.spectral_booth.set_light("EXEC_DEFAULT", True, light=light)
        yield from _wait(SETTLE_S)
        taken = []
        for photograph in range(PHOTOGRAPHS):
            path = FOLDER / f"{way}-{number}-{photograph}.png"
            subprocess.run(["import", "-window", "root", str(path)], check=True)
            head = list(bpy.context.window_manager.xr_session_state.viewer_pose_location)
            taken.append({"path": str(path), "head": head})
            yield
        found["photographs"][f"{way} {light}"] = taken


def _wait(seconds: float) -> Iterator[None]:
    ready = time.perf_counter() + seconds
    while time.perf_counter() < ready:
        yield


if __name__ == "__main__":
    found: dict[str, object] = {}
    play(steps(found), found, RESULT, PAUSE_S, LONGEST_S)
