"""Measured lamps: colour and quality against colour-science called directly, and against first principles."""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import Any

import colour
import numpy as np
import pytest

from spectral_core import standards
from spectral_core.cli import main
from spectral_core.light_design import two_peak_metamer
from spectral_core.lights import LARGEST_DUV, Light

CMFS = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]


def sums(nm: np.ndarray, powers: np.ndarray) -> np.ndarray:
    """XYZ (..., 3), Y = 1, as plain sums at the table's own even samples."""
    XYZ = powers @ np.array([CMFS[each] for each in nm.tolist()])
    return np.asarray(XYZ / XYZ[..., 1:2])


def uv(XYZ: np.ndarray) -> np.ndarray:
    """CIE 1960 uv."""
    return np.asarray(XYZ[..., :2] * [4, 6] / (XYZ @ [1, 15, 3])[..., None])


def test_xyz_of_401_sources(houser: tuple[np.ndarray, np.ndarray]) -> None:
    """1e-12: the same 81 products in float64, in another order."""
    nm, spds = houser
    ours = [Light.from_table("each", nm, spd).XYZ() for spd in spds]
    np.testing.assert_allclose(ours, sums(nm, spds), rtol=1e-12, atol=1e-15)


def test_cct_and_duv_of_401_sources_by_search(houser: tuple[np.ndarray, np.ndarray]) -> None:
    """The nearest of 30000 Planckian radiators (Planck's law summed here, 0.01 % apart).

    2e-4 in CCT: that grid, and Ohno's parabola (2013: 1 K); 3e-5 in Duv, from the same two.
    """
    nm, spds = houser
    metres = CMFS.wavelengths * 1e-9
    kelvin = 1000 * 1.0001 ** np.arange(30000)
    planck = metres**-5.0 / np.expm1(1.4388e-2 / (metres * kelvin[:, None]))
    locus = uv(planck @ CMFS.values)
    for spd, at in zip(spds, uv(sums(nm, spds)), strict=True):
        distance = np.hypot(*(locus - at).T)
        nearest = int(distance.argmin())
        cct, duv = standards.cct_and_duv(Light.from_table("each", nm, spd).xy())
        assert cct == pytest.approx(kelvin[nearest], rel=2e-4)
        assert duv == pytest.approx(distance[nearest] * np.sign(at[1] - locus[nearest, 1]), abs=3e-5)


def test_fidelity_and_rendering_indices_are_colour_sciences(houser: tuple[np.ndarray, np.ndarray]) -> None:
    """Every eighth source; the table goes in as it is, so nothing but float64 rounding may differ."""
    nm, spds = houser
    for spd in spds[::8]:
        sd = colour.SpectralDistribution(dict(zip(nm.tolist(), spd.tolist(), strict=True)))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            rf = colour.colour_fidelity_index(sd, method="CIE 2017")
            ra = colour.colour_rendering_index(sd)
        quality = Light.from_table("each", nm, spd).quality()
        assert quality.rf == pytest.approx(rf, abs=1e-9)
        assert quality.ra == pytest.approx(ra, abs=1e-9)


@pytest.mark.parametrize("lamp", ["illA-20201023", "illCWF-20201023", "illDay-20201023"])
def test_booth_lamps_from_a_file(mat_file: Any, lamp: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A measured booth, through CSV and the command line. 1e-12: numbers survive `repr`."""
    found = mat_file(f"lights/gretag/{lamp}.mat")
    nm, spd = found["wavelength"].astype(float), found["data"]
    path = tmp_path / f"{lamp}.csv"
    rows = "\n".join(f"{float(a)!r},{float(b)!r}" for a, b in zip(nm, spd, strict=True))
    path.write_text(f"nm,{lamp}\n{rows}\n", encoding="utf-8")
    assert main(["light", str(path), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    np.testing.assert_allclose(document["XYZ"], 100 * sums(nm, spd), rtol=1e-12)
    # What the lamps are called: A is near 2856 K, CWF near 4150 K, Day near 6500 K (a booth drifts by 10 %).
    nominal = {"illA": 2856, "illCWF": 4150, "illDay": 6500}[lamp.split("-")[0]]
    assert document["cct_K"] == pytest.approx(nominal, rel=0.1)


def test_short_tables_are_told(mat_file: Any) -> None:
    """The 2018 measurements end at 700 nm in mid-slope and have 10 nm steps: both are said."""
    found = mat_file("lights/gretag/illA-20180220.mat")
    light = Light.from_table("A", found["wavelength"].astype(float), found["data"])
    assert any("every 10 nm" in each for each in light.warnings)
    assert any("ends at 700 nm" in each for each in light.warnings)


def test_saturated_leds(mat_file: Any) -> None:
    """Six narrow LEDs: chromaticities as plain sums; the saturated ones have no CCT and no index."""
    found = mat_file("lights/ledSixSpectra.mat")
    nm, spds = found["wavelength"].astype(float), found["data"].T
    assert len(spds) == 6
    saturated = 0
    for spd in spds:
        light = Light.from_table("LED", nm, spd)
        np.testing.assert_allclose(light.XYZ(), sums(nm, spd), rtol=1e-12, atol=1e-15)
        quality = light.quality()
        if quality.duv is None or abs(quality.duv) > LARGEST_DUV:
            saturated += 1
            assert quality.cct_K is quality.rf is quality.ra is None
    assert saturated >= 3


@pytest.mark.parametrize("peak", [432.5, 456.0, 468.5])
def test_two_peaks_with_colour_sciences_own_observer(peak: float) -> None:
    """Interpolated linearly between its 1 nm samples, where ours is a spline: they differ by at most
    an eighth of the second difference (9e-4 of a Z near 1.7 at worst), about 7e-5 in xy.
    """
    target = colour.CCS_ILLUMINANTS["CIE 1931 2 Degree Standard Observer"]["D65"]
    light = two_peak_metamer(np.array(target), peak)
    at = np.stack([np.interp(light.wavelengths_nm, CMFS.wavelengths, CMFS.values[:, i]) for i in range(3)], axis=1)
    XYZ = light.powers @ at
    np.testing.assert_allclose(XYZ[:2] / XYZ.sum(), target, rtol=0, atol=7e-5)
