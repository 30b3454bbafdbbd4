"""Spectral OpenEXR images of others: the format's own samples, and what must be refused."""

from __future__ import annotations

import json
import warnings
from pathlib import Path

import colour
import numpy as np
import pytest

from spectral_core.baking import bake
from spectral_core.cli import main
from spectral_core.imaging import oiio
from spectral_core.lights import Light
from spectral_core.textures import open_texture

BANDS = np.arange(380.0, 731.0, 10)


@pytest.fixture(scope="module")
def exr(measured_data: Path) -> Path:
    return measured_data / "hyperspectral"


@pytest.fixture(scope="module")
def chart(exr: Path) -> np.ndarray:
    """The 24 patches (24, 36) of Fichet's chart, about the centres of a 6 x 4 layout."""
    texture = open_texture(exr / "fichet_Macbeth.exr")
    assert (texture.width, texture.height, texture.kind, texture.format) == (
        600, 400, "reflectance", "spectral OpenEXR",
    )  # fmt: skip
    np.testing.assert_array_equal(texture.wavelengths_nm, BANDS)
    image = np.concatenate([tile.values for tile in texture.tiles()])
    pitch_y, pitch_x = image.shape[0] // 4, image.shape[1] // 6
    patches = []
    for row in range(4):
        for column in range(6):
            cell = image[row * pitch_y : (row + 1) * pitch_y, column * pitch_x : (column + 1) * pitch_x]
            centre = cell[pitch_y // 4 : -pitch_y // 4, pitch_x // 4 : -pitch_x // 4]
            assert np.ptp(centre, axis=(0, 1)).max() == 0, "a patch is not uniform about its centre"
            np.testing.assert_array_equal(
                texture.pixel(column * pitch_x + pitch_x // 2, row * pitch_y + pitch_y // 2), centre[0, 0]
            )
            patches.append(centre[0, 0])
    return np.array(patches, dtype=np.float64)


def test_fichets_chart_is_babelcolors_average(chart: np.ndarray) -> None:
    """Same data behind both; 3e-8 is half a float32 step of values below 1."""
    sds = colour.SDS_COLOURCHECKERS["BabelColor Average"]
    np.testing.assert_allclose(chart, [sd.values for sd in sds.values()], rtol=0, atol=3e-8)


def test_fichets_chart_under_d65(chart: np.ndarray) -> None:
    """colour-science's ASTM E308 at 10 nm: 4e-4 in XYZ, its interpolation of lamp and reflectance
    (see the weighting factors), which is at most 0.2 in dE00.
    """
    cmfs = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    ours = chart @ Light.builtin("D65").weighting_factors(BANDS).matrix
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        theirs = np.array(
            [
                colour.sd_to_XYZ(sd, cmfs, colour.SDS_ILLUMINANTS["D65"], method="ASTM E308") / 100
                for sd in colour.SDS_COLOURCHECKERS["BabelColor Average"].values()
            ]
        )
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=4e-4)
    white = colour.CCS_ILLUMINANTS["CIE 1931 2 Degree Standard Observer"]["D65"]
    difference = colour.delta_E(colour.XYZ_to_Lab(ours, white), colour.XYZ_to_Lab(theirs, white), method="CIE 2000")
    assert difference.max() < 0.2


def test_fichets_chart_looks_like_colour_sciences(chart: np.ndarray) -> None:
    """BabelColor's own xyY under D50, printed with the spectra: 0.2 in dE00 for the sums (ours leave
    the ends at 380 and 730 nm repeated) and the rounded print.
    """
    data = colour.CCS_COLOURCHECKERS["BabelColor Average"]
    published = colour.xyY_to_XYZ(list(data.data.values()))
    ours = chart @ Light.builtin("D50").weighting_factors(BANDS).matrix
    difference = colour.delta_E(
        colour.XYZ_to_Lab(ours, data.illuminant), colour.XYZ_to_Lab(published, data.illuminant), method="CIE 2000"
    )
    assert difference.max() < 0.2


def test_bake_of_the_chart_in_srgb(exr: Path, chart: np.ndarray, tmp_path: Path) -> None:
    """8-bit PNG against colour-science's encoding: half a level of rounding, and 0.15 of a level for
    its rounded sRGB matrix and the ends at 380 and 730 nm.
    """
    result = bake(open_texture(exr / "fichet_Macbeth.exr"), [Light.builtin("D65")], tmp_path, image_format="png8")
    pixels = 255 * oiio().ImageBuf(str(result.images[0].path)).get_pixels(oiio().FLOAT)
    baked = pixels[50::100, 50::100].reshape(-1, 3)
    XYZ = chart @ Light.builtin("D65").weighting_factors(BANDS).matrix
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        expected = 255 * np.clip(colour.XYZ_to_sRGB(XYZ), 0, 1)
    np.testing.assert_allclose(baked, expected, rtol=0, atol=0.65)


def test_fichets_d65_is_radiance_of_d65s_chromaticity(exr: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """CIE's D65 to float32 up to 780 nm, where colour-science's table ends. 3e-5 in xy: the published
    one rests on 1 nm, this on 5 nm (2e-5).
    """
    texture = open_texture(exr / "fichet_D65.exr")
    assert texture.kind == "radiance"
    np.testing.assert_array_equal(texture.wavelengths_nm, np.arange(380.0, 826.0, 5))
    spectrum = texture.pixel(0, 0)
    d65 = colour.SDS_ILLUMINANTS["D65"]
    table = np.array([d65[nm] for nm in texture.wavelengths_nm if nm <= d65.shape.end])
    assert len(table) >= 81
    np.testing.assert_allclose(spectrum[: len(table)] / spectrum[36], table / table[36], rtol=1e-6)
    xy = Light.from_table("D65", texture.wavelengths_nm, spectrum).xy()
    np.testing.assert_allclose(xy, (0.31272, 0.32903), rtol=0, atol=3e-5)
    assert main(["texture", "pixel", str(exr / "fichet_D65.exr"), "0", "0", "--light", "D65"]) == 2
    assert "already lit" in capsys.readouterr().err


@pytest.mark.parametrize(("name", "word"), [("colour_Polarised", "polarised"), ("colour_BiSpectral", "bispectral")])
def test_polarised_and_bispectral_files_are_refused(
    exr: Path, name: str, word: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    path = str(exr / f"{name}.exr")
    for command in (["texture", "info", path], ["bake", path, "--light", "D65", "-o", str(tmp_path)]):
        assert main(command) == 2
        captured = capsys.readouterr()
        assert word in captured.err
        assert captured.err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_info_says_what_the_file_says(exr: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["texture", "info", str(exr / "fichet_Macbeth.exr"), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert {key: document[key] for key in ("width", "height", "bands", "wavelengths_nm", "step_nm", "kind")} == {
        "width": 600, "height": 400, "bands": 36, "wavelengths_nm": [380, 730], "step_nm": 10, "kind": "reflectance",
    }  # fmt: skip
