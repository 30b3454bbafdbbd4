"""Show a list of device codes one by one, for an instrument before the screen or the headset's lens."""

from __future__ import annotations

import time
from contextlib import ExitStack
from pathlib import Path

import bpy

from .common import reported

ADVANCES = (
    ("KEY", "By Key", "Space or right arrow shows the next patch"),
    ("TIMER", "By Timer", "Each patch stays for some seconds after it has settled"),
    ("FILE", "By File", "An instrument's script touches the file patch-next"),
)
_TICK_S = 0.02
_STEPS = {"SPACE": 1, "RIGHT_ARROW": 1, "LEFT_ARROW": -1}


class PlayPatches(bpy.types.Operator):
    """Show device codes one by one on a capsule, in the window and in the headset; Esc stops"""

    bl_idname = "spectral_booth.play_patches"
    bl_label = "Play Patches"
    bl_options = {"REGISTER"}  # the scene is as before afterwards: nothing to undo

    filepath: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Patches", description="CSV with the columns R,G,B; the published 234 if left empty", subtype="FILE_PATH"
    )
    folder: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Folder", description="Where patch-state.json and patches-shown.csv go", subtype="DIR_PATH", default="//"
    )
    advance: bpy.props.EnumProperty(name="Advance", items=ADVANCES)  # type: ignore[valid-type]
    seconds: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Seconds per Patch", description="How long a settled patch stays, by timer", default=3.0, min=0.0
    )
    settle: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Settle", description="Seconds after which a patch may be read", default=0.5, min=0.0
    )
    warm_up: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Warm Up", description="Seconds that the first patch stands before it may be read", default=5.0, min=0.0
    )
    headset: bpy.props.BoolProperty(  # type: ignore[valid-type]
        name="Start Headset", description="Start the VR session, and stop it afterwards", default=False
    )
    follow: bpy.props.BoolProperty(  # type: ignore[valid-type]
        name="Follow Headset",
        description="Keep the capsule in the middle of the headset's view, wherever it lies",
        default=True,
    )
    surround: bpy.props.BoolProperty(  # type: ignore[valid-type]
        name="Keep Surround", description="Leave the scene round the capsule; otherwise all else is black"
    )
    width_deg: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Width", description="Of the capsule, in degrees as the viewer sees it", default=20.0, min=1.0, max=90.0
    )
    quit: bpy.props.BoolProperty(  # type: ignore[valid-type]
        name="Quit Blender", description="Quit Blender afterwards", default=False, options={"HIDDEN", "SKIP_SAVE"}
    )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """From a button: ask for the settings first."""
        if self.properties.is_property_set("folder"):
            return self.execute(context)
        return context.window_manager.invoke_props_dialog(self, width=340, confirm_text="Play")

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Show the first patch; `modal` does the rest."""
        self._stack = ExitStack()
        try:
            with reported(self) as outcome:
                self._start(context)
                outcome.status = {"RUNNING_MODAL"}
        finally:
            if outcome.status != {"RUNNING_MODAL"}:
                self._stack.close()
        return outcome.status

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Time passes, keys step; all other events wait, so that nothing changes meanwhile."""
        now = time.time()
        try:
            with reported(self) as outcome:
                if event.type == "ESC":
                    self._playback.stop(now)
                elif event.type in _STEPS and event.value == "PRESS" and not event.is_repeat:
                    self._playback.step(_STEPS[event.type], now)
                elif event.type == "TIMER":
                    self._playback.tick(now, self._trigger.touched())
                self._update(now)
                if not self._playback.ended:
                    outcome.status = {"RUNNING_MODAL"}
        finally:
            if outcome.status != {"RUNNING_MODAL"}:
                self._end()
        if self._playback.ended == "stopped":
            return {"CANCELLED"}
        return outcome.status

    def cancel(self, context: bpy.types.Context) -> None:
        """Blender ends the player itself: another file, or the window closes."""
        self._end()

    def _start(self, context: bpy.types.Context) -> None:
        from spectral_core.display.measuring import patches, playback
        from spectral_core.errors import BlenderError

        from ..bridge import patches as stage

        if bpy.app.background:
            raise BlenderError("patches are shown in a window or a headset", remedy="start Blender with its window")
        chosen = patches.read_patches(bpy.path.abspath(self.filepath) if self.filepath else patches.PUBLISHED)
        pace = playback.Pace(self.advance, self.seconds, self.settle, self.warm_up)
        self._folder = _folder(self.folder)
        self._trigger = playback.Trigger(self._folder / playback.TRIGGER_FILE)
        window, area = _view(context)
        enter = self._stack.enter_context
        scene = enter(stage.staged(window.scene, self.width_deg, self.surround))
        enter(stage.shown_in(window, area, scene))
        enter(stage.in_headset(window, area, self.headset))
        self._frames = enter(stage.counting_frames(scene))
        self._scene = scene.name
        self._workspace = window.workspace.name
        self._stack.callback(_say, self._workspace, "")
        manager = context.window_manager
        timer = manager.event_timer_add(_TICK_S, window=window)
        self._stack.callback(manager.event_timer_remove, timer)
        self._playback = playback.Playback(chosen, pace)
        self._told: dict[str, object] = {}
        self._shown = 0
        self._update(time.time())
        manager.modal_handler_add(self)

    def _update(self, now: float) -> None:
        """What is shown, and what the files, the status bar and the panel say of it, if it changed."""
        from spectral_core.display.measuring import playback

        from ..bridge import patches as stage

        scene = bpy.data.scenes[self._scene]
        if self.follow:
            stage.follow_headset(scene)
        if self._shown != len(self._playback.showings):
            self._shown = len(self._playback.showings)
            stage.show(scene, self._playback.patches.codes[self._playback.patch])
            playback.write_shown(self._playback, self._folder)
            self._frames.reset()
        elif self._frames.enough():
            self._playback.drawn(now)
        document = self._playback.document(now)
        if document == self._told:
            return
        playback.write_state(document, self._folder)
        self._told = document
        levels = " ".join(f"{value:.4g}" for value in document["rgb_8bit"])
        _say(self._workspace, f"Patch {document['index']} of {document['count']}: {levels} ({document['state']})")

    def _end(self) -> None:
        from spectral_core.display.measuring import playback

        now = time.time()
        self._playback.stop(now)  # unless it is done
        self._stack.close()
        with reported(self):
            path = playback.write_shown(self._playback, self._folder)
            playback.write_state(self._playback.document(now), self._folder)
            self.report({"INFO"}, f"{self._playback.ended.capitalize()}; what was shown is in {path}")
        if self.quit:
            bpy.app.timers.register(_quit)  # once this operator is over


