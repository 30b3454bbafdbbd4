from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import displays
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spectral_core.arrays import Float64Array, frozen
from spectral_core.chromaticities import XYZ_to_uv, XYZ_to_xy
from spectral_core.display import builtin_profile_names, load_profile
from spectral_core.display.limits.gamut import GAMUT_RULES, map_to_gamut, peak_luminance
from spectral_core.display.models import DisplayModel
from spectral_core.display.models.fitting import MODEL_KINDS
from spectral_core.errors import DisplayError
from spectral_core.lights import Light

Run = Callable[..., tuple[int, str, str]]
KINDS = [kind.name for kind in MODEL_KINDS]
NAMES = [*KINDS, *builtin_profile_names()]
# What is a matrix behind its curves, so that its gamut is known in closed form.
LINEAR = [name for name in NAMES if "corrected" not in name]
colours = st.lists(st.floats(-1.5, 3), min_size=3, max_size=3)
codes = st.lists(st.floats(0, 1), min_size=3, max_size=3)


@cache
def model(name: str) -> DisplayModel:
    """A built-in model, or one fitted to the power-limited display, white at Y = 1."""
    if name not in KINDS:
        return load_profile(name).model
    measured = displays.measure(displays.power_limited, displays.published_protocol(), seed=1)
    scaled = replace(measured, XYZ=frozen(measured.XYZ / measured.white_XYZ[1]))
    return next(kind for kind in MODEL_KINDS if kind.name == name).fit(scaled)


def brightest(name: str, XYZ: Float64Array) -> float:
    """The largest factor at which a matrix display shows a chromaticity: where the first drive is full.

    Independent of the search: drives are affine in the factor. 0 if another drive is below that of
    code 0 there.
    """
    ends = model(name).linear(model(name).forward(np.stack([np.zeros(3), np.ones(3)])))
    start, end = model(name).linear(np.stack([np.zeros(3), XYZ]))
    slope = end - start
    factor = min((f - s) / d for f, s, d in zip(ends[1], start, slope, strict=True) if d > 0)
    return float(factor) if (start + factor * slope >= ends[0] - 1e-9).all() else 0.0


@pytest.mark.parametrize("name", LINEAR)
@settings(max_examples=60, deadline=None)
@given(XYZ=colours)
def test_any_colour_gets_codes_and_never_more_luminance(name: str, XYZ: list[float]) -> None:
    """But for black: nothing is darker. 1e-9 is rounding."""
    asked = np.array(XYZ)
    found, counts = map_to_gamut(model(name), asked, "chromaticity")
    assert ((found >= 0) & (found <= 1)).all()
    black = model(name).forward(np.zeros(3))[1]
    assert model(name).forward(found)[1] <= max(asked[1], black) + 1e-9
    assert counts.total == 1
    assert counts.outside in (0, 1)


@pytest.mark.parametrize("name", [name for name in NAMES if name not in LINEAR])
def test_corrected_models_give_codes_too(name: str) -> None:
    """Fewer colours, all at once: a corrected model is slow. 1e-6 is what its inverse is exact to."""
    asked = np.random.default_rng(8).uniform(-0.5, 2, (60, 3))
    found, counts = map_to_gamut(model(name), asked, "chromaticity")
    assert ((found >= 0) & (found <= 1)).all()
    shown, black = model(name).forward(found), model(name).forward(np.zeros(3))[1]
    assert (shown[:, 1] <= np.maximum(asked[:, 1], black) + 1e-6).all()
    assert counts.total == 60
    peak = peak_luminance(model(name), np.maximum(asked, 0.05))
    bright = (asked > 0.05).all(axis=1) & (peak > 0) & (peak < asked[:, 1])
    assert bright.sum() > 3
    np.testing.assert_allclose(XYZ_to_xy(shown[bright]), XYZ_to_xy(asked[bright]), atol=1e-6)
    np.testing.assert_allclose(shown[bright, 1], peak[bright], rtol=1e-6)


