from __future__ import annotations

import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spectral_core.arrays import Float64Array
from spectral_core.baking import PixelCounts, bake_to_memory, level2_weights, products, project, projection
from spectral_core.baking.encoding import count_outside
from spectral_core.display import load_profile, srgb
from spectral_core.display.profile import in_gamut
from spectral_core.errors import TextureError
from spectral_core.lights import Light
from spectral_core.textures import ArrayTexture
from spectral_core.textures.base import HyperspectralTexture, Samples

NM = np.linspace(380.0, 780.0, 41)
LIGHTS = [Light.builtin(name) for name in ("D65", "A", "FL11")]
# Axes (rows, columns, bands) in a file's order.
ORDERS = {"bip": (0, 1, 2), "bil": (0, 2, 1), "bsq": (2, 0, 1)}
# float32 sums of 41 to 101 products: a few times 6e-8, in the worst case of rounding 3e-6.
EXACT = 3e-6


def stored_as(cube: np.ndarray, order: str) -> np.ndarray:
    """The same array (rows, columns, bands), its axes in another order in memory."""
    axes = ORDERS[order]
    return np.ascontiguousarray(cube.transpose(axes)).transpose(np.argsort(axes))


@dataclass(eq=False)
class Plain(HyperspectralTexture):
    """A texture whose every property can be set."""

    values: np.ndarray
    own_gain: Float64Array
    own_dark: Float64Array
    own_good: np.ndarray

    def __post_init__(self) -> None:
        self.name, self.format, self.kind = "plain", "test", "reflectance"
        self.height, self.width, bands = self.values.shape
        self.wavelengths_nm = np.linspace(380, 780, bands)

    def samples(self, first: int, count: int) -> Samples:
        return self.values[first : first + count]

    @property
    def gain(self) -> Float64Array:
        return self.own_gain

    @property
    def dark(self) -> Float64Array:
        return self.own_dark

    @property
    def good(self) -> np.ndarray:
        return self.own_good


def plain(values: np.ndarray) -> Plain:
    bands = values.shape[2]
    return Plain(values, np.ones(bands), np.zeros(bands), np.ones(bands, dtype=bool))


