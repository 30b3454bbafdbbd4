"""MATLAB files of both kinds: which array, which wavelengths, what is refused, damage."""

from __future__ import annotations

import random
import struct
import sys
import time
import tracemalloc
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from damage import opens_or_says_why

from spectral_core.errors import MissingExtraError, TextureError
from spectral_core.textures import HyperspectralTexture, Reading, open_texture

scipy_io = pytest.importorskip("scipy.io")
h5py = pytest.importorskip("h5py")

NM = np.arange(400.0, 490.0, 10)
HEADER = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x100) + b"IM"
CLASSES = {"f4": "single", "f8": "double", "i": "int{}", "u": "uint{}"}

Save = Callable[..., None]


def cube(dtype: str = "uint16", height: int = 23, width: int = 7, bands: int = 9) -> np.ndarray:
    return np.random.default_rng(7).integers(0, 100, (height, width, bands)).astype(dtype)


def save_v5(path: Path, variables: dict[str, Any], packed: bool = True) -> None:
    scipy_io.savemat(path, variables, do_compression=packed)


def save_v73(path: Path, variables: dict[str, Any], packed: bool = True, chunks: tuple[int, ...] = (2, 7, 5)) -> None:
    """As MATLAB does: a header before the HDF5, reversed axes, classes as attributes."""

    def write(group: Any, name: str, value: Any) -> None:
        if isinstance(value, dict):
            inner = group.create_group(name)
            inner.attrs["MATLAB_class"] = np.bytes_("struct")
            for key, each in value.items():
                write(inner, key, each)
            return
        value = np.atleast_2d(value)
        value = value.astype(np.uint8) if value.dtype == bool else value
        options = {"chunks": chunks, "compression": "gzip"} if packed and value.ndim == 3 else {}
        dataset = group.create_dataset(name, data=value.T, **options)
        kind = CLASSES.get(value.dtype.str[1:]) or CLASSES[value.dtype.kind].format(value.dtype.itemsize * 8)
        dataset.attrs["MATLAB_class"] = np.bytes_("logical" if name.startswith("mask") else kind)

    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in variables.items():
            write(file, name, value)
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + struct.pack("<H", 0x200) + b"IM")


def whole(texture: HyperspectralTexture, step: int = 4) -> np.ndarray:
    return np.concatenate(
        [texture.samples(first, min(step, texture.height - first)) for first in range(0, texture.height, step)]
    )


@pytest.mark.parametrize("save", [save_v5, save_v73])
@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("dtype", ["uint8", "int16", "uint16", "int32", "uint64", "float32", "float64"])
def test_arrays_of_all_types(tmp_path: Path, save: Save, packed: bool, dtype: str) -> None:
    path, values = tmp_path / "t.mat", cube(dtype)
    save(path, {"cube": values, "wavelengths": NM, "mask": cube(bands=1)[..., 0] > 50}, packed)
    texture = open_texture(path)
    np.testing.assert_array_equal(whole(texture), values)
    np.testing.assert_array_equal(texture.pixel(5, 20), values[20, 5])
    assert texture.samples(0, 1).dtype == values.dtype
    assert texture.kind == ("unstated" if dtype.startswith("f") else "counts")
    np.testing.assert_array_equal(texture.wavelengths_nm, NM)
    assert texture.warnings == ("wavelengths 400 to 480 nm from 'wavelengths'",)
    assert open_texture(path, Reading(scale=100)).kind == "reflectance"
    # What is not packed is not copied either.
    assert texture.concurrent == (save is save_v5 or not packed)
    assert isinstance(texture.samples(0, 1), np.memmap) == (not packed)


@pytest.mark.parametrize("save", [save_v5, save_v73])
def test_arrays_in_structs(tmp_path: Path, save: Save) -> None:
    path, values = tmp_path / "t.mat", cube("float32")
    save(path, {"hsi": {"Data": values, "info": {"wavelength": NM / 1000, "fwhm": NM * 0 + 8}}, "x": np.ones((2, 2))})
    texture = open_texture(path, Reading(kind="reflectance"))
    assert texture.kind == "reflectance"
    np.testing.assert_array_equal(whole(texture), values)
    # Micrometres are rounded to a millionth of a nanometre.
    np.testing.assert_allclose(texture.wavelengths_nm, NM, rtol=0, atol=1e-6)
    assert texture.warnings == ("wavelengths 400 to 480 nm from 'hsi.info.wavelength'",)
    np.testing.assert_array_equal(whole(open_texture(path, Reading(variable="hsi.Data"))), values)


