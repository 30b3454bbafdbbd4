"""The report of a display: its gamut figures against other ways to find them, its pages, both eyes."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from datetime import date
from pathlib import Path

import displays
import numpy as np
import pytest
from test_report import Reader

from spectral_core import standards
from spectral_core.arrays import Float64Array, frozen
from spectral_core.chromaticities import XYZ_to_xy, uv_to_xy, xy_to_uv
from spectral_core.display.characterising.characterise import Characterisation, characterise
from spectral_core.display.judging.eyes import eye_difference
from spectral_core.display.limits.coverage import (
    area,
    coverage,
    reference_volume,
    reference_xy,
    volume,
)
from spectral_core.display.measuring.measurements import Measurements
from spectral_core.display.models import GammaMatrix
from spectral_core.report.display_data import held_out, ramps
from spectral_core.report.display_findings import what_is_missing, why_chosen

Run = Callable[..., tuple[int, str, str]]
FOUR_COLOURS = "Color,L,x,y\nRed,30,0.65,0.33\nGreen,85,0.24,0.70\nBlue,8,0.14,0.05\nWhite,109,0.30,0.32\n"
DRAWN = 200_000

needs_extra = pytest.mark.usefixtures("_report_extra")


@pytest.fixture
def _report_extra() -> None:
    for module in ("matplotlib", "jinja2"):
        pytest.importorskip(module)


@pytest.fixture(scope="module")
def oled() -> Measurements:
    """Not additive, without noise: what the models leave is theirs."""
    return displays.measure(displays.power_limited, displays.published_protocol())


@pytest.fixture(scope="module")
def oled_found(oled: Measurements) -> Characterisation:
    return characterise(oled)


def written(measured: Measurements, path: Path) -> Path:
    rows = [",".join(f"{value:.9g}" for value in row) for row in np.hstack([measured.codes, measured.XYZ])]
    path.write_text("R,G,B,X,Y,Z\n" + "\n".join(rows) + "\n", encoding="utf-8")
    return path


# Gamuts


def inside(points: Float64Array, triangle: Float64Array) -> np.ndarray:
    """Whether points (n, 2) have only positive barycentric coordinates."""
    first, second, third = triangle
    shares = np.linalg.solve(np.stack([first - third, second - third], axis=1), (points - third).T)
    return (shares >= 0).all(axis=0) & (shares.sum(axis=0) <= 1)


@pytest.mark.parametrize("seed", range(12))
def test_coverage_agrees_with_points_drawn_at_random(seed: int) -> None:
    """Triangles at random, either way round, apart, within each other or crossing."""
    rng = np.random.default_rng(seed)
    gamut, reference = rng.uniform(0, 1, (2, 3, 2))
    reference[:, 0] += 0.4 * (seed % 3)
    root, share = np.sqrt(rng.uniform(size=(DRAWN, 1))), rng.uniform(size=(DRAWN, 1))
    # Even over the reference triangle.
    points = (1 - root) * reference[0] + root * ((1 - share) * reference[1] + share * reference[2])
    fraction = inside(points, gamut).mean()
    found = coverage(gamut, reference)
    # Five standard deviations of a count, and a floor for fractions near 0 and 1.
    assert found.covered == pytest.approx(fraction, abs=5 * np.sqrt(0.25 / DRAWN))
    assert found.area == pytest.approx(area(gamut) / area(reference))
    assert found.covered <= min(1, found.area) + 1e-12


def test_coverage_of_the_reference_gamuts() -> None:
    """The primaries of sRGB, P3 and Rec.2020 are published to two or three decimals, the areas of their triangles
    follow by hand: 0.1121, 0.1520, 0.2119 in x, y. P3's red lies just outside Rec.2020.
    """
    srgb, p3, rec2020 = (reference_xy(name) for name in standards.GAMUTS)
    assert [area(each) for each in (srgb, p3, rec2020)] == pytest.approx([0.11205, 0.1520, 0.21187], abs=1e-5)
    for gamut in (srgb, p3, rec2020):
        for diagram in (np.asarray, xy_to_uv):
            same = coverage(diagram(gamut), diagram(gamut))
            assert (same.covered, same.area) == pytest.approx((1, 1), abs=1e-12)
    assert coverage(srgb, p3).covered == pytest.approx(0.11205 / 0.1520, abs=1e-4)
    assert coverage(p3, srgb).covered == pytest.approx(1, abs=1e-12)
    of_rec2020 = coverage(p3, rec2020)
    assert 0.717 < of_rec2020.covered < of_rec2020.area < 0.718


def test_a_triangle_within_one_apart_from_and_touching_another() -> None:
    triangle = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    assert coverage(triangle / 2, triangle).covered == pytest.approx(0.25)
    assert coverage(triangle, triangle / 2).covered == pytest.approx(1)
    assert coverage(triangle + 2, triangle).covered == 0
    # Mirrored on the longest side: they share that side and no area.
    assert coverage(1 - triangle, triangle).covered == pytest.approx(0, abs=1e-12)
    # The lower left half square cut by the lower right one: a quarter of the square.
    assert coverage(triangle * [-1, 1] + [1, 0], triangle).covered == pytest.approx(0.5)


def test_chromaticities_of_d65() -> None:
    """CIE 15 tabulates u' = 0.1978, v' = 0.4683 for x = 0.3127, y = 0.3290."""
    xy = np.array([0.3127, 0.3290])
    assert xy_to_uv(xy) == pytest.approx([0.1978, 0.4683], abs=5e-5)
    assert uv_to_xy(xy_to_uv(xy)) == pytest.approx(xy, abs=1e-15)


def test_volume_agrees_with_colours_drawn_at_random() -> None:
    """CIELAB colours even in a box are turned into linear sRGB by the formulas of CIE 15."""
    low, high = np.array([0, -90, -110]), np.array([100, 100, 96])
    L, a, b = np.random.default_rng(0).uniform(low, high, (DRAWN, 3)).T
    f = np.stack([(L + 16) / 116 + a / 500, (L + 16) / 116, (L + 16) / 116 - b / 200], axis=-1)
    matrix = standards.srgb_to_XYZ_matrix()
    XYZ = np.where(f > 6 / 29, f**3, (f - 4 / 29) * 3 * (6 / 29) ** 2) * matrix.sum(axis=1)
    linear = XYZ @ np.linalg.inv(matrix).T
    fraction = ((linear >= 0) & (linear <= 1)).all(axis=1).mean()
    drawn = fraction * np.prod(high - low)
    # Four standard deviations of the count: 1.7 %.
    assert reference_volume("sRGB") == pytest.approx(drawn, rel=4 * np.sqrt((1 - fraction) / fraction / DRAWN))


def test_volume_of_a_cube_of_codes() -> None:
    """XYZ chosen such that CIELAB is a box of known size, but for its turn."""

    def box(codes: Float64Array) -> Float64Array:
        L, a, b = 40 + 50 * codes[:, 0], 20 * codes[:, 1], 10 * codes[:, 2]
        return np.stack([(L + 16) / 116 + a / 500, (L + 16) / 116, (L + 16) / 116 - b / 200], axis=-1) ** 3

    assert volume(box, np.ones(3)) == pytest.approx(50 * 20 * 10, rel=1e-6)


# What plots and tables draw from


def test_held_out_colours_are_paired_with_their_predictions() -> None:
    """An additive display without noise is predicted exactly by gamma, matrix and black: a pair that
    does not belong together would differ by tens of dE00.
    """
    found = characterise(displays.measure(displays.additive, displays.published_protocol()), "gamma-matrix-black")
    white_Y = displays.additive(np.ones((1, 3)))[0, 1]
    held = held_out(found)
    assert held is not None
    assert len(held.codes) == int(found.measured.mixed.sum())
    truth = displays.additive(held.codes) / white_Y / found.measured.white_XYZ
    assert held.measured_over_white == pytest.approx(truth, abs=1e-9)
    assert held.predicted_over_white == pytest.approx(truth, abs=1e-6)
    assert held.dE00.max() < 0.01


def test_residuals_of_ramps_have_the_size_and_sign_they_say() -> None:
    """Against the display's own formula for the measured and the published one for the model."""
    found = characterise(displays.measure(displays.additive, displays.published_protocol()))
    grey = next(each for each in ramps(found) if each.name == "grey")
    model = found.models[0].model
    assert isinstance(model, GammaMatrix)
    white_Y = displays.additive(np.ones((1, 3)))[0, 1]
    measured = (grey.codes[:, None] ** displays.GAMMA @ displays.MATRIX[1] + displays.BLACK[1]) / white_Y
    modelled = grey.codes[:, None] ** model.gamma @ model.matrix[1]
    assert grey.residual_percent["gamma-matrix"] == pytest.approx(100 * (modelled - measured) / measured, abs=1e-6)
    # No black: too dark where it is dark.
    assert grey.residual_percent["gamma-matrix"][0] < -2
    assert grey.residual_percent["gamma-matrix-black"] == pytest.approx(np.zeros(len(grey.codes)), abs=1e-6)
    assert grey.black == pytest.approx(displays.BLACK[1] / displays.additive(np.ones((1, 3)))[0, 1])