def _quit() -> None:
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0]):
        bpy.ops.wm.quit_blender()


def _folder(name: str) -> Path:
    from spectral_core.errors import OutputError

    if name.startswith("//") and not bpy.data.filepath:
        raise OutputError("this file has no folder yet", remedy="save it, or name a folder for the patches")
    return Path(bpy.path.abspath(name))


def _view(context: bpy.types.Context) -> tuple[bpy.types.Window, bpy.types.Area]:
    """The 3D view that the operator was called from, else the largest one of the window."""
    from spectral_core.errors import BlenderError

    window = context.window or context.window_manager.windows[0]
    if context.area is not None and context.area.type == "VIEW_3D":
        return window, context.area
    areas = [each for each in window.screen.areas if each.type == "VIEW_3D"]
    if not areas:
        raise BlenderError("this window has no 3D view", remedy="open one, then play")
    return window, max(areas, key=lambda each: each.width * each.height)


def _say(workspace: str, text: str) -> None:
    """In the panel, and in the status bar with the keys."""
    manager = bpy.context.window_manager
    manager.spectral_booth_player = text
    keys = ". Space or right: next, left: back, Esc: stop"
    bpy.data.workspaces[workspace].status_text_set(text + keys if text else None)
    for area in (area for window in manager.windows for area in window.screen.areas if area.type == "VIEW_3D"):
        for region in area.regions:
            if region.type == "UI":  # nothing else tells the sidebar
                region.tag_redraw()
