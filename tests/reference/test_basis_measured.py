"""Spectral bases of measured surfaces under very different lights: how many coefficients do.

ISETCam's objects, food and natural objects (Vrhel et al. 1994; the objects hold the other two, which therefore count
twice) and the 24 ColorChecker patches: 300 surfaces, from 400 to 700 nm in steps of 10 nm.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spectral_core import standards
from spectral_core.baking import level2_weights
from spectral_core.basis import SpectralBasis, choose_basis, choose_for_textures, fit_basis
from spectral_core.basis.metric import differences
from spectral_core.lights import Light
from spectral_core.textures import open_texture

LIGHTS = [
    Light.builtin(name) for name in ("D65", "D50", "A", "FL11", "Philips TL-84", "LED-B3", "HP1", "two-peaks-d65")
]
WHITES = np.stack([light.XYZ() for light in LIGHTS])
NM = np.arange(400.0, 701.0, 10.0)
# Largest dE00 that these many coefficients must stay within.
REQUIRED = {7: 1.0, 9: 0.2, 12: 0.1}


@pytest.fixture(scope="module")
def surfaces(mat_file: Any) -> np.ndarray:
    """XYZ (300, 8, 3)."""
    found = []
    for name in ("Objects", "Food", "Nature"):
        library = mat_file(f"reflectances/{name}_Vhrel.mat")
        found += [np.interp(NM, library["wavelength"].astype(float), each) for each in library["data"].T]
    _, nm, values = standards.colorchecker()
    found += [np.interp(NM, nm, each) for each in values]
    assert len(found) == 300
    return np.stack([np.array(found) @ light.weighting_factors(NM).matrix for light in LIGHTS], axis=1)


@pytest.fixture(scope="module")
def fitted(surfaces: np.ndarray) -> dict[int, tuple[SpectralBasis, float]]:
    """Bases by K, each with the seconds it took."""
    standards.dE00(WHITES[0], WHITES[0], WHITES[0])  # the import of colour-science is not part of a fit
    found = {}
    for K in REQUIRED:
        started = time.perf_counter()
        basis = fit_basis(surfaces, LIGHTS, K)
        found[K] = (basis, time.perf_counter() - started)
    return found


def regression(surfaces: np.ndarray, K: int) -> float:
    """Largest dE00 of the best mean square of XYZ / white with K coefficients."""
    relative = (surfaces / WHITES).reshape(len(surfaces), -1)
    directions = np.linalg.svd(relative, full_matrices=False)[2][:K]
    return float(differences((relative @ directions.T @ directions).reshape(-1, 8, 3) * WHITES, surfaces, WHITES).max())


@pytest.mark.parametrize("K", REQUIRED)
def test_few_coefficients_do(fitted: dict[int, tuple[SpectralBasis, float]], surfaces: np.ndarray, K: int) -> None:
    """dE00 by colour-science, light by light; the white, which is no surface, within the same. What half floats add
    is below 0.1: 2^-11 of a coefficient that carries up to 100 of lightness or chroma."""
    basis, seconds = fitted[K]
    shown = basis.XYZ(basis.coefficients(surfaces))
    dE00 = np.stack([standards.dE00(shown[:, i], surfaces[:, i], WHITES[i]) for i in range(8)])
    halves = basis.coefficients(surfaces).astype(np.float16)
    stored = max(each.max for each in basis.measure(surfaces, halves))
    white = max(each.max for each in basis.measure(WHITES[None]))
    print(
        f"\nK = {K}: dE00 max {dE00.max():.3f}, mean {dE00.mean():.3f}; half floats {stored:.3f}; white {white:.3f}; "
        f"regression {regression(surfaces, K):.3f}; {seconds:.2f} s"
    )
    assert dE00.max() <= REQUIRED[K]
    assert white <= REQUIRED[K]
    assert stored < dE00.max() + 0.1
    assert seconds < 5


def test_regression_needs_more(surfaces: np.ndarray, fitted: dict[int, tuple[SpectralBasis, float]]) -> None:
    """Of mean squares, at least two coefficients more for each tolerance."""
    for K, limit in REQUIRED.items():
        assert fitted[K][0].largest_error < regression(surfaces, K) / 2
        assert regression(surfaces, K + 1) > limit


@pytest.mark.parametrize("K", REQUIRED)
def test_other_surfaces_are_worse_and_it_is_said(surfaces: np.ndarray, K: int) -> None:
    """Fitted to every second surface, which puts the duplicates on either side; the rest has a larger error."""
    for half in (0, 1):
        basis = fit_basis(surfaces[half::2], LIGHTS, K)
        of_others = basis.measure(surfaces[1 - half :: 2])
        largest, mean = max(each.max for each in of_others), np.mean([each.mean for each in of_others])
        print(f"\nK = {K}: fitted to a half {basis.largest_error:.3f}, the other half {largest:.3f}, mean {mean:.3f}")
        assert largest > basis.largest_error
        assert mean < REQUIRED[K]


@pytest.mark.parametrize("tolerance", [1.0, 0.2, 0.1, 0.05])
def test_a_tolerance_finds_its_coefficients(surfaces: np.ndarray, tolerance: float) -> None:
    started = time.perf_counter()
    basis = choose_basis(surfaces, LIGHTS, tolerance)
    seconds = time.perf_counter() - started
    print(f"\ndE00 {tolerance}: K = {basis.K}, {basis.largest_error:.3f}, {seconds:.2f} s")
    assert max(each.max for each in basis.measure(surfaces)) <= tolerance
    assert min(K for K, limit in {**REQUIRED, 13: 0.05}.items() if limit <= tolerance) >= basis.K


@pytest.mark.parametrize(("tolerance", "most"), [(1.0, 5), (0.3, 9)])
def test_a_capture_is_within_the_tolerance_in_every_pixel(measured_data: Path, tolerance: float, most: int) -> None:
    """An airborne capture of land and water, 10 000 pixels as half floats, against float64 throughout.

    1e-3: the projection's float32 in the darkest pixels.
    """
    path = measured_data / "hyperspectral/jasperRidge2_R198.hdr"
    if not path.is_file():
        pytest.skip(f"{path.name} is not among the measured data")
    texture = open_texture(path)
    packed = choose_for_textures([texture], LIGHTS, tolerance)
    basis, stored = packed.basis, packed.textures[0].coefficients().reshape(-1, packed.basis.K)
    spectra = texture.rows(0, texture.height).reshape(-1, texture.bands).astype(np.float64)
    XYZ = (spectra @ level2_weights(texture, LIGHTS)).reshape(-1, len(LIGHTS), 3)
    largest = max(each.max for each in basis.measure(XYZ, stored))
    print(f"\ndE00 {tolerance}: K = {basis.K}, every pixel within {largest:.3f}")
    assert largest <= tolerance + 1e-3
    assert packed.textures[0].largest_error == pytest.approx(largest, abs=1e-3)
    assert most >= basis.K