def test_patches_that_read_no_light_are_counted(oled: Measurements) -> None:
    """Dark codes of a coarse instrument: the three darkest greens, black and one mixed colour read 0."""
    mixed = int(np.flatnonzero(oled.mixed)[0])
    dark = (oled.channel(1) & (oled.codes[:, 1] < 0.06)) | (oled.codes.max(axis=1) == 0)
    dark[mixed] = True
    found = characterise(replace(oled, XYZ=frozen(np.where(dark[:, None], 0.0, oled.XYZ))), "channel-lut")
    # Such a patch in the middle of the gamut is a bad reading: it is put back to see what would be drawn.
    assert [each.unlit for each in ramps(found)] == [0, 3, 0, 0]
    assert all(np.isfinite(each.residual_percent["channel-lut"]).all() for each in ramps(found))
    kept = int(np.flatnonzero((found.measured.codes == found.held_out.codes[0]).all(axis=1))[0])
    XYZ = found.measured.XYZ.copy()
    XYZ[kept] = 0.0
    held = held_out(replace(found, measured=replace(found.measured, XYZ=frozen(XYZ))))
    assert held is not None
    assert held.unlit == 1
    assert np.isnan(held.uv[0]).all()
    assert np.isfinite(held.uv[1:]).all()
    assert np.isfinite(held.measured).all()


