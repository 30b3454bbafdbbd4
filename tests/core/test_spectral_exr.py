"""Spectral OpenEXR: parts, what is reduced, what is refused, damage."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest
from damage import opens_or_says_why

from spectral_core.errors import TextureError
from spectral_core.imaging import oiio
from spectral_core.textures import Reading, open_texture

NM = (450, 550, 650)
FLUORESCENT = ["T.450,0nm", "T.450,0nm.550,0nm", "T.550,0nm", "T.650,0nm"]
POLARISED = [f"S{stokes}.{nm},0nm" for stokes in range(4) for nm in NM]


def write_parts(
    path: Path, parts: list[tuple[list[str], np.ndarray]], tile: int = 0, pixel: str = "float", at: int = 0
) -> None:
    """A file of one part or several, (height, width, channels) each."""
    specs = []
    for number, (names, values) in enumerate(parts):
        spec = oiio().ImageSpec(values.shape[1], values.shape[0], values.shape[2], pixel)
        spec.channelnames = tuple(names)
        spec.attribute("oiio:subimagename", f"part{number}")
        spec.x, spec.y = at, at
        # All parts of a file share the display window.
        spec.full_x, spec.full_y, spec.full_width, spec.full_height = 0, 0, 512, 512
        spec.tile_width = spec.tile_height = tile
        specs.append(spec)
    output = oiio().ImageOutput.create(str(path))
    assert output.open(str(path), specs) if len(specs) > 1 else output.open(str(path), specs[0]), output.geterror()
    for number, (_, values) in enumerate(parts):
        assert number == 0 or output.open(str(path), specs[number], "AppendSubimage"), output.geterror()
        assert output.write_image(np.ascontiguousarray(values)), output.geterror()
    assert output.close()


def cube(bands: int, height: int = 40, width: int = 7) -> np.ndarray:
    return np.random.default_rng(bands).random((height, width, bands)).astype(np.float32)


@pytest.mark.parametrize("tile", [0, 16])
def test_channels_of_all_parts_are_read(tmp_path: Path, tile: int) -> None:
    """Bands interleaved between the parts, RGB in front, and a data window that does not begin at 0."""
    path, values, picture = tmp_path / "parts.exr", cube(5), cube(3)
    names = [f"T.{nm},0nm" for nm in (400, 450, 500, 550, 600)]
    write_parts(
        path,
        [
            (["R", "G", "B"], picture[:9]),
            ([names[3], names[0], names[4]], values[..., [3, 0, 4]]),
            ([names[1], names[2]], values[..., [1, 2]]),
        ],
        tile,
        at=11,
    )
    texture = open_texture(path)
    np.testing.assert_array_equal(texture.wavelengths_nm, [400, 450, 500, 550, 600])
    assert (texture.height, texture.width, texture.warnings) == (40, 7, ())
    np.testing.assert_array_equal(texture.rows(0, 40), values)
    np.testing.assert_array_equal(texture.rows(21, 5), values[21:26])


def test_parts_of_different_sizes_are_refused(tmp_path: Path) -> None:
    write_parts(tmp_path / "x.exr", [(["T.450,0nm"], cube(1)), (["T.550,0nm"], cube(1, height=39))])
    with pytest.raises(TextureError, match=r"differ in size \(7 x 39 at 0, 0; 7 x 40 at 0, 0\)"):
        open_texture(tmp_path / "x.exr")


def test_bands_side_by_side_are_not_copied(tmp_path: Path) -> None:
    write_parts(tmp_path / "x.exr", [(["T.450,0nm", "T.550,0nm", "T.650,0nm"], cube(3))])
    assert open_texture(tmp_path / "x.exr").samples(0, 4).base is not None


def test_a_polarised_file_is_reduced_to_its_intensity(tmp_path: Path) -> None:
    path, values = tmp_path / "p.exr", cube(12)
    write_parts(path, [(POLARISED, values)])
    with pytest.raises(TextureError, match=r"is polarised .* or give --reduce"):
        open_texture(path)
    texture = open_texture(path, Reading(reduce=True))
    assert (texture.kind, texture.fluorescent) == ("radiance", False)
    assert texture.warnings == ("polarised: 9 channels of Stokes S1 to S3 are left out; the intensity S0 stays",)
    np.testing.assert_array_equal(texture.rows(0, 40), values[..., :3])
    values[..., 3:] = 0  # unpolarised light, whatever the channels
    write_parts(path, [(POLARISED, values)])
    assert open_texture(path).warnings == ()


def test_a_fluorescent_file_is_reduced_to_its_reflectance(tmp_path: Path) -> None:
    path, values = tmp_path / "f.exr", cube(4)
    write_parts(path, [(FLUORESCENT, values)])
    with pytest.raises(TextureError, match=r"is bispectral .* or --reduce"):
        open_texture(path)
    texture = open_texture(path, Reading(reduce=True))
    assert (texture.kind, texture.fluorescent) == ("reflectance", True)
    assert texture.warnings[0].startswith("fluorescent: 1 channels of light")
    np.testing.assert_array_equal(texture.rows(0, 40), values[..., [0, 2, 3]])


def test_fluorescence_of_zero_is_none_and_in_one_pixel_is_some(tmp_path: Path) -> None:
    path, values = tmp_path / "f.exr", cube(4, height=300)
    values[..., 1] = 0
    write_parts(path, [(FLUORESCENT, values)])
    texture = open_texture(path, Reading(reduce=True))
    assert (texture.fluorescent, texture.warnings) == (False, ())
    np.testing.assert_array_equal(open_texture(path).rows(0, 300), values[..., [0, 2, 3]])
    values[299, 6, 1] = 1e-6
    write_parts(path, [(FLUORESCENT, values)])
    with pytest.raises(TextureError, match="bispectral"):
        open_texture(path)


def test_fluorescence_alone_is_no_texture(tmp_path: Path) -> None:
    write_parts(tmp_path / "f.exr", [(["T.450,0nm.550,0nm"], cube(1))])
    with pytest.raises(TextureError, match="no intensity"):
        open_texture(tmp_path / "f.exr", Reading(reduce=True))


def test_more_channels_than_openimageio_opens_by_default(tmp_path: Path) -> None:
    """50 bands with all pairs below the diagonal are 1275 channels; 1024 is the library's limit."""
    bands = range(400, 900, 10)
    names = [f"T.{nm},0nm" for nm in bands] + [f"T.{i},0nm.{o},0nm" for i in bands for o in bands if o > i]
    values = np.ones((2, 2, len(names)), np.float32)
    write_parts(tmp_path / "f.exr", [(names, values)])
    texture = open_texture(tmp_path / "f.exr", Reading(reduce=True))
    assert (len(names), texture.bands, texture.fluorescent) == (1275, 50, True)
    assert texture.rows(0, 2).min() == 1


def test_the_user_says_what_it_is(tmp_path: Path) -> None:
    path, values = tmp_path / "x.exr", cube(1)
    write_parts(path, [(["S0.450,0nm"], values)])
    assert open_texture(path).kind == "radiance"
    texture = open_texture(path, Reading(scale=4))
    assert (texture.kind, texture.scale) == ("reflectance", 4)
    np.testing.assert_array_equal(texture.rows(0, 40), values / np.float32(4))


@pytest.mark.parametrize("tile", [0, 16])
def test_damage(tmp_path: Path, tile: int, capfd: pytest.CaptureFixture[str]) -> None:
    """Whatever the bytes: a texture or one line, and the library prints none of its own."""
    path = tmp_path / "m.exr"
    write_parts(path, [(FLUORESCENT, cube(4)), (["T.500,0nm"], cube(1))], tile)
    opened = opens_or_says_why(path, path.read_bytes(), random.Random(9), 300, Reading(reduce=True))
    assert 5 < opened < 295  # both ends are reached
    assert capfd.readouterr().err == ""
