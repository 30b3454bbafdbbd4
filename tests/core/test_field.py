from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from spectral_core.display.field import field_report, fit_map, read_field
from spectral_core.errors import DisplayError

Run = Callable[..., tuple[int, str, str]]
GRID = np.array([[x, y] for x in range(-20, 21, 10) for y in range(-20, 21, 10)], dtype=np.float64)


def luminance(points: np.ndarray) -> np.ndarray:
    """120 cd/m2 in the centre, falling with the square of the angle, brighter to the right."""
    return np.asarray(120 * (1 - 4e-4 * (points**2).sum(axis=1) + 2e-3 * points[:, 0]))


def write(path: Path, columns: str, table: np.ndarray) -> Path:
    path.write_text("\n".join([columns, *(",".join(f"{value:.12g}" for value in row) for row in table)]))
    return path


def test_a_known_field_is_found(tmp_path: Path) -> None:
    """Without noise the quadratic is exact: 1e-9 is rounding and what the file's digits leave."""
    path = write(tmp_path / "f.csv", "x_deg,y_deg,Y", np.column_stack([GRID, luminance(GRID)]))
    (white,) = field_report(read_field(path)).patches
    assert white.map is not None
    assert white.map.degree == 2
    assert white.map.held_out_rms < 1e-9
    at = np.array([[3.0, -7.0], [15.0, 15.0]])
    np.testing.assert_allclose(white.map.at(at), luminance(at) / 120, atol=1e-9)
    assert white.luminance.max == pytest.approx(1.0)
    assert white.luminance.min == pytest.approx(1 - 4e-4 * 800 - 0.04)
    assert white.tilt_percent_per_degree == (pytest.approx(0.2), pytest.approx(0.0, abs=1e-9))
    away = np.hypot(*GRID.T)
    assert white.fall_off_percent_per_degree == pytest.approx(100 * 4e-4 * (away**3).sum() / (away**2).sum())
    assert (white.dE00, white.delta_uv) == (None, None)


def test_the_held_out_error_is_that_of_unseen_points() -> None:
    """Readings of 0.5 %: what is held out is off by the noise and a little more, and the map's own
    error on points never read is below the noise."""
    unseen = np.random.default_rng(1).uniform(-18, 18, (500, 2))
    held_out, actual = [], []
    for seed in range(10):
        noise = 1 + np.random.default_rng(seed).normal(0, 0.005, len(GRID))
        found = fit_map(GRID, luminance(GRID) / 120 * noise)
        assert found is not None
        assert found.degree == 2
        held_out.append(found.held_out_rms)
        actual.append(np.sqrt(((found.at(unseen) - luminance(unseen) / 120) ** 2).mean()))
    assert 0.004 < np.mean(held_out) < 0.0075
    assert np.mean(actual) < 0.003


def test_a_uniform_field_gets_a_constant() -> None:
    found = fit_map(GRID, np.ones(len(GRID)))
    assert found is not None
    assert (found.degree, found.held_out_rms) == (0, pytest.approx(0, abs=1e-12))


def test_chromaticity_shifts(tmp_path: Path) -> None:
    """u' = 4x / (-2x + 12y + 3) by hand; equal luminances leave only the shift."""
    points = np.array([[0, 0], [10, 0], [0, 10], [-10, 0], [0, -10], [7, 7]])
    xyY = np.tile([0.3127, 0.3290, 100.0], (6, 1))
    xyY[1, 0] += 0.003
    xyY[2, 2] = 80.0
    (white,) = field_report(
        read_field(write(tmp_path / "f.csv", "x_deg,y_deg,x,y,Y", np.column_stack([points, xyY])))
    ).patches

    def uv(x: float, y: float) -> np.ndarray:
        return np.array([4 * x, 9 * y]) / (-2 * x + 12 * y + 3)

    assert white.delta_uv is not None
    assert white.delta_uv.max == pytest.approx(np.hypot(*(uv(0.3157, 0.329) - uv(0.3127, 0.329))), rel=1e-6)
    assert white.dE00 is not None
    assert white.dE00_chromatic is not None
    # Y = 0.8 of white is L* = 91.68; S_L = 1 + 0.015 d^2 / sqrt(20 + d^2) at the mean L* less 50 (CIEDE2000).
    d = (100 + 91.68) / 2 - 50
    assert white.dE00.max == pytest.approx((100 - 91.68) / (1 + 0.015 * d**2 / np.sqrt(20 + d**2)), abs=0.01)
    assert 1 < white.dE00_chromatic.max < 4


def test_patches_are_told_apart(tmp_path: Path) -> None:
    """White and red, red falling off faster, codes in 0..255."""
    rows = [
        [x, y, *code, *(np.array(XYZ) * (1 - fall * np.hypot(x, y)))]
        for x, y in GRID
        for code, XYZ, fall in (((255, 0, 0), (50, 25, 2), 0.01), ((255, 255, 255), (95, 100, 108), 0.005))
    ]
    report = field_report(read_field(write(tmp_path / "f.csv", "x_deg,y_deg,R,G,B,X,Y,Z", np.array(rows))))
    assert [each.name for each in report.patches] == ["white", "red"]
    assert [each.fall_off_percent_per_degree for each in report.patches] == [pytest.approx(0.5), pytest.approx(1.0)]


