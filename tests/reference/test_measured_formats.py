"""Every spectral OpenEXR and MATLAB texture of the measured data, value for value as other readers give it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from colour.io import read_spectral_image_Fichet2021

from spectral_core.errors import TextureError
from spectral_core.textures import HyperspectralTexture, Reading, open_texture

MatFile = Callable[[str], Mapping[str, Any]]


def whole(texture: HyperspectralTexture) -> np.ndarray:
    return np.concatenate([tile.values for tile in texture.tiles()])


@pytest.mark.parametrize(
    ("name", "part", "kind", "left_out", "fluorescent"),
    [
        ("fichet_Macbeth", "T", "reflectance", 0, False),
        ("fichet_D65", "S0", "radiance", 0, False),
        ("colour_Polarised", "S0", "radiance", 24, False),
        ("colour_BiSpectral", "T", "reflectance", 820, True),
    ],
)
def test_spectral_exr_as_colour_science_reads_it(
    measured_data: Path, name: str, part: str, kind: str, left_out: int, fluorescent: bool
) -> None:
    """What is left out is counted by colour-science's components: Stokes S1 to S3, or all pairs of wavelengths."""
    path = measured_data / "hyperspectral" / f"{name}.exr"
    components = read_spectral_image_Fichet2021(str(path))
    texture = open_texture(path, Reading(reduce=True))
    wavelengths, values = components.pop(part)
    np.testing.assert_allclose(texture.wavelengths_nm, wavelengths, rtol=0, atol=1e-6)
    # float32 both; colour-science goes through float64 and back.
    np.testing.assert_array_equal(whole(texture), values.astype(np.float32))
    assert (texture.kind, texture.fluorescent) == (kind, fluorescent)
    assert sum(len(others) for others, _ in components.values()) == left_out
    assert len(texture.warnings) == (left_out > 0)
    assert all(f": {left_out} channels" in warning for warning in texture.warnings)


@pytest.mark.parametrize(
    ("name", "array", "wavelengths", "shape", "range_"),
    [
        ("an_hsi_image_sub_for_demo", "hsi_img_sub", "wavelengths", (51, 88, 72), (-0.1822535, 0.854496)),
        ("an_hsi_img_for_class_demo", "hsi_sub", "wavlength", (31, 20, 72), (-0.1822535, 0.77411926)),
    ],
)
def test_matlab_cubes_as_scipy_reads_them(
    measured_data: Path, mat_file: MatFile, name: str, array: str, wavelengths: str, shape: tuple[int, int, int],
    range_: tuple[float, float],
) -> None:  # fmt: skip
    """Reflectance of MUUFL Gulfport with small negative values; the files do not say that it is reflectance."""
    path = measured_data / "hyperspectral" / f"{name}.mat"
    scipys = mat_file(f"hyperspectral/{name}.mat")
    texture = open_texture(path)
    assert (texture.height, texture.width, texture.bands, texture.format) == (*shape, "MATLAB v5")
    assert texture.kind == "unstated"
    assert open_texture(path, Reading(kind="reflectance")).kind == "reflectance"
    np.testing.assert_array_equal(whole(texture), scipys[array])
    np.testing.assert_array_equal(texture.wavelengths_nm, scipys[wavelengths])
    assert texture.warnings == (f"wavelengths 367.7 to 1043.4 nm from '{wavelengths}'",)
    # As the files' own figures to float32.
    assert (float(whole(texture).min()), float(whole(texture).max())) == pytest.approx(range_, rel=1e-7)


def test_arrays_in_structs_of_structs(measured_data: Path, mat_file: MatFile) -> None:
    """A display of ISETCam: 80 x 80 x 4 maps of its sub-pixels, in a struct in a struct."""
    scipys = mat_file("displays/OLED-Sony.mat")["d"]["dixel"].item()["intensitymap"].item()
    path = measured_data / "displays/OLED-Sony.mat"
    with pytest.raises(TextureError, match=r"d\.dixel\.intensitymap 80 x 80 x 4, d\.dixel\.controlmap 80 x 80 x 4"):
        open_texture(path)
    texture = open_texture(path, Reading(variable="d.dixel.intensitymap", wavelengths="400,500,600,700"))
    np.testing.assert_array_equal(whole(texture), scipys.astype(np.float32))


@pytest.mark.parametrize("name", ["reflectances/Food_Vhrel.mat", "lights/spd_houser.mat"])
def test_matlab_files_without_a_cube_say_what_they_hold(measured_data: Path, name: str) -> None:
    path = measured_data / name
    if not path.is_file():
        pytest.skip(f"{name} is not among the measured data")
    with pytest.raises(TextureError, match="holds no numeric array of shape") as caught:
        open_texture(path)
    assert "\n" not in str(caught.value)
