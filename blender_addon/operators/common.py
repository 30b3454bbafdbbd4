"""What the operators share."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy

FINISHED = frozenset({"FINISHED"})
CANCELLED = frozenset({"CANCELLED"})


class ManagedScene:
    """Mix-in of the operators that need a spectral scene."""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Only in a scene that `build` made; says so otherwise."""
        if context.scene is not None and context.scene.spectral_booth.is_managed:
            return True
        cls.poll_message_set("This is no spectral scene; build one first")  # type: ignore[attr-defined]
        return False


class Outcome:
    """What an operator returns at its end."""

    def __init__(self) -> None:
        self.status = set(FINISHED)


@contextmanager
def reported(operator: bpy.types.Operator) -> Iterator[Outcome]:
    """Turn the errors a user can meet into a report and ``CANCELLED``; all others pass through."""
    from spectral_core.errors import SpectralBoothError

    outcome = Outcome()
    try:
        yield outcome
    except SpectralBoothError as error:
        operator.report({"ERROR"}, str(error))
        outcome.status = set(CANCELLED)


@contextmanager
def busy(context: bpy.types.Context) -> Iterator[None]:
    """Show Blender's progress cursor for a step that cannot say how far it is."""
    manager = context.window_manager
    manager.progress_begin(0, 1)
    manager.progress_update(0)
    try:
        yield
    finally:
        manager.progress_end()
