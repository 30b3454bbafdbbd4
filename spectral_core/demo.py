"""The demonstration: both scenes built, rendered, verified and reported in one go."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from spectral_core.blender_process import run_verb
from spectral_core.report.documents import Document
from spectral_core.report.html import ReportInput, SceneRun, find_renders, write_report
from spectral_core.scene import LEVELS, bundled_scene

Progress = Callable[[float, str], None]

# Shares of the whole run, from a trial on two cores.
_SHARES = {"build chart": 0.07, "verify chart": 0.30, "build booth": 0.10, "verify booth": 0.50, "report": 0.03}
# Level 0 has white lamps: it is the same under every light, and the chart shows it.
_BOOTH_LEVELS = (1, 2)


def run_demo(output: Path, progress: Progress) -> Document:
    """Build, render and verify the chart and the booth into `output`, and write the report."""
    started = time.perf_counter()
    steps = _Steps(progress)
    runs = {}
    for kind, scene, levels in (("chart", "colorchecker", LEVELS), ("booth", "booth", _BOOTH_LEVELS)):
        description, blend, images = bundled_scene(scene), output / f"{scene}.blend", output / kind
        run_verb(["build", str(description), "-o", str(blend)], steps.begin(f"build {kind}"))
        chosen = [part for level in levels for part in ("--level", str(level))]
        found = run_verb(["verify", str(blend), *chosen, "--images", str(images)], steps.begin(f"verify {kind}"))
        runs[kind] = SceneRun(found, find_renders(images, found), description.parent)
    steps.begin("report")(0.0, "plots")
    report = output / "report.html"
    write_report(report, ReportInput(chart=runs["chart"], booth=runs["booth"]))
    return {
        "report": str(report),
        "blend": str(output / "booth.blend"),
        "images": [str(path) for run in runs.values() for path in run.renders.values()],
        "seconds": time.perf_counter() - started,
    }


class _Steps:
    """Fits the progress of each step into its share of the whole."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._done = 0.0
        self._share = 0.0

    def begin(self, step: str) -> Progress:
        """Start a step; its own progress runs from 0 to 1."""
        self._done += self._share
        self._share = _SHARES[step]
        done, share = self._done, self._share
        return lambda fraction, what: self._progress(done + share * fraction, f"{step}: {what}")
