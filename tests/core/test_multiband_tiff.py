"""Multi-band TIFF: samples or pages as bands, mapped or unpacked, and what is refused."""

from __future__ import annotations

import json
import random
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from damage import opens_or_says_why
from tiff_writer import tiff_bytes

from spectral_core.errors import TextureError
from spectral_core.imaging import oiio
from spectral_core.textures import HyperspectralTexture, Reading, open_texture

NM = Reading(wavelengths="400:480:10")
TYPES = ("u1", "i1", "u2", "i2", "u4", "i4", "f2", "f4", "f8")


def cube(dtype: str = "u2", height: int = 23, width: int = 11, bands: int = 9) -> np.ndarray:
    return np.random.default_rng(5).integers(0, 100, (height, width, bands)).astype(dtype)


def as_pages(values: np.ndarray) -> list[np.ndarray]:
    return [values[..., [band]] for band in range(values.shape[2])]


def whole(texture: HyperspectralTexture, step: int = 5) -> np.ndarray:
    return np.concatenate(
        [texture.samples(first, min(step, texture.height - first)) for first in range(0, texture.height, step)]
    )


@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize("big", [False, True])
@pytest.mark.parametrize("order", "<>")
def test_uncompressed_files_are_mapped(tmp_path: Path, dtype: str, big: bool, order: str) -> None:
    values, path = cube(dtype), tmp_path / "t.tif"
    for options in ({}, {"planar": True}, {"strip_rows": 4}, {"planar": True, "strip_rows": 4}, {"pages": True}):
        pages = as_pages(values) if options.pop("pages", False) else [values]
        path.write_bytes(tiff_bytes(pages, order, big, **options))
        texture = open_texture(path, NM)
        rows = texture.samples(2, 3)
        assert texture.concurrent
        assert rows.base is not None
        assert rows.dtype == np.dtype(dtype).newbyteorder(order)
        np.testing.assert_array_equal(whole(texture), values)
        assert texture.kind == ("unstated" if dtype[0] == "f" else "counts")


@pytest.mark.parametrize("dtype", TYPES[:-1])
@pytest.mark.parametrize("order", "<>")
def test_compressed_files_are_unpacked_by_strips(tmp_path: Path, dtype: str, order: str) -> None:
    values, path = cube(dtype), tmp_path / "t.tif"
    for options in ({}, {"planar": True}, {"strip_rows": 4}, {"planar": True, "strip_rows": 4}, {"pages": True}):
        pages = as_pages(values) if options.pop("pages", False) else [values]
        path.write_bytes(tiff_bytes(pages, order, packed=True, **options))
        texture = open_texture(path, NM)
        assert not texture.concurrent
        np.testing.assert_array_equal(whole(texture), values)
        assert texture.samples(0, 1).dtype == np.dtype(dtype)


def test_pages_at_uneven_distances_are_mapped_too(tmp_path: Path) -> None:
    values, path = cube(), tmp_path / "t.tif"
    path.write_bytes(tiff_bytes(as_pages(values), gaps=(0, 40, 8)))
    texture = open_texture(path, NM)
    assert texture.concurrent
    np.testing.assert_array_equal(whole(texture), values)


def test_pages_of_several_samples(tmp_path: Path) -> None:
    values, path = cube(), tmp_path / "t.tif"
    for packed in (False, True):
        path.write_bytes(tiff_bytes([values[..., :3], values[..., 3:6], values[..., 6:]], packed=packed))
        np.testing.assert_array_equal(whole(open_texture(path, NM)), values)


@pytest.mark.parametrize("tile", [0, 16])
@pytest.mark.parametrize("config", ["contig", "separate"])
def test_files_of_openimageio(tmp_path: Path, tile: int, config: str) -> None:
    """Its own strips and tiles, LZW; a fourth channel it calls alpha is a band like the others."""
    values, path = cube("f4"), tmp_path / "t.tif"
    spec = oiio().ImageSpec(11, 23, 9, "float")
    spec.attribute("compression", "lzw")
    spec.attribute("planarconfig", config)
    spec.tile_width = spec.tile_height = tile
    output = oiio().ImageOutput.create(str(path))
    assert output.open(str(path), spec), output.geterror()
    assert output.write_image(values)
    output.close()
    np.testing.assert_array_equal(whole(open_texture(path, NM)), values)


@pytest.mark.parametrize("dtype", ["u2", "f4"])
def test_more_bands_than_openimageio_opens_by_default(tmp_path: Path, dtype: str) -> None:
    """1024 is its limit against damage; it stands as before afterwards."""
    values, path = cube(dtype, 3, 2, 1500), tmp_path / "t.tif"
    before = oiio().get_int_attribute("limits:channels")
    path.write_bytes(tiff_bytes([values], packed=True))
    np.testing.assert_array_equal(whole(open_texture(path, Reading(wavelengths="400:2000:1.0673782521681121"))), values)
    assert oiio().get_int_attribute("limits:channels") == before


