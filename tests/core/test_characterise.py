from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import displays
import numpy as np
import pytest

from spectral_core.arrays import frozen
from spectral_core.display import DisplayProfile, read_profile, write_profile
from spectral_core.display.characterising.characterise import characterise, errors
from spectral_core.display.characterising.checks import check
from spectral_core.display.measuring.measurements import Measurements, read_measurements
from spectral_core.display.models import DisplayModel
from spectral_core.display.models.curves import fit_curve
from spectral_core.display.models.fitting import MODEL_KINDS
from spectral_core.errors import DisplayError

Run = Callable[..., tuple[int, str, str]]
KINDS = [kind.name for kind in MODEL_KINDS]


@pytest.fixture(scope="module")
def oled() -> Measurements:
    return displays.measure(displays.power_limited, displays.published_protocol(), seed=1)


def fitted(measured: Measurements, name: str) -> DisplayModel:
    """A model of a kind, white at Y = 1."""
    scaled = replace(measured, XYZ=frozen(measured.XYZ / measured.white_XYZ[1]))
    return next(kind for kind in MODEL_KINDS if kind.name == name).fit(scaled)


def unseen(display: displays.Display, white_Y: float) -> Measurements:
    """500 noise-free colours with white at Y = 1."""
    codes = np.random.default_rng(99).uniform(0, 1, (500, 3))
    return Measurements(frozen(codes), frozen(display(codes) / white_Y))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_power_limited_headset(seed: int) -> None:
    """1 % in luminance is about 0.35 in L*, of which smoothing over the patches leaves a part: 0.5.
    The published model is off by more than 2 there.
    """
    measured = displays.measure(displays.power_limited, displays.published_protocol(seed), seed)
    found = characterise(measured)
    truth = unseen(displays.power_limited, measured.white_XYZ[1])
    white = displays.power_limited(np.ones((1, 3)))[0] / measured.white_XYZ[1]
    mean = {each.name: errors(each.model, truth, white).mean() for each in found.models}
    assert mean[found.chosen.name] <= 0.5
    assert mean["gamma-matrix-black"] > 2
    # Seven readings of 1 % make the sum uncertain by about 2 %: three times that.
    assert found.checks.additivity_error == pytest.approx(0.30, abs=0.06)
    assert any("not additive" in each for each in found.warnings)


def test_an_additive_display_gets_the_published_model() -> None:
    """Noise-free, the model is the truth; simpler is not enough, since black is 0.02 %."""
    measured = displays.measure(displays.additive, displays.published_protocol())
    found = characterise(measured)
    assert found.chosen.name == "gamma-matrix-black"
    assert found.chosen.held_out is not None
    assert found.chosen.held_out.max < 0.01
    for channel, gamma in zip("RGB", displays.GAMMA, strict=True):
        assert found.gamma[channel][0] == pytest.approx(gamma, abs=1e-3)
        assert found.gamma[channel][1] == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("name", KINDS)
def test_inverses_undo_every_model_in_gamut(oled: Measurements, name: str) -> None:
    """1e-6 of white is asked; near black no code above the threshold of gain-offset-gamma is left out."""
    model = fitted(oled, name)
    codes = np.random.default_rng(4).uniform(0, 1, (2000, 3))
    XYZ = model.forward(codes)
    back = model.inverse(XYZ)
    assert np.isfinite(back).all()
    np.testing.assert_allclose(model.forward(back), XYZ, atol=1e-6)


@pytest.mark.parametrize("name", KINDS)
def test_no_colour_gives_nan(oled: Measurements, name: str) -> None:
    model = fitted(oled, name)
    XYZ = np.random.default_rng(5).uniform(-1, 3, (500, 3))
    assert np.isfinite(model.inverse(XYZ)).all()
    assert np.isfinite(model.inverse(np.zeros((1, 3)))).all()


@pytest.mark.parametrize("name", KINDS)
def test_grey_ramps_rise(oled: Measurements, name: str) -> None:
    """The luminance of grey rises with its code, however noisy the readings."""
    model = fitted(oled, name)
    ramp = np.repeat(np.linspace(0.05, 1, 200)[:, None], 3, axis=1)
    assert (np.diff(model.forward(ramp)[:, 1]) > 0).all()


