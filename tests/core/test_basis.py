"""Spectral bases: exact where they must be, within tolerance elsewhere, and one clear line for bad input."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

import spectral_core as sb
from spectral_core import standards
from spectral_core.basis import (
    SpectralBasis,
    choose_basis,
    choose_for_textures,
    encode_texture,
    encoding_steps,
    extend,
    fit_basis,
    surface_samples,
    with_light,
)
from spectral_core.basis.metric import differences, local_metric
from spectral_core.basis.samples import texture_samples
from spectral_core.errors import LightError, SpectralBoothError, SpectrumError, TextureError
from spectral_core.lights import Light
from spectral_core.surfaces import Surface
from spectral_core.textures import ArrayTexture

LIGHTS = tuple(Light.builtin(name) for name in ("D65", "A", "FL11", "LED-B3"))
WHITES = np.stack([light.XYZ() for light in LIGHTS])
NM = np.linspace(400.0, 700.0, 31)


def XYZ_of(reflectance: np.ndarray, lights: tuple[Light, ...] = LIGHTS, nm: np.ndarray = NM) -> np.ndarray:
    """(n, L, 3) of reflectances (n, bands)."""
    return np.stack([reflectance @ light.weighting_factors(nm).matrix for light in lights], axis=1)


def reflectances(count: int, seed: int = 1) -> np.ndarray:
    """Smooth ones (count, 31) between 0.02 and 0.95."""
    rng = np.random.default_rng(seed)
    centres, widths = rng.uniform(380, 720, (2, count, 1, 1)), rng.uniform(30, 120, (1, count, 1, 1))
    bumps = np.exp(-(((NM - centres[0]) / widths[0]) ** 2))[:, 0] - 0.6 * np.exp(-(((NM - centres[1]) / 40) ** 2))[:, 0]
    bumps -= bumps.min(axis=1, keepdims=True)
    return 0.02 + 0.93 * rng.uniform(0.1, 1, (count, 1)) * bumps / bumps.max(axis=1, keepdims=True)


@pytest.fixture(scope="module")
def chart() -> np.ndarray:
    _, nm, values = standards.colorchecker()
    return XYZ_of(values, nm=nm)


@pytest.fixture(scope="module")
def five(chart: np.ndarray) -> SpectralBasis:
    return fit_basis(chart, LIGHTS, 5)


@pytest.fixture(scope="module")
def picture() -> ArrayTexture:
    """Mixtures of six smooth reflectances, 40 x 30 pixels."""
    shares = np.random.default_rng(2).dirichlet(np.full(6, 0.4), (30, 40))
    return ArrayTexture((shares @ reflectances(6)).astype(np.float32), NM, "picture")


def test_three_for_each_light_are_exact(chart: np.ndarray) -> None:
    """Of any colours, not only those it was fitted to; 1e-9 is far above float64's rounding of values near 1."""
    basis = fit_basis(chart[:2], LIGHTS, 12)
    others = np.random.default_rng(3).uniform(-0.1, 1.2, (50, 4, 3))
    np.testing.assert_allclose(basis.XYZ(basis.coefficients(others)), others, rtol=0, atol=1e-9)
    assert basis.largest_error < 1e-9


def test_bands_and_colours_give_the_same_coefficients(five: SpectralBasis) -> None:
    """Rounding of float64, times analysis of up to some hundred."""
    reflectance = reflectances(20)
    at_bands = reflectance @ five.band_analysis(NM)
    np.testing.assert_allclose(at_bands, five.coefficients(XYZ_of(reflectance)), rtol=0, atol=1e-11)
    backwards = reflectance[:, ::-1] @ five.band_analysis(NM[::-1])
    np.testing.assert_allclose(backwards, at_bands, rtol=0, atol=1e-9)