def test_points_on_a_line_get_no_map(tmp_path: Path) -> None:
    points = np.array([[x, 0.0] for x in range(-20, 21, 5)])
    report = field_report(
        read_field(write(tmp_path / "f.csv", "x_deg,y_deg,Y", np.column_stack([points, luminance(points)])))
    )
    assert report.patches[0].map is None
    assert report.patches[0].tilt_percent_per_degree is None
    assert any("no map" in each for each in report.warnings)


def test_repeats_are_held_out_together(tmp_path: Path) -> None:
    """Every point read three times: the same map, and the centre is the mean."""
    table = np.repeat(np.column_stack([GRID, luminance(GRID)]), 3, axis=0)
    table[:, 2] *= np.tile([0.99, 1.0, 1.01], len(GRID))
    (white,) = field_report(read_field(write(tmp_path / "f.csv", "x_deg,y_deg,Y", table))).patches
    assert white.centre_Y == pytest.approx(120)
    assert white.map is not None
    assert white.map.degree == 2
    # Each reading is off by 1 % of some 0.85, two of three times.
    assert white.map.held_out_rms == pytest.approx(0.01 * np.sqrt(2 / 3) * 0.86, rel=0.05)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no rows"),
        ("x_deg,y_deg,Y\n0,0,100\n", "one point"),
        ("x,y,Y\n0,0,100\n1,1,90\n", "header"),
        ("x_deg,y_deg,Y\n0,0,100\n1,1\n", "line 3"),
        ("x_deg,y_deg,Y\n0,0,100\n1,1,nan\n", "line 3"),
        ("x_deg,y_deg,Y\n0,0,100\n1,1,dim\n", "line 3"),
        ("x_deg,y_deg,Y\n0,0,100\n1,1,0\n", "not above 0"),
        ("x_deg,y_deg,Y\n0,0,100\n0,0,99\n", "one point"),
        ("x_deg,y_deg,Y\n10,0,100\n20,0,99\n", "no nearer to the centre"),
        ("x_deg,y_deg,Y\n0,0,100\n1000,0,99\n", "degrees"),
        ("x_deg,y_deg,x,y,Y\n0,0,0.3,0,100\n1,0,0.3,0.3,99\n", "not above 0"),
        ("x_deg,y_deg,R,G,B,X,Y,Z\n0,0,1,0,0,50,25,2\n9,0,1,0,0,50,25,2\n", "white"),
        (f"x_deg,y_deg,Y\n0,0,100\n1,1,{'9' * 200_000}\n", "is no CSV"),
    ],
)
def test_unusable_readings_get_one_line(run: Run, tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "f.csv"
    path.write_text(text)
    code, out, err = run("field", path)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert message in err


def test_the_command_and_its_picture(run: Run, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    image = pytest.importorskip("PIL.Image")
    path = write(tmp_path / "f.csv", "x_deg,y_deg,Y", np.column_stack([GRID, luminance(GRID)]))
    code, out, _ = run("field", path, "--plot", tmp_path / "f.png", "--json")
    found = json.loads(out)
    assert code == 0
    assert found["points"] == 25
    assert set(found["patches"][0]) >= {"luminance", "fall_off_percent_per_degree", "dE00", "delta_uv", "map"}
    with image.open(tmp_path / "f.png") as picture:
        pixels = np.asarray(picture.convert("RGB")).astype(int)
    # Yellow (bright) and blue-green (dark) of the map cover a good part of the picture.
    assert ((pixels[..., 0] > 200) & (pixels[..., 2] < 120)).mean() > 0.02
    assert (pixels[..., 2] > pixels[..., 0] + 20).mean() > 0.05
    assert "white" in run("field", path)[1]


@pytest.mark.parametrize("Y", [np.full(25, 80.0), 80 - np.arange(25.0)])
def test_pictures_of_flat_fields_and_of_lines(run: Run, tmp_path: Path, Y: np.ndarray) -> None:
    pytest.importorskip("matplotlib")
    points = GRID if Y[0] == Y[-1] else np.column_stack([np.arange(25.0) - 12, np.zeros(25)])
    path = write(tmp_path / "f.csv", "x_deg,y_deg,Y", np.column_stack([points, Y]))
    assert run("field", path, "--plot", tmp_path / "f.png")[0] == 0
    assert (tmp_path / "f.png").stat().st_size > 5000


def test_a_centre_beside_the_centre_is_told() -> None:
    from spectral_core.display.field import FieldReadings

    points = GRID + np.array([1.0, 0.0])
    report = field_report((FieldReadings("white", points, luminance(points), None),))
    assert any("nothing was read at the centre" in each for each in report.warnings)
    with pytest.raises(DisplayError):
        field_report((FieldReadings("white", points + 5, luminance(points), None),))
