"""What the operators share."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from contextlib import contextmanager
from typing import Any

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


class Stepped:
    """Mix-in of operators whose work comes in steps.

    In a window one step per timer event, so that Blender stays alive and Esc can stop it; elsewhere all at once.
    """

    stopped_text = "Stopped"
    _steps: Generator[Any, None, Any]

    def _start(self, context: bpy.types.Context) -> Generator[Any, None, Any]:
        """The steps; what they return goes to `_store`. Closing them leaves everything as it was."""
        raise NotImplementedError

    def _store(self, context: bpy.types.Context, result: Any) -> None:
        """Keep what the steps returned."""
        raise NotImplementedError

    def _progress(self, step: Any) -> tuple[float, str]:
        """Fraction done and what is being done."""
        raise NotImplementedError

    def run_in_steps(self, context: bpy.types.Context) -> set[str]:
        """Begin; `modal` goes on."""
        with reported(self) as outcome:  # type: ignore[arg-type]
            self._steps = self._start(context)
            manager = context.window_manager
            self._timer = manager.event_timer_add(0.01, window=context.window)
            manager.progress_begin(0, 1)
            manager.modal_handler_add(self)
            outcome.status = {"RUNNING_MODAL"}
        return outcome.status

    def run_at_once(self, context: bpy.types.Context) -> set[str]:
        """All steps."""
        with reported(self) as outcome, busy(context):  # type: ignore[arg-type]
            from spectral_core.steps import finished

            def told(step: Any) -> None:
                context.window_manager.progress_update(self._progress(step)[0])

            self._store(context, finished(self._start(context), told))
        return outcome.status

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """One step per timer event; all other events wait, so that nothing changes meanwhile."""
        if event.type == "ESC":
            self._end(context)
            self.report({"WARNING"}, self.stopped_text)  # type: ignore[attr-defined]
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"RUNNING_MODAL"}
        with reported(self) as outcome:  # type: ignore[arg-type]
            try:
                fraction, what = self._progress(next(self._steps))
            except StopIteration as finished:
                self._store(context, finished.value)
            else:
                context.window_manager.progress_update(fraction)
                context.workspace.status_text_set(f"{what} ({fraction:.0%}). Esc cancels")
                return {"RUNNING_MODAL"}
        self._end(context)
        return outcome.status

    def _end(self, context: bpy.types.Context) -> None:
        self._steps.close()
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        context.workspace.status_text_set(None)
