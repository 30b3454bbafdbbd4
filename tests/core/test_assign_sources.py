"""Spectra for RGB textures: what codes mean, libraries, what the spectra are worth."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from assign_samples import (
    D65,
    FL11,
    NM,
    all_dE00,
    noise,
    smooth_library,
    srgb_icc,
    write_image,
    write_library,
)

from spectral_core import standards
from spectral_core.assigning import Library, held_out, read_library, spectra_source
from spectral_core.assigning.codes import between, code_colours
from spectral_core.assigning.icc_codes import IccProfile
from spectral_core.assigning.image import RgbImage
from spectral_core.display import load_profile, srgb
from spectral_core.display.export import export_icc
from spectral_core.display.export.icc import D50
from spectral_core.errors import DisplayError, SpectrumError
from spectral_core.imaging import oiio
from spectral_core.lights import Light


@pytest.fixture
def image(tmp_path: Path) -> RgbImage:
    return RgbImage(write_image(tmp_path / "t.png", noise(8, 8)))


@pytest.mark.parametrize("lamp", ["D65", "A"])
def test_an_icc_profile_means_what_the_display_profile_means(image: RgbImage, tmp_path: Path, lamp: str) -> None:
    """Of two built-in displays, exported. LittleCMS gives 16-bit L*a*b*; ICC's own numbers have 16 bits too:
    0.02 dE00 for colours, 0.2 in the dark, where black is a large share."""
    pytest.importorskip("PIL")
    white = Light.builtin(lamp).XYZ()
    codes = np.random.default_rng(0).integers(0, 256, (500, 3)) / 255
    for name in ("sRGB", "htc-vive-2021"):
        by_icc = code_colours(image, white, icc=export_icc(load_profile(name), tmp_path / "p.icc"))
        own = code_colours(image, white, profile=name)
        dE00 = standards.dE00(by_icc.XYZ(codes), own.XYZ(codes), white)
        assert np.median(dE00) < 0.02
        assert dE00.max() < 0.2
        np.testing.assert_allclose(own.XYZ(np.ones((1, 3)))[0], white, atol=1e-9)
        np.testing.assert_allclose(by_icc.XYZ(np.ones((1, 3)))[0], white, atol=2e-4)
        assert "display" in by_icc.profile


def test_the_images_own_profile_is_used(tmp_path: Path) -> None:
    """Of Pillow, version 2: embedded in PNG and TIFF it gives what sRGB gives, within its own rounding."""
    icc, white = srgb_icc(), D65.XYZ()
    codes = noise(6, 5)
    for suffix in (".png", ".tif"):
        profile = np.frombuffer(icc, dtype=np.uint8)
        path = write_image(tmp_path / f"t{suffix}", codes, ICCProfile=(oiio().TypeDesc(f"uint8[{len(icc)}]"), profile))
        picture = RgbImage(path)
        assert picture.icc == icc
        means = code_colours(picture, white)
        assert "of the image itself" in means.profile
        assert means.warnings == ()
        expected = code_colours(picture, white, profile="sRGB")
        assert "not used" in expected.warnings[0]
        flat = codes.reshape(-1, 3) / 255
        assert standards.dE00(means.XYZ(flat), expected.XYZ(flat), white).max() < 0.05


def test_codes_of_16_bits_lie_between_those_of_8() -> None:
    """Linear steps of 1/255 on a curve like gamma 2.2: 1e-5 of XYZ."""
    profile = IccProfile(srgb_icc(), Path("s.icc"))
    codes = np.random.default_rng(1).uniform(0, 1, (300, 3))
    XYZ = srgb().to_XYZ(codes) @ between(srgb().to_XYZ(np.ones(3)), D50).T
    Lab = standards.XYZ_to_Lab(XYZ, D50)
    light = codes.min(axis=1) > 0.1  # the darkest steps are steep in L*a*b*
    assert standards.delta_E_2000(profile.Lab(codes), Lab)[light].max() < 0.03


def test_a_scanners_white_is_not_the_perfect_diffuser(image: RgbImage, tmp_path: Path) -> None:
    """The same profile as a scanner's with a medium of 80 %: its white has Y = 0.8, and chroma is scaled with it."""
    data = bytearray(srgb_icc())
    data[12:16] = b"scnr"
    count = struct.unpack(">I", data[128:132])[0]
    tags = {
        bytes(data[at : at + 4]): struct.unpack(">2I", data[at + 4 : at + 12])
        for at in range(132, 132 + 12 * count, 12)
    }
    at = tags[b"wtpt"][0]
    data[at + 8 : at + 20] = struct.pack(">3i", *np.round(D50 * 0.8 * 65536).astype(int).tolist())
    profile = IccProfile(bytes(data), Path("s.icc"))
    assert "input" in profile.name
    Lab = profile.Lab(np.ones((1, 3)))[0]
    assert Lab[0] == pytest.approx(116 * np.cbrt(0.8) - 16, abs=0.01)
    np.testing.assert_allclose(Lab[1:], 0, atol=0.02)
    path = tmp_path / "s.icc"
    path.write_bytes(data)
    assert "D50" in code_colours(image, FL11.XYZ(), icc=path).warnings[0]
    assert code_colours(image, Light.builtin("D50").XYZ(), icc=path).warnings == ()


def test_without_a_profile_srgb_is_taken_and_said(image: RgbImage) -> None:
    means = code_colours(image, D65.XYZ())
    assert means.profile == "sRGB"
    assert "taken as sRGB" in means.warnings[0]