@pytest.mark.parametrize("order", list(ORDERS))
@pytest.mark.parametrize("dtype", ["u1", "<u2", ">u2", "<i2", "<u4", "<f4", ">f4", "<f8"])
def test_every_order_and_type_is_the_float64_product(order: str, dtype: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Tiles and strips that do not divide the rows; all within `EXACT` of the white."""
    monkeypatch.setattr(projection, "TILE_BYTES", 4 * 41 * 29)
    monkeypatch.setattr(projection, "_STRIP_BYTES", 4 * 41 * 53 * 5)
    cube = np.random.default_rng(1).uniform(0, 1, (37, 53, 41))
    scale = 1.0 if np.dtype(dtype).kind == "f" else 250.0
    stored = stored_as((cube * scale).astype(dtype), order)
    texture = ArrayTexture(stored, NM, scale=scale)
    weights = level2_weights(texture, LIGHTS)
    exact = stored.astype(np.float64) / scale @ weights
    np.testing.assert_allclose(project(texture, weights), exact, rtol=0, atol=EXACT)


@pytest.mark.parametrize("width", [1, 2, 7])
@pytest.mark.parametrize("bands", [1, 2, 41])
@pytest.mark.parametrize("order", list(ORDERS))
def test_the_smallest_textures(order: str, width: int, bands: int) -> None:
    stored = stored_as(np.random.default_rng(2).random((3, width, bands), dtype=np.float32), order)
    texture = ArrayTexture(stored, np.linspace(400, 700, bands) if bands > 1 else np.array([550.0]))
    weights = level2_weights(texture, LIGHTS)
    np.testing.assert_allclose(project(texture, weights), stored @ weights, rtol=0, atol=EXACT)


@given(st.integers(1, 300), st.integers(1, 120), st.integers(1, 30), st.booleans(), st.integers(0, 3))
@settings(max_examples=60, deadline=None)
def test_both_products_are_numpys(rows: int, bands: int, columns: int, across: bool, gap: int) -> None:
    """Whatever the shape, and with a gap between the rows; float32's rounding of a sum of 120."""
    rng = np.random.default_rng(rows)
    if across:
        pixels = rng.random((bands, rows + gap), dtype=np.float32)[:, :rows].T
    else:
        pixels = rng.random((rows, bands + gap), dtype=np.float32)[:, :bands]
    factors = rng.random((bands, columns), dtype=np.float32)
    exact = pixels.astype(np.float64) @ factors
    sgemm = products._scipy_sgemm()
    for product in (products._by_numpy, *([products._by_blas(sgemm)] if sgemm is not None else [])):
        out = np.full((rows, columns), np.nan, dtype=np.float32)
        product(pixels, factors, out)
        np.testing.assert_allclose(out, exact, rtol=0, atol=bands * 6e-7)


@pytest.mark.parametrize(
    "layout",
    [
        lambda cube: np.asfortranarray(cube),
        lambda cube: cube[:, ::-1],
        lambda cube: cube[:, :, ::-1],
        lambda cube: np.repeat(cube, 2, axis=2)[..., ::2],
        lambda cube: np.broadcast_to(cube[:1, :1], cube.shape),
        lambda cube: np.broadcast_to(cube[:, :, :1], cube.shape),
        lambda cube: np.repeat(cube, 3, axis=2)[:, :, 5:6],
    ],
    ids=["fortran", "mirrored", "falling", "every second", "one pixel", "one value", "one band of many"],
)
def test_floats_that_no_blas_can_take_as_they_lie(layout: Any) -> None:
    """A Fortran-ordered .npy has no contiguous axis in a row; BLAS would be handed a copy."""
    cube = np.random.default_rng(5).random((7, 11, 31), dtype=np.float32)
    values = layout(cube)
    texture = ArrayTexture(values, np.linspace(400.0, 700.0, values.shape[2]))
    weights = level2_weights(texture, LIGHTS)
    assert np.abs(project(texture, weights) - values.astype(np.float64) @ weights).max() < EXACT


def test_bands_too_close_together_are_told_of_or_refused() -> None:
    """A pair 0.01 nm apart among bands of 10 nm: its difference, which is noise, is carried over 10 nm.

    Under the narrow lines of FL11 that amplifies errors 70 times; pairs 1.6 nm apart, where detectors
    overlap, 1.4 times, as much as any grid.
    """
    even = np.arange(380.0, 781.0, 10.0)
    light = Light.builtin("FL11")

    def paired(gap: float) -> ArrayTexture:
        wavelengths = np.sort(np.append(even, 550 + gap))
        return ArrayTexture(np.full((2, 3, len(wavelengths)), 0.5, np.float32), wavelengths)

    with pytest.raises(TextureError, match=r"bands near 550 nm that lie too close together.* 69 times"):
        bake_to_memory(paired(0.01), [light])
    assert any("up to 7.8 times: around 550 nm" in each for each in bake_to_memory(paired(0.1), [light]).warnings)
    assert bake_to_memory(paired(1.6), [light]).warnings == ()
    assert light.weighting_factors(paired(1.6).wavelengths_nm).amplification < 1.5
    for step in (2.0, 5.0, 10.0, 20.0, 40.0):
        for each in ("D65", "FL11", "LPS", "Mercury"):
            assert Light.builtin(each).weighting_factors(np.arange(380.0, 781.0, step)).amplification < 2


def test_infrared_has_no_colour() -> None:
    texture = ArrayTexture(np.full((2, 3, 9), 0.5, np.float32), np.linspace(900, 1700, 9))
    with pytest.raises(TextureError, match="no good band of visible light, only from 900 to 1700 nm"):
        bake_to_memory(texture, LIGHTS)
    texture = ArrayTexture(np.full((2, 3, 9), 0.5, np.float32), np.linspace(700, 1500, 9))
    assert any("rest on the repeated end values" in each for each in bake_to_memory(texture, LIGHTS).warnings)


def test_scipys_product_is_there_where_numpys_is_old() -> None:
    """What `own_threads` rests on in an environment with NumPy 1.26 and SciPy."""
    scipy = pytest.importorskip("scipy", reason="inside Blender there is no SciPy")
    assert scipy.__version__
    assert products._scipy_sgemm() is not None
    with products.own_threads() as product:
        assert (product is products._by_numpy) == (int(np.__version__.split(".")[0]) >= 2)


def test_gain_and_dark_are_in_the_weights() -> None:
    """Values are (stored - dark) gain; counts to 4000 rounded in float32 to 2e-7 of themselves."""
    rng = np.random.default_rng(3)
    texture = plain(rng.integers(200, 4000, (20, 30, 41)).astype(np.uint16))
    texture.own_gain, texture.own_dark = rng.uniform(1 / 4000, 1 / 3000, 41), rng.uniform(50, 150, 41)
    weights = level2_weights(texture, LIGHTS)
    exact = ((texture.values - texture.own_dark) * texture.own_gain) @ weights
    np.testing.assert_allclose(project(texture, weights), exact, rtol=0, atol=EXACT)
    by_column = plain(texture.values)
    by_column.own_gain = texture.own_gain * rng.uniform(0.9, 1.1, (30, 41))
    by_column.own_dark = texture.own_dark + rng.uniform(-9, 9, (30, 41))
    exact = ((texture.values - by_column.own_dark) * by_column.own_gain) @ weights
    np.testing.assert_allclose(project(by_column, weights), exact, rtol=0, atol=EXACT)


def test_bad_bands_have_no_weight_whatever_they_hold() -> None:
    rng = np.random.default_rng(4)
    smooth = 0.5 + 0.3 * np.sin(np.linspace(0, 3, 41) + rng.uniform(0, 3, (12, 9, 1)))
    texture = plain(smooth.astype(np.float32))
    texture.own_good[[0, 7, 8, 40]] = False
    texture.values[..., [7, 40]] = np.nan
    texture.values[..., [0, 8]] = 1e6
    weights = level2_weights(texture, LIGHTS)
    assert not weights[~texture.own_good].any()
    # The spline bridges the gaps: a smooth reflectance keeps its colour to 1e-3 of white.
    exact = smooth @ level2_weights(plain(smooth.astype(np.float32)), LIGHTS)
    np.testing.assert_allclose(project(texture, weights), exact, rtol=0, atol=1e-3)
    texture.own_good[:] = False
    with pytest.raises(TextureError, match="no good band"):
        level2_weights(texture, LIGHTS)


def test_bands_without_weight_are_not_read() -> None:
    """An infrared detector's bands do not even enter the product."""
    nm = np.linspace(380, 2500, 213)
    texture = ArrayTexture(np.random.default_rng(5).random((4, 5, 213), dtype=np.float32), nm)
    how = projection.projection(texture, level2_weights(texture, LIGHTS))
    kept = nm[how.bands]
    assert kept[0] == 380
    # The observer ends at 830 nm; a spline's reach falls off by 0.27 a band, to 1e-12 in 22 of them.
    assert 830 < kept[-1] < 830 + 26 * 10


def test_what_is_read_in_order_by_one_thread() -> None:
    """A texture that cannot be read by several threads is read by one, from the top."""
    seen: list[tuple[int, int]] = []

    class Sequential(ArrayTexture):
        concurrent = False

        def samples(self, first: int, count: int) -> Samples:
            seen.append((first, threading.get_ident()))
            return super().samples(first, count)

    texture = Sequential(np.random.default_rng(6).random((3000, 40, 41), dtype=np.float32), NM)
    weights = level2_weights(texture, LIGHTS)
    result = project(texture, weights, threads=3)
    assert len(seen) > 1
    assert [first for first, _ in seen] == sorted(first for first, _ in seen)
    assert {thread for _, thread in seen} == {threading.get_ident()}
    np.testing.assert_allclose(result[::500], texture.samples(0, 3000)[::500] @ weights, rtol=0, atol=EXACT)


def test_the_result_can_be_a_mapped_file(tmp_path: Path) -> None:
    texture = ArrayTexture(np.random.default_rng(7).random((6, 5, 41), dtype=np.float32), NM)
    weights = level2_weights(texture, LIGHTS)
    out = np.lib.format.open_memmap(tmp_path / "XYZ.npy", "w+", np.float32, (6, 5, 9))
    assert project(texture, weights, out=out) is out
    np.testing.assert_array_equal(np.load(tmp_path / "XYZ.npy"), project(texture, weights))
    with pytest.raises(ValueError, match="contiguous float32 of shape"):
        project(texture, weights, out=np.empty((6, 5, 9)))


@pytest.mark.parametrize("name", ["sRGB", "htc-vive-2021", "htc-vive-2020"])
@pytest.mark.parametrize(("image_format", "levels"), [("png8", 255), ("png16", 65535)])
def test_codes_are_the_profiles_rounded(name: str, image_format: str, levels: int) -> None:
    """Where float32 falls on the other side of a half it is one level off: 2e-6 in code is 0.1 level of 16 bits."""
    texture = ArrayTexture(np.random.default_rng(8).uniform(-0.05, 1.2, (40, 40, 41)).astype(np.float32), NM)
    profile = load_profile(name)
    (image,) = bake_to_memory(texture, [LIGHTS[0]], profile, image_format).images  # type: ignore[arg-type]
    assert image.dtype == (np.uint8 if levels == 255 else np.uint16)
    XYZ = texture.samples(0, 40).astype(np.float64) @ level2_weights(texture, [LIGHTS[0]])
    codes = levels * np.clip(profile.model.encode(np.clip(profile.to_linear(XYZ), 0, 1)), 0, 1)
    off = np.abs(image - codes)
    # Near black a power has no slope that float32 would hold: linear 1e-6 of rounding is 3e-3 in code.
    assert (off[codes > 0.02 * levels] <= 0.5 + 3e-6 * levels).all()
    assert np.median(off) <= 0.3


def test_a_gradient_meets_srgb_at_both_ends_of_its_line() -> None:
    """Greys from black to white, the two pieces of the curve included: never a level off."""
    grey = np.linspace(0, 1, 4096, dtype=np.float32)[None, :, None] * np.ones(41, dtype=np.float32)
    baked = bake_to_memory(ArrayTexture(grey, NM), [LIGHTS[0]], image_format="png8")
    (image,) = baked.images
    codes = 255 * np.clip(srgb().model.encode(srgb().to_linear(grey[0, :, :1] * LIGHTS[0].XYZ())), 0, 1)
    assert np.abs(image[0] - codes).max() <= 0.5 + 1e-3
    assert baked.counts == PixelCounts()


def test_memory_and_files_agree(tmp_path: Path) -> None:
    from spectral_core.baking import bake
    from spectral_core.imaging import oiio

    texture = ArrayTexture(np.random.default_rng(9).random((30, 20, 41), dtype=np.float32), NM)
    images = bake_to_memory(texture, LIGHTS, image_format="png8").images
    result = bake(texture, LIGHTS, tmp_path, image_format="png8")
    for image, written in zip(images, result.images, strict=True):
        np.testing.assert_array_equal(oiio().ImageBuf(str(written.path)).get_pixels(oiio().UINT8), image)


def test_colours_out_of_gamut_are_counted_as_the_profile_does() -> None:
    linear = np.random.default_rng(10).uniform(-0.2, 1.3, (5000, 2, 3)).astype(np.float32)
    linear[:4, 1] = [[0, 1, 0.5], [-5e-5, 1.00005, 0], [-2e-4, 0.5, 0.5], [0.5, 0.5, 1.0002]]
    np.testing.assert_array_equal(count_outside(linear), (~in_gamut(linear)).sum(axis=0))
    assert count_outside(linear[:2, 1:]).tolist() == [0]
    assert count_outside(linear[2:4, 1:]).tolist() == [2]
