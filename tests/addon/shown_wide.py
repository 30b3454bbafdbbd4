"""Run by test_wide in a process of its own, whose variable OCIO names an exported config.

Opens a scene whose surfaces emit XYZ, and saves the mean codes and pixels of each surface through the config's view.

    python shown_wide.py FILE.blend DISPLAY RESULT.json
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

import bpy

from blender_addon import props
from blender_addon.bridge import measure
from blender_addon.bridge.display import Display, shown_on
from blender_addon.bridge.render import render_linear, save_shown


def main(path: Path, display: str, result: Path) -> None:
    props.register()
    bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False)
    scene = next(each for each in bpy.data.scenes if each.spectral_booth.is_managed)
    masks = measure.identify(scene).masks
    with shown_on(scene, Display(display, "Standard"), in_XYZ=True):
        pixels = render_linear(scene).pixels
        codes = save_shown(scene, result.with_suffix(".png"))
    seen = {name: mask for name, mask in masks.items() if mask.any()}
    found = {
        kind: {name: values[mask].mean(axis=0, dtype=float).tolist() for name, mask in seen.items()}
        for kind, values in (("pixels", pixels), ("codes", codes))
    }
    result.write_text(json.dumps({**found, "blender": bpy.app.version_string}), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2], Path(sys.argv[3]))
    sys.stdout.flush()
    os._exit(0)  # the bpy module's threads can deadlock when the interpreter ends