def test_arrows_are_enlarged_to_be_seen_and_not_to_run_off(oled_found: Characterisation) -> None:
    held = held_out(oled_found)
    assert held is not None
    length = held.magnification * np.percentile(np.hypot(*held.change[:, 1:].T), 95)
    assert 10 < length <= 30


def test_why_a_model_was_chosen(oled: Measurements, oled_found: Characterisation) -> None:
    assert oled_found.chosen.name in why_chosen(oled_found)
    forced = replace(oled_found, chosen=oled_found.models[0])
    assert "was asked for" in why_chosen(forced)
    difference = forced.chosen.held_out_errors.mean() - min(each.held_out_errors.mean() for each in forced.models)
    assert f"is worse by {difference:.3f} ±" in why_chosen(forced)


def test_what_is_missing_is_named(oled: Measurements, oled_found: Characterisation) -> None:
    assert [each.what for each in what_is_missing(oled_found, oled)] == ["repeats"]
    few = oled.subset((oled.codes > 0.999).any(axis=1) & np.isin(oled.codes, (0, 1)).all(axis=1))
    named = [each.what for each in what_is_missing(characterise(few), few)]
    assert named[:4] == ["enough mixed colours (0)", "ramps of the channels", "black", "repeats"]
    assert "patches for grey-lut-corrected" in named


# Both eyes


def test_eyes_that_differ_by_a_known_amount(oled: Measurements, oled_found: Characterisation) -> None:
    """A dimmer copy differs in luminance alone; one with more blue also in colour."""
    dimmer = replace(oled, XYZ=frozen(0.9 * oled.XYZ))
    same = eye_difference(oled_found, characterise(dimmer), oled, dimmer)
    assert same.luminance_ratio == pytest.approx(0.9, abs=1e-12)
    assert same.white_duv == pytest.approx(0, abs=1e-12)
    assert same.left_for_right.mean == pytest.approx(oled_found.chosen.fit.mean, abs=1e-6)
    bluer = replace(oled, XYZ=frozen(oled.XYZ * [1, 1, 1.05]))
    other = eye_difference(oled_found, characterise(bluer), oled, bluer)
    left, right = (xy_to_uv(XYZ_to_xy(each.white_XYZ)) for each in (oled, bluer))
    assert other.white_duv == pytest.approx(np.hypot(*(left - right)))
    # What the readings themselves differ by, but for what the models leave: at most 3.0 (5 % in Z is 3.3 in b*).
    white = bluer.white_XYZ
    apart = standards.delta_E_2000(standards.XYZ_to_Lab(oled.XYZ, white), standards.XYZ_to_Lab(bluer.XYZ, white))
    for shared in (other.left_for_right, other.right_for_left):
        assert shared.mean == pytest.approx(apart.mean(), abs=oled_found.chosen.fit.mean)
        assert shared.max == pytest.approx(apart.max(), abs=oled_found.chosen.fit.max)
    relative = replace(bluer, unit="relative")
    assert eye_difference(oled_found, oled_found, oled, relative).luminance_ratio is None


