"""Registering leaves nothing behind and loads nothing that takes long."""

from __future__ import annotations

import subprocess
import sys
import unittest.mock

import bpy

import blender_addon

# Blender loads the package under the name of its repository; only the order of work is asked here.
_FRESH = """
import sys, bpy, blender_addon
blender_addon.register()
print(sorted({name.split(".")[0] for name in sys.modules} & {"spectral_core", "colour", "OpenImageIO"}))
blender_addon.unregister()  # or the bpy module of 4.5 crashes when it ends
"""


def _traces() -> tuple[object, ...]:
    types = sorted(name for name in dir(bpy.types) if "pectral" in name or "SPECTRAL" in name)
    handlers = {
        name: len(getattr(bpy.app.handlers, name))
        for name in ("undo_pre", "undo_post", "redo_pre", "redo_post", "load_post")
    }
    return (
        types,
        hasattr(bpy.types.Scene, "spectral_booth"),
        hasattr(bpy.types.WindowManager, "spectral_booth_player"),
        dir(bpy.ops.spectral_booth),
        handlers,
    )


def test_this_blender_is_one_that_is_supported() -> None:
    # With a numpy that does not fit, bpy prints import errors and goes on: say so here.
    assert bpy.app.version[:2] in {(4, 5), (5, 0)}


def test_unregister_leaves_nothing_and_register_works_again() -> None:
    registered = _traces()
    blender_addon.unregister()
    try:
        bare = _traces()
        blender_addon.register()
        assert _traces() == registered
        blender_addon.unregister()
        assert _traces() == bare
        assert bare[0] == []
        assert bare[1] is False
    finally:
        blender_addon.register()
    assert {kind: sum(kind in name for name in registered[0]) for kind in ("_OT_", "_MT_", "_PT_")} == {
        "_OT_": 18,
        "_MT_": 1,
        "_PT_": 6,
    }


def test_registration_imports_neither_the_core_nor_colour_science() -> None:
    done = subprocess.run([sys.executable, "-c", _FRESH], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


def test_no_mock_of_matplotlib_stays_for_other_addons(chart: bpy.types.Scene) -> None:
    assert "colour" in sys.modules
    mocks = [
        name
        for name, module in sys.modules.items()
        if name.startswith("matplotlib") and isinstance(module, unittest.mock.NonCallableMock)
    ]
    assert mocks == []