def test_errors_are_those_of_samples_and_white(five: SpectralBasis, chart: np.ndarray) -> None:
    """Computed here with the reference function, light by light; 1e-9 in dE00 is rounding of L*a*b*."""
    everything = np.concatenate([chart, WHITES[None]])
    shown = five.XYZ(five.coefficients(everything))
    for index, error in enumerate(five.errors):
        dE00 = standards.dE00(shown[:, index], everything[:, index], WHITES[index])
        found = (error.light, error.mean, error.p95, error.max)
        wanted = (LIGHTS[index].name, dE00.mean(), np.percentile(dE00, 95), dE00.max())
        assert found[0] == wanted[0]
        assert found[1:] == pytest.approx(wanted[1:], abs=1e-9)
        np.testing.assert_allclose(five.synthesis_of(error.light), five.synthesis[index])
    assert five.largest_error == max(each.max for each in five.measure(everything))


def test_the_largest_error_is_smaller_than_of_regression(chart: np.ndarray, five: SpectralBasis) -> None:
    """Reduced-rank regression in XYZ relative to white, whose components the fit starts near: at least halved."""
    relative = (np.concatenate([chart, WHITES[None]]) / WHITES).reshape(25, -1)
    directions = np.linalg.svd(relative, full_matrices=False)[2][:5]
    shown = (relative @ directions.T @ directions).reshape(25, 4, 3) * WHITES
    regression = differences(shown, relative.reshape(25, 4, 3) * WHITES, WHITES).max()
    assert five.largest_error < regression / 2


def test_the_metric_is_that_of_small_differences() -> None:
    """Against the formula with a step of about dE00 0.1: the next term is some hundredths of it."""
    rng = np.random.default_rng(4)
    colours = XYZ_of(reflectances(40))
    steps = 5e-4 * colours * rng.normal(size=colours.shape)
    metric = local_metric(colours, WHITES)
    predicted = np.sqrt(np.einsum("nli,nlij,nlj->nl", steps, metric, steps))
    np.testing.assert_allclose(predicted, differences(colours + steps, colours, WHITES), rtol=0.05, atol=2e-3)


def test_coefficients_are_scaled_and_survive_half_floats(chart: np.ndarray) -> None:
    """The largest of each is 1 in size. Half floats round by 2^-11: dE00 stays below 0.1, against the 40 of lightness
    that a coefficient may carry times 5e-4, and as much again in chroma."""
    basis = fit_basis(chart, LIGHTS, 8)
    coefficients = basis.coefficients(np.concatenate([chart, WHITES[None]]))
    np.testing.assert_allclose(np.abs(coefficients).max(axis=0), 1.0, rtol=1e-9)
    rounded = coefficients.astype(np.float16).astype(np.float64)
    cost = differences(basis.XYZ(rounded), basis.XYZ(coefficients), WHITES)
    assert 0.001 < cost.max() < 0.1
    exact, stored = basis.measure(chart), basis.measure(chart, coefficients[:-1].astype(np.float16))
    assert all(b.max <= a.max + cost.max() for a, b in zip(exact, stored, strict=True))


@pytest.mark.parametrize("tolerance", [2.0, 0.5, 0.1])
def test_the_fewest_coefficients_within_a_tolerance(chart: np.ndarray, tolerance: float) -> None:
    basis = choose_basis(chart, LIGHTS, tolerance)
    assert basis.largest_error <= tolerance
    assert basis.K == 3 or fit_basis(chart, LIGHTS, basis.K - 1).largest_error > tolerance


def test_the_white_is_within_the_tolerance_though_no_sample_is_grey() -> None:
    red = XYZ_of(np.where(NM > 600, 0.8, 0.03)[None] * np.linspace(0.2, 1, 9)[:, None])
    basis = choose_basis(red, LIGHTS, 0.2)
    greys = WHITES * np.linspace(0.02, 1, 20)[:, None, None]
    assert max(each.max for each in basis.measure(greys)) <= 0.2


def test_any_tolerance_and_any_number_of_samples(chart: np.ndarray) -> None:
    """One surface is enough, and where nothing else is small enough K = 3 L is."""
    assert choose_basis(chart[:1], LIGHTS, 0.01).largest_error <= 0.01
    assert choose_basis(chart, LIGHTS, 1e-13).K == 12


def test_many_samples_are_let_in_by_their_error() -> None:
    """More than are fitted at once: none of the rest is worse."""
    colours = XYZ_of(reflectances(1500))
    basis = choose_basis(colours, LIGHTS, 0.5)
    assert max(each.max for each in basis.measure(colours)) <= 0.5
    assert basis.K < 12