def test_curves_follow_quiet_ramps_and_smooth_noisy_ones() -> None:
    codes = np.linspace(0, 1, 53)
    truth = codes**2.2 * (1 + 0.05 * np.sin(9 * codes) * (1 - codes))
    at = np.linspace(0.1, 1, 500)
    exact = at**2.2 * (1 + 0.05 * np.sin(9 * at) * (1 - at))
    quiet = fit_curve(codes, truth).forward(at)
    # Between 53 samples a cubic leaves about 1e-5 of this curve.
    assert np.abs(quiet - exact).max() < 1e-4
    noisy = truth * (1 + np.random.default_rng(0).normal(0, 0.01, 53))
    error = fit_curve(codes, noisy).forward(at) / exact - 1
    # The readings' own is 0.01, and half of that is what twenty neighbours leave at best.
    assert np.sqrt((error**2).mean()) < 0.0085
    curve = fit_curve(codes, noisy)
    np.testing.assert_allclose(
        curve.inverse(curve.forward(np.linspace(-0.2, 1.3, 99))), np.linspace(-0.2, 1.3, 99), atol=1e-6
    )


def test_one_bad_patch_is_found_and_named() -> None:
    good = displays.measure(displays.additive, displays.published_protocol(), seed=2)
    XYZ = good.XYZ.copy()
    bad = int(np.flatnonzero(good.mixed)[7])
    XYZ[bad] = XYZ[bad][::-1] * 0.5
    found = characterise(replace(good, XYZ=frozen(XYZ)))
    assert any("left out" in each and f"{good.codes[bad, 0]:.2f}" in each for each in found.warnings)
    clean = characterise(good)
    assert found.chosen.held_out is not None
    assert clean.chosen.held_out is not None
    assert found.chosen.held_out.mean == pytest.approx(clean.chosen.held_out.mean, rel=0.1)


