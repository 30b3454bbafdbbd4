"""Runs in the application's window: ``live_switch.py -- RESULT.json SCENE.toml FOLDER``.

A scene of many materials is encoded in a spectral basis and its light is changed, by coloured and by coded lamps:
how long that keeps the main thread, how long the next redraw takes beside later ones, and what it touched.
"""

from __future__ import annotations

import hashlib
import importlib
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np

sys.path.append(str(Path(__file__).parent))
from many_materials import LIGHTS
from steps import play, view

PAUSE_S = 0.2
LONGEST_S = 700.0
# Changes of light are timed in blocks apart in time: others' work on the machine spoils some.
BLOCKS, BLOCK = 12, 9
ROUNDS = 24
LATER = 2
# All shaders are compiled when after so long so many redraws in a row took about the same time.
WARM_UP_S = 10.0
STEADY = 5
# Each redraw renders one more sample of this many: with one alone, later redraws would only show it again.
SAMPLES = 4096

RESULT, SCENE, FOLDER = (Path(each) for each in sys.argv[sys.argv.index("--") + 1 :])
SHOWN = (LIGHTS[0], f"0.5 {LIGHTS[1]} + 0.3 {LIGHTS[0]} + 0.2 {LIGHTS[2]}", LIGHTS[1])


def steps(found: dict[str, object]) -> Iterator[None]:
    """What a user does, a step at a time."""
    ways = importlib.import_module("bl_ext.user_default.spectral_booth.bridge.ways")
    place = view()
    with bpy.context.temp_override(**place):
        bpy.ops.spectral_booth.build(filepath=str(SCENE), calibrate=False)
        bpy.ops.spectral_booth.encode(tolerance=0.1)
    scene = bpy.context.window_manager.windows[0].scene
    space = place["space_data"]
    space.show_region_ui = space.show_region_toolbar = space.overlay.show_overlays = False
    space.region_3d.view_perspective, space.shading.type = "CAMERA", "RENDERED"
    scene.eevee.taa_samples = SAMPLES
    with bpy.context.temp_override(**place):
        bpy.ops.screen.screen_full_area(use_hide_panels=True)  # no panel is drawn beside it
    yield
    for way in ("COLOURED", "CODED"):
        with bpy.context.temp_override(**view()):
            bpy.ops.spectral_booth.set_way(way=way)
        times: list[float] = []
        while sum(times) < WARM_UP_S or max(times[-STEADY:]) > 2 * min(times[-STEADY:]):
            times.append(_redraw())
            yield
        before = _touchable()
        found[way] = {"warm_up_s": times}
        found[way]["switches_s"] = yield from _switches(ways, scene)
        found[way]["first_s"], found[way]["later_s"] = yield from _redraws(ways, scene)
        found[way]["updated"] = _updated(ways, scene)
        yield
        found[way]["touched"] = [name for name, state in _touchable().items() if state != before.get(name)]
        found[way]["things"] = len(before)
        yield from _photographs(found[way], ways, scene, way)


def _switches(ways: object, scene: bpy.types.Scene) -> Iterator[None]:
    """Blocks of seconds per change of light: of the change and of the dependency graph as the main thread's clock
    shows them, and of both the processor time of the main thread.
    """
    blocks = []
    for _ in range(BLOCKS):
        times = []
        for number in range(BLOCK):
            used, started = time.thread_time(), time.perf_counter()
            ways.light(scene, SHOWN[number % len(SHOWN)], 2)
            changed = time.perf_counter()
            scene.view_layers[0].update()
            updated = time.perf_counter()
            times.append((changed - started, updated - changed, time.thread_time() - used))
        blocks.append(times)
        yield
    return blocks


def _redraws(ways: object, scene: bpy.types.Scene) -> Iterator[None]:
    """Seconds of the first redraw after a change of light, and of later ones; in turn, so that noise meets both."""
    first, later = [], []
    for number in range(ROUNDS):
        ways.light(scene, SHOWN[number % len(SHOWN)], 2)
        scene.view_layers[0].update()
        first.append(_redraw())
        later.append([_redraw() for _ in range(LATER)])
        yield
    return first, later


def _redraw() -> float:
    with bpy.context.temp_override(**view()):
        started = time.perf_counter()
        bpy.ops.wm.redraw_timer(type="DRAW_WIN_SWAP", iterations=1)
        return time.perf_counter() - started


def _updated(ways: object, scene: bpy.types.Scene) -> list[str]:
    """What the dependency graph evaluates anew for a change of light; trees of nodes by whom they belong to."""
    owned = (*bpy.data.materials, *bpy.data.lights, *bpy.data.worlds)
    owners = {each.node_tree.as_pointer(): each for each in owned if each.node_tree is not None}
    names: set[str] = set()

    def note(_: object, graph: bpy.types.Depsgraph) -> None:
        for each in graph.updates:
            item = each.id.original
            item = owners.get(item.as_pointer(), item)
            names.add(f"{type(item).__name__} {item.name}")

    bpy.app.handlers.depsgraph_update_post.append(note)
    try:
        for light in SHOWN:
            ways.light(scene, light, 2)
            scene.view_layers[0].update()
    finally:
        bpy.app.handlers.depsgraph_update_post.remove(note)
    return sorted(names)


def _touchable() -> dict[str, object]:
    """All materials, node groups and images, as far as a change of light could touch them."""
    state: dict[str, object] = {}
    for tree in (*(each.node_tree for each in bpy.data.materials if each.node_tree), *bpy.data.node_groups):
        nodes = [(node.name, node.type, [_value(each) for each in node.inputs]) for node in tree.nodes]
        links = [(each.from_socket.path_from_id(), each.to_socket.path_from_id()) for each in tree.links]
        state[f"{tree.id_data.name} {tree.name} {tree.as_pointer()}"] = (nodes, links)
    for image in bpy.data.images:
        pixels = np.empty(len(image.pixels), dtype=np.float32)
        image.pixels.foreach_get(pixels)
        state[f"image {image.name}"] = (image.is_dirty, hashlib.sha256(pixels.tobytes()).hexdigest())
    return state


def _value(socket: bpy.types.NodeSocket) -> object:
    value = getattr(socket, "default_value", None)
    return list(value) if hasattr(value, "__len__") and not isinstance(value, str) else value


def _photographs(found: dict[str, object], ways: object, scene: bpy.types.Scene, way: str) -> Iterator[None]:
    """The window after the first redraw under each light."""
    for number, light in enumerate(SHOWN):
        ways.light(scene, light, 2)
        scene.view_layers[0].update()
        _redraw()
        subprocess.run(["import", "-window", "root", str(FOLDER / f"{way}-{number}.png")], check=True)
        yield
    region = view()["region"]
    window = view()["window"]
    found["region"] = [window.x + region.x, window.y + region.y, region.width, region.height]


if __name__ == "__main__":
    found: dict[str, object] = {}
    play(steps(found), found, RESULT, PAUSE_S, LONGEST_S)
