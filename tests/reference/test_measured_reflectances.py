"""Measured reflectances under several lights, through CSV and the command line, against colour-science."""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import Any

import colour
import numpy as np
import pytest

from spectral_core.cli import main
from spectral_core.lights import Light

LIBRARIES = ("Food_Vhrel", "Nature_Vhrel", "Objects_Vhrel", "MiniatureMacbethChart")
LIGHTS = ("D65", "A", "FL11", "LED-B3")
CMFS = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]


def as_csv(path: Path, nm: np.ndarray, values: np.ndarray) -> Path:
    rows = [",".join(map(repr, [float(a), *map(float, b)])) for a, b in zip(nm, values, strict=True)]
    header = "nm," + ",".join(f"s{i}" for i in range(values.shape[1]))
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize("library", LIBRARIES)
def test_libraries_under_lights(
    mat_file: Any, library: str, light: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """XYZ, Lab, codes and gamut of every sample.

    XYZ: colour-science's own (scipy's) spline of the reflectance to the lamp's samples, ends
    repeated, and a plain sum; 1e-11 is float64 rounding, 1e-9 the same in Lab. Linear sRGB: 3e-4,
    for colour-science rounds its matrix to four decimals (half a unit times X + Y + Z).
    """
    spline = pytest.importorskip("scipy.interpolate").CubicSpline
    found = mat_file(f"reflectances/{library}.mat")
    nm, values = found["wavelength"].astype(float), found["data"]
    assert main(["reflectance", str(as_csv(tmp_path / "r.csv", nm, values)), "--light", light, "--json"]) == 0
    colours = json.loads(capsys.readouterr().out)["colours"]
    assert len(colours) == values.shape[1]

    lamp = colour.SDS_ILLUMINANTS[light]
    at = np.array([each for each in lamp.wavelengths if CMFS.shape.start <= each <= CMFS.shape.end])
    power = np.array([lamp[each] for each in at])
    weight = power[:, None] * np.array([CMFS[each] for each in at])
    weight /= weight[:, 1].sum()
    clipped = np.clip(at, nm[0], nm[-1])
    XYZ = spline(nm, values, axis=0)(clipped).T @ weight
    white = weight.sum(axis=0)
    Lab = colour.XYZ_to_Lab(XYZ, white[:2] / white.sum())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        linear = colour.XYZ_to_sRGB(XYZ, apply_cctf_encoding=False)
    codes = np.array([each["rgb_8bit"] for each in colours]) / 255
    np.testing.assert_allclose([each["XYZ"] for each in colours], XYZ, rtol=0, atol=1e-11)
    np.testing.assert_allclose([each["Lab"] for each in colours], Lab, rtol=0, atol=1e-9)
    shown = np.sign(codes) * colour.cctf_decoding(np.abs(codes))
    np.testing.assert_allclose(shown, linear, rtol=0, atol=3e-4)
    outside = np.maximum(-linear, linear - 1).max(axis=1)
    clear = np.abs(outside) > 5e-4  # nearer to the border the rounded matrix decides
    assert [each["in_gamut"] for each in np.array(colours)[clear]] == (outside[clear] < 0).tolist()


def test_the_small_chart_is_a_chart(mat_file: Any) -> None:
    """A small ColorChecker measured by others, column by column from the upper left: each patch is
    nearest to its own one of BabelColor's average.

    Another print and another instrument: mean dE00 1.7, below 2.
    """
    found = mat_file("reflectances/MiniatureMacbethChart.mat")
    nm, values = found["wavelength"].astype(float), found["data"].T
    ours = colour.XYZ_to_Lab(values @ Light.builtin("D65").weighting_factors(nm).matrix)
    sds = colour.SDS_COLOURCHECKERS["BabelColor Average"]
    grid = next(iter(sds.values())).wavelengths
    chart = np.array([sd.values for sd in sds.values()]) @ Light.builtin("D65").weighting_factors(grid).matrix
    Lab = colour.XYZ_to_Lab(chart)
    distances = np.array([[colour.delta_E(a, b, method="CIE 2000") for b in Lab] for a in ours])
    columns = np.arange(24).reshape(4, 6).T.ravel()
    np.testing.assert_array_equal(distances.argmin(axis=1), columns)
    assert distances.min(axis=1).mean() < 2