@pytest.mark.parametrize("rule", GAMUT_RULES)
@pytest.mark.parametrize("name", LINEAR)
@settings(max_examples=30, deadline=None)
@given(code=codes)
def test_colours_in_gamut_stay(name: str, rule: str, code: list[float]) -> None:
    """To 1e-8 of white: sRGB's two pieces miss each other by 2e-9 where they meet (IEC 61966-2-1's rounded
    numbers); codes of near-black channels amplify rounding, light does not.
    """
    XYZ = model(name).forward(np.array(code))
    found, counts = map_to_gamut(model(name), XYZ, rule)  # type: ignore[arg-type]
    np.testing.assert_allclose(model(name).forward(found), XYZ, atol=1e-8)
    assert counts.outside == 0


@pytest.mark.parametrize("name", [name for name in NAMES if name not in LINEAR])
def test_colours_in_gamut_stay_with_corrected_models(name: str) -> None:
    asked = np.random.default_rng(3).uniform(0, 1, (100, 3))
    XYZ = model(name).forward(asked)
    for rule in GAMUT_RULES:
        found, counts = map_to_gamut(model(name), XYZ, rule)
        np.testing.assert_allclose(found, np.clip(model(name).inverse(XYZ), 0, 1), atol=1e-9)
        assert counts.outside == 0


@pytest.mark.parametrize("name", LINEAR)
@settings(max_examples=60, deadline=None)
@given(code=codes, factor=st.floats(1.01, 20))
def test_too_bright_a_colour_keeps_its_chromaticity(name: str, code: list[float], factor: float) -> None:
    """Its luminance is the largest there is, by the closed form."""
    XYZ = model(name).forward(np.maximum(np.array(code), 0.3)) * factor
    limit = brightest(name, XYZ)
    found, counts = map_to_gamut(model(name), XYZ, "chromaticity")
    shown = model(name).forward(found)
    if limit > 0:
        np.testing.assert_allclose(XYZ_to_xy(shown), XYZ_to_xy(XYZ), atol=1e-6)
        assert shown[1] == pytest.approx(min(limit, 1.0) * XYZ[1], rel=1e-9)
        assert peak_luminance(model(name), XYZ) == pytest.approx(limit * XYZ[1], rel=1e-9)
    # Within a thousandth of fitting, clipping may change less than is counted.
    if not 0.999 <= limit < 1.001:
        assert counts.luminance == int(0 < limit < 0.999)


@pytest.mark.parametrize("name", LINEAR)
def test_foreign_chromaticities_move_straight_to_the_gamuts_edge(name: str) -> None:
    """Spectral lights: what is shown lies on the line in u'v' from the colour to white, at the edge,
    and keeps the luminance (0.02 of white, which every edge but blue's end can have).
    """
    display = model(name)
    for nm in (480.0, 500.0, 520.0, 580.0):
        asked = Light.from_lines("line", [nm], [1.0]).XYZ() * 0.02
        found, counts = map_to_gamut(display, asked, "chromaticity")
        shown = display.forward(found)
        assert (counts.chromaticity, counts.luminance) == (1, 0)
        assert shown[1] == pytest.approx(asked[1], rel=1e-6)
        black, white = display.forward(np.zeros(3)), display.forward(np.ones(3))
        share = (asked[1] - black[1]) / (white[1] - black[1])
        start, end = XYZ_to_uv(asked), XYZ_to_uv(black + share * (white - black))
        along, moved = end - start, XYZ_to_uv(shown) - start
        assert abs(along[0] * moved[1] - along[1] * moved[0]) / np.hypot(*along) < 1e-6
        assert 0 < moved @ along < along @ along
        # A step back towards the colour leaves the gamut: it moved no further than it must.
        mixed = shown + 0.01 * (asked - shown)
        assert (display.linear(mixed) < display.linear(black) - 1e-9).any()