def test_elements_of_struct_arrays(tmp_path: Path) -> None:
    path, values = tmp_path / "t.mat", cube()
    scans = np.array([(values, 1), (values + 1, 2)], dtype=[("cube", object), ("number", object)])
    save_v5(path, {"scans": scans, "wl": NM})
    with pytest.raises(TextureError, match=r"2 arrays .* scans\(1\)\.cube 23 x 7 x 9, scans\(2\)\.cube 23 x 7 x 9"):
        open_texture(path)
    np.testing.assert_array_equal(whole(open_texture(path, Reading(variable="scans(2).cube"))), values + 1)


@pytest.mark.parametrize("save", [save_v5, save_v73])
def test_which_array_is_asked_for(tmp_path: Path, save: Save) -> None:
    path, values = tmp_path / "t.mat", cube()
    save(path, {"a": values, "b": values + 1, "lambda": NM})
    with pytest.raises(TextureError, match="2 arrays that could be the texture; give --variable: a 23 x 7 x 9, b 23"):
        open_texture(path)
    np.testing.assert_array_equal(whole(open_texture(path, Reading(variable="b"))), values + 1)
    with pytest.raises(TextureError, match=r"holds no array 'lambda' of shape .* give --variable, one of a 23 x 7 x 9"):
        open_texture(path, Reading(variable="lambda"))
    save(path, {"flat": values[..., 0], "lambda": NM})
    with pytest.raises(TextureError, match=r"holds no numeric array of shape .* only flat 23 x 7, lambda 1 x 9"):
        open_texture(path)


@pytest.mark.parametrize("save", [save_v5, save_v73])
@pytest.mark.parametrize(
    ("vectors", "found"),
    [
        ({"wavlength": NM}, NM),
        ({"Wavelengths_nm": NM[::-1]}, NM[::-1]),
        ({"bands": NM, "x": NM + 5}, NM),
        ({"x": NM}, NM),
        ({"x": NM[::-1]}, NM[::-1]),
        ({"wl_um": NM / 1000}, NM),
        # Not plain enough:
        ({}, None),
        ({"x": NM / 1000}, None),
        ({"x": np.arange(400.0, 409)}, None),
        ({"x": NM * (-1.0) ** np.arange(9)}, None),
        ({"x": np.array([400.0, 420, 410, 430, 440, 450, 460, 470, 480])}, None),
        ({"x": NM, "y": NM + 5}, None),
        ({"wl": NM, "lambda": NM + 5}, None),
        ({"wl": NM[:8]}, None),
        ({"bands": np.arange(1.0, 10)}, None),
        ({"wl": NM * np.nan}, None),
    ],
)
def test_wavelengths_are_found_or_asked_for(
    tmp_path: Path, save: Save, vectors: dict[str, np.ndarray], found: np.ndarray | None
) -> None:
    path = tmp_path / "t.mat"
    save(path, {"cube": cube(), **vectors})
    if found is None:
        with pytest.raises(TextureError, match=r"give --wavelengths .* for 9 bands"):
            open_texture(path)
    else:
        np.testing.assert_allclose(open_texture(path).wavelengths_nm, found, rtol=0, atol=1e-6)
    given = open_texture(path, Reading(wavelengths="500:900:50"))
    assert (given.wavelengths_nm[0], given.warnings) == (500, ())


@pytest.mark.parametrize("save", [save_v5, save_v73])
def test_names_that_say_what_it_is(tmp_path: Path, save: Save) -> None:
    path = tmp_path / "t.mat"
    for name, kind in (("reflectances", "reflectance"), ("Radiance", "radiance"), ("hsi", "unstated")):
        save(path, {name: cube("float64"), "wl": NM})
        assert open_texture(path).kind == kind
    save(path, {"reflectance": cube("uint16"), "wl": NM})
    with pytest.raises(TextureError, match="which one is reflectance 1"):
        open_texture(path)


def element(kind: int, data: bytes) -> bytes:
    return struct.pack("<II", kind, len(data)) + data + b"\0" * (-len(data) % 8)


def array(array_class: int, shape: tuple[int, ...], name: bytes, content: bytes) -> bytes:
    flags = element(6, struct.pack("<II", array_class, 0))
    return element(14, flags + element(5, struct.pack(f"<{len(shape)}i", *shape)) + element(1, name) + content)


