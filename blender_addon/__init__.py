"""Spectral Booth in Blender: operators, a panel and background commands on top of the core.

Registration imports neither the core nor colour-science: operators and commands do so when they run.
"""

from __future__ import annotations

from types import ModuleType


def register() -> None:
    """Add properties, operators, the panel, handlers and background commands."""
    for part in _parts():
        part.register()


def unregister() -> None:
    """Remove them again, last first."""
    for part in reversed(_parts()):
        part.unregister()


def _parts() -> tuple[ModuleType, ...]:
    # Imported here because `python -m blender_addon.command` imports this package first, and must
    # then find `command` not imported yet.
    from . import command, eyes, handlers, operators, props, ui

    return (props, operators, ui, handlers, eyes, command)
