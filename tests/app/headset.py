"""Runs in the application beside a simulated headset: ``headset.py -- RESULT.json PATCHES.csv FOLDER``.

First an instrument's script leads through the patches in the headset, then keys in the window alone.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import bpy

sys.path.append(str(Path(__file__).parent))
from steps import play, view

PAUSE_S = 0.5
LONGEST_S = 540.0
# In software the headset's first frame takes a while: its shaders are compiled.
WARM_UP_S = 30.0
SETTLE_S = 2.0

RESULT, PATCHES, FOLDER = (Path(each) for each in sys.argv[sys.argv.index("--") + 1 :])


def steps(found: dict[str, object]) -> Iterator[None]:
    """What a user does, a step at a time."""
    place = view()
    place["space_data"].show_region_ui = True
    yield  # the sidebar has its categories once it was drawn
    sidebar = next(each for each in place["area"].regions if each.type == "UI")
    sidebar.active_panel_category = "Spectral Booth"
    bpy.context.window.scene.view_settings.view_transform = "AgX"
    cube = bpy.data.objects["Cube"]
    with bpy.context.temp_override(**place):
        bpy.ops.transform.translate("EXEC_DEFAULT", True, value=(1.0, 0.0, 0.0))
    yield
    found["before"] = _state()
    with bpy.context.temp_override(**place):
        found["played"] = sorted(
            bpy.ops.spectral_booth.play_patches(
                "INVOKE_DEFAULT", filepath=str(PATCHES), folder=str(FOLDER), advance="FILE",
                settle=SETTLE_S, warm_up=WARM_UP_S, headset=True,
            )
        )  # fmt: skip
    instrument = subprocess.Popen([sys.executable, str(Path(__file__).with_name("instrument.py")), str(FOLDER)])
    found["playing"] = []
    region = place["region"]
    found["middle"] = [region.x + region.width // 2, place["window"].height - region.y - region.height // 2]
    while instrument.poll() is None:
        found["playing"].append(_playing())
        yield
    found["instrument"] = instrument.returncode
    yield
    found["after"] = _state()
    yield from _keys(found, place)
    found["cube"] = cube.location.x
    with bpy.context.temp_override(**view()):
        bpy.ops.ed.undo()
    yield
    found["undone"] = bpy.data.objects["Cube"].location.x


def _keys(found: dict[str, object], place: dict[str, object]) -> Iterator[None]:
    """Forward, forward, back, and Esc."""
    with bpy.context.temp_override(**place):
        bpy.ops.spectral_booth.play_patches(
            "INVOKE_DEFAULT", filepath=str(PATCHES), folder=str(FOLDER / "keys"), settle=0.0, warm_up=0.0
        )
    indices = []
    for key in ("SPACE", "RIGHT_ARROW", "LEFT_ARROW", "ESC"):
        yield
        indices.append(_document(FOLDER / "keys")["index"])
        for value in ("PRESS", "RELEASE"):
            place["window"].event_simulate(type=key, value=value, x=400, y=400)
    yield
    found["keys"] = indices
    found["stopped"] = _document(FOLDER / "keys")["state"]
    found["after_keys"] = _state()


def _document(folder: Path) -> dict[str, object]:
    return json.loads((folder / "patch-state.json").read_text(encoding="utf-8"))


def _playing() -> dict[str, object]:
    state = bpy.context.window_manager.xr_session_state
    return {
        "headset": _session(),
        "head": None if state is None else list(state.viewer_pose_location),
        "panel": bpy.context.window_manager.spectral_booth_player,
    }


def _session() -> bool:
    state = bpy.context.window_manager.xr_session_state
    return state is not None and bpy.types.XrSessionState.is_running(bpy.context)


def _state() -> dict[str, object]:
    """All that the player might leave changed."""
    place = view()
    space = place["space_data"]
    settings = bpy.context.window_manager.xr_session_settings
    kinds = ("scenes", "objects", "meshes", "cameras", "materials", "worlds")
    return {
        "scene": place["window"].scene.name,
        "view": [space.shading.type, space.overlay.show_overlays, space.show_gizmo, space.region_3d.view_perspective],
        "colour": place["window"].scene.view_settings.view_transform,
        "headset": [settings.show_floor, settings.show_selection, settings.shading.type],
        "session": _session(),
        "data": {kind: sorted(each.name for each in getattr(bpy.data, kind)) for kind in kinds},
        "panel": bpy.context.window_manager.spectral_booth_player,
    }


if __name__ == "__main__":
    found: dict[str, object] = {}
    play(steps(found), found, RESULT, PAUSE_S, LONGEST_S)
