"""The HTML report: complete, self-contained, the same on every run."""

from __future__ import annotations

import importlib
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from spectral_core.errors import MissingExtraError, OutputError
from spectral_core.imaging import write_png
from spectral_core.report import findings, numerals
from spectral_core.report.html import ReportInput, SceneRun, find_renders, write_report
from spectral_core.report.published import published_differences, published_hyperspectral_srgb, published_lights
from spectral_core.report.tables import colorchecker_srgb
from spectral_core.surfaces import colorchecker_maker_srgb

needs_extra = pytest.mark.usefixtures("_report_extra")
VOID = {"meta", "img", "br", "link", "hr", "input"}


@pytest.fixture
def _report_extra():
    for module in ("matplotlib", "jinja2", "PIL"):
        pytest.importorskip(module)


def level(error: float, in_gamut: int = 2) -> dict:
    """A level whose figures are all told apart: red 1, green 2, blue 3 times the error."""
    spread = {each: {"mean": error * n, "sd": error * n / 2, "max": error * n * 3} for n, each in enumerate("RGB", 1)}
    readings = [
        {
            "name": f"chart 0{index}",
            "surface": f"colorchecker {index}",
            "rendered_rgb_8bit": [100.0 + error, 90.0, 80.0],
            "exact_rgb_8bit": [100.0, 90.0, -80.0 if index > in_gamut else 80.0],
            "dE00": error / 2,
            "in_gamut": index <= in_gamut,
        }
        for index in (1, 2, 3)
    ]
    return {
        "rgb8": spread,
        "rgb8_in_gamut": spread,
        "dE00": {"mean": error, "p95": error * 2, "max": error * 4},
        "dE00_in_gamut": {"mean": error / 2, "p95": error, "max": error * 2 if in_gamut else 0.0},
        "stages": {each: {"mean": error / 7, "sd": 0, "max": error / 3} for each in ("8-bit rounding", "material")},
        "patches": 3,
        "in_gamut": in_gamut,
        "switch_seconds": 0.0123,
        "render_seconds": 4.56,
        "readings": readings,
    }


def document(scene: str = "Chart") -> dict:
    lights = [
        {"name": "D65", "level0": level(3.11), "level1": level(2.22), "level2": level(0.0137), "conditions": []},
        {
            "name": "two-peaks-d65",
            "level0": level(31.1),
            "level1": level(22.2),
            "level2": level(0.0273, in_gamut=0),
            "textures": {"lemon": {"mean_colour": 0.07, "pixels": {"mean": 0.314, "sd": 0.1, "max": 2.718}}},
            "conditions": [
                "spectral lines at 456.00, 569.00 nm, summed at their exact wavelengths",
                "outside linear Rec.709, negative channels shown as 0: colorchecker cyan, colorchecker <blue>",
                "ends of reflectances repeated beyond their bands: 0.027% of the white's X, Y or Z at most",
            ],
        },
    ]
    stages = {each: {"mean": 0.1234, "max": 0.4321} for each in ("8-bit rounding", "material")}
    return {
        "scene": scene,
        "blender": "5.0.1",
        "shading": "forward",
        "file": "/secret/place/chart.blend",
        "lights": lights,
        "stages": stages,
        "left_out": ["images for 26 uniform surfaces: each is one constant"],
    }


