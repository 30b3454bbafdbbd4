"""Commands ``spectral-booth patches``: lists of codes, shown on a display and paired with readings."""

from __future__ import annotations

import json as json_module
from pathlib import Path

import click

from spectral_core.blender_process import run_in_window
from spectral_core.cli.console import Document, emit, facts, progress_bar
from spectral_core.cli.options import FiniteRange, as_json
from spectral_core.display.measuring import playback
from spectral_core.display.measuring.patches import PUBLISHED, pair, read_patches, write_paired, write_patches
from spectral_core.errors import BlenderError, DisplayError
from spectral_core.files import read_text

_PATH = click.Path(path_type=Path)
# What runs in the application once its window stands. An error is told in one line and ends it.
_SCRIPT = """
import sys, bpy

def play():
    try:
        with bpy.context.temp_override(window=bpy.context.window_manager.windows[0]):
            bpy.ops.spectral_booth.play_patches("INVOKE_DEFAULT", quit=True, **{options!r})
    except Exception as error:
        print("error:", " ".join(str(error).removeprefix("Error: ").split()), file=sys.stderr, flush=True)
        bpy.ops.wm.quit_blender()

bpy.app.timers.register(play, first_interval=1.0)
"""


@click.group()
def patches() -> None:
    """Show device codes to an instrument, and pair them with its readings."""


@patches.command("new")
@click.option("-o", "--output", type=_PATH, required=True, help="the CSV to write")
@as_json
def new(output: Path, json: bool) -> None:
    """Write the published 234 patches as CSV, to be edited or played."""
    chosen = read_patches(PUBLISHED)
    write_patches(chosen, output)
    document = {"file": str(output), "patches": len(chosen)}
    emit(document, json, lambda console: console.print(facts(document)))


@patches.command("play")
@click.argument("file", default=PUBLISHED)
@click.option("-o", "--output", type=_PATH, required=True, help="folder for patch-state.json and patches-shown.csv")
@click.option("--blend", type=_PATH, help="show them in this .blend instead of an empty file")
@click.option("--headset", is_flag=True, help="start the VR session")
@click.option("--surround", is_flag=True, help="leave the .blend's scene round the capsule")
@click.option(
    "--advance",
    type=click.Choice([each.lower() for each in playback.ADVANCES]),
    default="key",
    show_default=True,
    help="the next patch comes by key, after --seconds, or when patch-next is touched",
)
@click.option("--seconds", type=FiniteRange(0), default=3.0, show_default=True, help="per settled patch, by timer")
@click.option("--settle", type=FiniteRange(0), default=0.5, show_default=True, help="seconds until a patch may be read")
@click.option("--warm-up", type=FiniteRange(0), default=5.0, show_default=True, help="seconds more for the first one")
@as_json
def play(
    file: str, output: Path, blend: Path | None, headset: bool, surround: bool, advance: str, seconds: float,
    settle: float, warm_up: float, json: bool,
) -> None:  # fmt: skip
    """Show the patches of FILE (CSV with R,G,B; the published 234 if left out) in Blender's window.

    It needs a Blender application with the extension: BLENDER, else `blender` on the path. Space or
    right shows the next patch, left the one before, Esc stops.
    """
    count = len(read_patches(file))  # a wrong row is told before Blender starts
    options = {
        "filepath": "" if file == PUBLISHED else str(Path(file).resolve()),
        "folder": str(output.resolve()),
        "headset": headset,
        "surround": surround,
        "advance": advance.upper(),
        "seconds": seconds,
        "settle": settle,
        "warm_up": warm_up,
    }
    # Over the state of an earlier run, and a folder that cannot be written to is told now.
    playback.write_state({"format": 1, "state": "starting"}, output)
    with progress_bar(f"showing {count} patches"):
        run_in_window(_SCRIPT.format(options=options), blend)
    last = json_module.loads(read_text(output / playback.STATE_FILE, DisplayError, "play the patches again"))
    if last["state"] not in ("done", "stopped"):
        raise BlenderError("Blender ended before the patches did", remedy="play them again")
    document: Document = {
        "state": last["state"],
        "patches": count,
        "last": last["index"],
        "shown": str(output / playback.SHOWN_FILE),
    }
    emit(document, json, lambda console: console.print(facts(document)))


@patches.command("pair")
@click.argument("shown", type=_PATH)
@click.argument("readings", type=_PATH)
@click.option("-o", "--output", type=_PATH, required=True, help="the CSV to write, for `characterise`")
@as_json
def pair_command(shown: Path, readings: Path, output: Path, json: bool) -> None:
    """Join SHOWN (patches-shown.csv) with an instrument's READINGS (CSV with X,Y,Z or x,y,Y).

    They are matched by the readings' column index if there is one, else by their column time, else by
    order.
    """
    paired = pair(shown, readings)
    write_paired(paired, output)
    document = {
        "file": str(output),
        "readings": len(paired.rows),
        "matched_by": paired.matched_by,
        "warnings": list(paired.warnings),
    }
    emit(document, json, lambda console: console.print(facts(document)))


def add_patch_commands(group: click.Group) -> None:
    """Add this module's commands to the program."""
    group.add_command(patches)