def test_the_same_again(chart: np.ndarray, five: SpectralBasis) -> None:
    """But for sums whose order depends on where an array lies in memory: 1e-10 here, and 1e-6 shows on no display."""
    again = fit_basis(chart, LIGHTS, 5)
    np.testing.assert_allclose(again.analysis, five.analysis, rtol=1e-6, atol=1e-6 * np.abs(five.analysis).max())
    np.testing.assert_allclose(again.synthesis, five.synthesis, rtol=1e-6, atol=1e-6)


def test_json_keeps_every_bit(five: SpectralBasis) -> None:
    lines = Light.from_lines("lines", [450.0, 550.0, 610.0], [1.0, 1.0, 1.0])
    basis = fit_basis(XYZ_of(reflectances(9), (*LIGHTS, lines)), (*LIGHTS, lines), 6)
    back = SpectralBasis.from_json(json.loads(json.dumps(basis.to_json())))
    np.testing.assert_array_equal(back.analysis, basis.analysis)
    np.testing.assert_array_equal(back.synthesis, basis.synthesis)
    np.testing.assert_array_equal(back.band_analysis(NM), basis.band_analysis(NM))
    assert back.errors == basis.errors
    assert back.light_names == basis.light_names
    assert back.lights[-1].lines.all()
    assert not back.lights[0].lines.any()


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("format", "other", "is no spectral basis of this version"),
        ("analysis", None, "are no basis of 4 lights"),
        ("analysis", [["x"]], "something that is no number"),
        ("analysis", [[1.0] * 4 + [float("nan")]] * 12, "no finite number"),
        ("synthesis", [[1.0]], "are no basis of 4 lights"),
        ("lights", [], "needs a light"),
        ("lights", [{"name": "D65"}], "lacks 'wavelengths_nm'"),
        ("errors", [{"light": "D65", "mean": "x", "p95": 0, "max": 0}], "something that is no number"),
        ("errors", [], "errors are not those"),
        ("observer", "me", "no observer 'me'"),
    ],
)
def test_json_that_is_no_basis(five: SpectralBasis, key: str, value: Any, message: str) -> None:
    with pytest.raises(SpectralBoothError, match=message):
        SpectralBasis.from_json({**five.to_json(), key: value})


def test_a_light_that_comes_later(chart: np.ndarray) -> None:
    """Its error is that of its synthesis; the basis with it leaves what is encoded as it is."""
    basis, new = fit_basis(chart, LIGHTS, 9), Light.builtin("D50")
    _, nm, values = standards.colorchecker()
    under_new = XYZ_of(values, (new,), nm)[:, 0]
    added = with_light(basis, new, chart, under_new)
    everything = np.concatenate([under_new, new.XYZ()[None]])
    coefficients = basis.coefficients(np.concatenate([chart, WHITES[None]]))
    dE00 = standards.dE00(coefficients @ added.synthesis.T, everything, new.XYZ())
    assert added.error.max == pytest.approx(dE00.max(), abs=1e-9)
    # D50 is nearly in the span of four lights like it: a tenth of what is visible.
    assert added.error.max < 0.1
    wider = extend(basis, added)
    assert wider.light_names == (*basis.light_names, "D50")
    # Added zeros may change the order of the sums.
    together = np.concatenate([chart, under_new[:, None]], axis=1)
    np.testing.assert_allclose(wider.coefficients(together), coefficients[:-1], rtol=0, atol=1e-12)
    np.testing.assert_array_equal(wider.synthesis_of("D50"), added.synthesis)
    with pytest.raises(LightError, match="two lights of the basis are called 'D50'"):
        extend(wider, added)


