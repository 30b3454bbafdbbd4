"""Textures in NumPy's formats: which numbers they hold, and what they are."""

from __future__ import annotations

import random
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from damage import opens_or_says_why

from spectral_core.errors import TextureError
from spectral_core.textures import Reading, open_texture

NM = np.array([400.0, 500.0, 600.0, 700.0])


@pytest.fixture
def counts() -> np.ndarray:
    return np.random.default_rng(1).integers(0, 4096, (6, 5, 4)).astype(np.uint16)


def test_integers_are_counts_unless_someone_says_which_is_1(tmp_path: Path, counts: np.ndarray) -> None:
    path = tmp_path / "c.npy"
    np.save(path, counts)
    texture = open_texture(path, Reading(wavelengths="400:700:100"))
    assert (texture.kind, texture.scale) == ("counts", 1.0)
    np.testing.assert_array_equal(texture.wavelengths_nm, NM)
    np.testing.assert_array_equal(texture.samples(2, 3), counts[2:5])
    assert texture.samples(0, 6).dtype == np.uint16
    scaled = open_texture(path, Reading(wavelengths="400:700:100", scale=4096))
    assert (scaled.kind, scaled.scale) == ("reflectance", 4096)
    # A power of two divides float32 exactly.
    np.testing.assert_array_equal(scaled.rows(0, 6), counts / np.float32(4096))


def test_floats_in_npy_are_reflectance_unless_someone_says_otherwise(tmp_path: Path, counts: np.ndarray) -> None:
    path = tmp_path / "f.npy"
    np.save(path, counts.astype(np.float64))
    assert open_texture(path, Reading(wavelengths="400,500,600,700")).kind == "reflectance"
    radiance = open_texture(path, Reading(wavelengths="400,500,600,700", kind="radiance"))
    assert (radiance.kind, radiance.scale) == ("radiance", 1.0)


def test_fortran_order_and_other_byte_orders_stay_views_of_the_file(tmp_path: Path, counts: np.ndarray) -> None:
    path = tmp_path / "f.npy"
    np.save(path, np.asfortranarray(counts.astype(">u2")))
    rows = open_texture(path, Reading(wavelengths="400:700:100")).samples(1, 2)
    assert rows.dtype == np.dtype(">u2")
    assert rows.strides == (2, 12, 60)  # height is the fastest axis: two bytes a row
    assert isinstance(rows, np.memmap)
    np.testing.assert_array_equal(rows, counts[1:3])


@pytest.mark.parametrize("packed", [False, True])
def test_what_the_arrays_of_an_archive_say(tmp_path: Path, counts: np.ndarray, packed: bool) -> None:
    path = tmp_path / "t.npz"
    save = np.savez_compressed if packed else np.savez
    save(path, counts=counts, wavelengths_nm=NM)
    assert open_texture(path).kind == "counts"
    assert open_texture(path, Reading(scale=4095)).kind == "reflectance"
    save(path, reflectance=counts, wavelengths_nm=NM, scale=1024)
    texture = open_texture(path)
    assert (texture.kind, texture.scale) == ("reflectance", 1024)
    np.testing.assert_array_equal(texture.rows(3, 3), counts[3:] / np.float32(1024))
    assert open_texture(path, Reading(scale=2048)).scale == 2048  # the user's word comes first
    save(path, radiance=counts, wavelengths_nm=NM, scale=np.float32(10))
    texture = open_texture(path, Reading(wavelengths="410:710:100"))
    assert (texture.kind, texture.scale, texture.wavelengths_nm[0]) == ("radiance", 1.0, 410)
    assert texture.warnings == ("its scale of 10 is not used: it is for reflectance, and this is radiance",)


def test_two_cubes_in_one_archive(tmp_path: Path, counts: np.ndarray) -> None:
    path = tmp_path / "t.npz"
    np.savez(path, reflectance=counts / 4096, radiance=counts * 2.0, wavelengths_nm=NM)
    texture = open_texture(path)
    assert (texture.kind, texture.warnings) == ("reflectance", ("reflectance is used; it holds radiance as well",))
    lit = open_texture(path, Reading(kind="radiance"))
    assert lit.kind == "radiance"
    np.testing.assert_array_equal(lit.rows(0, 6), counts * np.float32(2))


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"reflectance": np.ones((2, 2, 4), np.uint8)}, "which one is reflectance 1"),
        ({"reflectance": np.ones((2, 2, 4), np.uint8), "scale": [1, 2]}, "'scale' holds 2 numbers"),
        ({"reflectance": np.ones((2, 2, 4), np.uint8), "scale": 0}, "'scale' in it: scale 0 is impossible"),
        ({"reflectance": np.ones((2, 2, 4), np.uint8), "scale": np.nan}, "scale nan is impossible"),
        ({"reflectance": np.ones((2, 2, 4), np.uint8), "scale": "x"}, "'scale' is of type"),
        ({"reflectance": np.ones((2, 2, 4), bool)}, "type bool"),
        ({"reflectance": np.ones((2, 2, 4), complex)}, "type complex128"),
        ({"spectra": np.ones((2, 2, 4))}, "holds spectra, wavelengths_nm"),
    ],
)
def test_archives_that_are_refused(tmp_path: Path, arrays: dict[str, np.ndarray], message: str) -> None:
    np.savez(tmp_path / "t.npz", wavelengths_nm=NM, **arrays)
    with pytest.raises(TextureError, match=message):
        open_texture(tmp_path / "t.npz")


def test_missing_wavelengths_are_asked_for(tmp_path: Path, counts: np.ndarray) -> None:
    np.save(tmp_path / "c.npy", counts)
    with pytest.raises(TextureError, match=r"give --wavelengths, write c\.wavelengths\.csv beside it"):
        open_texture(tmp_path / "c.npy")
    with pytest.raises(TextureError, match="3 wavelengths for 4 bands"):
        open_texture(tmp_path / "c.npy", Reading(wavelengths="400:600:100"))


@pytest.mark.parametrize("kind", ["npy", "npz", "packed.npz"])
def test_damage(tmp_path: Path, counts: np.ndarray, kind: str) -> None:
    """Whatever the bytes: a texture, or one line. Nothing larger than the file promises in earnest is allocated."""
    path = tmp_path / f"m.{kind}"
    if kind == "npy":
        np.save(path, counts)
    else:
        (np.savez if kind == "npz" else np.savez_compressed)(path, reflectance=counts, wavelengths_nm=NM, scale=4096)
    reading = Reading(wavelengths="400:700:100", scale=4095)
    tracemalloc.start()
    opened = opens_or_says_why(path, path.read_bytes(), random.Random(8), 300, reading)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert 5 < opened < 295  # both ends are reached
    assert peak < 20e6
