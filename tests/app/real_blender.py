"""What the tests of the real application share."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Callable
from pathlib import Path

PROJECT = Path(__file__).parents[2]
APPLICATION = Path(__file__).with_name("application.sh")
# Below the project, which is the one folder that the application sees under the same path.
WORK = PROJECT / "out" / "app"
# Blender's own extension manager says it where a package of its own is missing; no add-on is concerned.
# The simulated headset has no play area to report.
HARMLESS = re.compile(r"bl_pkg|cattr|Error messages or info|reference_bounds_rect")

Application = Callable[..., subprocess.CompletedProcess[str]]


def log_of(done: subprocess.CompletedProcess[str]) -> str:
    """All that it said."""
    return done.stdout + done.stderr


def assert_clean(done: subprocess.CompletedProcess[str]) -> None:
    """It ended well and complained of nothing."""
    log = log_of(done)
    assert done.returncode == 0, log
    bad = [line for line in log.splitlines() if re.search(r"Traceback|Error|ERROR", line) and not HARMLESS.search(line)]
    assert bad == [], log