class Reader(HTMLParser):
    """Checks nesting; collects cells, attributes that load something, and the text."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.sources: list[str] = []
        self.cells: list[str] = []
        self.text = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.sources += [value or "" for name, value in attrs if name in ("src", "href", "srcset", "data")]
        if tag == "td":
            self.cells.append("")
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data
        if self.open and self.open[-1] == "td":
            self.cells[-1] += data


def read(path: Path) -> Reader:
    reader = Reader()
    reader.feed(path.read_text(encoding="utf-8"))
    reader.close()
    assert not reader.open
    return reader


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    for module in ("matplotlib", "jinja2", "PIL"):
        pytest.importorskip(module)
    folder = tmp_path_factory.mktemp("report")
    for name in ("D65_level0", "D65_level2", "two-peaks-d65_level2"):
        write_png(folder / f"{name}.png", np.full((4, 6, 3), 0.25, dtype=np.float32))
    renders = find_renders(folder, document())
    assert set(renders) == {("D65", 0), ("D65", 2), ("two-peaks-d65", 2)}
    path = folder / "report.html"
    write_report(path, ReportInput(SceneRun(document(), renders), SceneRun(document("Light booth"), renders)))
    return path


def test_is_well_formed_and_self_contained(page: Path):
    reader = read(page)
    assert reader.sources
    assert all(source.startswith("data:image/") for source in reader.sources)
    text = page.read_text(encoding="utf-8")
    assert not re.search(r"url\(|@import|<script|<link", text)
    assert "/secret/place" not in text
    assert str(page.parent) not in text


def test_shows_every_light_and_the_figures_of_the_document(page: Path):
    reader = read(page)
    for name in ("D65", "two-peaks-d65"):
        assert name in reader.cells
    for cell in ("2.22 ± 1.11", "6.66", "0.014", "0.07 / 0.31", "12.3", "4.56", "22.20 ± 11.10", "0 of 3", "0.43"):
        assert cell in reader.cells, cell
    assert "456.00, 569.00 nm" in reader.text
    assert "2 surfaces: cyan, <blue>" in reader.text
    assert "0.027 % of the white" in reader.text
    assert "images for 26 uniform surfaces" in reader.text
    assert "Blender 5.0.1" in reader.text
    assert "Light booth" in reader.text


def test_published_figures_stand_beside_ours(page: Path):
    reader = read(page)
    assert "30 ± 29" in reader.cells
    assert {"published", "6503"} <= set(reader.cells)
    assert "3.42" in reader.cells


def test_headline_names_the_worst_light(page: Path):
    # Largest level-2 error: blue, 0.0273 x 3 x 3 = 0.2457 levels. dE00 counts D65 only, since
    # nothing of the other light is in gamut: 0.0137 x 2.
    worst = findings.worst(document(), 2)
    assert worst is not None
    assert worst.levels == pytest.approx(0.2457)
    assert worst.levels_light == "two-peaks-d65"
    assert (worst.dE00_light, worst.dE00) == ("D65", pytest.approx(0.0274))
    assert "0.25 of an 8-bit sRGB level before rounding (two-peaks-d65)" in " ".join(read(page).text.split())


def test_headline_owns_up_to_textures(page: Path):
    text = " ".join(read(page).text.split())
    assert "off by 0.07 levels at most (lemon, two-peaks-d65); single pixels by 0.31 on average" in text


@needs_extra
@pytest.mark.parametrize("scene", ["chart", "booth"])
def test_one_scene_is_enough_and_pages_are_reproducible(tmp_path: Path, scene: str):
    short = document()
    short["lights"] = short["lights"][:1]
    del short["lights"][0]["level0"], short["lights"][0]["level1"]["readings"]
    run = SceneRun(json.loads(json.dumps(short)))
    report = replace(ReportInput(), **{scene: run})
    for name in ("a.html", "b.html"):
        write_report(tmp_path / name, report)
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()
    reader = read(tmp_path / "a.html")
    assert "No renders were kept." in reader.text
    assert ("ColorChecker reflectances under D65" in reader.text) == (scene == "chart")


@needs_extra
def test_nothing_to_report_is_refused(tmp_path: Path):
    with pytest.raises(OutputError, match="no light was verified"):
        write_report(tmp_path / "report.html", ReportInput())
    assert not (tmp_path / "report.html").exists()


@needs_extra
def test_a_broken_render_is_named(tmp_path: Path):
    broken = tmp_path / "broken.png"
    broken.write_bytes(b"no picture")
    short = document()
    short["lights"] = short["lights"][:1]
    with pytest.raises(OutputError, match=r"broken\.png"):
        write_report(tmp_path / "report.html", ReportInput(SceneRun(short, {("D65", 2): broken})))


@pytest.mark.parametrize("missing", ["jinja2", "matplotlib", "PIL"])
def test_missing_packages_are_named_with_the_remedy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, missing: str):
    real = importlib.import_module

    def refuse(name: str, package: str | None = None):
        if name.split(".")[0] == missing:
            raise ImportError(name)
        return real(name, package)

    monkeypatch.setattr(importlib, "import_module", refuse)
    with pytest.raises(MissingExtraError, match=r"pip install 'spectral-booth\[report\]'"):
        write_report(tmp_path / "report.html", ReportInput(SceneRun(document())))


@needs_extra
def test_a_light_from_a_file_is_shown_by_the_name_of_its_file(tmp_path: Path):
    lamp = tmp_path / "my lamp.csv"
    lamp.write_text("nm,power\n" + "\n".join(f"{nm},1" for nm in range(380, 785, 5)), encoding="utf-8")
    picture = tmp_path / "picture.png"
    write_png(picture, np.full((2, 2, 3), 0.5, dtype=np.float32))
    short = document()
    short["lights"] = [{**short["lights"][0], "name": str(lamp)}]
    write_report(tmp_path / "report.html", ReportInput(SceneRun(short, {(str(lamp), 2): picture})))
    reader = read(tmp_path / "report.html")
    assert "my lamp.csv" in reader.cells
    assert str(tmp_path) not in (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "No renders were kept." not in reader.text


def test_published_tables_have_our_names():
    assert set(published_lights()) == {"D65", "D50", "d65-simulator", "two-peaks-d65"}
    assert published_differences()["two-peaks-d65", 1].mean == (30.0, 9.0, 6.5)
    # Printed as 3.4, 1.6, 1.9 in the publication.
    means = np.abs(published_hyperspectral_srgb() - colorchecker_maker_srgb()).mean(axis=0)
    assert means == pytest.approx([3.4, 1.6, 1.9], abs=0.05)


def test_our_reflectances_give_the_published_colours():
    # Two instruments and two charts: a mean of 0.6 of a level is what measurement allows.
    apart = np.abs(np.clip(colorchecker_srgb(), 0, 255) - published_hyperspectral_srgb()).mean(axis=0)
    assert (apart < 0.6).all()


@pytest.mark.parametrize(
    ("value", "text"), [(0.0, "0"), (1.24e-6, "1.2 × 10⁻⁶"), (0.0772, "0.077"), (101.2, "101"), (-0.5, "−0.50")]
)
def test_small_numbers(value: float, text: str):
    assert numerals.small(value) == text


def test_fixed_numbers_have_no_negative_zero_and_a_dash_for_none():
    assert numerals.fixed(-0.0001, 2) == "0.00"
    assert numerals.fixed(None, 1) == numerals.fixed(float("nan"), 1) == "–"