def test_a_light_that_sees_what_no_other_does_says_so(chart: np.ndarray) -> None:
    """A basis of one light knows nothing of another's colours but what the first one shows."""
    basis = fit_basis(chart[:, :1], LIGHTS[:1], 3)
    added = with_light(basis, LIGHTS[2], chart[:, :1], chart[:, 2])
    assert added.error.max > 1


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"K": 0}, "no spectral basis of 0 coefficients for 4 lights; K is a whole number from 1 to 12"),
        ({"K": 13}, "no spectral basis of 13"),
        ({"samples": np.zeros((0, 4, 3))}, "too few samples for a spectral basis: none"),
        ({"samples": np.zeros((3, 2, 3))}, r"samples of shape \(3, 2, 3\) have no XYZ under 4 lights"),
        ({"samples": np.full((3, 4, 3), np.nan)}, "sample 0 of 3 holds a value that is no finite number"),
        ({"lights": ()}, "needs a light"),
        ({"lights": LIGHTS[:1] * 4}, "two lights of the basis are called 'D65'"),
        ({"observer": "me"}, "no observer 'me'"),
        (
            {"lights": (*LIGHTS[:3], Light.from_lines("infrared", [720.0], [1.0]))},
            "colour differences are undefined under 'infrared'",
        ),
    ],
)
def test_what_cannot_be_fitted(chart: np.ndarray, wrong: dict[str, Any], message: str) -> None:
    how: dict[str, Any] = {"samples": chart, "lights": LIGHTS, "K": 4, **wrong}
    with pytest.raises(SpectralBoothError, match=message):
        fit_basis(**how)


def test_what_cannot_be_asked(five: SpectralBasis, chart: np.ndarray) -> None:
    with pytest.raises(LightError, match=r"the basis has no light 'D50'; it has D65, A, FL11, LED-B3"):
        five.synthesis_of("D50")
    with pytest.raises(SpectrumError, match=r"shape \(24, 3, 3\)"):
        five.coefficients(chart[:, :3])
    with pytest.raises(SpectrumError, match=r"coefficients of shape \(24, 4\) for 24 samples"):
        five.measure(chart, np.zeros((24, 4)))
    with pytest.raises(SpectrumError, match="give a tolerance above 0"):
        choose_basis(chart, LIGHTS, 0.0)
    with pytest.raises(SpectrumError, match=r"XYZ of shape \(3, 3\) under the new light for 24 samples"):
        with_light(five, Light.builtin("D50"), chart, np.zeros((3, 3)))


def test_surfaces_and_pixels_are_samples(picture: ArrayTexture) -> None:
    grey = Surface("grey", NM, np.full(31, 0.5), None, None, 0.0, 1.0)
    textured = Surface("textured", np.zeros(0), np.zeros(0), picture, None, 0.0, 1.0)
    samples = surface_samples([grey, textured], LIGHTS, count=50)
    assert 40 <= len(samples) <= 51
    np.testing.assert_allclose(samples[0], 0.5 * WHITES, rtol=0, atol=1e-12)
    everything = XYZ_of(picture.rows(0, 30).reshape(-1, 31).astype(np.float64))
    nearest = [np.abs(everything - sample).max(axis=(1, 2)).min() for sample in samples[1:]]
    assert max(nearest) < 1e-12  # pixels as they are, not mixtures
    np.testing.assert_array_equal(surface_samples([grey, textured], LIGHTS, count=50), samples)
    assert len(texture_samples(picture, LIGHTS, count=2000)) == 1200
    with pytest.raises(SpectrumError, match="no surface"):
        surface_samples([], LIGHTS)


@pytest.mark.parametrize("half", [False, True])
def test_a_texture_is_encoded_as_computed_directly(picture: ArrayTexture, five: SpectralBasis, half: bool) -> None:
    """Against float64 throughout. float32 sums err by 3e-6 of the white at most, the analysis multiplies that by up
    to its column sums; then float32 or half floats round once, in half floats perhaps to the other neighbour."""
    packed = encode_texture(picture, five, half)
    spectra = picture.rows(0, 30).astype(np.float64)
    wanted = spectra @ five.band_analysis(NM)
    assert [image.shape for image in packed.images] == [(30, 40, 4)] * 2
    assert {image.dtype for image in packed.images} == {np.dtype(np.float16 if half else np.float32)}
    assert not packed.images[1][:, :, 1:].any()
    assert max(np.abs(image).max() for image in packed.images) <= 1
    sums = 3e-6 * np.abs(five.analysis).sum(axis=0)
    rounding = (2.0**-10 if half else 2.0**-23) * np.abs(wanted)
    found = packed.coefficients()
    assert (np.abs(found - wanted) <= sums + rounding + 1e-7).all()
    errors = five.measure(XYZ_of(spectra.reshape(-1, 31)), found.reshape(-1, 5))
    for ours, direct in zip(packed.errors, errors, strict=True):
        # The projection's float32 against float64: dE00 1e-3 in the darkest; the percentile's bins are 1 % wide.
        assert (ours.mean, ours.max) == pytest.approx((direct.mean, direct.max), abs=1e-3)
        assert ours.p95 == pytest.approx(direct.p95, rel=0.02, abs=1e-3)
    if not half:
        of_worst = max(each.max for each in five.measure(packed.worst[:1]))
        assert packed.largest_error == pytest.approx(of_worst, abs=1e-3)


