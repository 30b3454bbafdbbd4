"""How a script plays a user in the application: a step at a time, from a timer; Blender draws in between."""

from __future__ import annotations

import json
import time
import traceback
from collections.abc import Iterator
from pathlib import Path

import bpy

Found = dict[str, object]


def view() -> dict[str, object]:
    """The context of the window's 3D view."""
    window = bpy.context.window_manager.windows[0]
    area = next(each for each in window.screen.areas if each.type == "VIEW_3D")
    region = next(each for each in area.regions if each.type == "WINDOW")
    return {"window": window, "area": area, "region": region, "space_data": area.spaces.active}


def play(steps: Iterator[None], found: Found, result: Path, pause_s: float, longest_s: float) -> None:
    """Take the steps, `pause_s` apart; then write what was `found` to `result` as JSON, and quit Blender.

    An exception, or more than `longest_s`, ends them and is found as ``exception``.
    """
    started = time.perf_counter()

    def step() -> float | None:
        found["seconds"] = time.perf_counter() - started
        try:
            if found["seconds"] > longest_s:
                raise TimeoutError(f"not done after {longest_s} s")
            next(steps)
        except StopIteration:
            pass
        except BaseException:
            found["exception"] = traceback.format_exc()
        else:
            return pause_s
        result.write_text(json.dumps(found), encoding="utf-8")
        with bpy.context.temp_override(window=bpy.context.window_manager.windows[0]):
            bpy.ops.wm.quit_blender()
        return None

    found["blender"] = bpy.app.version_string
    bpy.context.preferences.view.show_splash = False
    bpy.app.timers.register(step, first_interval=2.0)
