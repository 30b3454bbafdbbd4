"""Undo and redo of textured scenes.

Blender's undo restores an image's packed file but keeps the pixels it has in memory, so that a
light change undone would leave textures in the new light beside lamps in the old one. Where undo
changed a scene's light or level, the pixels of its images are dropped; Blender reads them again
from the packed file when it next shows them.
"""

from __future__ import annotations

import bpy
from bpy.app.handlers import persistent

_Shown = dict[str, tuple[str, str]]
# What each managed scene showed just before an undo or redo; names, never pointers.
_before: _Shown = {}


@persistent
def _remember(*_: object) -> None:
    _before.clear()
    _before.update(_shown())


@persistent
def _resync(*_: object) -> None:
    for name, shown in _shown().items():
        if _before.get(name) == shown:
            continue
        from .bridge import state

        for image in state.managed_images(bpy.data.scenes[name]):
            image.buffers_free()
    _before.clear()


def _shown() -> _Shown:
    return {
        scene.name: (scene.spectral_booth.light, scene.spectral_booth.level)
        for scene in bpy.data.scenes
        if scene.spectral_booth.is_managed
    }


_handlers = (
    ("undo_pre", _remember),
    ("redo_pre", _remember),
    ("undo_post", _resync),
    ("redo_post", _resync),
)


def register() -> None:
    """Follow undo and redo."""
    for name, function in _handlers:
        getattr(bpy.app.handlers, name).append(function)


def unregister() -> None:
    """Stop following."""
    for name, function in reversed(_handlers):
        found = getattr(bpy.app.handlers, name)
        if function in found:
            found.remove(function)
    _before.clear()
