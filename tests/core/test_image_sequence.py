"""One image per wavelength: names, formats, sizes, what is refused, damage."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest
from damage import opens
from test_fuzz import mutate_bytes
from tiff_writer import tiff_bytes

from spectral_core.errors import TextureError
from spectral_core.imaging import oiio
from spectral_core.textures import Reading, open_texture
from spectral_core.textures.wavelengths import wavelengths_in_names


def write_image(path: Path, values: np.ndarray) -> None:
    """(height, width) or (height, width, channels) as its ending says."""
    values = np.atleast_3d(values)
    spec = oiio().ImageSpec(values.shape[1], values.shape[0], values.shape[2], str(values.dtype).replace("32", ""))
    output = oiio().ImageOutput.create(str(path))
    assert output.open(str(path), spec), output.geterror()
    assert output.write_image(np.ascontiguousarray(values)), output.geterror()
    output.close()


def write_sequence(folder: Path, values: np.ndarray, names: list[str]) -> Path:
    folder.mkdir(exist_ok=True)
    for band, name in enumerate(names):
        write_image(folder / name, values[..., band])
    return folder


def cube(dtype: str, bands: int = 5, height: int = 37, width: int = 13) -> np.ndarray:
    return np.random.default_rng(6).integers(0, 250, (height, width, bands)).astype(dtype)


@pytest.mark.parametrize(
    ("ending", "dtype"),
    [("bmp", "uint8"), ("png", "uint8"), ("png", "uint16"), ("tif", "uint16"), ("TIFF", "float32")],
)
def test_all_formats_hold_the_same_texture(tmp_path: Path, ending: str, dtype: str) -> None:
    """Written from long to short wavelengths; the texture's are in order."""
    values = cube(dtype)
    folder = write_sequence(tmp_path / "capture", values[..., ::-1], [f"{nm}.{ending}" for nm in range(480, 379, -25)])
    for given in (folder, folder / f"*.{ending}"):
        texture = open_texture(given)
        np.testing.assert_array_equal(texture.wavelengths_nm, [380, 405, 430, 455, 480])
        assert texture.kind == ("unstated" if dtype == "float32" else "counts")
        assert (texture.name, texture.samples(0, 1).dtype) == ("capture", np.dtype(dtype))
        np.testing.assert_array_equal(np.concatenate([t.values for t in texture.tiles()]), values.astype(np.float32))
        np.testing.assert_array_equal(texture.pixel(3, 30), values[30, 3])
        np.testing.assert_array_equal(texture.pixel(4, 2), values[2, 4])


def test_the_published_system_s_sequence(tmp_path: Path) -> None:
    """101 BMPs from 380 to 780 nm in 4 nm; 24-bit BMPs with three equal channels are grey."""
    values = cube("uint8", bands=101)
    folder = tmp_path / "skin"
    folder.mkdir()
    for band in range(101):
        write_image(folder / f"{380 + 4 * band}.bmp", np.repeat(values[..., [band]], 3, axis=2))
    texture = open_texture(folder, Reading(scale=255))
    np.testing.assert_array_equal(texture.wavelengths_nm, np.arange(380, 781, 4))
    assert (texture.kind, texture.scale, texture.bands) == ("reflectance", 255, 101)
    # One rounding of the reciprocal and one of the product: two float32 steps.
    np.testing.assert_allclose(texture.rows(0, 37), values / 255, rtol=2.4e-7)


def test_the_folder_one_is_in_has_a_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """``bake .`` called its images ``_D65.exr``."""
    folder = write_sequence(tmp_path / "capture", cube("uint8"), [f"{nm}.png" for nm in range(400, 501, 25)])
    monkeypatch.chdir(folder)
    for given in (".", "*.png", "../capture", "../capture/"):
        assert open_texture(given).name == "capture"


