"""The report of `verify` and `demo`: one self-contained HTML file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from spectral_core.bake import file_name
from spectral_core.errors import OutputError
from spectral_core.files import atomic_path
from spectral_core.lights import Light
from spectral_core.report import findings, numerals, tables
from spectral_core.report.chromaticity import chromaticity_plot
from spectral_core.report.documents import Document
from spectral_core.report.embedding import image_uri
from spectral_core.report.extras import extra
from spectral_core.report.plots import ErrorPoint, PatchError, level_plot, patch_map, spd_plot, time_plot
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
        A scene to look at: plain (level 0) is set beside managed (level 2).
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
    jinja2 = extra("jinja2")
    extra("matplotlib")
    extra("PIL.Image")
    if not report.runs:
        raise OutputError("no light was verified", where=path, remedy="give the result of `verify` for a scene")
    package = resources.files("spectral_core.report")
    environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(lambda name: package.joinpath(name).read_text(encoding="utf-8")),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters.update(fixed=numerals.fixed, small=numerals.small)
    text = environment.get_template("report.html").render(_context(report))
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _context(report: ReportInput) -> dict[str, Any]:
    lights = _lights(report)
    strips = _strips(report, lights)
    return {
        "title": report.title,
        "css": resources.files("spectral_core.report").joinpath("report.css").read_text(encoding="utf-8"),
        "runs": [_run(run) for run in report.runs],
        "light_names": list(lights),
        "booth_strips": strips.get("booth", []),
        "chart_strips": strips.get("chart", []),
        "lights_table": tables.lights_table(lights),
        "published": bool(tables.published_lights().keys() & lights.keys()),
        "spds": [(name, spd_plot(light)) for name, light in lights.items()],
        "chromaticity": chromaticity_plot({name: light.xy() for name, light in lights.items()}),
        "colorchecker": tables.colorchecker_table() if report.chart else None,
        "count": numerals.count,
        "listed": numerals.listed,
    }


def _lights(report: ReportInput) -> dict[str, Light]:
    """All lights of the documents by the names they have there, each once."""
    return {
        light["name"]: resolve_light(light["name"], run.folder) for run in report.runs for light in run.document["lights"]
    }


def _run(run: SceneRun) -> dict[str, Any]:
    """What the template shows of one scene."""
    document = run.document
    points = error_points(document)
    conditions = findings.conditions_met(document)
    return {
        "scene": document["scene"],
        "blender": document.get("blender"),
        "shading": document.get("shading"),
        "lights": [light["name"] for light in document["lights"]],
        "worst": {level: findings.worst(document, level) for level in tables.LEVELS},
        "switch_ms": _mean_switch_ms(document),
        "channels": tables.channels_table(document),
        "differences": tables.difference_table(document),
        "published": tables.published_table(document),
        "textures": tables.textures_table(document),
        "stages": tables.stages_table(document),
        "times": tables.time_table(document),
        "level_plot": level_plot(points),
        "time_plot": time_plot(points),
        "patch_maps": [(name, patch_map(each)) for name, each in patch_errors(document).items()],
        "conditions": conditions,
        "kinds": findings.kinds_met(conditions),
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
                PatchError(
                    exact=tuple(each[0]["exact_rgb_8bit"]),
                    rendered={level: tuple(one["rendered_rgb_8bit"]) for level, one in zip(readings, each, strict=True)},
                    dE00={level: one["dE00"] for level, one in zip(readings, each, strict=True)},
                    in_gamut=each[0]["in_gamut"],
                )
                for each in zip(*readings.values(), strict=True)
            ]
    return found


def _mean_switch_ms(document: Document) -> float:
    seconds = [light["level2"]["switch_seconds"] for light in document["lights"] if "level2" in light]
    return 1000 * sum(seconds) / len(seconds) if seconds else float("nan")


def _strips(report: ReportInput, lights: Mapping[str, Light]) -> dict[str, list[_Strip]]:
    """Renders side by side: all levels of the chart; the booth plain and managed."""
    plans = {"chart": (report.chart, tables.LEVELS), "booth": (report.booth, (0, 2))}
    wanted = {
        scene: [key for light in run.document["lights"] for level in levels if (key := (light["name"], level)) in run.renders]
        for scene, (run, levels) in plans.items()
        if run is not None
    }
    total = max(1, sum(map(len, wanted.values())))
    allowance = int(IMAGE_BUDGET_BYTES / _BASE64_GROWTH / total)
    found: dict[str, list[_Strip]] = {}
    for scene, keys in wanted.items():
        run = plans[scene][0]
        assert run is not None
        for light in dict.fromkeys(name for name, _ in keys):
            pictures = tuple(
                _picture(scene, light, level, run.renders[name, level], allowance)
                for name, level in keys
                if name == light
            )
            found.setdefault(scene, []).append(_Strip(light, _facts(lights[light]), pictures))
    return found


def _picture(scene: str, light: str, level: int, path: Path, allowance_bytes: int) -> _Picture:
    chart = {0: "level 0: white lamps", 1: "level 1: lamps of the light's RGB", 2: "level 2: spectral"}
    label = chart[level] if scene == "chart" else {0: "plain", 1: "level 1", 2: "managed"}[level]
    return _Picture(label, image_uri(path, allowance_bytes), f"{scene} under {light}, {label}")


def _facts(light: Light) -> str:
    quality = light.quality()
    cct = f"{quality.cct_K:.0f} K" if quality.cct_K is not None else "no CCT"
    return cct if quality.rf is None else f"{cct}, Rf {quality.rf:.1f}"