@pytest.mark.parametrize("ramp", [0, 1, 2, 3])
@pytest.mark.parametrize("factor", [0.5, 1.5])
def test_one_bad_reading_in_a_ramp_does_little(ramp: int, factor: float) -> None:
    """Off by half: the bound of a clean set still holds, and the patch is named."""
    good = displays.measure(displays.power_limited, displays.published_protocol(1), seed=1)
    chosen = np.flatnonzero(good.grey if ramp == 3 else good.channel(ramp))
    XYZ = good.XYZ.copy()
    XYZ[chosen[len(chosen) // 2]] *= factor
    found = characterise(replace(good, XYZ=frozen(XYZ)))
    truth = unseen(displays.power_limited, good.white_XYZ[1])
    white = displays.power_limited(np.ones((1, 3)))[0] / good.white_XYZ[1]
    assert errors(found.chosen.model, truth, white).mean() <= 0.5
    assert any("ramp falls" in each for each in found.warnings)


def test_four_colours_get_what_they_can_support(tmp_path: Path) -> None:
    path = tmp_path / "small.csv"
    path.write_text("\ufeffColor,L,x,y\nRed,30,0.65,0.33\nGreen,85,0.24,0.70\nBlue,8,0.14,0.05\nWhite,110,0.30,0.32\n")
    found = characterise(read_measurements(path))
    assert found.chosen.name == "gamma-matrix-black"
    assert found.chosen.held_out is None
    assert any("2.2 is assumed" in each for each in found.warnings)
    assert found.checks.additivity_error == pytest.approx(123 / 110 - 1)
    with pytest.raises(DisplayError, match="do not support"):
        characterise(read_measurements(path), "grey-lut")


def test_repeats_give_the_noise() -> None:
    codes = np.concatenate([displays.published_protocol(), np.ones((20, 3))])
    noise = check(displays.measure(displays.additive, codes, seed=3)).noise_dE00
    assert noise is not None
    assert 0.2 < noise < 1.5
    assert check(displays.measure(displays.additive, displays.published_protocol())).noise_dE00 is None


def rows(measured: Measurements, columns: str, scale: float = 1.0) -> str:
    values = measured.XYZ
    if columns == "x,y,Y":
        total = values.sum(axis=1)
        values = np.stack([values[:, 0] / total, values[:, 1] / total, values[:, 1]], axis=1)
    lines = [
        ",".join(f"{value:.10g}" for value in (*code * scale, *row))
        for code, row in zip(measured.codes, values, strict=True)
    ]
    return "\n".join([f"R,G,B,{columns}", *lines])


def test_all_formats_hold_the_same_readings(tmp_path: Path) -> None:
    measured = displays.measure(displays.additive, displays.published_protocol())
    table = np.concatenate([measured.codes * 100, measured.XYZ], axis=1)
    lines = [f"{index} " + " ".join(f"{value:.10g}" for value in row) for index, row in enumerate(table)]
    fields = "SAMPLE_ID RGB_R RGB_G RGB_B XYZ_X XYZ_Y XYZ_Z"
    head = ["CTI3", "", "BEGIN_DATA_FORMAT", fields, "END_DATA_FORMAT", "BEGIN_DATA"]
    text = "\n".join([*head, *lines, "END_DATA"])
    for name, content in {
        "a.csv": rows(measured, "X,Y,Z"),
        "b.csv": rows(measured, "x,y,Y", 255),
        "c.ti3": text,
    }.items():
        path = tmp_path / name
        path.write_text(content)
        found = read_measurements(path)
        np.testing.assert_allclose(found.codes, measured.codes, atol=1e-9)
        np.testing.assert_allclose(found.XYZ, measured.XYZ, rtol=1e-7)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("R,G,B,X,Y,Z\n1,1,1,95,100,108\n", "red was not measured"),
        (
            "Color,L,x,y\nRed,30,0.6,0.3\nGreen,44,0.2,0.7\nBlue,3,0.15,0.05\nWhite,23,0.3,0.3\n",
            "contradict each other",
        ),
        ("R,G,B,X,Y,Z\n1,1,1,95,bright,108\n", "line 2"),
        ("R,G,B,X,Y,Z\n1,1,1,95\n", "line 2"),
        ("a,b,c\n1,2,3\n", "header"),
        ("Color,L,x,y\nPink,30,0.6,0.3\n", "Pink"),
        ("Color,L,x,y\nRed,30,0.6,0\n", "not above 0"),
        ("R,G,B,X,Y,Z\n1,1,1,95,100,0\n", "not above 0"),
        ("R,G,B,X,Y,Z\n", "holds no rows"),
        ("CTI3\nBEGIN_DATA_FORMAT\nRGB_R\n", "END_DATA_FORMAT"),
        ("CTI3\nBEGIN_DATA_FORMAT\nRGB_R RGB_G\nEND_DATA_FORMAT\nBEGIN_DATA\n1 2 3\nEND_DATA\n", "3 values for 2"),
    ],
)
def test_unusable_measurements_get_one_line(run: Run, tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "display.csv"
    path.write_text(text)
    code, out, err = run("characterise", path)
    assert (code, out) == (2, "")
    assert err.startswith(f"error: {path}")
    assert message in err
    assert err.count("\n") == 1


@pytest.mark.parametrize("name", KINDS)
def test_profiles_of_every_model_survive_json(tmp_path: Path, oled: Measurements, name: str) -> None:
    model = fitted(oled, name)
    path = tmp_path / "p.json"
    write_profile(DisplayProfile("p", model, "simulated", 100.0), path)
    back = read_profile(path)
    assert back.white_Y == 100.0
    codes = np.random.default_rng(6).uniform(0, 1, (50, 3))
    np.testing.assert_array_equal(back.to_XYZ(codes), model.forward(codes))


def test_characterise_and_convert_on_the_command_line(run: Run, tmp_path: Path, oled: Measurements) -> None:
    path, profile = tmp_path / "oled.csv", tmp_path / "oled.json"
    path.write_text(rows(oled, "X,Y,Z"))
    code, out, _ = run("characterise", path, "-o", profile, "--json")
    document = json.loads(out)
    assert code == 0
    assert set(document) >= {
        "model",
        "models",
        "gamma",
        "additivity_error",
        "additivity_XYZ",
        "black_XYZ",
        "white_XYZ",
        "noise_dE00",
        "warnings",
    }
    assert document["white_XYZ"][1] == pytest.approx(oled.white_XYZ[1])
    codes = tmp_path / "codes.csv"
    codes.write_text("R,G,B\n1,1,1\n0.25,0.5,0.75\n")
    code, xyz, _ = run("convert", "--profile", profile, "--to", "xyz", codes)
    assert code == 0
    assert float(xyz.splitlines()[1].split(",")[1]) == pytest.approx(oled.white_XYZ[1], rel=0.02)  # units of the file
    back = tmp_path / "xyz.csv"
    back.write_text(xyz + "300,10,10\n")
    code, out, err = run("convert", "--profile", profile, "--to", "codes", back)
    assert code == 0
    np.testing.assert_allclose([float(v) for v in out.splitlines()[2].split(",")], [0.25, 0.5, 0.75], atol=1e-6)
    assert "1 of 3" in err
    back.write_text("X,Y,Z\n1,2\n")
    assert run("convert", "--profile", profile, "--to", "codes", back)[0] == 2
