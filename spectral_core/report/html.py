"""The report of `verify` and `demo`: one self-contained HTML file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path, PureWindowsPath
from typing import Any

import numpy as np

from spectral_core.baking import file_name
from spectral_core.errors import OutputError
from spectral_core.lights import Light, LightQuality
from spectral_core.report import findings, tables
from spectral_core.report.chromaticity import chromaticity_plot
from spectral_core.report.documents import Document
from spectral_core.report.embedding import image_uri
from spectral_core.report.extras import extra
from spectral_core.report.pages import write_page
from spectral_core.report.plots import ErrorPoint, PatchError, level_plot, patch_map, spd_plot, time_plot
from spectral_core.report.published import published_lights
from spectral_core.scene import resolve_light

# Renders may take this much of the page, base64 included, so that it can be mailed.
IMAGE_BUDGET_BYTES = 6_000_000
_BASE64_GROWTH = 4 / 3

Renders = Mapping[tuple[str, int], Path]


@dataclass(frozen=True)
class SceneRun:
    """What `verify` found in one scene.

    Attributes
    ----------
    document
        The JSON of `verify`.
    renders
        Pictures by (light, level); those that are missing are left out. `find_renders` collects
        what `verify` kept.
    folder
        Where lights given as files are relative to: the folder of the scene description.
    """

    document: Document
    renders: Renders = field(default_factory=dict)
    folder: Path = Path()


@dataclass(frozen=True)
class ReportInput:
    """What a report is made of; one of the two scenes may be missing.

    Attributes
    ----------
    chart
        A scene with single patches, the ColorChecker: its three levels are set side by side.
    booth
        A scene to look at: plain (level 1) is set beside managed (level 2).
    title
        The heading.
    """

    chart: SceneRun | None = None
    booth: SceneRun | None = None
    title: str = "Spectral Booth: rendered colours against theory"

    @property
    def runs(self) -> list[SceneRun]:
        """The scenes that are there, the chart first."""
        return [each for each in (self.chart, self.booth) if each is not None and each.document.get("lights")]


@dataclass(frozen=True)
class _Picture:
    label: str
    uri: str
    alt: str


@dataclass(frozen=True)
class _Strip:
    """Renders of one light side by side."""

    light: str
    facts: str
    pictures: tuple[_Picture, ...]


def find_renders(folder: Path, document: Document) -> dict[tuple[str, int], Path]:
    """The pictures that ``verify --images`` left in a folder, by (light, level)."""
    named = {
        (light["name"], level): folder / f"{file_name(light['name'])}_level{level}.png"
        for light in document["lights"]
        for level in tables.levels_of(light)
    }
    return {key: path for key, path in named.items() if path.is_file()}


def write_report(path: Path, report: ReportInput) -> None:
    """Write the report as one HTML file without external resources, the same bytes for the same input.

    Raises
    ------
    MissingExtraError
        If matplotlib, jinja2 or Pillow is not installed.
    OutputError
        If there is nothing to report, a render cannot be read, or the file cannot be written.
    LightError, SpectrumError
        If a light of the documents cannot be found any more.
    """
    extra("PIL.Image")
    if not report.runs:
        raise OutputError("no light was verified", where=path, remedy="give the result of `verify` for a scene")
    write_page(path, "report.html", _context(report))


def _context(report: ReportInput) -> dict[str, Any]:
    lights = _lights(report)
    report = replace(report, chart=_with_short_names(report.chart), booth=_with_short_names(report.booth))
    qualities = {name: light.quality() for name, light in lights.items()}
    strips = _strips(report, qualities)
    return {
        "title": report.title,
        "runs": [_run(run, run is report.chart) for run in report.runs],
        "light_names": list(lights),
        "booth_strips": strips.get("booth", []),
        "chart_strips": strips.get("chart", []),
        "lights_table": tables.lights_table(lights, qualities),
        "published": bool(published_lights().keys() & lights.keys()),
        "spds": [(name, spd_plot(light)) for name, light in lights.items()],
        "chromaticity": chromaticity_plot({name: light.xy() for name, light in lights.items()}),
        "colorchecker": tables.colorchecker_table() if report.chart else None,
        "kinds": findings.kinds_met([run.document for run in report.runs]),
    }


def _lights(report: ReportInput) -> dict[str, Light]:
    """All lights of the documents by the names the page gives them, each once."""
    names = ((light["name"], run.folder) for run in report.runs for light in run.document["lights"])
    return {_short_name(name): resolve_light(name, folder) for name, folder in names}


def _short_name(name: str) -> str:
    """A light from a file goes by the file's name: folders say nothing to a reader, or too much."""
    return PureWindowsPath(name).name


def _with_short_names(run: SceneRun | None) -> SceneRun | None:
    if run is None:
        return None
    lights = [{**light, "name": _short_name(light["name"])} for light in run.document.get("lights", [])]
    renders = {(_short_name(light), level): path for (light, level), path in run.renders.items()}
    return replace(run, document={**run.document, "lights": lights}, renders=renders)