def test_doubles_that_matlab_keeps_as_bytes_are_no_counts(tmp_path: Path) -> None:
    """It stores whole numbers of any class as the smallest integers that hold them."""
    path, values = tmp_path / "t.mat", cube("uint8")
    path.write_bytes(HEADER + array(6, values.shape, b"cube", element(2, values.tobytes("F"))))
    texture = open_texture(path, Reading(wavelengths="400:480:10"))
    assert (texture.kind, texture.samples(0, 1).dtype) == ("unstated", np.uint8)
    np.testing.assert_array_equal(whole(texture), values)
    np.testing.assert_array_equal(scipy_io.loadmat(path)["cube"], values)


def test_numbers_so_few_that_they_stand_in_a_tag(tmp_path: Path) -> None:
    path = tmp_path / "t.mat"
    path.write_bytes(HEADER + array(9, (1, 2, 2), b"c", struct.pack("<I", 4 << 16 | 2) + bytes([1, 2, 3, 4])))
    values = open_texture(path, Reading(wavelengths="400,500")).samples(0, 1)
    np.testing.assert_array_equal(values, [[[1, 3], [2, 4]]])
    np.testing.assert_array_equal(values, scipy_io.loadmat(path)["c"])


def test_other_byte_order(tmp_path: Path) -> None:
    path, values = tmp_path / "t.mat", cube("uint16")
    flags = struct.pack(">IIII", 6, 8, 11, 0) + struct.pack(">IIiiii", 5, 12, *values.shape, 0)
    name = struct.pack(">HH", 1, 1) + b"c\0\0\0"
    data = values.astype(">u2").tobytes("F")
    body = flags + name + struct.pack(">II", 4, len(data)) + data
    path.write_bytes(HEADER[:124] + b"\1\0MI" + struct.pack(">II", 14, len(body)) + body)
    np.testing.assert_array_equal(scipy_io.loadmat(path)["c"], values)
    np.testing.assert_array_equal(whole(open_texture(path, Reading(wavelengths="400:480:10"))), values)


HOSTILE = {
    "a struct array of 2**28 elements": array(
        2, (1 << 14, 1 << 14), b"x", element(5, struct.pack("<i", 2)) + element(1, b"a\0b\0")
    ),
    "cells": array(1, (1 << 14, 1 << 14), b"x", b""),
    "a cube of 2**31 numbers": array(9, (1 << 11, 1 << 10, 1 << 10), b"x", struct.pack("<II", 2, 1 << 31)),
    "a cube of more": array(9, (1 << 20, 1 << 20, 1 << 20), b"x", element(2, b"1234567")),
    "negative sides": array(9, (-1, 2, 2), b"x", element(2, b"1234")),
    "structs in structs": b"",
}


def nested(depth: int) -> bytes:
    inner = array(9, (1, 1), b"", element(2, b"1"))
    for _ in range(depth):
        inner = array(2, (1, 1), b"", element(5, struct.pack("<i", 2)) + element(1, b"a\0") + inner)
    return inner


@pytest.mark.parametrize("what", HOSTILE)
@pytest.mark.parametrize("packed", [False, True])
def test_promises_are_not_believed(tmp_path: Path, what: str, packed: bool) -> None:
    """Little time and memory, whatever a small file promises: scipy takes 4 GB for the first of these."""
    path, data = tmp_path / "t.mat", HOSTILE[what] or nested(200)
    if packed:
        deflated = zlib.compress(data)
        data = struct.pack("<II", 15, len(deflated)) + deflated
    path.write_bytes(HEADER + data)
    tracemalloc.start()
    started = time.perf_counter()
    with pytest.raises(TextureError, match=r"is a damaged MATLAB file|holds no numeric array"):
        open_texture(path, Reading(wavelengths="400,500"))
    assert time.perf_counter() - started < 1
    assert tracemalloc.get_traced_memory()[1] < 10e6
    tracemalloc.stop()