def test_coefficients_beyond_the_samples_are_scaled_by_powers_of_two(picture: ArrayTexture) -> None:
    """A basis fitted to dark samples only: bright pixels have larger coefficients than 1."""
    basis = fit_basis(XYZ_of(0.01 * reflectances(20, 9)), LIGHTS, 6)
    packed = encode_texture(picture, basis, half=False)
    assert packed.scale.max() > 1
    np.testing.assert_array_equal(np.log2(packed.scale) % 1, 0)
    assert all(np.abs(image).max() <= 1 for image in packed.images)
    wanted = picture.rows(0, 30).astype(np.float64) @ basis.band_analysis(NM)
    scale = np.abs(wanted).max(axis=(0, 1))
    np.testing.assert_allclose(packed.coefficients() / scale, wanted / scale, rtol=0, atol=1e-3)


def test_a_tolerance_holds_for_every_pixel(picture: ArrayTexture, chart: np.ndarray) -> None:
    packed = choose_for_textures([picture], LIGHTS, 0.3, chart)
    assert packed.textures[0].largest_error <= 0.3
    assert packed.basis.largest_error <= 0.3
    assert packed.basis.K < 12
    spectra = picture.rows(0, 30).reshape(-1, 31).astype(np.float64)
    stored = packed.textures[0].coefficients().reshape(-1, packed.basis.K)
    # 1e-3: float32 of the projection, as above.
    assert max(each.max for each in packed.basis.measure(XYZ_of(spectra), stored)) <= 0.3 + 1e-3


def test_half_floats_that_cost_more_than_the_tolerance_are_named(picture: ArrayTexture) -> None:
    with pytest.raises(SpectrumError, match=r"half floats alone cost dE00 .* use single floats"):
        choose_for_textures([picture], LIGHTS, 0.002)
    assert choose_for_textures([picture], LIGHTS, 0.01, half=False).textures[0].largest_error <= 0.01


def test_bad_textures(five: SpectralBasis) -> None:
    with pytest.raises(TextureError, match="holds radiance"):
        encode_texture(ArrayTexture(np.ones((4, 4, 31), np.float32), NM, kind="radiance"), five)
    holed = np.full((20, 20, 31), 0.5, np.float32)
    holed[3, 4, 5] = np.nan
    repaired = encode_texture(ArrayTexture(holed, NM), five)
    assert repaired.counts.repaired == 1
    assert any("1 of 400 pixels" in each for each in repaired.warnings)
    with pytest.raises(TextureError, match="row 3"):
        encode_texture(ArrayTexture(holed, NM), five, bad_pixels="refuse")
    with pytest.raises(TextureError, match="more than the images hold"):
        encode_texture(ArrayTexture(np.full((4, 4, 31), 1e6, np.float32), NM), five)


def test_encoding_stops_when_asked(five: SpectralBasis) -> None:
    """Progress rises to 1, and a closed generator leaves nothing running."""
    large = ArrayTexture(np.broadcast_to(reflectances(1).astype(np.float32), (600, 600, 31)), NM)
    seen: list[float] = []
    packed = encode_texture(large, five, progress=lambda fraction, _: seen.append(fraction))
    assert seen == sorted(seen)
    assert seen[-1] == 1
    assert len(seen) > 1
    assert packed.images[0].shape == (600, 600, 4)
    steps = encoding_steps(large, five)
    assert 0 < next(steps) < 1
    steps.close()


def test_public_names() -> None:
    assert sb.SpectralBasis is SpectralBasis
    assert sb.fit_basis is fit_basis
    assert sb.choose_basis is choose_basis