def test_profiles_that_cannot_be_used(image: RgbImage, tmp_path: Path) -> None:
    pytest.importorskip("PIL")
    white = D65.XYZ()
    data = srgb_icc()
    for number, broken in enumerate((b"", b"no profile", data[:200], data[:16] + b"CMYK" + data[20:])):
        path = tmp_path / f"{number}.icc"
        path.write_bytes(broken)
        with pytest.raises(DisplayError, match=f"{number}.icc"):
            code_colours(image, white, icc=path)
    with pytest.raises(DisplayError, match="no such file"):
        code_colours(image, white, icc=tmp_path / "none.icc")
    with pytest.raises(DisplayError, match="both"):
        code_colours(image, white, icc=tmp_path / "0.icc", profile="sRGB")


def test_libraries_are_put_together(tmp_path: Path) -> None:
    first, second = smooth_library(5), smooth_library(7, seed=1)
    one, two = write_library(tmp_path / "a.csv", first), write_library(tmp_path / "b.csv", second)
    both = read_library([one, two, one])
    assert both.names == tuple(f"a r{i}" for i in range(5)) + tuple(f"b r{i}" for i in range(7))
    assert "5 reflectances are there twice" in both.warnings[0]
    np.testing.assert_array_equal(both.values, np.concatenate([first.values, second.values]))
    chart = read_library([one, "colorchecker"])
    assert len(chart.names) == 29
    assert "resampled to 31 wavelengths" in chart.warnings[0]
    finer = read_library(["colorchecker"], step_nm=5)
    np.testing.assert_array_equal(finer.wavelengths_nm, np.arange(380, 731, 5))
    # A cubic spline at the library's own wavelengths is the library.
    np.testing.assert_allclose(finer.values[:, ::2], read_library(["colorchecker"]).values, atol=1e-12)
    beyond = read_library(["colorchecker", one])
    assert "none beyond 400 to 700 nm" in beyond.warnings[-1]
    for bad in (0.01, 400.0):
        with pytest.raises(SpectrumError, match="impossible"):
            read_library([one], step_nm=bad)
    with pytest.raises(SpectrumError, match="no library"):
        read_library([])


def test_matlab_libraries(tmp_path: Path) -> None:
    scipy_io = pytest.importorskip("scipy.io")
    library = smooth_library(4)
    for name, order in (("up", slice(None)), ("down", slice(None, None, -1))):
        variables = {"data": library.values.T[order], "wavelength": NM[order][None], "comment": "made"}
        scipy_io.savemat(tmp_path / f"{name}.mat", variables, do_compression=name == "up")
        found = read_library([tmp_path / f"{name}.mat"])
        np.testing.assert_array_equal(found.values, library.values)
        np.testing.assert_array_equal(found.wavelengths_nm, NM)
        assert found.names == ("1", "2", "3", "4")
    bad = {
        "no variable 'data' of numbers, only wavelength": {"wavelength": NM},
        "no variable 'data' of numbers": {"data": "text", "wavelength": NM},
        "has 30 rows": {"data": library.values.T[:30], "wavelength": NM},
        "'data' of numbers": {"data": library.values.T * 1j, "wavelength": NM},
        "finite": {"data": library.values.T * np.nan, "wavelength": NM},
        "occurs twice": {"data": library.values.T, "wavelength": np.repeat(NM[:16], 2)[:31]},
        "reflectance up to": {"data": library.values.T * 100, "wavelength": NM},
        "micrometres": {"data": library.values.T, "wavelength": NM / 1000},
    }
    for message, variables in bad.items():
        scipy_io.savemat(tmp_path / "bad.mat", variables)
        with pytest.raises(SpectrumError, match=message):
            read_library([tmp_path / "bad.mat"])
    (tmp_path / "new.mat").write_bytes(b"MATLAB 7.3 MAT-file, Platform: GLNXA64" + bytes(600))
    with pytest.raises(SpectrumError, match=r"new\.mat"):
        read_library([tmp_path / "new.mat"])


def test_held_out_leaves_itself_out() -> None:
    """By hand: for each reflectance the nearest of the others under the scanner's lamp, compared under A."""
    library, A = smooth_library(60), Light.builtin("A")
    (found,) = held_out(spectra_source(FL11, library), library, FL11, [A])
    distances = all_dE00(library.Lab(FL11), library.Lab(FL11))
    np.fill_diagonal(distances, np.inf)
    expected = standards.delta_E_2000(library.Lab(A), library.Lab(A)[distances.argmin(axis=1)])
    assert found.dE00.mean == pytest.approx(expected.mean(), abs=1e-9)
    assert found.dE00.max == pytest.approx(expected.max(), abs=1e-9)
    assert found.colours == 60
    same = held_out(spectra_source(FL11, library, 8, exact=True), library, FL11, [FL11, A])
    assert same[0].dE00.mean < 0.2  # the colour itself is met, but for those that 0..1 keeps away
    assert same[1].dE00.mean < found.dE00.mean / 3
    with pytest.raises(SpectrumError, match="left out"):
        held_out(spectra_source(FL11, smooth_library(1)), smooth_library(1), FL11, [A])


def test_a_grey_rgb_texture_is_right_under_any_lamp() -> None:
    """The yardstick itself: of constant reflectances an RGB texture predicts all colours, to rounding."""
    grey = Library(("a", "b", "c"), NM, np.array([0.2, 0.5, 0.8])[:, None] * np.ones(len(NM)))
    (found,) = held_out(spectra_source(D65, grey), grey, D65, [Light.builtin("A")])
    assert found.rgb_texture.max < 1e-6