def test_a_compressed_array_that_ends_early_or_fails_its_checksum(tmp_path: Path) -> None:
    path = tmp_path / "t.mat"
    save_v5(path, {"cube": cube()})
    whole_file = bytearray(path.read_bytes())
    for at, message in ((len(whole_file) - 1, "incorrect data check"), (len(whole_file) // 2, "damaged MATLAB file")):
        damaged = bytearray(whole_file)
        damaged[at] ^= 0xFF
        path.write_bytes(damaged)
        with pytest.raises(TextureError, match=message):
            open_texture(path, Reading(wavelengths="400:480:10")).samples(0, 1)
    path.write_bytes(whole_file[:-20])
    with pytest.raises(TextureError, match="cut short"):
        open_texture(path, Reading(wavelengths="400:480:10"))


def test_h5py_is_asked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    save_v73(tmp_path / "t.mat", {"cube": cube(), "wl": NM})
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(
        MissingExtraError, match=r"h5py, which is not installed; pip install 'spectral-booth\[matlab\]'"
    ):
        open_texture(tmp_path / "t.mat")


def test_version_5_needs_no_other_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    save_v5(tmp_path / "t.mat", {"cube": cube(), "wl": NM})
    for package in ("h5py", "scipy"):
        monkeypatch.setitem(sys.modules, package, None)
    np.testing.assert_array_equal(whole(open_texture(tmp_path / "t.mat")), cube())


def test_whole_chunks_are_unpacked_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Chunks of 5 rows, tiles of 3, blocks of two chunks."""
    row_bytes = 7 * 9 * 2
    monkeypatch.setattr("spectral_core.textures.images.row_buffer.block_rows.__defaults__", (10 * row_bytes,))
    save_v73(tmp_path / "t.mat", {"cube": cube(), "wl": NM})
    texture = open_texture(tmp_path / "t.mat")
    buffer = texture._rows.__self__
    read, blocks = buffer._read, []
    monkeypatch.setattr(buffer, "_read", lambda first, count: blocks.append((first, count)) or read(first, count))
    np.testing.assert_array_equal(whole(texture, 3), cube())
    assert blocks == [(0, 10), (10, 10), (20, 3)]


@pytest.mark.parametrize("trick", ["link", "external", "virtual", "sparse", "plain", "logical"])
def test_hdf5_that_is_not_what_it_seems(tmp_path: Path, trick: str) -> None:
    """Nothing outside the file is read, nothing that was never written, no axes in an unknown order."""
    path, other = tmp_path / "t.mat", tmp_path / "other.mat"
    save_v73(other, {"cube": cube()}, packed=False)
    (tmp_path / "raw").write_bytes(bytes(9 * 7 * 23 * 2))
    save_v73(path, {"wl": NM})
    with h5py.File(path, "r+") as file:
        if trick == "link":
            file["cube"] = h5py.ExternalLink(str(other), "cube")
        elif trick == "external":
            file.create_dataset("cube", (9, 7, 23), "u2", external=[(str(tmp_path / "raw"), 0, 9 * 7 * 23 * 2)])
        elif trick == "virtual":
            layout = h5py.VirtualLayout((9, 7, 23), "u2")
            layout[:] = h5py.VirtualSource(str(other), "cube", (9, 7, 23))
            file.create_virtual_dataset("cube", layout)
        elif trick == "sparse":
            file.create_dataset("cube", (9, 7, 23), "u2", chunks=(9, 7, 1))[:, :, :20] = 1
        else:
            file.create_dataset("cube", data=cube().T)
        if trick not in ("link", "plain"):
            file["cube"].attrs["MATLAB_class"] = np.bytes_("logical" if trick == "logical" else "uint16")
    message = {
        "external": "lies in another file", "virtual": "lies in another file", "sparse": "were never written",
    }.get(trick, "holds no numeric array")  # fmt: skip
    with pytest.raises(TextureError, match=message):
        open_texture(path)


def test_an_hdf5_array_that_promises_more_than_is_there(tmp_path: Path) -> None:
    path = tmp_path / "t.mat"
    save_v73(path, {"wl": NM})
    with h5py.File(path, "r+") as file:
        dataset = file.create_dataset("cube", (9, 1 << 20, 1 << 20), "u2", chunks=(9, 64, 64), compression="gzip")
        dataset[:, :64, :64] = 1
        dataset.attrs["MATLAB_class"] = np.bytes_("uint16")
    with pytest.raises(TextureError, match="promises 19,791,209,299,968 bytes, the file holds"):
        open_texture(path)


@pytest.mark.parametrize("save", [save_v5, save_v73])
@pytest.mark.parametrize("packed", [False, True])
def test_damage(tmp_path: Path, save: Save, packed: bool, capfd: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "m.mat"
    save(path, {"s": {"cube": cube(height=6), "wavelengths": NM}, "x": np.ones((3, 3))}, packed)
    tracemalloc.start()
    opened = opens_or_says_why(path, path.read_bytes(), random.Random(12), 400, Reading())
    assert tracemalloc.get_traced_memory()[1] < 20e6
    tracemalloc.stop()
    assert 5 < opened < 395  # both ends are reached
    assert capfd.readouterr().err == ""
