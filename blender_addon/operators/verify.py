"""Verify a scene from its rendered pixels."""

from __future__ import annotations

import time
from collections.abc import Generator
from typing import TYPE_CHECKING

import bpy

from .common import ManagedScene, reported

if TYPE_CHECKING:
    from spectral_core.verification import LightResult

    from ..bridge.verify import Step

LIGHTS = (
    ("ALL", "All Lights", "Every light of the scene"),
    ("CURRENT", "This Light", "The light that is shown"),
)


class VerifyScene(ManagedScene, bpy.types.Operator):
    """Render the scene at every level and compare the pixels with the exact colours"""

    bl_idname = "spectral_booth.verify"
    bl_label = "Verify"
    bl_options = {"REGISTER", "UNDO"}

    lights: bpy.props.EnumProperty(name="Lights", items=LIGHTS, default="ALL")  # type: ignore[valid-type]
    write_json: bpy.props.BoolProperty(  # type: ignore[valid-type]
        name="Write JSON", description="Write the figures beside the .blend, NAME.verify.json", default=False
    )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """In a window: one render at a time, Esc cancels."""
        if bpy.app.background:
            return self.execute(context)
        with reported(self) as outcome:
            self._start(context)
            manager = context.window_manager
            self._timer = manager.event_timer_add(0.01, window=context.window)
            manager.progress_begin(0, 1)
            manager.modal_handler_add(self)
            outcome.status = {"RUNNING_MODAL"}
        return outcome.status

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """One step per timer event; all other events wait, so that nothing changes meanwhile."""
        if event.type == "ESC":
            self._end(context)
            self.report({"WARNING"}, "Verification cancelled; the scene is as it was")
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"RUNNING_MODAL"}
        with reported(self) as outcome:
            try:
                step = next(self._steps)
            except StopIteration as finished:
                self._store(context, finished.value)
            else:
                context.window_manager.progress_update(step.fraction)
                context.workspace.status_text_set(f"Verifying {step.what} ({step.fraction:.0%}). Esc cancels")
                return {"RUNNING_MODAL"}
        self._end(context)
        return outcome.status

    def execute(self, context: bpy.types.Context) -> set[str]:
        """From a script or in the background: all at once."""
        with reported(self) as outcome:
            self._start(context)
            try:
                while True:
                    next(self._steps)
            except StopIteration as finished:
                self._store(context, finished.value)
        return outcome.status

    def _start(self, context: bpy.types.Context) -> None:
        from ..bridge import state
        from ..bridge.verify import json_path, verify_steps

        scene = context.scene
        if self.write_json:
            json_path()  # an unsaved file has no folder: say so before the renders, not after
        current = scene.spectral_booth.light
        lights = [current] if self.lights == "CURRENT" else list(state.description(scene).lights)
        self._started = time.perf_counter()
        self._steps: Generator[Step, None, list[LightResult]] = verify_steps(scene, lights)

    def _store(self, context: bpy.types.Context, results: list[LightResult]) -> None:
        from ..bridge import verify

        context.scene.spectral_booth.result = verify.summary(results)
        if self.write_json:
            path = verify.write_json(context.scene, results, time.perf_counter() - self._started)
            self.report({"INFO"}, f"Wrote {path}")

    def _end(self, context: bpy.types.Context) -> None:
        self._steps.close()  # puts the scene's own light back
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        context.workspace.status_text_set(None)