@pytest.mark.parametrize(
    "description",
    [
        json.dumps({"wavelengths": list(range(400, 490, 10))}),
        json.dumps({"wavelengths_nm": [400.0 + 10 * band for band in range(9)], "shape": [1]}),
        json.dumps({"Wavelength": [0.4 + 0.01 * band for band in range(9)]}),
        "camera = x\nwavelength = {400, 410,\n 420, 430, 440, 450, 460, 470, 480}\n",
        "Wavelengths: [0.40 0.41 0.42 0.43 0.44 0.45 0.46 0.47 0.48]",
    ],
)
def test_wavelengths_of_the_description(tmp_path: Path, description: str) -> None:
    path = tmp_path / "t.tif"
    path.write_bytes(tiff_bytes([cube()], description=description))
    # Micrometres are rounded to a millionth of a nanometre.
    np.testing.assert_allclose(open_texture(path).wavelengths_nm, np.arange(400, 490, 10), rtol=0, atol=1e-6)
    assert open_texture(path, Reading(wavelengths="500:900:50")).wavelengths_nm[0] == 500  # the user comes first


@pytest.mark.parametrize(
    ("pages", "options", "message"),
    [
        ([cube()], {}, "does not say its wavelengths; give --wavelengths"),
        ([cube()], {"description": '{"wavelengths": "no"}'}, "does not say its wavelengths"),
        ([cube()], {"description": '{"wavelengths": [400, 410]}'}, "2 wavelengths for 9 bands"),
        ([cube()], {"description": '{"wavelengths": [1, 2, 3, 4, 5, 6, 7, 8, 9]}'}, "neither nm nor micrometres"),
        ([cube()], {"description": '{"wavelengths": [null, true, [], {}, 1, 2, 3, 4, 5]}'}, "neither nm nor"),
        ([cube()], {"description": "[" * 100_000}, "does not say its wavelengths"),
        ([cube()], {"description": "wavelength = {" * 50_000}, "does not say its wavelengths"),  # in linear time
        ([cube(bands=3)], {"photometric": 2}, r"has only 3 channels; give the folder .* or a pattern like '\*\.tif'"),
        ([cube(bands=1), cube(bands=1, height=22)], {}, "page 2 is 11 x 22, 1 samples of uint16, the first is 11 x 23"),
        ([cube(bands=1), cube("u1", bands=1)], {}, "page 2 is 11 x 23, 1 samples of uint8"),
        ([cube()], {"photometric": 0}, "white is zero"),
        ([cube(bands=4)], {"photometric": 5}, "inks"),
        ([cube("f8")], {"packed": True}, "OpenImageIO misreads"),
    ],
)
def test_files_that_are_refused(
    tmp_path: Path, pages: list[np.ndarray], options: dict[str, object], message: str
) -> None:
    path = tmp_path / "t.tif"
    path.write_bytes(tiff_bytes(pages, **options))
    with pytest.raises(TextureError, match=message):
        open_texture(path)


def test_a_preview_behind_the_bands_is_left_out_and_named(tmp_path: Path) -> None:
    path = tmp_path / "t.tif"
    path.write_bytes(tiff_bytes([cube(), cube(height=5, bands=3)]))
    texture = open_texture(path, NM)
    assert texture.bands == 9
    assert texture.warnings == ("pages from 2 on are left out: they are 11 x 5, 3 samples of uint16",)


def test_three_channels_are_bands_if_someone_says_wavelengths(tmp_path: Path) -> None:
    path = tmp_path / "t.tif"
    path.write_bytes(tiff_bytes([cube(bands=3)], photometric=2))
    assert open_texture(path, Reading(wavelengths="450,550,650", scale=100)).kind == "reflectance"


@pytest.mark.parametrize("packed", [False, True])
def test_files_that_are_cut_short(tmp_path: Path, packed: bool) -> None:
    """Some versions of OpenImageIO crash at strips beyond the end of the file."""
    path = tmp_path / "t.tif"
    data = bytearray(tiff_bytes([cube()], packed=packed, strip_rows=4))
    at = data.index(b"\x17\x01\x04\x00")  # the entry of the strips' sizes
    sizes = int.from_bytes(data[at + 8 : at + 12], "little")
    data[sizes : sizes + 4] = (1 << 20).to_bytes(4, "little")
    path.write_bytes(data)
    with pytest.raises(TextureError, match="beyond the end of the file: it is cut short"):
        open_texture(path, NM)


@pytest.mark.parametrize("options", [{}, {"planar": True}, {"strip_rows": 4}])
def test_damaged_strips_are_not_taken_for_pixels(tmp_path: Path, options: dict[str, object]) -> None:
    """OpenImageIO 3.0 keeps it to itself that it cannot unpack strips of deflate."""
    path = tmp_path / "t.tif"
    data = bytearray(tiff_bytes([cube()], packed=True, **options))
    assert data[8] == 0x78  # the first strip begins: that of zlib's default window
    data[8] = 0xFF
    path.write_bytes(data)
    with pytest.raises(TextureError, match="rows from 0 on cannot be read"):
        open_texture(path, NM).samples(0, 5)


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("big", [False, True])
@pytest.mark.parametrize("pages", [False, True])
def test_damage(tmp_path: Path, packed: bool, big: bool, pages: bool, capfd: pytest.CaptureFixture[str]) -> None:
    values, path = cube(height=6, width=4), tmp_path / "m.tif"
    data = tiff_bytes(as_pages(values) if pages else [values], big=big, packed=packed, strip_rows=2)
    tracemalloc.start()
    opened = opens_or_says_why(path, data, random.Random(10), 300, NM)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert (0 if packed else 5) < opened < 295  # both ends are reached; packed samples hardly survive
    assert peak < 100e6
    assert capfd.readouterr().err == ""
