"""Operators ``bpy.ops.spectral_booth.*``: gather inputs, make one call, report what went wrong."""

from __future__ import annotations

import bpy

from .adopt import AdoptMaterials, ReleaseMaterials
from .build import BuildScene
from .display import AddDisplayGroup, ClearDisplay, SetDisplay
from .light import CalibrateWhite, SetLevel, SetLight
from .patches import PlayPatches
from .render import RenderScene
from .textures import BakeTexture
from .verify import VerifyScene
from .ways import BakeColours, Encode, SetLampLight, SetMixture, SetWay

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
    SetWay,
    Encode,
    BakeColours,
    SetMixture,
    SetLampLight,
    AdoptMaterials,
    ReleaseMaterials,
)


def register() -> None:
    """Add the operators."""
    for each in _classes:
        bpy.utils.register_class(each)


def unregister() -> None:
    """Remove them again."""
    for each in reversed(_classes):
        bpy.utils.unregister_class(each)
