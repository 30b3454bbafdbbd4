"""Operators ``bpy.ops.spectral_booth.*``: gather inputs, make one call, report what went wrong."""

from __future__ import annotations

import bpy

from .build import BuildScene
from .display import AddDisplayGroup, ClearDisplay, SetDisplay
from .light import CalibrateWhite, SetLevel, SetLight
from .patches import PlayPatches
from .render import RenderScene
from .textures import BakeTexture
from .verify import VerifyScene

_classes = (
    BuildScene,
    SetLight,
    SetLevel,
    CalibrateWhite,
    RenderScene,
    VerifyScene,
    SetDisplay,
    ClearDisplay,
    AddDisplayGroup,
    PlayPatches,
    BakeTexture,
)


def register() -> None:
    """Add the operators."""
    for each in _classes:
        bpy.utils.register_class(each)


def unregister() -> None:
    """Remove them again."""
    for each in reversed(_classes):
        bpy.utils.unregister_class(each)
