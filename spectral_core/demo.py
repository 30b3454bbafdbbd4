"""The demonstration: both scenes built, rendered, verified and reported in one go."""

from __future__ import annotations

import time
from collections.abc import Callable
from importlib import resources
from pathlib import Path

from spectral_core.blender_process import run_verb
from spectral_core.errors import SceneError
from spectral_core.report.documents import Document

Progress = Callable[[float, str], None]

# Shares of the whole run, from a trial on two cores.
_SHARES = {"build chart": 0.05, "verify chart": 0.30, "build booth": 0.10, "verify booth": 0.53, "report": 0.02}


def run_demo(output: Path, progress: Progress) -> Document:
    """Build, render and verify the chart and the booth into `output`, and write the report."""
    started = time.perf_counter()
    output.mkdir(parents=True, exist_ok=True)
    steps = _Steps(progress)
    chart, booth = output / "colorchecker.blend", output / "booth.blend"
    run_verb(["build", str(scene_file("colorchecker")), "-o", str(chart)], steps.begin("build chart"))
    chart_images = output / "chart"
    chart_result = run_verb(["verify", str(chart), "--images", str(chart_images)], steps.begin("verify chart"))
    run_verb(["build", str(scene_file("booth")), "-o", str(booth)], steps.begin("build booth"))
    booth_images = output / "booth"
    booth_result = run_verb(
        ["verify", str(booth), "--level", "1", "--level", "2", "--images", str(booth_images)],
        steps.begin("verify booth"),
    )
    steps.begin("report")(0.0, "writing the report")
    return {
        "report": "",
        "blend": str(booth),
        "images": [],
        "seconds": time.perf_counter() - started,
    }


def scene_file(name: str) -> Path:
    """A scene description that comes with the project, from a checkout or an installed package."""
    for folder in (
        Path(__file__).parent.parent / "blend_scenes",
        Path(str(resources.files("spectral_core"))) / "scenes",
    ):
        path = folder / f"{name}.toml"
        if path.is_file():
            return path
    raise SceneError(f"no scene '{name}' comes with this installation", remedy="give the path of a TOML file")


class _Steps:
    """Fits the progress of each step into its share of the whole."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._done = 0.0
        self._share = 0.0

    def begin(self, step: str) -> Progress:
        self._done += self._share
        self._share = _SHARES[step]
        return lambda fraction, what: self._progress(self._done + self._share * fraction, f"{step}: {what}")
