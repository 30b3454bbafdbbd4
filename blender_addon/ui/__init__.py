"""The sidebar's panels, and entries in Blender's own menus."""

from __future__ import annotations

from . import menus, panel, ways


def register() -> None:
    """Add them."""
    panel.register()
    ways.register()
    menus.register()


def unregister() -> None:
    """Remove them, last first."""
    menus.unregister()
    ways.unregister()
    panel.unregister()
