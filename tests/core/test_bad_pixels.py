from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from spectral_core.baking import PixelCounts, bake, bake_to_memory, level2_weights, project
from spectral_core.baking.pixels import PixelRule, interpolated
from spectral_core.display import srgb
from spectral_core.errors import TextureError
from spectral_core.lights import Light
from spectral_core.textures import ArrayTexture

NM = np.linspace(400.0, 700.0, 31)
D65 = [Light.builtin("D65")]


@given(
    npst.arrays(np.float64, (5, 9), elements=st.floats(-1, 2)),
    npst.arrays(np.bool_, (5, 9)),
    st.lists(st.floats(0.1, 50), min_size=9, max_size=9),
)
@settings(max_examples=200, deadline=None)
def test_gaps_are_filled_as_numpy_interpolates(spectra: np.ndarray, missing: np.ndarray, gaps: list[float]) -> None:
    """1e-12: rounding of one multiplication and one addition of numbers up to 3."""
    nm = 380 + np.cumsum(gaps)
    filled = interpolated(spectra, missing, nm)
    for spectrum, gone, result in zip(spectra, missing, filled, strict=True):
        expected = np.zeros(9) if gone.all() else np.interp(nm, nm[~gone], spectrum[~gone])
        np.testing.assert_allclose(result, expected, rtol=0, atol=1e-12)
        np.testing.assert_array_equal(result[~gone], spectrum[~gone])


def test_repaired_lost_negative_and_above_are_counted() -> None:
    cube = np.full((6, 7, 31), 0.5, dtype=np.float32)
    cube[0, 0, 10] = np.nan
    cube[1, 2, [0, 1, 30]] = np.inf, np.nan, -np.inf
    cube[2, 3] = np.nan
    cube[3, 3, 4] = -0.01
    cube[4, :2, 5] = 1.06
    cube[5, 5, 5] = 1.05
    texture = ArrayTexture(cube, NM)
    weights = level2_weights(texture, D65)
    XYZ = project(texture, weights, bad_pixels="repair")
    grey = 0.5 * weights.sum(axis=0)
    np.testing.assert_allclose(XYZ[0, 0], grey, atol=1e-6)
    np.testing.assert_allclose(XYZ[1, 2], grey, atol=1e-6)
    np.testing.assert_array_equal(XYZ[2, 3], 0)
    np.testing.assert_allclose(XYZ[3, 3], cube[3, 3].astype(float) @ weights, atol=1e-6)
    np.testing.assert_allclose(XYZ[4, 0], cube[4, 0].astype(float) @ weights, atol=1e-6)
    with pytest.raises(TextureError, match="no finite number in row 0"):
        project(texture, weights)


def test_a_bake_tells_what_it_did(tmp_path: Path) -> None:
    cube = np.full((6, 7, 31), 0.5, dtype=np.float32)
    cube[0, :3, 10] = np.nan
    cube[2, 3] = np.nan
    cube[3, 3, 4] = -0.01
    cube[4, :2, 5] = 1.06
    result = bake(ArrayTexture(cube, NM, "capture"), D65, tmp_path)
    assert result.counts == PixelCounts(repaired=3, lost=1, negative=1, above=2)
    told = "\n".join(result.warnings)
    for words in (
        "3 of 42 pixels have values",
        "1 of 42 pixels hold no number",
        "0.08% of the values are neg",
        "0.15%",
    ):
        assert words in told


def test_values_of_no_data_are_no_values() -> None:
    """An ignored integer within the range of the others."""
    cube = np.random.default_rng(0).integers(1000, 9000, (5, 6, 31)).astype(np.int16)
    cube[2, 2, 5:8] = 5000
    texture = ArrayTexture(cube, NM, scale=10_000)
    texture.ignore_value = 5000
    mended = cube.astype(np.float64)
    mended[2, 2, 5:8] = np.interp([5, 6, 7], [4, 8], mended[2, 2, [4, 8]])
    for place in np.argwhere((cube == 5000) & ~((np.arange(31) > 4) & (np.arange(31) < 8))):
        pytest.fail(f"the random cube holds the value at {place}")
    weights = level2_weights(texture, D65)
    XYZ = project(texture, weights, bad_pixels="repair")
    np.testing.assert_allclose(XYZ, mended / 10_000 @ weights, rtol=0, atol=3e-6)
    assert np.isnan(texture.rows(2, 1)[0, 2, 5:8]).all()


def test_a_line_in_reflectance_not_in_counts() -> None:
    """With a gain per band the line between neighbours is one of reflectances."""
    rng = np.random.default_rng(1)
    gain = rng.uniform(0.2, 2.0, 31)

    class Gained(ArrayTexture):
        @property
        def gain(self) -> np.ndarray:
            return gain

    straight = np.linspace(0.2, 0.8, 31)
    stored = np.broadcast_to(straight / gain, (3, 4, 31)).astype(np.float32)
    stored = stored.copy()
    stored[1, 1, [4, 5, 20]] = np.nan
    texture = Gained(stored, NM)
    weights = level2_weights(texture, D65)
    np.testing.assert_allclose(
        project(texture, weights, "repair"), np.broadcast_to(straight @ weights, (3, 4, 3)), atol=3e-6
    )


