"""Verify a scene from its rendered pixels."""

from __future__ import annotations

import time
from collections.abc import Generator
from typing import TYPE_CHECKING

import bpy

from .common import ManagedScene, Stepped

if TYPE_CHECKING:
    from spectral_core.verification import LightResult

    from ..bridge.verify import Step

LIGHTS = (
    ("ALL", "All Lights", "Every light of the scene"),
    ("CURRENT", "This Light", "The light that is shown"),
)


class VerifyScene(ManagedScene, Stepped, bpy.types.Operator):
    """Render the scene at every level and compare the pixels with the exact colours"""

    bl_idname = "spectral_booth.verify"
    bl_label = "Verify"
    bl_options = {"REGISTER", "UNDO"}

    lights: bpy.props.EnumProperty(name="Lights", items=LIGHTS, default="ALL")  # type: ignore[valid-type]
    write_json: bpy.props.BoolProperty(  # type: ignore[valid-type]
        name="Write JSON", description="Write the figures beside the .blend, NAME.verify.json", default=False
    )

    stopped_text = "Verification cancelled; the scene is as it was"

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """In a window: one render at a time, Esc cancels."""
        return self.execute(context) if bpy.app.background else self.run_in_steps(context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """From a script or in the background: all at once."""
        return self.run_at_once(context)

    def _progress(self, step: Step) -> tuple[float, str]:
        return step.fraction, f"Verifying {step.what}"

    def _start(self, context: bpy.types.Context) -> Generator[Step, None, list[LightResult]]:
        from ..bridge import state
        from ..bridge.verify import json_path, verify_steps

        scene = context.scene
        if self.write_json:
            json_path()  # an unsaved file has no folder: say so before the renders, not after
        current = scene.spectral_booth.light
        lights = [current] if self.lights == "CURRENT" else list(state.description(scene).lights)
        self._started = time.perf_counter()
        return verify_steps(scene, lights)

    def _store(self, context: bpy.types.Context, result: list[LightResult]) -> None:
        from ..bridge import verify

        context.scene.spectral_booth.result = verify.summary(result)
        if self.write_json:
            path = verify.write_json(context.scene, result, time.perf_counter() - self._started)
            self.report({"INFO"}, f"Wrote {path}")
