"""ENVI spectral libraries as tables of spectra: by their header, as CSV would be read."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from envi_samples import cube_of, listed, write_envi, write_library

from spectral_core.errors import SpectrumError
from spectral_core.spectra import Quantity, Spectra, read_spectra, write_spectra

NM = np.arange(380.0, 781.0, 20)
VALUES = np.random.default_rng(1).uniform(0.02, 0.9, (3, len(NM)))
NAMED = "spectra names = {leaf, red brick,\n sea water}"


def library(
    folder: Path, *more: str, values: np.ndarray = VALUES, code: int = 5, quantity: Quantity = "reflectance"
) -> Spectra:
    lines = ("wavelength units = Nanometers", f"wavelength = {listed(NM[: values.shape[1]])}", NAMED)
    return read_spectra(write_library(folder, values, code, *lines, *more), quantity)


@pytest.mark.parametrize("data", ["lib.sli", "lib.SLI", "lib", "lib.dat"])
def test_a_library_by_either_file(tmp_path: Path, data: str) -> None:
    lines = ("wavelength units = Micrometers", f"wavelength = {listed(NM / 1000)}", NAMED)
    header = write_library(tmp_path, VALUES, 5, *lines, data=data)
    for path in (header, tmp_path / data):
        spectra = read_spectra(path, "reflectance")
        assert spectra.names == ("leaf", "red brick", "sea water")
        np.testing.assert_array_equal(spectra.wavelengths_nm, NM)
        np.testing.assert_array_equal(spectra.values, VALUES)
        assert (spectra.named, spectra.lines, spectra.warnings) == (True, False, ())


@pytest.mark.parametrize("quantity", ["reflectance", "power"])
def test_a_scale_divides(tmp_path: Path, quantity: Quantity) -> None:
    counts = np.round(VALUES * 10000).astype(np.int16)
    spectra = library(tmp_path, "reflectance scale factor = 10000", values=counts, code=2, quantity=quantity)
    np.testing.assert_array_equal(spectra.values, counts / 10000)
    assert spectra.warnings == ()


def test_integers_without_a_scale_are_power_only(tmp_path: Path) -> None:
    counts = np.round(VALUES * 10000).astype(np.uint16)
    with pytest.raises(SpectrumError, match="reflectance up to 8"):
        library(tmp_path, "reflectance scale factor = 0", values=counts, code=12)
    spectra = library(tmp_path, "reflectance scale factor = 0", values=counts, code=12, quantity="power")
    np.testing.assert_array_equal(spectra.values, counts)
    assert spectra.warnings == ("reflectance scale factor 0 is impossible; ignored",)


def test_wavelengths_in_any_order_and_bad_ones(tmp_path: Path) -> None:
    falling = library(tmp_path, f"wavelength = {listed(NM[::-1])}")
    np.testing.assert_array_equal(falling.values, VALUES[:, ::-1])
    assert len(falling.warnings) == 1  # of the key that is there twice
    mixed = np.random.default_rng(2).permutation(len(NM))
    spectra = library(tmp_path, f"wavelength = {listed(NM[mixed])}")
    np.testing.assert_array_equal(spectra.wavelengths_nm, NM)
    np.testing.assert_array_equal(spectra.values[:, mixed], VALUES)
    assert spectra.warnings[-1] == "the wavelengths were out of order; sorted"
    # The third is bad and has the wavelength of the second; the last is no light.
    nm = [*NM[:2], NM[1], *NM[3:-1], 14000]
    bad = [1, 1, 0, *[1] * (len(NM) - 3)]
    spectra = library(tmp_path, f"wavelength = {listed(nm)}", f"bbl = {listed(bad)}")
    np.testing.assert_array_equal(spectra.wavelengths_nm, [*NM[:2], *NM[3:-1]])
    np.testing.assert_array_equal(spectra.values, np.delete(VALUES, [2, len(NM) - 1], axis=1))
    assert "2 of 21 wavelengths are left out" in spectra.warnings[-1]


@pytest.mark.parametrize("hole", [np.nan, np.inf, -1.23e34, -99.0])
def test_missing_data(tmp_path: Path, hole: float) -> None:
    nm = [*NM[:-2], 900.0, 1000.0]
    values = VALUES.copy()
    values[0, 5] = values[1, -1] = hole
    spectra = library(tmp_path, f"wavelength = {listed(nm)}", "data ignore value = -99", values=values)
    assert spectra.names == ("red brick", "sea water")
    np.testing.assert_array_equal(spectra.wavelengths_nm, nm[:-1])
    np.testing.assert_array_equal(spectra.values, VALUES[1:, :-1])
    assert spectra.warnings[-2:] == (
        "1 of 3 spectra are left out: they lack data where light is seen",
        "1 of 21 wavelengths are left out: some spectra lack data there",
    )
    values[:, 5] = hole
    with pytest.raises(SpectrumError, match="none of the 3 spectra has data"):
        library(tmp_path, f"wavelength = {listed(nm)}", "data ignore value = -99", values=values)


def test_names_that_do_not_fit_are_not_given(tmp_path: Path) -> None:
    spectra = library(tmp_path, "spectra names = {leaf, red, worn, brick}")
    assert (spectra.names, spectra.named) == (("1", "2", "3"), False)
    assert "numbered" in spectra.warnings[-1]
    assert library(tmp_path, "spectra names = {a,b,c,}").names == ("a", "b", "c")
    assert not library(tmp_path, "spectra names = ").named


def test_csv_beside_a_library_stays_csv(tmp_path: Path) -> None:
    library(tmp_path)
    for name in ("lib.csv", "lib.txt", "other.dat", "other"):
        (tmp_path / name).write_text("nm,a\n400,0.5\n700,0.25\n")
        assert read_spectra(tmp_path / name, "reflectance").names == ("a",)
    write_envi(tmp_path, cube_of(4), 4, data="scene.img", header="scene.hdr")
    (tmp_path / "scene.dat").write_text("nm,a\n400,0.5\n700,0.25\n")
    assert read_spectra(tmp_path / "scene.dat", "reflectance").names == ("a",)
    (tmp_path / "plot.txt").write_text("ENVI ASCII Plot File,a\n400,0.5\n700,0.25\n")
    assert read_spectra(tmp_path / "plot.txt", "reflectance").names == ("a",)


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (["file type = ENVI Standard"], "is an ENVI image, not a table of spectra; open it as a texture"),
        (["bands = 2"], "has 2 bands"),
        (["samples = 30000"], "30000 wavelengths, more than 20000"),
        (["lines = 16000000"], "more than 33,554,432 values"),
        (["lines = 4"], "holds 504 bytes, and lib.hdr promises 672"),
        (["wavelength = "], "does not say its wavelengths"),
        (["wavelength units = Index"], "in 'Index'"),
        (["wavelength units = cm"], "not all between 100 and 5000 nm"),
        ([f"wavelength = {listed([380, *NM[:-1]])}"], r"samples 1 and 2 \(from 1\) are both at 380 nm"),
        ([f"wavelength = {listed(NM + 1000)}"], "miss the visible range"),
        ([f"data gain values = {listed([2] * len(NM))}"], "gives gains"),
        (["data type = 6"], "complex"),
    ],
)
def test_libraries_that_are_refused(tmp_path: Path, lines: list[str], message: str) -> None:
    with pytest.raises(SpectrumError, match=message):
        library(tmp_path, *lines)


def test_commands_take_it_like_a_table(run: Callable[..., tuple[int, str, str]], tmp_path: Path) -> None:
    spectra = library(tmp_path)
    write_spectra(tmp_path / "same.csv", NM, VALUES, spectra.names)
    code, out, err = run("reflectance", tmp_path / "lib.sli", "--light", "D65")
    assert (code, out, err) == run("reflectance", tmp_path / "same.csv", "--light", "D65")
    assert (code, "red brick" in out) == (0, True)