def test_more_images_than_may_be_open(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In blocks of 8 rows, so that images beyond the limit are opened again for each."""
    monkeypatch.setattr("spectral_core.textures.images.sequence._MOST_OPEN", 2)
    monkeypatch.setattr("spectral_core.textures.images.sequence._LARGE_BLOCK_BYTES", 8 * 13 * 5)
    values = cube("uint8")
    texture = open_texture(write_sequence(tmp_path / "c", values, [f"{nm}nm.png" for nm in range(400, 500, 20)]))
    rows = [texture.samples(first, min(3, 37 - first)) for first in range(0, 37, 3)]
    np.testing.assert_array_equal(np.concatenate(rows), values)
    assert len(texture._open) == 2
    np.testing.assert_array_equal(texture.samples(5, 20), values[5:25])  # over three blocks


def test_images_are_decoded_a_block_at_a_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each row is read once from the top down, whatever the tiles."""
    read: list[tuple[int, int]] = []
    values = cube("uint8")
    texture = open_texture(write_sequence(tmp_path / "c", values, [f"{nm}.png" for nm in range(400, 500, 20)]))
    decode = texture._grey_rows

    def counted(index: int, first: int, count: int) -> np.ndarray:
        read.append((first, count))
        return decode(index, first, count)

    monkeypatch.setattr(texture, "_grey_rows", counted)
    texture._buffer._size = 10
    for first in range(0, 37, 3):
        texture.samples(first, min(3, 37 - first))
    assert sorted(set(read)) == [(0, 10), (10, 10), (20, 10), (30, 7)]
    assert len(read) == 4 * 5


def test_alpha_that_hides_nothing_is_dropped(tmp_path: Path) -> None:
    values = cube("uint8", bands=2)
    for band, nm in enumerate((400, 500)):
        opaque = np.full((37, 13), 255, np.uint8)
        write_image(tmp_path / f"{nm}.png", np.stack([values[..., band]] * 3 + [opaque], axis=-1))
    np.testing.assert_array_equal(open_texture(tmp_path).samples(0, 37), values)
    opaque[9, 9] = 254
    write_image(tmp_path / "500.png", np.stack([values[..., 1]] * 3 + [opaque], axis=-1))
    with pytest.raises(TextureError, match=r"500\.png: is transparent in places"):
        open_texture(tmp_path).samples(0, 37)


def test_colour_is_refused(tmp_path: Path) -> None:
    for nm in (400, 500):
        picture = np.repeat(cube("uint8", bands=1), 3, axis=2)
        write_image(tmp_path / f"{nm}.bmp", picture)
    picture[20, 5, 2] += 1
    write_image(tmp_path / "500.bmp", picture)
    texture = open_texture(tmp_path)
    with pytest.raises(TextureError, match=r"500\.bmp: is in colour in the rows from 0 on"):
        texture.rows(0, 1)


def test_jpeg_is_warned_of(tmp_path: Path) -> None:
    for nm in (400, 500):
        write_image(tmp_path / f"{nm}.jpg", cube("uint8", bands=1))
    assert open_texture(tmp_path).warnings == ("JPEG is lossy: these are not the values that were captured",)


@pytest.mark.parametrize(
    ("odd", "message"),
    [
        (("420.png", np.zeros((37, 14), np.uint8)), r"420\.png: is 14 x 37, 1 channel of uint8, 400\.png is 13 x 37"),
        (("420.png", np.zeros((37, 13), np.uint16)), r"420\.png: is 13 x 37, 1 channel of uint16"),
        (("420.png", np.zeros((37, 13, 3), np.uint8)), r"420\.png: is 13 x 37, 3 channels of uint8"),
        (("dark.png", np.zeros((37, 13), np.uint8)), r"do not hold the same numbers \(400\.png to dark\.png\)"),
        (("420.bmp", np.zeros((37, 13), np.uint8)), r"several formats \(bmp, png\); give a pattern"),
        (("400.0.png", np.zeros((37, 13), np.uint8)), "a wavelength occurs twice"),
    ],
)
def test_images_that_do_not_belong_together(tmp_path: Path, odd: tuple[str, np.ndarray], message: str) -> None:
    write_sequence(tmp_path, cube("uint8", bands=2), ["400.png", "440.png"])
    write_image(tmp_path / odd[0], odd[1])
    with pytest.raises(TextureError, match=message):
        open_texture(tmp_path)


def test_folders_and_patterns_without_a_sequence(tmp_path: Path) -> None:
    (tmp_path / "._400.png").write_bytes(b"x")
    (tmp_path / "notes.txt").write_bytes(b"x")
    for name in ("", "*.png", "[", "[a", "**", "?" * 300, "x/*.png"):
        with pytest.raises(TextureError, match=r"no images|cannot be searched|no such file"):
            open_texture(tmp_path / name)
    write_image(tmp_path / "400.png", cube("uint8", bands=1))
    with pytest.raises(TextureError, match="holds 1 images"):
        open_texture(tmp_path)
    (tmp_path / "450.png").write_bytes(b"not an image")
    with pytest.raises(TextureError, match=r"450\.png: is no BMP, PNG, TIFF or JPEG"):
        open_texture(tmp_path)


def test_a_page_of_several_is_not_taken_for_a_band(tmp_path: Path) -> None:
    for nm in (400, 500):
        (tmp_path / f"{nm}.tif").write_bytes(tiff_bytes([cube("uint8", bands=1)] * 2))
    with pytest.raises(TextureError, match="has several pages"):
        open_texture(tmp_path)


@pytest.mark.parametrize("ending", ["png", "bmp", "jpg"])
def test_one_picture_is_no_texture(tmp_path: Path, ending: str) -> None:
    write_image(tmp_path / f"p.{ending}", np.zeros((4, 4, 3), np.uint8))
    with pytest.raises(
        TextureError, match=rf"has only 3 channels; give the folder .* or a pattern like '\*\.{ending}'"
    ):
        open_texture(tmp_path / f"p.{ending}")


def test_wavelengths_are_given_in_the_order_of_numbers(tmp_path: Path) -> None:
    """band_10 comes after band_9."""
    values = cube("uint8", bands=11)
    folder = write_sequence(tmp_path / "c", values, [f"band_{number}.png" for number in range(11)])
    with pytest.raises(TextureError, match=r"hold no wavelengths \(band_0\.png to band_10\.png\).* for 11 bands"):
        open_texture(folder)
    texture = open_texture(folder, Reading(wavelengths="700:600:-10"))
    np.testing.assert_array_equal(texture.wavelengths_nm, np.arange(600, 701, 10))
    np.testing.assert_array_equal(texture.samples(0, 37), values[..., ::-1])
    with pytest.raises(TextureError, match="10 wavelengths for 11 bands"):
        open_texture(folder, Reading(wavelengths="400:490:10"))


def test_what_is_given_comes_before_the_names(tmp_path: Path) -> None:
    folder = write_sequence(tmp_path / "c", cube("uint8", bands=2), ["400.png", "500.png"])
    assert open_texture(folder, Reading(wavelengths="400,500")).warnings == ()
    texture = open_texture(folder, Reading(wavelengths="410,510"))
    np.testing.assert_array_equal(texture.wavelengths_nm, [410, 510])
    assert texture.warnings == ("the names say 400 to 500 nm; what was given is used instead",)


@pytest.mark.parametrize(
    ("stems", "wavelengths"),
    [
        (["380", "384", "388"], [380, 384, 388]),
        (["img_380nm", "img_390nm"], [380, 390]),
        (["band_0.55um", "band_0.6um", "band_1um"], [550, 600, 1000]),
        (["0,55 µm", "0,6 µm"], [550, 600]),
        (["x_450.5", "x_460.5"], [450.5, 460.5]),
        (["scan2_1_450", "scan2_2_460", "scan2_3_470"], [450, 460, 470]),
        (["2024-01-05 450", "2024-01-05 460"], [450, 460]),
        (["380nm_10nm", "390nm_10nm"], [380, 390]),
        (["401nm", "402nm", "403nm"], [401, 402, 403]),
        (["0900", "1000", "1100"], [900, 1000, 1100]),
        (["b1_1nm_450nm", "b2_1nm_460nm"], [450, 460]),
        # What follows may be wavelengths or not: never guessed.
        (["000", "001", "002"], None),
        (["1", "2", "3"], None),
        (["100", "101", "102"], None),
        (["IMG_0400", "IMG_0410", "IMG_0420"], None),
        (["450_5", "460_0", "470_5"], None),
        (["450-460", "460-470", "470-480"], None),
        (["400_500", "410_520"], None),
        (["400nm_450nm", "410nm_460nm"], None),
        (["400nm", "410"], None),
        (["a", "b"], None),
        (["5nm", "10nm"], None),
        (["0.45", "0.46"], None),
        (["9" * 200, "8" * 200], None),
        (["450", "450"], None),
    ],
)  # fmt: skip
def test_wavelengths_in_names(stems: list[str], wavelengths: list[float] | None) -> None:
    found, why = wavelengths_in_names(stems)
    assert (found is None) == (wavelengths is None) == bool(why)
    if found is not None:
        # Micrometres are rounded to a millionth of a nanometre.
        np.testing.assert_allclose(found, wavelengths, rtol=0, atol=1e-6)


@pytest.mark.parametrize("ending", ["bmp", "png", "tif", "jpg"])
def test_damage(tmp_path: Path, ending: str, capfd: pytest.CaptureFixture[str]) -> None:
    random_ = random.Random(11)
    folder = write_sequence(tmp_path / "c", cube("uint8", bands=2, height=6), [f"{nm}.{ending}" for nm in (400, 500)])
    path = folder / f"500.{ending}"
    whole = path.read_bytes()
    opened = 0
    for _ in range(300):
        path.write_bytes(mutate_bytes(whole, random_))
        opened += opens(path, Reading(), folder)
    assert 0 < opened < 300  # both ends are reached
    # libpng prints what is wrong itself, and OpenImageIO has no way to say not to.
    assert [line for line in capfd.readouterr().err.splitlines() if not line.startswith("libpng ")] == []


@pytest.mark.parametrize("ending", ["bmp", "png", "tif", "jpg"])
def test_files_that_are_cut_short(tmp_path: Path, ending: str) -> None:
    values = cube("uint8", bands=2, height=300, width=200)
    folder = write_sequence(tmp_path / "c", values, [f"{nm}.{ending}" for nm in (400, 500)])
    path = folder / f"500.{ending}"
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(TextureError, match=rf"500\.{ending}: .*(cannot be read|cut short|damaged)"):
        list(open_texture(folder).tiles())
