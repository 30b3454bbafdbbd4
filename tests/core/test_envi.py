"""ENVI images: every order and type equals its source, nothing is copied, and traps are told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from envi_samples import AXES, NM, TYPES, cube_of, header_lines, listed, write_data, write_envi

from spectral_core.errors import TextureError
from spectral_core.textures import HyperspectralTexture, Reading, open_texture
from spectral_core.textures.base import Samples


def envi(folder: Path, *more: str, code: int = 12, reading: Reading | None = None) -> HyperspectralTexture:
    """A small image whose header ends with more lines."""
    return open_texture(write_envi(folder, cube_of(code), code, "bil", 0, 0, *more), reading)


def with_header(folder: Path, text: str | bytes, code: int = 12) -> HyperspectralTexture:
    """A small image with a header of any text."""
    write_data(folder / "x.raw", cube_of(code))
    (folder / "x.hdr").write_bytes(text if isinstance(text, bytes) else text.encode())
    return open_texture(folder / "x.hdr")


def mapping_of(samples: Samples) -> np.memmap:
    base = samples.base
    while not isinstance(base, np.memmap):
        assert base is not None, "no memory map is behind it"
        base = base.base
    return base


@pytest.mark.parametrize("offset", [0, 7, 4096 + 24])
@pytest.mark.parametrize("order", [0, 1])
@pytest.mark.parametrize("code", TYPES)
@pytest.mark.parametrize("interleave", AXES)
def test_every_order_and_type_is_a_view_of_the_file(
    tmp_path: Path, interleave: str, code: int, order: int, offset: int
) -> None:
    cube = cube_of(code)
    texture = open_texture(write_envi(tmp_path, cube, code, interleave, order, offset))
    assert (texture.height, texture.width, texture.bands) == cube.shape
    whole, part = texture.samples(0, texture.height), texture.samples(2, 2)
    np.testing.assert_array_equal(whole, cube)
    np.testing.assert_array_equal(part, cube[2:4])
    assert whole.dtype.newbyteorder("=") == cube.dtype
    assert np.shares_memory(whole, part)
    assert np.shares_memory(part, mapping_of(part))
    assert not part.flags.writeable
    # A step of one sample along the axis that the file runs through fastest.
    assert part.strides[2 if interleave == "bip" else 1] == cube.itemsize
    np.testing.assert_array_equal(texture.wavelengths_nm, NM)
    assert texture.warnings == ()


@pytest.mark.parametrize("interleave", AXES)
def test_a_row_is_a_matrix_that_products_take_as_it_is(tmp_path: Path, interleave: str) -> None:
    """Either its rows or its columns are contiguous: BLAS reads both without a copy."""
    texture = open_texture(write_envi(tmp_path, cube_of(4), 4, interleave))
    row = texture.samples(3, 1)[0]
    assert row.itemsize in row.strides
    assert np.shares_memory(row, mapping_of(row))


@pytest.mark.parametrize(
    ("data", "header", "opened"),
    [
        ("x.raw", "x.hdr", "x.hdr"),
        ("x.raw", "x.hdr", "x.raw"),
        ("x.raw", "x.raw.hdr", "x.raw"),
        ("x.raw", "x.raw.hdr", "x.raw.hdr"),
        ("x", "x.hdr", "x"),
        ("x", "x.hdr", "x.hdr"),
        ("X.IMG", "x.HDR", "X.IMG"),
        ("X.Img", "X.Hdr", "X.Hdr"),
        ("x.anything", "x.anything.hdr", "x.anything"),
        ("x.anything", "x.anything.hdr", "x.anything.hdr"),
        ("a.b.bil", "a.b.hdr", "a.b.bil"),
        ("a.b.bil", "a.b.hdr", "a.b.hdr"),
    ],
)
def test_either_file_finds_the_other(tmp_path: Path, data: str, header: str, opened: str) -> None:
    cube = cube_of(12)
    write_envi(tmp_path, cube, 12, data=data, header=header)
    np.testing.assert_array_equal(open_texture(tmp_path / opened).samples(0, 5), cube)


def test_the_nearer_header_and_data_file_count(tmp_path: Path) -> None:
    write_envi(tmp_path, cube_of(12), 12)
    write_envi(tmp_path, cube_of(4), 4, data="x.raw", header="x.raw.hdr")
    assert open_texture(tmp_path / "x.raw").samples(0, 1).dtype == np.float32
    write_envi(tmp_path, cube_of(5), 5, data="x", header="x.hdr")
    assert open_texture(tmp_path / "x.hdr").samples(0, 1).dtype == np.float64


def test_files_that_cannot_be_told_apart_or_are_missing(tmp_path: Path) -> None:
    path = write_envi(tmp_path, cube_of(12), 12)
    (tmp_path / "x.img").write_bytes(b"")
    with pytest.raises(TextureError, match=r"could be the header of x\.img, x\.raw; open the data file"):
        open_texture(path)
    (tmp_path / "x.img").unlink()
    (tmp_path / "x.raw").unlink()
    with pytest.raises(TextureError, match="without its data file"):
        open_texture(path)
    (tmp_path / "x.jpg").write_bytes(b"\xff\xd8")
    with pytest.raises(TextureError, match="no texture of a known format"):
        open_texture(tmp_path / "x.jpg")


def test_a_file_cut_short_is_refused_and_a_longer_one_is_not(tmp_path: Path) -> None:
    path = write_envi(tmp_path, cube_of(12), 12, "bip", 0, 10)
    data = (tmp_path / "x.raw").read_bytes()
    assert len(data) == 10 + 5 * 4 * 7 * 2
    (tmp_path / "x.raw").write_bytes(data[:-1])
    with pytest.raises(TextureError, match=r"holds 289 bytes, and x\.hdr promises 290 .* after 10 bytes"):
        open_texture(path)
    (tmp_path / "x.raw").write_bytes(data + b"more")
    np.testing.assert_array_equal(open_texture(path).samples(0, 5), cube_of(12))


MESSY = (
    "\ufeffENVI\r\n"
    "; a comment = not an entry\r\n"
    "   ;another\r\n"
    "Description={one = two, {three}\r\n"
    "SAMPLES=4\r\nLines =5\r\n\r\n\r\nbands= 7\r\n"
    "Header_Offset=0\r\nDATATYPE = 12 ; unsigned\r\nInterLeave=BSQ\r\nbyte  order = 0\r\n"
    "wavelengthunits=nm\r\n"
    "wavelength =\r\n  {400\r\n,450.5 , 5e2,\r\n; and a comment\r\n550.25,\r\n600,650,700,}"
)


@pytest.mark.parametrize("ends", ["\r\n", "\n", "\r"])
def test_headers_by_many_hands(tmp_path: Path, ends: str) -> None:
    texture = with_header(tmp_path, MESSY.replace("\r\n", ends))
    np.testing.assert_array_equal(texture.wavelengths_nm, NM)
    np.testing.assert_array_equal(texture.samples(0, 5), cube_of(12))
    assert texture.warnings == ()


def test_latin_1_and_lists_with_blanks(tmp_path: Path) -> None:
    lines = header_lines(cube_of(12), 12)[:-2]
    text = "\n".join([*lines, "sensor type = Kühl", "wavelength units = µm", "wavelength = {0.4 0.4505", "0.5",
                      "0.55025 0.6 0.65 0.7}"])  # fmt: skip
    texture = with_header(tmp_path, text.encode("latin-1"))
    np.testing.assert_array_equal(texture.wavelengths_nm, NM)
    assert texture.warnings == ()


def test_the_last_of_equal_keys_counts_and_is_told(tmp_path: Path) -> None:
    texture = envi(
        tmp_path, "reflectance scale factor = 10000", "reflectance scale factor = 20000", "bands = 7", "oops"
    )
    assert texture.scale == 20000
    assert texture.warnings == (
        "the header gives 'reflectance scale factor' more than once; the last one counts",
        "the header has 1 lines that are no 'key = value'; ignored",
    )


C_NM_GHZ = 299_792_458.0


@pytest.mark.parametrize(
    ("unit", "written"),
    [
        ("Nanometers", NM),
        ("nanometres", NM),
        ("nm", NM),
        ("Micrometers", [nm / 1e3 for nm in NM]),
        ("Microns", [nm / 1e3 for nm in NM]),
        ("um", [nm / 1e3 for nm in NM]),
        ("μm", [nm / 1e3 for nm in NM]),
        ("Angstroms", [nm * 10 for nm in NM]),
        ("Millimeters", [nm / 1e6 for nm in NM]),
        ("cm", [nm / 1e7 for nm in NM]),
        ("Meters", [nm / 1e9 for nm in NM]),
        ("Wavenumber", [1e7 / nm for nm in NM]),
        ("cm-1", [1e7 / nm for nm in NM]),
        ("GHz", [C_NM_GHZ / nm for nm in NM]),
        ("MHz", [1e3 * C_NM_GHZ / nm for nm in NM]),
    ],
)
def test_units_of_wavelengths(tmp_path: Path, unit: str, written: list[float]) -> None:
    """Rounded to 1e-6 nm, so that no unit leaves noise."""
    texture = envi(tmp_path, f"wavelength units = {unit}", f"wavelength = {listed(written)}")
    np.testing.assert_array_equal(texture.wavelengths_nm, NM)


@pytest.mark.parametrize(("factor", "unit"), [(1, "nanometres"), (1e-3, "micrometres")])
def test_a_missing_unit_is_told(tmp_path: Path, factor: float, unit: str) -> None:
    texture = envi(tmp_path, "wavelength units =", f"wavelength = {listed([nm * factor for nm in NM])}")
    np.testing.assert_array_equal(texture.wavelengths_nm, NM)
    assert texture.warnings[-1] == f"the header does not say the unit of its wavelengths; {unit} by their magnitude"


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (["wavelength units = Index"], "in 'Index'; give them with --wavelengths"),
        (["wavelength units = Unknown"], "in 'Unknown'"),
        (["wavelength units =", "wavelength = {1,2,3,4,5,6,7}"], "without a unit"),
        (["wavelength units =", "bands = 4", "wavelength = {1,2,3,4}"], "without a unit"),
        (["wavelength units =", "wavelength = {0.5,0.6,0.7,0.8,0.9,1,700}"], "without a unit"),
        (["wavelength units = Micrometers"], r"400000 to 700000 nm \(in the header: Micrometers\) are not all between"),
        (["wavelength units = cm-1", "wavelength = {0,1,2,3,4,5,6}"], "not all between"),
        (["wavelength = {400,500}"], "'wavelength' has 2 values for 7 bands"),
        (["wavelength = {400 500}"], "'wavelength' has 2 values for 7 bands"),
        (["wavelength = {400,1,2,3,4,5,6,7,8}"], "'wavelength' has 9 values for 7 bands"),
        (["wavelength = {400,450,500,550,600,650,x}"], "value 7 of 'wavelength', 'x', is no finite number"),
        (["wavelength = {400,450,500,550,600,nan,700}"], "value 6 of 'wavelength', 'nan'"),
        (["wavelength = {400,450,500,5_50,600,650,700}"], "value 4 of 'wavelength'"),
        (["wavelength = {400,450,,550,600,650,700}"], "value 3 of 'wavelength', '', is"),
        (["wavelength = {400,450,500,450,600,650,450}"], r"bands 2 and 4 \(from 1\) and 1 more .* at 450 nm; .*write"),
        (["wavelength = {}"], "does not say the wavelengths of its 7 bands; give them with --wavelengths"),
        (["wavelength = {400,"], "brace of 'wavelength' is never closed"),
        (["data type = 6"], r"complex numbers \(data type 6, complex64\)"),
        (["data type = 9"], "complex128"),
        (["data type = 7"], "data type 7; give one of 1, 2, 3, 4, 5, 12"),
        (["data type = "], "lacks 'data type'"),
        (["interleave = tiled"], "interleave 'tiled'"),
        (["interleave = "], "lacks 'interleave'"),
        (["byte order = 2"], "byte order 2"),
        (["byte order = Intel"], "'byte order = Intel' is no number"),
        (["samples = 0"], "has 0 samples"),
        (["lines = -5"], "has -5 lines"),
        (["lines = 99999999999"], "has 99999999999 lines"),
        (["bands = 5000"], "5000 bands, more than 4000"),
        (["samples = 4.5"], "'samples = 4.5' is no whole number"),
        (["samples = nan"], "no whole number"),
        (["samples = 1e400"], "no whole number"),
        (["samples = many"], "is no number"),
        (["header offset = -1"], "header offset of -1"),
        (["header offset = 1000000000000000"], "holds 280 bytes, and x.hdr promises 1,000,000,000,000,280"),
        (["file compression = 1"], "compressed"),
        (["major frame offsets = {16, 0}"], "major frame offsets"),
        (["file type = ENVI Classification"], "file type 'envi classification'"),
        (["file type = TIFF"], "file type 'tiff'"),
        (["file type = ENVI Spectral Library"], "is a spectral library, not an image; use it where tables"),
        (["bbl = {1,1,1}"], "'bbl' has 3 values for 7 bands"),
        (["bbl = {0,0,0,0,0,0,0}"], "calls all bands bad"),
        (["bbl = {0,0,0,0,0.5,0,1}"], "other values than 0 and 1"),
        (["data gain values = {1,2,3,4,5,6,0}"], r"the gain 0 of band 7 \(from 1\)"),
        (["data offset values = {0,1e300,2,3,4,5,6}"], r"the offset 1e\+300 of band 2"),
        (["data gain values = {1,2}"], "2 values for 7 bands"),
        (["data ignore value = none"], "'data ignore value = none' is no number"),
        (["reflectance scale factor = lots"], "is no number"),
    ],
)  # fmt: skip
def test_headers_that_are_refused(tmp_path: Path, lines: list[str], message: str) -> None:
    with pytest.raises(TextureError, match=message) as caught:
        envi(tmp_path, *lines)
    assert str(caught.value).startswith(str(tmp_path))
    assert caught.value.remedy


def test_a_user_s_wavelengths_replace_what_cannot_be_read(tmp_path: Path) -> None:
    reading = Reading(wavelengths="400:700:50")
    texture = envi(tmp_path, "wavelength units = Index", "wavelength = {1,2}", reading=reading)
    np.testing.assert_array_equal(texture.wavelengths_nm, np.arange(400.0, 701, 50))
    assert texture.warnings == (
        "the header gives 'wavelength units', 'wavelength' more than once; the last one counts",
        "the wavelengths that were given replace the header's",
    )
    texture = envi(tmp_path, "wavelength = {}", reading=reading)
    assert len(texture.warnings) == 1  # of the key that is there twice
    with pytest.raises(TextureError, match="4 wavelengths for 7 bands"):
        envi(tmp_path, reading=Reading(wavelengths="400:700:100"))


def test_axes_that_overlap_or_fall(tmp_path: Path) -> None:
    overlapping = (400, 500, 600, 590, 650, 645, 700)
    texture = envi(tmp_path, f"wavelength = {listed(overlapping)}")
    np.testing.assert_array_equal(texture.wavelengths_nm, overlapping)
    assert texture.warnings[-1].startswith("the wavelengths turn back 2 times")
    texture = envi(tmp_path, f"wavelength = {listed(NM[::-1])}")
    np.testing.assert_array_equal(texture.wavelengths_nm, NM[::-1])
    assert "turn back" not in texture.warnings[-1]


def test_bad_bands(tmp_path: Path) -> None:
    texture = envi(tmp_path, "bbl = {1, 0, 1.0, 1, 1, 0, 1}")
    assert texture.good.tolist() == [True, False, True, True, True, False, True]
    assert envi(tmp_path).good.all()


@pytest.mark.parametrize(
    ("code", "lines", "kind", "scale", "warning"),
    [
        (12, [], "counts", 1, None),
        (4, [], "unstated", 1, None),
        (2, ["reflectance scale factor = 10000.0"], "reflectance", 10000, None),
        (4, ["reflectance scale factor = 1"], "reflectance", 1, None),
        (12, ["reflectance scale factor = 0.000000"], "counts", 1, "scale factor 0 is impossible; ignored"),
        (4, ["reflectance scale factor = 0"], "unstated", 1, "impossible"),
        (12, ["reflectance scale factor = -3"], "counts", 1, "impossible"),
        (12, ["reflectance scale factor = nan"], "counts", 1, "impossible"),
        (12, ["reflectance scale factor = inf"], "counts", 1, "impossible"),
        (12, ["reflectance scale factor = 1"], "counts", 1, "cannot be that of uint16"),
        (4, ["z plot titles = {Wavelength, Reflectance}"], "reflectance", 1, "by what the header calls"),
        (4, ["z plot titles = {Wavelength, Reflectance (%)}"], "unstated", 1, None),
        (4, ["data units = Radiance (W/m2/sr/um)"], "radiance", 1, "by what the header calls"),
        (12, ["data units = radiance"], "radiance", 1, "by what the header calls"),
        (4, ["z plot titles = {radiance, reflectance}"], "unstated", 1, None),
        (12, ["data units = Reflectance"], "counts", 1, "does not say which is 1; give --scale"),
    ],
)
def test_what_values_mean(
    tmp_path: Path, code: int, lines: list[str], kind: str, scale: float, warning: str | None
) -> None:
    texture = envi(tmp_path, *lines, code=code)
    assert (texture.kind, texture.scale) == (kind, scale)
    assert len(texture.warnings) == (warning is not None)
    assert warning is None or warning in texture.warnings[0]
    np.testing.assert_array_equal(texture.gain, np.full(7, 1 / scale))


@pytest.mark.parametrize(
    ("reading", "kind", "scale", "warnings"),
    [
        (Reading(), "reflectance", 10000, 0),
        (Reading(scale=10000), "reflectance", 10000, 1),
        (Reading(scale=4095), "reflectance", 4095, 1),
        (Reading(kind="reflectance"), "reflectance", 10000, 0),
        (Reading(kind="radiance"), "radiance", 1, 0),
        (Reading(kind="counts"), "counts", 1, 1),
    ],
)
def test_the_user_s_word_comes_first(tmp_path: Path, reading: Reading, kind: str, scale: float, warnings: int) -> None:
    texture = envi(tmp_path, "reflectance scale factor = 10000", reading=reading)
    assert (texture.kind, texture.scale, len(texture.warnings)) == (kind, scale, warnings)
    with pytest.raises(TextureError, match="does not say which one is reflectance 1"):
        envi(tmp_path, reading=Reading(kind="reflectance"))


def test_gains_and_offsets_of_each_band(tmp_path: Path) -> None:
    """Float64: the product of both forms differs by rounding only."""
    gain, offset = np.arange(1, 8) / 8, np.arange(7) - 3.0
    lines = (f"data gain values = {listed(gain)}", f"data offset values = {listed(offset)}")
    texture = envi(tmp_path, *lines)
    assert texture.kind == "unstated"
    assert "calibrated by the header's 'data gain values'" in texture.warnings[0]
    stored = texture.samples(0, 5).astype(float)
    np.testing.assert_allclose((stored - texture.dark) * texture.gain, stored * gain + offset, rtol=1e-14, atol=1e-11)
    np.testing.assert_allclose(texture.rows(1, 2), (stored * gain + offset)[1:3], rtol=3e-7, atol=1e-3)
    to_reflectance = tuple(line.replace("data ", "data reflectance ") for line in lines)
    assert envi(tmp_path, *to_reflectance).kind == "reflectance"
    both = (*lines, f"data reflectance gain values = {listed(gain / 2)}")
    assert envi(tmp_path, *both).gain[0] == 1 / 16
    assert envi(tmp_path, *both, reading=Reading(kind="radiance")).gain[0] == 1 / 8
    assert envi(tmp_path, *both, "reflectance scale factor = 10000").gain[0] == 1e-4
    assert envi(tmp_path, *both, reading=Reading(kind="counts")).gain[0] == 1
    assert envi(tmp_path, *both, reading=Reading(scale=200)).gain[0] == 1 / 200
    flat = ("data gain values = {1,1,1,1,1,1,1}", "data offset values = {0,0,0,0,0,0,0}")
    assert envi(tmp_path, *flat).kind == "counts"
    bad = ("data gain values = {2,2,2,2,2,2,0}", "bbl = {1,1,1,1,1,1,0}")
    assert envi(tmp_path, *bad).gain.tolist() == [2, 2, 2, 2, 2, 2, 1]


@pytest.mark.parametrize(
    ("code", "written", "expected"),
    [
        (2, "-9999", -9999),
        (12, "-9999", None),
        (12, "65535.0", 65535),
        (12, "0.5", None),
        (1, "inf", None),
        (4, "-3.4028235e38", float(np.finfo(np.float32).min)),
        (4, "0.1", float(np.float32(0.1))),
        (4, "-1.7976931348623157e308", None),
        (5, "-1.7976931348623157e308", -np.finfo(np.float64).max),
        (4, "-inf", -np.inf),
        (4, "nan", None),
    ],
)  # fmt: skip
def test_the_value_of_no_data(tmp_path: Path, code: int, written: str, expected: float | None) -> None:
    texture = envi(tmp_path, f"data ignore value = {written}", code=code)
    assert texture.ignore_value == expected
    assert len(texture.warnings) == (expected is None and written != "nan")


def test_no_data_becomes_nan(tmp_path: Path) -> None:
    cube = cube_of(2)
    cube[1, 2, 3] = -9999
    texture = open_texture(
        write_envi(tmp_path, cube, 2, "bil", 1, 0, "data ignore value = -9999", "reflectance scale factor = 100")
    )
    rows = texture.rows(0, 5)
    assert np.argwhere(np.isnan(rows)).tolist() == np.argwhere(cube == -9999).tolist() == [[1, 2, 3]]
    # Two roundings of float32.
    np.testing.assert_allclose(rows[2:], cube[2:] / 100, rtol=2.4e-7)


def test_a_missing_byte_order_is_told(tmp_path: Path) -> None:
    assert envi(tmp_path, "byte order =").warnings[-1] == (
        "the header does not say the byte order; little end first is assumed"
    )
    assert len(envi(tmp_path, "byte order =", code=1).warnings) == 1  # of the key that is there twice


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"ENVI\n", "lacks 'samples'"),
        (b"ENVI", "lacks 'samples'"),
        (b"ENVI ASCII Plot File\n", "no texture of a known format"),
        ("ENVI\n".encode("utf-16"), "no texture of a known format"),
        (b"ENVI\n" + b"x = 1\n" * 3000, "far too long for a header"),
        (b"ENVI\n" + b"y\n" * 3000, "far too long for a header"),
        (b"ENVI\n" + b" " * (4 << 20), "larger than 4 MB"),
        (b"#?RADIANCE\n", "no texture of a known format"),
    ],
)
def test_files_that_are_no_headers(tmp_path: Path, data: bytes, message: str) -> None:
    (tmp_path / "x.raw").write_bytes(bytes(280))
    (tmp_path / "x.hdr").write_bytes(data)
    with pytest.raises(TextureError, match=message):
        open_texture(tmp_path / "x.hdr")
