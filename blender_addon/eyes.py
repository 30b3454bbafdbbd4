"""Tell the shaders which eye of a headset is being drawn.

Blender draws the left eye, then the right one, from the same scene, and shaders have no other way to
know which: after each eye this sets the scene's property for the next. No pose is guessed, so that
it holds however the head moves.
"""

from __future__ import annotations

import bpy
import gpu

EYE_PROPERTY = "spectral_booth_eye"
# From one draw to the next a view moves right by this much only from the left eye to the right one:
# pupils are 50 to 75 mm apart, and no head moves as far within a frame.
_LEAST_SEPARATION_M = 0.02

_handle: object | None = None
_last_position: object | None = None


def _next_eye() -> None:
    """After an eye was drawn: set the property for the one that comes next."""
    global _last_position
    scene = bpy.context.scene
    if EYE_PROPERTY not in scene:
        return
    camera = gpu.matrix.get_model_view_matrix().inverted_safe()
    position, rightwards = camera.translation.copy(), camera.col[0].to_3d()
    drawn_right = _last_position is not None and (position - _last_position).dot(rightwards) > _LEAST_SEPARATION_M
    _last_position = position
    eye = 0.0 if drawn_right else 1.0
    scene[EYE_PROPERTY] = eye
    # What the next eye is drawn from; waiting for the dependency graph would be a frame too late.
    bpy.context.view_layer.depsgraph.scene_eval[EYE_PROPERTY] = eye


def register() -> None:
    """Follow the eyes of every VR session."""
    global _handle
    _handle = bpy.types.SpaceView3D.draw_handler_add(_next_eye, (), "XR", "POST_VIEW")


def unregister() -> None:
    """Stop following."""
    global _handle, _last_position
    if _handle is not None:
        bpy.types.SpaceView3D.draw_handler_remove(_handle, "XR")
    _handle = _last_position = None
