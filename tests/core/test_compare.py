"""Predicted against measured colours: statistics, pairing, plots."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import displays
import numpy as np
import pytest

from spectral_core.cli.compare import compare_document
from spectral_core.display import DisplayProfile, write_profile
from spectral_core.display.comparison import Colours, compare, read_colours
from spectral_core.display.models import GammaMatrix

Run = Callable[..., tuple[int, str, str]]
Csv = Callable[..., Path]
D65 = "95.047,100,108.883"
WHITE = np.array([95.047, 100.0, 108.883])


def test_ishihara_dots_as_published(run: Run, measured_data: Path, csv: Csv) -> None:
    """The ten dE00 of the published plate, which is printed with them against the wrong rows: as a set
    within 0.06, for chromaticities of four decimals and luminances of one.
    """
    table = [
        line.split(",")
        for line in (measured_data / "published/ishihara_plate3_dots_d65.csv").read_text().splitlines()[1:]
    ]
    files = [
        csv("\n".join(["name,x,y,Y", *(",".join([row[0], *row[at : at + 3]]) for row in table)]), f"{at}.csv")
        for at in (1, 4)
    ]
    code, out, _ = run("compare", *files, "--white", D65, "--json")
    document = json.loads(out)
    assert code == 0
    ours = sorted(each["dE00"] for each in document["pairs"])
    np.testing.assert_allclose(ours, sorted(float(row[7]) for row in table), atol=0.06)
    assert document["dE00"]["mean"] == pytest.approx(0.96, abs=0.005)


def test_statistics_as_published(measured_data: Path) -> None:
    """The published caps: mean 1.5, the standard deviation of the twelve 0.36 (printed 0.4).

    Colours are made whose lightness alone differs, by as much as gives these dE00.
    """
    text = (measured_data / "published/fm100_caps_real_vs_virtual_dE00.csv").read_text()
    wanted = np.array([float(line.split(",")[2]) for line in text.splitlines()[1:]])
    # About L* = 50 CIEDE2000 weighs lightness by 1; its average with the pair's is corrected by iteration.
    step = wanted.copy()
    for _ in range(20):
        compared = compare(Colours(grey(50 - step / 2)), Colours(grey(50 + step / 2)), WHITE)
        step = step * wanted / compared.dE00
    statistics = compare_document(compared, "", [])["dE00"]
    assert statistics["mean"] == pytest.approx(1.5, abs=0.05)
    assert statistics["sd"] == pytest.approx(0.36, abs=0.005)
    assert statistics["max"] == pytest.approx(2.42)
    np.testing.assert_allclose(compared.dL, step, atol=1e-9)
    np.testing.assert_allclose(compared.dC, 0, atol=0.01)
    assert not any(compared.hue_known)


def grey(lightness: np.ndarray) -> np.ndarray:
    """XYZ (n, 3) of greys by L*, from its definition."""
    return ((lightness[:, None] + 16) / 116) ** 3 * WHITE


def lab(L: float, C: float, h: float) -> str:
    """A row X,Y,Z of L*, C* and hue in degrees, from the definition of L*a*b*."""
    fy = (L + 16) / 116
    f = np.array([fy + C * np.cos(np.radians(h)) / 500, fy, fy - C * np.sin(np.radians(h)) / 200])
    return ",".join(f"{value:.10g}" for value in f**3 * WHITE)


def test_differences_are_measured_less_predicted(run: Run, csv: Csv) -> None:
    a = csv(f"X,Y,Z\n{lab(60, 30, 350)}\n{lab(50, 20, 90)}\n", "a.csv")
    b = csv(f"X,Y,Z\n{lab(61, 33, 5)}\n{lab(50, 20, 80)}\n", "b.csv")
    pairs = json.loads(run("compare", a, b, "--white", D65, "--json")[1])["pairs"]
    assert [pairs[0][key] for key in ("dL", "dC", "dh")] == pytest.approx([1, 3, 15], abs=1e-6)
    assert [pairs[1][key] for key in ("dL", "dC", "dh")] == pytest.approx([0, 0, -10], abs=1e-6)


def test_pairs_by_name_by_code_and_by_order(tmp_path: Path, csv: Csv) -> None:
    a = read_colours(csv("name,X,Y,Z\nwhite,95,100,108\nred,40,20,2\nred,41,21,3\n", "a.csv"))
    b = read_colours(csv("name,x,y,Y\nRed,0.6,0.3,20\nWhite,0.31,0.33,100\nred,0.6,0.3,21\n", "b.csv"))
    found = compare(a, b, WHITE)
    np.testing.assert_allclose(found.predicted_XYZ, [[40, 20, 2], [95, 100, 108], [41, 21, 3]])
    assert found.labels == ("Red", "White", "red")
    c = read_colours(csv("R,G,B,X,Y,Z\n255,255,255,95,100,108\n0,0,255,18,7,95\n", "c.csv"))
    d = read_colours(csv("R,G,B,X,Y,Z\n0,0,1,19,8,96\n1,1,1,96,101,109\n", "d.csv"))
    np.testing.assert_allclose(compare(c, d, WHITE).predicted_XYZ, [[18, 7, 95], [95, 100, 108]])
    bare = read_colours(csv("X,Y,Z\n95,100,108\n18,7,95\n", "e.csv"))
    np.testing.assert_allclose(compare(bare, d, WHITE).predicted_XYZ, bare.XYZ)
    assert compare(bare, d, WHITE).labels == ("0/0/255", "255/255/255")
    np.testing.assert_allclose(d.white_XYZ(), [96, 101, 109])


def test_a_profile_predicts_its_own_display(run: Run, tmp_path: Path) -> None:
    """Without noise nothing differs; 2 % more luminance is dE00 of (1.02^(1/3) - 1) 116 in L* at white."""
    white_Y = float(displays.additive(np.ones((1, 3)))[0, 1])
    profile, readings = tmp_path / "p.json", tmp_path / "r.csv"
    model = GammaMatrix(displays.GAMMA, displays.MATRIX / white_Y, displays.BLACK / white_Y)
    write_profile(DisplayProfile("p", model, "simulated", white_Y), profile)
    codes = np.concatenate([np.ones((1, 3)), np.random.default_rng(1).uniform(0, 1, (20, 3))])
    table = np.concatenate([codes, displays.additive(codes) * 1.02], axis=1)
    np.savetxt(readings, table, delimiter=",", header="R,G,B,X,Y,Z", comments="", fmt="%.10g")
    document = json.loads(run("compare", readings, "--profile", profile, "--white",
                              ",".join(map(str, displays.additive(np.ones((1, 3)))[0])), "--json")[1])  # fmt: skip
    assert document["pairs"][0]["dL"] == pytest.approx(116 * (1.02 ** (1 / 3) - 1), abs=1e-6)
    assert document["white"] == "white as given"
    code, out, err = run("compare", readings, "--profile", "htc-vive-2021", "--json")
    assert code == 0
    assert "scaled to the measured" in err
    assert json.loads(out)["white"] == "measured white"
    assert json.loads(out)["pairs"][0]["dL"] == pytest.approx(0, abs=1e-9)


def test_a_plot_is_written(run: Run, csv: Csv, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    a = csv(f"X,Y,Z\n{lab(60, 30, 350)}\n{lab(50, 20, 90)}\n0,0,0\n", "a.csv")
    b = csv(f"X,Y,Z\n{lab(61, 33, 5)}\n{lab(50, 20, 80)}\n0,0,0\n", "b.csv")
    for name, head in (("p.png", b"\x89PNG"), ("p.svg", b"<?xml")):
        assert run("compare", a, b, "--white", D65, "--plot", tmp_path / name)[0] == 0
        assert (tmp_path / name).read_bytes().startswith(head)
    again = (tmp_path / "p.svg").read_bytes()
    run("compare", a, b, "--white", D65, "--plot", tmp_path / "p.svg")
    assert (tmp_path / "p.svg").read_bytes() == again
    code, _, err = run("compare", a, a, "--white", D65, "--plot", tmp_path / "same.png")
    assert (code, err) == (0, "")
    code, _, err = run("compare", a, b, "--white", D65, "--plot", tmp_path / "p.pdf")
    assert code == 2
    assert "no .png or .svg" in err


@pytest.mark.parametrize(
    ("a", "b", "options", "message"),
    [
        ("X,Y,Z\n1,2,3\n", "X,Y,Z\n1,2,3\n1,2,3\n", ("--white", D65), "1 colours against 2"),
        ("name,X,Y,Z\na,1,2,3\n", "name,X,Y,Z\nb,1,2,3\n", ("--white", D65), "'b' (row 1) of the second"),
        ("name,X,Y,Z\na,1,2,3\nc,1,2,3\n", "name,X,Y,Z\na,1,2,3\n", ("--white", D65), "'c' (row 2) of the first"),
        ("X,Y,Z\n1,2,3\n", "X,Y,Z\n1,2,3\n", (), "no white among"),
        ("X,Y,Z\n1,2,3\n", "X,Y,Z\n1,2,3\n", ("--white", "1,2"), "is no white"),
        ("X,Y,Z\n1,2,3\n", "X,Y,Z\n1,nan,3\n", ("--white", D65), "line 2"),
        ("X,Y,Z\n1,2,3\n", "X,Y,Z\n1,2\n", ("--white", D65), "line 2"),
        ("X,Y,Z\n1,2,3\n", "x,y,Y\n0.3,0,3\n", ("--white", D65), "y is not above 0"),
        ("X,Y,Z\n1,2,3\n", "X,Y,Z\n", ("--white", D65), "no rows"),
        ("X,Y,Z\n1,2,3\n", "", ("--white", D65), "no rows"),
    ],
)
def test_unusable_input_gets_one_line(
    run: Run, csv: Csv, a: str, b: str, options: tuple[str, ...], message: str
) -> None:
    code, out, err = run("compare", csv(a, "a.csv"), csv(b, "b.csv"), *options)
    assert (code, out) == (2, "")
    assert message in err
    assert err.count("\n") == 1


def test_units_that_differ_are_told(run: Run, csv: Csv) -> None:
    code, _, err = run(
        "compare", csv("X,Y,Z\n0.9,1,1.1\n", "a.csv"), csv("X,Y,Z\n90,100,110\n", "b.csv"), "--white", D65
    )
    assert code == 0
    assert "same unit" in err


def test_either_a_second_file_or_a_profile(run: Run, csv: Csv) -> None:
    a = csv("X,Y,Z\n1,2,3\n", "a.csv")
    for extra in ((), (a, "--profile", "sRGB")):
        code, _, err = run("compare", a, *extra)
        assert code == 2
        assert "nothing to compare with" in err
    assert "no codes" in run("compare", a, "--profile", "sRGB")[2]
