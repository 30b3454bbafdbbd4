"""What sampling at 4 nm from 380 to 780 nm costs, on the chart's measured spectra.

Reference: the same lamp nodes in float64 with the reflectance's own spline at them. The bounds are
about five times the interpolation error of a cubic spline there for smooth lamps, twice for lamps
with lines, and what two bare lines between bands reach (``benchmarks/weighting_factors.py``).
"""

from __future__ import annotations

import numpy as np
import pytest

from spectral_core import light_design, standards
from spectral_core.lights import Light
from spectral_core.weights import colour_matching, interpolation_operator

BANDS = np.arange(380.0, 781.0, 4)
SMOOTH = ("A", "B", "C", "D50", "D55", "D65", "D75", "E", "LED-B1", "LED-B4", "LED-V1", "Incandescent", "ID65")


def largest_error(light: Light) -> float:
    _, nm, reflectance = standards.colorchecker("ColorChecker N Ohta")
    at_nodes = reflectance @ interpolation_operator(nm, light.wavelengths_nm).T
    per_node = light.powers[:, None] * colour_matching(light.wavelengths_nm)
    exact = at_nodes @ per_node / per_node[:, 1].sum()
    sampled = reflectance @ interpolation_operator(nm, BANDS).T @ light.weighting_factors(BANDS).matrix
    white = light.XYZ()
    difference = standards.delta_E_2000(standards.XYZ_to_Lab(sampled, white), standards.XYZ_to_Lab(exact, white))
    return float(difference.max())


@pytest.mark.parametrize("name", SMOOTH)
def test_smooth_lights(name: str) -> None:
    assert largest_error(Light.builtin(name)) <= 0.005


@pytest.mark.parametrize("name", ["FL11", "Philips TL-84", "HP1", "LED-B3"])
def test_lights_with_lines(name: str) -> None:
    assert largest_error(Light.builtin(name)) <= 0.01


@pytest.mark.parametrize("peak", [430.0, 437.0, 445.0, 450.0, 456.0, 463.0, 470.0, 475.0])
def test_two_lines(peak: float) -> None:
    assert largest_error(light_design.two_peak_metamer(Light.builtin("D65").xy(), peak)) <= 0.035