def test_the_way_to_the_edge_has_no_step() -> None:
    """Across the edge of the triangle the mapped colour changes little by little."""
    display = model("htc-vive-2020")
    red, white = display.forward(np.array([1.0, 0, 0])), display.forward(np.ones(3))
    path = white + np.linspace(0.8, 1.2, 400)[:, None] * (red - white)
    found, _ = map_to_gamut(display, path * (0.9 / path[:, 1:2]), "chromaticity")
    shown = display.forward(found)
    assert np.abs(np.diff(XYZ_to_uv(shown), axis=0)).max() < 2e-3
    assert np.abs(np.diff(shown[:, 1])).max() < 5e-3


@pytest.mark.parametrize("rule", GAMUT_RULES)
@pytest.mark.parametrize("name", NAMES)
def test_extremes_give_numbers(name: str, rule: str) -> None:
    asked = np.array([[0, 0, 0], [1e300, 1e300, 1e300], [-1e300, 1e300, 0], [0, -1, 0], [1e-300, 1e-300, 0], [0, 0, 5]])
    found, counts = map_to_gamut(model(name), asked, rule)  # type: ignore[arg-type]
    assert np.isfinite(found).all()
    assert counts.total == 6
    with pytest.raises(DisplayError, match="no rule"):
        map_to_gamut(model(name), asked, "squeeze")  # type: ignore[arg-type]
    with pytest.raises(DisplayError, match="finite"):
        map_to_gamut(model(name), np.array([[np.nan, 0, 0]]), "clip")


def test_nothing_is_darker_than_black() -> None:
    """Black of the published Vive is 0.4 %: darker colours become it; a saturated colour just above is
    mixed with grey, at its own luminance."""
    display = load_profile("htc-vive-2020")
    found, counts = map_to_gamut(
        display, np.array([[0.0, 0, 0], [0.001, 0.002, 0.001], [0.003, 0.006, 0.001]]), "chromaticity"
    )
    np.testing.assert_array_equal(found[:2], 0)
    assert counts.black == 3
    assert display.to_XYZ(found[2])[1] == pytest.approx(0.006, rel=1e-6)


def test_empty_and_single_colours() -> None:
    found, counts = map_to_gamut(load_profile("sRGB"), np.zeros((0, 3)), "chromaticity")
    assert found.shape == (0, 3)
    assert counts.total == 0
    assert map_to_gamut(load_profile("sRGB"), np.full((2, 4, 3), 0.2), "clip")[0].shape == (2, 4, 3)


def test_peak_of_the_published_headset() -> None:
    """Diaz-Barrancas et al. 2021: D65's red drive is 1.04, so that its peak is 1 / 1.04."""
    D65 = Light.builtin("D65").XYZ()
    drive = np.array([2.19, -0.69, -0.32]) @ D65
    assert peak_luminance(load_profile("htc-vive-2021"), D65) == pytest.approx(1 / drive, rel=1e-12)
    assert drive == pytest.approx(1.04, abs=0.005)


def test_convert_takes_a_rule_and_counts(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "xyz.csv"
    path.write_text("X,Y,Z\n0.2,0.2,0.2\n1.9,2.0,2.1\n0.01,0.5,0.01\n")
    shown = {}
    for rule in GAMUT_RULES:
        code, out, err = run("convert", "--to", "codes", "--gamut", rule, path)
        assert code == 0
        assert "2 of 3 colours are out of gamut: 1 by luminance, 1 by chromaticity" in err
        shown[rule] = np.array([[float(cell) for cell in row.split(",")] for row in out.splitlines()[1:]])
    assert (
        run("convert", "--to", "codes", "--keep", path)[1]
        == run("convert", "--to", "codes", "--gamut", "keep", path)[1]
    )
    np.testing.assert_array_equal(np.clip(shown["keep"], 0, 1), shown["clip"])
    assert shown["keep"].max() > 1
    assert shown["chromaticity"][1].max() == pytest.approx(1)
    kept = load_profile("sRGB").to_XYZ(shown["chromaticity"][1])
    np.testing.assert_allclose(XYZ_to_xy(kept), XYZ_to_xy(np.array([1.9, 2.0, 2.1])), atol=1e-6)
    assert run("convert", "--to", "codes", "--gamut", "squeeze", path)[0] == 2
