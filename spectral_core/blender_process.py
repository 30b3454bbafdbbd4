"""Run a verb in Blender: the bpy module of this environment, else an application with the extension."""

from __future__ import annotations

import collections
import importlib.util
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from spectral_core.errors import BlenderError, SpectralBoothError

_PROGRESS = "spectral-booth progress "
_ERROR = "error: "
_KEPT_LINES = 12

Progress = Callable[[float, str], None]


def blender_command() -> list[str]:
    """The command that takes a verb: bpy here, else ``BLENDER``, else ``blender`` on the path.

    Raises
    ------
    BlenderError
        If there is none; the message says how to get one.
    """
    if importlib.util.find_spec("bpy") is not None:
        return [sys.executable, "-m", "blender_addon.command"]
    application = _application("pip install 'spectral-booth[blender]' (Python 3.11), or ")
    return [application, "--background", "--command", "spectral_booth"]


def run_in_window(script: str, blend: Path | None = None) -> None:
    """Run Python in the application with its window, on a .blend or an empty file, until it quits.

    Raises
    ------
    SpectralBoothError
        With the line ``error: ...`` that the script printed.
    BlenderError
        If there is no application, or it broke.
    """
    if blend is not None and not blend.is_file():
        raise BlenderError("no such file", where=blend, remedy="name a .blend")
    command = [_application(""), *([str(blend)] if blend else []), "--python-expr", script]
    code, tail = _run(command)
    if code:
        raise BlenderError(f"Blender stopped with code {code}: {tail}", remedy="does its window open?")


def _application(instead: str) -> str:
    """``BLENDER``, else ``blender`` on the path; `instead` begins the remedy if there is neither."""
    application = os.environ.get("BLENDER") or shutil.which("blender")
    if application is None:
        raise BlenderError(
            "this command needs Blender and there is none",
            remedy=f"{instead}set BLENDER to an application with the extension installed",
        )
    if shutil.which(application) is None:
        raise BlenderError("BLENDER names no program", where=application, remedy="set it to Blender's executable")
    return application


def run_verb(arguments: Sequence[str], progress: Progress | None = None, ocio: Path | None = None) -> dict[str, Any]:
    """Run a verb with its arguments and return its JSON result; `ocio` is the OpenColorIO config to start with.

    Raises
    ------
    SpectralBoothError
        With the verb's own message if it refused its input.
    BlenderError
        If Blender is missing or broke.
    """
    command = blender_command()
    with tempfile.TemporaryDirectory() as folder:
        result = Path(folder) / "result.json"
        code, tail = _run([*command, *arguments, "--result", str(result)], progress, ocio)
        if code or not result.exists():
            raise BlenderError(
                f"Blender stopped with code {code} and no result: {tail}",
                remedy="run it again; if it repeats, check the graphics driver",
            )
        document: dict[str, Any] = json.loads(result.read_text(encoding="utf-8"))
        return document


class VerbError(SpectralBoothError):
    """What a verb inside Blender said of its input; already a whole line."""


def _run(command: Sequence[str], progress: Progress | None = None, ocio: Path | None = None) -> tuple[int, str]:
    """Run a command to its end: its code and its last lines; its ``error: ...`` is raised."""
    tail: collections.deque[str] = collections.deque(maxlen=_KEPT_LINES)
    with subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        env={**os.environ, "OCIO": str(ocio)} if ocio else None,
    ) as process:
        try:
            refused = _follow(process, tail, progress)
        except BaseException:
            process.kill()
            raise
    if refused is not None:
        raise VerbError(refused)
    return process.returncode, " | ".join(tail)


def _follow(process: subprocess.Popen[str], tail: collections.deque[str], progress: Progress | None) -> str | None:
    """Read the output to its end; the verb's error line, or None."""
    refused = None
    for raw in process.stdout or ():
        line = raw.rstrip()
        if line.startswith(_PROGRESS):
            fraction, _, what = line.removeprefix(_PROGRESS).partition(" ")
            if progress:
                progress(float(fraction), what)
        elif line.startswith(_ERROR):
            refused = line.removeprefix(_ERROR)
        elif line:
            tail.append(line)
    return refused