def test_values_too_large_to_add_up_are_refused() -> None:
    cube = np.full((3, 4, 31), 3e38, dtype=np.float32)
    with pytest.raises(TextureError, match="too large"):
        project(ArrayTexture(cube, NM), 1e3 * level2_weights(ArrayTexture(cube, NM), D65))


def alive(dtype: str, scale: float) -> np.ndarray:
    """A smooth capture with noise."""
    rng = np.random.default_rng(2)
    smooth = 0.5 + 0.3 * np.sin(np.linspace(0, 3, 31) + rng.uniform(0, 3, (40, 30, 1)))
    return np.asarray((scale * (smooth + rng.normal(0, 0.002, smooth.shape))).astype(dtype))


@pytest.mark.parametrize(("dtype", "scale"), [("f4", 1.0), ("u2", 4000.0), ("u1", 250.0)])
def test_dead_bands_are_found_named_and_left_out(dtype: str, scale: float, tmp_path: Path) -> None:
    cube = alive(dtype, scale)
    whole = bake_to_memory(ArrayTexture(cube, NM, scale=scale), D65)
    assert whole.warnings == ()
    broken = cube.copy()
    broken[..., 12] = 0
    broken[..., [20, 21]] = np.nan if dtype == "f4" else np.iinfo(dtype).max
    mended = bake_to_memory(ArrayTexture(broken, NM, scale=scale), D65)
    assert any("520, 600, 610 nm" in warning for warning in mended.warnings)
    assert mended.counts == PixelCounts()
    # The spline over a gap of 30 nm in a smooth spectrum with 0.2 % (or 1/250) of noise.
    np.testing.assert_allclose(mended.images[0], whole.images[0], rtol=0, atol=0.01)
    result = bake(ArrayTexture(broken, NM, scale=scale), D65, tmp_path)
    assert any("dead bands" in warning for warning in result.warnings)


def test_what_is_black_or_of_one_colour_is_not_dead() -> None:
    """Nothing but zeros; a uniform grey; an end without signal beside an end without signal."""
    for cube in (np.zeros((20, 20, 31), np.float32), np.full((20, 20, 31), 0.3, np.float32)):
        assert bake_to_memory(ArrayTexture(cube, NM), D65).warnings == ()
    dark_end = alive("f4", 1.0)
    dark_end[..., :4] = [0.0, 0.0, 0.0, 0.004]
    dark_end[..., 3] += np.random.default_rng(3).normal(0, 1e-3, (40, 30)).clip(0)
    assert not any("dead" in warning for warning in bake_to_memory(ArrayTexture(dark_end, NM), D65).warnings)


@pytest.mark.parametrize("dtype", ["u1", "u2", "i2", ">i2", "u4", "i4", "f2", "f4", "f8", ">f4"])
@pytest.mark.parametrize("dark", [0.0, 3.0])
def test_clean_is_what_needs_no_rule(dtype: str, dark: float) -> None:
    """One value at a time, at both ends of what is counted, with the largest and the smallest of the type."""
    kind = np.dtype(dtype)
    scale = 1.0 if kind.kind == "f" else 100.0
    rule = PixelRule(np.full(2, dark), np.full(2, 1 / scale), np.ones(2, bool), np.array([500.0, 600.0]), None)
    top = dark + 1.05 * scale
    values = [dark, dark + scale / 2, top, top - scale / 10, top + scale / 10, dark - scale / 100]
    info = np.iinfo(kind) if kind.kind in "iu" else np.finfo(kind)
    values += [float(info.max), float(info.min)] + ([np.nan, np.inf, -np.inf] if kind.kind == "f" else [])
    for value in values:
        with np.errstate(invalid="ignore", over="ignore"):
            block = np.full((3, 2), dark + scale / 2).astype(kind)
            block[1, 0] = np.clip(value, info.min, info.max) if np.isfinite(value) else value
        stored = float(block[1, 0])
        clean = bool(dark <= stored <= top)
        # At the very top the last bit may go either way: then the rule counts nothing either.
        assert rule.is_clean(block) == clean or stored == pytest.approx(top, rel=1e-3), (value, stored)
        with np.errstate(over="ignore"):
            counted = rule.apply(block, block.astype(np.float32))
        if rule.is_clean(block):
            assert counted == PixelCounts()


@pytest.mark.parametrize("dtype", ["f4", "u1"])
def test_surfaces_that_are_black_in_some_bands_are_not_dead(dtype: str) -> None:
    """Saturated blue, red and magenta: taken for dead, their zeros became the brightness of the other bands."""
    shades = np.random.default_rng(4).uniform(0.7, 1, (20, 20, 1))
    for bright in (NM < 480, NM > 600, (NM < 480) | (NM > 600)):
        values = 0.6 * bright * shades
        scale = 1.0 if dtype == "f4" else 255.0
        stored = values.astype(dtype) if dtype == "f4" else np.round(values * scale).astype(dtype)
        texture = ArrayTexture(stored, NM, scale=scale)
        baked = bake_to_memory(texture, D65)
        assert not any("dead" in warning for warning in baked.warnings)
        exact = srgb().to_linear((stored / scale) @ D65[0].weighting_factors(NM).matrix)
        # float32 sums of 31 values below 1, and the display's matrix with entries up to 3.
        np.testing.assert_allclose(baked.images[0], exact, rtol=0, atol=3e-6)