def _run(run: SceneRun, chart: bool) -> dict[str, Any]:
    """What the template shows of one scene."""
    document = run.document
    points = error_points(document)
    return {
        "scene": document["scene"],
        "blender": document.get("blender"),
        "shading": document.get("shading"),
        "lights": [light["name"] for light in document["lights"]],
        "worst": {level: findings.worst(document, level) for level in tables.LEVELS},
        "worst_texture": findings.worst_texture(document),
        "switch_ms": {level: _mean_switch_ms(document, level) for level in tables.LEVELS},
        "channels": tables.channels_table(document),
        "differences": tables.difference_table(document),
        "published": tables.published_table(document) if chart else None,
        "textures": tables.textures_table(document),
        "stages": tables.stages_table(document),
        "times": tables.time_table(document),
        "level_plot": level_plot(points),
        "time_plot": time_plot(points),
        "patch_maps": [(name, patch_map(each)) for name, each in patch_errors(document).items()],
        "conditions": findings.conditions_met(document),
        "left_out": document.get("left_out", []),
    }


def error_points(document: Document) -> list[ErrorPoint]:
    """The points of the plots: one per light and level; lights with nothing in gamut have no dE00."""
    points = []
    for light in document["lights"]:
        for level in tables.levels_of(light):
            result = light[f"level{level}"]
            inside, rgb8 = result["dE00_in_gamut"], result["rgb8"]
            points.append(
                ErrorPoint(
                    light["name"],
                    level,
                    inside["mean"] if result["in_gamut"] else float("nan"),
                    inside["max"] if result["in_gamut"] else float("nan"),
                    float(np.mean([rgb8[each]["mean"] for each in tables.CHANNELS])),
                    max(rgb8[each]["max"] for each in tables.CHANNELS),
                    result["switch_seconds"] + result["render_seconds"],
                )
            )
    return points


def patch_errors(document: Document) -> dict[str, list[PatchError]]:
    """Per light its patches, where the document has them for some level."""
    found = {}
    for light in document["lights"]:
        readings = {
            level: light[f"level{level}"]["readings"]
            for level in (1, 2)
            if light.get(f"level{level}", {}).get("readings")
        }
        if readings:
            found[light["name"]] = [
                _patch_error(dict(zip(readings, each, strict=True))) for each in zip(*readings.values(), strict=True)
            ]
    return found


def _patch_error(readings: Mapping[int, Any]) -> PatchError:
    """One patch from its readings by level; the exact colour is the same at all of them."""
    one = next(iter(readings.values()))
    return PatchError(
        exact=tuple(one["exact_rgb_8bit"]),
        rendered={level: tuple(each["rendered_rgb_8bit"]) for level, each in readings.items()},
        dE00={level: each["dE00"] for level, each in readings.items()},
        in_gamut=one["in_gamut"],
    )


def _mean_switch_ms(document: Document, level: int) -> float:
    key = f"level{level}"
    seconds = [light[key]["switch_seconds"] for light in document["lights"] if key in light]
    return 1000 * sum(seconds) / len(seconds) if seconds else float("nan")


def _strips(report: ReportInput, qualities: Mapping[str, LightQuality]) -> dict[str, list[_Strip]]:
    """Renders side by side: all levels of the chart; the booth plain and managed."""
    plans = [("chart", report.chart, tables.LEVELS), ("booth", report.booth, (1, 2))]
    shown = {
        scene: _shown(run, levels) for scene, run, levels in plans if run is not None and run.document.get("lights")
    }
    pictures = sum(len(levels) for lights in shown.values() for levels in lights.values())
    allowance = int(IMAGE_BUDGET_BYTES / _BASE64_GROWTH / max(1, pictures))
    return {
        scene: [
            _Strip(
                light,
                _facts(qualities[light]),
                tuple(_picture(scene, light, level, path, allowance) for level, path in levels.items()),
            )
            for light, levels in lights.items()
        ]
        for scene, lights in shown.items()
    }


def _shown(run: SceneRun, levels: Sequence[int]) -> dict[str, dict[int, Path]]:
    """The renders there are, by light and level, in the order of the document."""
    names = [light["name"] for light in run.document["lights"]]
    found = {
        name: {level: run.renders[name, level] for level in levels if (name, level) in run.renders} for name in names
    }
    return {name: renders for name, renders in found.items() if renders}


def _picture(scene: str, light: str, level: int, path: Path, allowance_bytes: int) -> _Picture:
    chart = {0: "level 0: white lamps", 1: "level 1: lamps of the light's RGB", 2: "level 2: spectral"}
    label = chart[level] if scene == "chart" else {1: "plain: RGB lamps, RGB materials", 2: "managed: spectral"}[level]
    return _Picture(label, image_uri(path, allowance_bytes), f"{scene} under {light}, {label}")


def _facts(quality: LightQuality) -> str:
    cct = f"{quality.cct_K:.0f} K" if quality.cct_K is not None else "no CCT"
    return cct if quality.rf is None else f"{cct}, Rf {quality.rf:.1f}"