# Pages


def page(path: Path) -> tuple[str, Reader]:
    text = path.read_text(encoding="utf-8")
    reader = Reader()
    reader.feed(text)
    assert not reader.open
    assert all(source.startswith("data:image/") for source in reader.sources)
    assert "nan" not in re.sub(r"data:[^\"]*", "", text).casefold().split()
    return text, reader


@needs_extra
def test_the_report_of_one_display(run: Run, oled: Measurements, tmp_path: Path) -> None:
    report = tmp_path / "report.html"
    code, out, _ = run("characterise", written(oled, tmp_path / "oled.csv"), "--report", report, "--json")
    assert code == 0
    document = json.loads(out)
    assert document["report"] == str(report)
    _, reader = page(report)
    chosen = next(each for each in document["models"] if each["name"] == document["model"])
    words = " ".join(reader.text.split())
    assert f"within {chosen['held_out']['mean']:.2f} dE00 on average" in words
    assert f"sum to {100 * document['additivity_error']:.1f} % more than white in luminance" in words
    assert len(reader.sources) == 5  # gamut, ramps, greys, errors, additivity
    assert f"{document['model']} ✓" in reader.cells
    assert "spectral-booth characterise oled.csv --report report.html" in words
    assert str(tmp_path) not in reader.text


@needs_extra
def test_the_report_of_four_colours_says_what_is_missing(run: Run, csv: Callable[..., Path], tmp_path: Path) -> None:
    report = tmp_path / "report.html"
    code, _, _ = run("characterise", csv(FOUR_COLOURS, "hmd.csv"), "--report", report)
    assert code == 0
    _, reader = page(report)
    words = " ".join(reader.text.split())
    assert "is not known" in words
    assert "black was not measured" in words
    assert "No ramp was measured" in words
    assert len(reader.sources) == 2  # gamut, additivity


@needs_extra
def test_the_report_of_both_eyes(run: Run, oled: Measurements, tmp_path: Path) -> None:
    left, right = tmp_path / "left.csv", tmp_path / "right.csv"
    written(oled, left)
    written(replace(oled, XYZ=frozen(0.9 * oled.XYZ)), right)
    report = tmp_path / "report.html"
    code, out, _ = run("characterise", left, "--right", right, "--report", report, "--json")
    assert code == 0
    document = json.loads(out)
    assert document["eyes"]["luminance_ratio"] == pytest.approx(0.9, abs=1e-6)
    assert document["right"]["white_XYZ"][1] == pytest.approx(0.9 * document["white_XYZ"][1], rel=1e-6)
    _, reader = page(report)
    words = " ".join(reader.text.split())
    assert "has 90.0 % of the luminance" in words
    assert "spectral-booth characterise left.csv --right right.csv --report report.html" in words
    assert len(reader.sources) == 8  # gamut and greys of both, the others of each


@needs_extra
def test_the_same_input_gives_the_same_bytes(oled: Measurements, oled_found: Characterisation, tmp_path: Path) -> None:
    from spectral_core.report.display import DisplayReport, Eye, write_display_report

    report = DisplayReport([Eye("display", "<oled>.csv", oled, oled_found)], "command", date(2024, 5, 17))
    paths = [tmp_path / name for name in ("a.html", "b.html")]
    for path in paths:
        write_display_report(path, report)
    assert paths[0].read_bytes() == paths[1].read_bytes()
    text, reader = page(paths[0])
    assert "2024-05-17" in reader.text
    assert "<oled>" not in text


def test_a_right_eye_without_a_report_is_refused(run: Run, csv: Callable[..., Path]) -> None:
    file = csv(FOUR_COLOURS)
    code, out, err = run("characterise", file, "--right", file)
    assert (code, out) == (2, "")
    assert "--report" in err
    assert "Traceback" not in err


def test_a_right_eye_that_contradicts_itself_leaves_no_report(
    run: Run, csv: Callable[..., Path], tmp_path: Path
) -> None:
    bad = csv(FOUR_COLOURS.replace("Red,30", "Red,300"), "bad.csv")
    report = tmp_path / "report.html"
    code, _, err = run("characterise", csv(FOUR_COLOURS), "--right", bad, "--report", report)
    assert code == 2
    assert "brighter than white" in err
    assert not report.exists()
