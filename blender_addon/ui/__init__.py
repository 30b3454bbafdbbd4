"""The sidebar panel."""

from __future__ import annotations

from . import panel


def register() -> None:
    """Add the panel."""
    panel.register()


def unregister() -> None:
    """Remove it."""
    panel.unregister()
