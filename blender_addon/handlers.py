"""Undo and redo of textured scenes; files that are opened.

Blender's undo restores an image's packed file but keeps the pixels it has in memory, so that a
light change undone would leave textures in the new light beside lamps in the old one. Where undo
changed what a scene's images show, the pixels of its images are dropped; Blender reads them again
from the packed file when it next shows them.
"""

from __future__ import annotations

import bpy
from bpy.app.handlers import persistent

_Shown = dict[str, tuple[str, ...]]
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
        from .bridge import shading

        for image in shading.images_in(bpy.data.scenes[name]):
            image.buffers_free()
    _before.clear()


@persistent
def _look_again(*_: object) -> None:
    """A file for a view that this Blender may not have says so: which views there are is told when Blender starts."""
    wide = [scene for scene in bpy.data.scenes if scene.spectral_booth.target == "WIDE"]
    if wide:
        from .bridge import ways

        for scene in wide:
            scene.spectral_booth.way_notes = "; ".join(ways.notes(scene))


def _shown() -> _Shown:
    return {scene.name: _images_show(scene) for scene in bpy.data.scenes if scene.spectral_booth.is_managed}


_handlers = (
    ("load_post", _look_again),
    ("undo_pre", _remember),
    ("redo_pre", _remember),
    ("undo_post", _resync),
    ("redo_post", _resync),
)


def _images_show(scene: bpy.types.Scene) -> tuple[str, ...]:
    """What the images of a scene depend on: coefficients are the same for every light."""
    from .bridge import state

    kept = scene.spectral_booth
    if kept.basis is not None:
        return (kept.basis.as_string(), str(kept.basis_half))
    own = [f"{lamp.name}: {lamp.get(state.LAMP_LIGHT_KEY, '')}" for lamp in state.managed_lamps(scene)]
    return (kept.light, kept.level, kept.way, *own)


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
