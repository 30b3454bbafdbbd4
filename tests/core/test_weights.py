from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spectral_core import standards
from spectral_core.errors import LightError, SpectrumError
from spectral_core.lights import Light
from spectral_core.weights import colour_matching, interpolation_operator, quadrature_widths, weighting_factors

BANDS = np.arange(380.0, 781.0, 4)


def test_lines_between_bands_are_exact_for_a_cubic_reflectance() -> None:
    """A cubic spline reproduces cubics, so three laser lines give the analytic sum.

    1e-9: float64 rounding through a spline solve of 101 bands is about 1e-13.
    """
    lines, powers = np.array([457.3, 532.1, 638.9]), np.array([1.0, 0.7, 1.3])

    def cubic(nm: np.ndarray) -> np.ndarray:
        t = (nm - 580) / 200
        return 0.4 + 0.2 * t - 0.1 * t**2 + 0.15 * t**3

    light = Light.from_lines("lasers", lines.tolist(), powers.tolist())
    per_line = powers[:, None] * colour_matching(lines)
    exact = cubic(lines) @ per_line / per_line[:, 1].sum()
    for bands in (BANDS, BANDS[::-1], np.sort(np.random.default_rng(1).uniform(390, 720, 40))):
        ours = cubic(bands) @ light.weighting_factors(bands).matrix
        np.testing.assert_allclose(ours, exact, rtol=0, atol=1e-9)


@settings(max_examples=60, deadline=None)
@given(
    bands=st.lists(st.floats(200, 1100), min_size=1, max_size=60, unique=True),
    light=st.sampled_from(["D65", "A", "FL11", "LPS", "two-peaks-d65"]),
    observer=st.sampled_from(list(standards.OBSERVERS)),
)
def test_the_perfect_diffuser_is_the_white_on_any_grid(bands: list[float], light: str, observer: str) -> None:
    """Interpolation weights sum to one, whatever the grid: the columns sum to the white's XYZ."""
    grid = np.array(bands)
    if len(grid) > 1 and np.diff(np.sort(grid)).min() < 0.05:
        return  # nearly coincident bands have huge weights of both signs
    factors = Light.builtin(light).weighting_factors(grid, observer)
    scale = max(1.0, float(np.abs(factors.matrix).max()))
    np.testing.assert_allclose(factors.matrix.sum(axis=0), factors.white_XYZ, atol=1e-9 * scale)
    assert factors.white_XYZ[1] == pytest.approx(1.0, abs=1e-12)
    assert 0 <= factors.extended <= 2


@given(st.permutations(list(range(20))))
def test_the_order_of_bands_does_not_matter(order: list[int]) -> None:
    light = Light.builtin("FL11")
    bands = np.linspace(400, 700, 20)
    straight = light.weighting_factors(bands).matrix
    shuffled = light.weighting_factors(bands[order]).matrix
    np.testing.assert_allclose(shuffled, straight[order], atol=1e-15)


@pytest.mark.parametrize("count", [2, 3, 4, 5, 30])
def test_the_spline_reproduces_polynomials_up_to_its_samples(count: int) -> None:
    """Degree 3, or less with fewer than four samples; linear reproduces degree 1."""
    rng = np.random.default_rng(count)
    source = np.sort(rng.uniform(400, 700, count))
    target = rng.uniform(source[0], source[-1], 50)
    polynomial = np.polynomial.Polynomial(rng.normal(size=min(count, 4)), domain=[400, 700])
    np.testing.assert_allclose(
        interpolation_operator(source, target) @ polynomial(source), polynomial(target), atol=1e-10
    )
    line = np.polynomial.Polynomial([0.3, 0.2], domain=[400, 700])
    np.testing.assert_allclose(
        interpolation_operator(source, target, "linear") @ line(source), line(target), atol=1e-12
    )


def test_ends_are_repeated_and_reported() -> None:
    """ASTM E308: weight beyond the bands goes to the end bands; 400-1000 nm under E misses 0.4 % of Z or X."""
    light = Light.builtin("E")
    factors = light.weighting_factors(np.arange(400.0, 1001.0, 4))
    below = light.wavelengths_nm < 400
    matching = colour_matching(light.wavelengths_nm)
    share = (light.powers[:, None] * matching)[below].sum(axis=0) / (light.powers[:, None] * matching).sum(axis=0)
    assert factors.extended_below == pytest.approx(share.max(), rel=1e-12)
    assert factors.extended_above == 0.0
    assert 0.001 < factors.extended_below < 0.01


def test_cubic_is_more_accurate_than_linear() -> None:
    """The reason for the spline, on a smooth reflectance at 10 nm."""
    light = Light.builtin("FL11")

    def smooth(nm: np.ndarray) -> np.ndarray:
        return 0.5 + 0.3 * np.sin(nm / 25)

    exact = smooth(light.wavelengths_nm) @ light.weighting_factors(light.wavelengths_nm).matrix
    bands = np.arange(380.0, 781.0, 10)
    errors = {
        kind: np.abs(smooth(bands) @ light.weighting_factors(bands, interpolation=kind).matrix - exact).max()
        for kind in ("linear", "cubic")
    }
    assert errors["cubic"] < errors["linear"] / 5


def test_observers_at_their_own_samples_are_the_table() -> None:
    for observer in standards.OBSERVERS:
        wavelengths, values = standards.observer_table(observer)
        np.testing.assert_allclose(colour_matching(wavelengths, observer), values, atol=1e-15)
        assert not colour_matching(np.array([100.0, 2000.0]), observer).any()


def test_quadrature_of_an_even_table_is_its_step() -> None:
    np.testing.assert_array_equal(quadrature_widths(np.arange(380.0, 781.0, 5)), 5.0)
    np.testing.assert_array_equal(quadrature_widths(np.array([400.0, 410.0, 440.0])), [10.0, 20.0, 30.0])


@pytest.mark.parametrize("bands", [[400.0, 400.0], [np.nan, 500.0], [], np.linspace(380, 780, 4001).tolist()])
def test_impossible_bands_are_refused(bands: list[float]) -> None:
    with pytest.raises(SpectrumError):
        Light.builtin("D65").weighting_factors(np.array(bands))


def test_invisible_light_is_refused() -> None:
    with pytest.raises(LightError):
        weighting_factors(np.array([900.0]), np.array([1.0]), BANDS)
    with pytest.raises(SpectrumError):
        interpolation_operator(BANDS, BANDS, "nearest")


def test_colour_science_leaves_no_mocks_behind() -> None:
    """Without scipy or matplotlib it replaces them in the whole process."""
    import sys
    from unittest.mock import NonCallableMock

    standards.colour_science_version()
    assert not [name for name, module in sys.modules.items() if isinstance(module, NonCallableMock)]
