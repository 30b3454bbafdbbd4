"""Spectra for RGB textures: the search is exact, mixtures are smooth, colours come back from the written file."""

from __future__ import annotations

import io
import json
import random
import struct
import zipfile
import zlib
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spectral_core import standards
from spectral_core.assigning import Library, assign, held_out, read_library, spectra_source
from spectral_core.assigning.bounds import Boxes, box_bounds, pair_lower_bound
from spectral_core.assigning.change import smoothest_change
from spectral_core.assigning.codes import between, code_colours
from spectral_core.assigning.icc_codes import IccProfile
from spectral_core.assigning.image import RgbImage
from spectral_core.assigning.nearest import nearest
from spectral_core.display import load_profile, srgb
from spectral_core.display.export import export_icc
from spectral_core.display.export.icc import D50
from spectral_core.errors import DisplayError, OutputError, SpectralBoothError, SpectrumError, TextureError
from spectral_core.imaging import oiio
from spectral_core.lights import Light
from spectral_core.textures import open_texture

Run = Callable[..., tuple[int, str, str]]
NM = np.arange(400.0, 701.0, 10)
D65, FL11 = Light.builtin("D65"), Light.builtin("FL11")
# A half float rounds by at most 1 part in 2048; averaged over the bands that is far less than this dE00.
HALF = 0.03
BLUE = np.array([0.0, 5.0, -40.0])


def smooth_library(count: int, seed: int = 0) -> Library:
    """Reflectances like measured ones: a level, steps and bands, smooth, within 0.02 to 0.95."""
    random_ = np.random.default_rng(seed)
    level, step, edge, width, band, centre = (
        random_.uniform(*limits, (count, 1))
        for limits in ((-2.5, 2), (-4, 4), (420, 680), (8, 40), (-2.5, 2.5), (420, 680))
    )
    curve = level + step / (1 + np.exp(-(NM - edge) / width)) + band * np.exp(-(((NM - centre) / 45) ** 2))
    values = 0.02 + 0.93 / (1 + np.exp(-curve))
    return Library(tuple(f"r{i}" for i in range(count)), NM, values)


def write_image(path: Path, codes: np.ndarray, **attributes: Any) -> Path:
    """Write codes (height, width, channels), uint8 or uint16."""
    spec = oiio().ImageSpec(
        codes.shape[1], codes.shape[0], codes.shape[2], str(codes.dtype).replace("float32", "float")
    )
    for name, value in attributes.items():
        spec.attribute(name, *value) if isinstance(value, tuple) else spec.attribute(name, value)
    output = oiio().ImageOutput.create(str(path))
    assert output.open(str(path), spec), output.geterror()
    assert output.write_image(np.ascontiguousarray(codes))
    output.close()
    return path


def write_library(path: Path, library: Library) -> Path:
    rows = [",".join(map(repr, [float(nm), *row.tolist()])) for nm, row in zip(NM, library.values.T, strict=True)]
    path.write_text("\n".join([",".join(["nm", *library.names]), *rows]) + "\n")
    return path


def noise(height: int, width: int, seed: int = 3, kind: str = "uint8") -> np.ndarray:
    return np.random.default_rng(seed).integers(0, np.iinfo(kind).max, (height, width, 3), kind, endpoint=True)


def all_rows(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Wavelengths, and values (height, width, bands) in float64."""
    texture: Any = open_texture(path)
    values = texture.rows(0, texture.height).astype(np.float64)
    if hasattr(texture, "close"):
        texture.close()
    assert texture.kind == "reflectance"
    return texture.wavelengths_nm, values


def Lab_at_random(count: int, chroma: float, seed: int) -> np.ndarray:
    random_ = np.random.default_rng(seed)
    return np.column_stack([random_.uniform(0, 100, count), random_.normal(0, chroma, (count, 2))])


def all_dE00(colours: np.ndarray, library: np.ndarray) -> np.ndarray:
    return standards.delta_E_2000(np.repeat(colours[:, None], len(library), axis=1), library[None])


# --- the search


@pytest.mark.parametrize("chroma", [4, 25, 60, 110])
@pytest.mark.parametrize("size", [1, 24, 700])
def test_nearest_is_what_brute_force_finds(chroma: float, size: int) -> None:
    """1e-9: the same function on arrays of other shapes. Greys, and colours beyond any gamut, among them."""
    library = Lab_at_random(size, chroma, 1)
    colours = np.concatenate([Lab_at_random(400, chroma, 2), library[:50], np.eye(3) * 50, np.zeros((1, 3))])
    distances = all_dE00(colours, library)
    for count in (1, 2, 7):
        if count > size:
            continue
        found = nearest(colours, library, count)
        best = np.argsort(distances, axis=1, kind="stable")[:, :count]
        np.testing.assert_allclose(found.dE00, np.take_along_axis(distances, best, axis=1), rtol=0, atol=1e-9)
        np.testing.assert_array_equal(found.rows, best)


@pytest.mark.parametrize("count", [1, 5, 8])
def test_nearest_but_for_ones_own(count: int) -> None:
    library = Lab_at_random(300, 30, 4)
    own = np.random.default_rng(5).integers(0, 300, 400)
    colours = np.concatenate([library[own[:200]], Lab_at_random(200, 30, 6)])
    distances = all_dE00(colours, library)
    distances[np.arange(400), own] = np.inf
    found = nearest(colours, library, count, own)
    expected = np.sort(distances, axis=1)[:, :count]
    np.testing.assert_allclose(found.dE00, expected, rtol=0, atol=1e-9)


def test_ties_go_to_the_first() -> None:
    library = np.repeat(Lab_at_random(20, 30, 7), 3, axis=0)
    for count in (1, 2, 3):
        found = nearest(library, library, count)
        np.testing.assert_array_equal(found.rows, (np.arange(60) // 3 * 3)[:, None] + np.arange(count))


@pytest.mark.parametrize("spread", [0.5, 8, 60])
def test_bounds_hold(spread: float) -> None:
    """Of a million pairs, half of them blue, where the terms of chroma and hue work against each other.

    Squares are compared; 1e-9 is rounding. The pair's bound is worth something: on average above 0.6 of dE00.
    """
    random_ = np.random.default_rng(8)
    first = np.concatenate([Lab_at_random(250_000, 50, 9), Lab_at_random(250_000, 15, 10) + BLUE])
    second = first + random_.normal(0, spread, first.shape)
    dE00 = standards.delta_E_2000(first, second)
    lower = pair_lower_bound(first.T, second.T)
    assert (lower <= dE00**2 * (1 + 1e-9) + 1e-12).all()
    assert np.mean(np.sqrt(lower) / np.maximum(dE00, 1e-9)) > 0.6

    corner, side = first[::5] - random_.uniform(0, spread, (100_000, 3)), random_.uniform(0, 2 * spread, (100_000, 3))
    boxes, pairs = Boxes(corner, corner + side), np.arange(100_000)
    least, most = box_bounds(boxes, pairs, Boxes(second[::5], second[::5]), pairs)
    for share in (0.0, 1.0, *random_.uniform(0, 1, (6, 3))):
        dE00 = standards.delta_E_2000(corner + share * side, second[::5])
        assert (least <= dE00**2 * (1 + 1e-9) + 1e-12).all()
        assert (most >= dE00**2 * (1 - 1e-9)).all()


# --- nearest, mixed, changed


def test_a_texture_of_library_colours_gets_its_spectra_back(tmp_path: Path) -> None:
    """Painted from a library of colours that 16 bits tell apart: each texel gets its own spectrum, to what
    floats hold; dE00 only by the rounding of 16-bit codes (0.01), and with floats as codes exactly 0."""
    library = smooth_library(300)
    XYZ = library.XYZ(D65)
    codes = srgb().to_codes(XYZ)
    fits = ((codes >= 0) & (codes <= 1)).all(axis=1)
    chosen = np.random.default_rng(1).choice(np.flatnonzero(fits), (20, 31))
    image = write_image(tmp_path / "t.png", np.round(codes[chosen] * 65535).astype(np.uint16))
    done = assign(image, D65, tmp_path / "o.npz", library, half=False)
    assert done.dE00.max < 0.01
    assert done.reflectances_used == len(np.unique(chosen))
    np.testing.assert_array_equal(all_rows(tmp_path / "o.npz")[1], library.values[chosen].astype(np.float32))
    choice = spectra_source(D65, library).choose(XYZ)
    np.testing.assert_array_equal(choice.rows[:, 0], np.arange(300))
    np.testing.assert_array_equal(choice.dE00, 0)


@pytest.mark.parametrize("suffix", [".npz", ".npy", ".exr"])
@pytest.mark.parametrize("how", [{}, {"mix": 6}, {"mix": 6, "exact": True}, {"exact": True}])
def test_what_is_written_has_the_colours_that_are_reported(tmp_path: Path, suffix: str, how: dict[str, Any]) -> None:
    library = smooth_library(200)
    codes = noise(25, 18)
    done = assign(write_image(tmp_path / "t.png", codes), D65, tmp_path / f"o{suffix}", library, **how)
    nm, values = all_rows(tmp_path / f"o{suffix}")
    assert values.shape == (25, 18, len(NM))
    np.testing.assert_array_equal(nm, NM)
    XYZ = values @ D65.weighting_factors(NM).matrix
    wanted = srgb().to_XYZ(codes / 255) @ between(srgb().to_XYZ(np.ones(3)), D65.XYZ()).T
    dE00 = standards.dE00(XYZ, wanted, D65.XYZ())
    assert done.dE00.mean == pytest.approx(dE00.mean(), abs=HALF)
    assert done.dE00.p95 == pytest.approx(np.percentile(dE00, 95), abs=0.2)  # 450 texels: the next one is as far
    assert done.dE00.max == pytest.approx(dE00.max(), abs=HALF)
    assert (done.pixels, done.colours, done.bands) == (450, len(np.unique(codes.reshape(-1, 3), axis=0)), len(NM))
    assert done.outside_0_1 == 0
    assert values.min() >= 0
    assert values.max() <= 1
    assert sum(share for _, share in done.most_used) <= 1 + 1e-9


def test_many_blocks_are_one_texture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Blocks of a few rows, colours forgotten in between, a few rows written at a time."""
    library, codes = smooth_library(50), noise(40, 9)
    codes[20:] = codes[:20]
    image = write_image(tmp_path / "t.png", codes)
    whole = assign(image, D65, tmp_path / "a.npz", library)
    monkeypatch.setattr("spectral_core.assigning.assignment._TEXELS", 27)
    monkeypatch.setattr("spectral_core.assigning.assignment._WRITTEN_BYTES", 2 * 9 * len(NM) * 4)
    parts = assign(image, D65, tmp_path / "b.npz", library)
    assert parts.dE00.max == whole.dE00.max
    assert parts.dE00.mean == pytest.approx(whole.dE00.mean, abs=1e-12)  # summed in another order
    assert parts.colours == whole.colours == len(np.unique(codes.reshape(-1, 3), axis=0))
    monkeypatch.setattr("spectral_core.assigning.known._MOST", 30)
    forgetful = assign(image, D65, tmp_path / "c.npz", library)
    assert forgetful.colours is None
    assert forgetful.dE00.p95 == whole.dE00.p95
    for name in "bc":
        np.testing.assert_array_equal(all_rows(tmp_path / f"{name}.npz")[1], all_rows(tmp_path / "a.npz")[1])


@pytest.mark.parametrize("exact", [False, True])
@pytest.mark.parametrize("count", [2, 5, 16])
def test_a_mixture_is_no_worse_than_the_nearest(count: int, exact: bool) -> None:
    """Over all of sRGB, most of it far outside this library; 1e-9 is rounding."""
    library, colours = smooth_library(60), srgb().to_XYZ(noise(40, 40).reshape(-1, 3) / 255)
    single = spectra_source(D65, library).choose(colours)
    mixed = spectra_source(D65, library, count, exact).choose(colours)
    own = mixed.spectra(np.concatenate([library.values, np.zeros((3, len(NM)))]) if exact else library.values)
    assert (mixed.dE00 <= single.dE00 + 1e-9).all()
    assert mixed.dE00.mean() < single.dE00.mean() * 0.95
    if not exact:
        assert mixed.weights is not None
        assert mixed.weights.min() >= 0
        np.testing.assert_allclose(mixed.weights.sum(axis=1), 1, atol=1e-12)
        XYZ = own @ D65.weighting_factors(NM).matrix
        np.testing.assert_allclose(standards.dE00(XYZ, colours, D65.XYZ()), mixed.dE00, atol=1e-9)


def test_mixtures_do_not_band() -> None:
    """Along a line of colours, ever smaller steps make ever smaller changes of the spectrum, where the nearest
    jumps by as much as before. The path crosses the library, and leaves it."""
    library = smooth_library(80)
    ends = srgb().to_XYZ(np.array([[0.1, 0.12, 0.1], [0.95, 0.8, 0.3], [0.2, 0.9, 0.95]]))

    def largest_step(count: int, exact: bool, steps: int) -> float:
        along = np.concatenate([np.linspace(a, b, steps) for a, b in pairwise(ends)])
        source = spectra_source(D65, library, count, exact)
        spectra = source.choose(along).spectra(source.table)
        return float(np.abs(np.diff(spectra, axis=0)).max())

    for exact in (False, True):
        coarse, fine = (largest_step(8, exact, steps) for steps in (1500, 12_000))
        assert fine < coarse / 4  # an eighth, but for where the solution turns a corner
        assert fine < 0.01
    assert largest_step(0, False, 12_000) > 0.05


def test_a_mixture_at_a_colour_of_the_library_is_that_spectrum() -> None:
    """1e-3: the prior of Shepard's weights at a distance of 1e-6 dE00."""
    library = smooth_library(60)
    source = spectra_source(D65, library, 6)
    np.testing.assert_allclose(source.choose(library.XYZ(D65)).spectra(library.values), library.values, atol=1e-3)


def test_the_smoothest_change_has_its_colour() -> None:
    """Exactly, on even and uneven grids; and no other change of that colour bends less."""
    for nm in (NM, np.sort(np.random.default_rng(2).uniform(390, 720, 40))):
        factors = FL11.weighting_factors(nm).matrix
        change = smoothest_change(nm, factors)
        np.testing.assert_allclose(change @ factors, np.eye(3), atol=1e-9)
    factors = FL11.weighting_factors(NM).matrix
    change, random_ = smoothest_change(NM, factors), np.random.default_rng(3)
    bends = (np.diff(change, n=2) ** 2).sum() + 1e-3 * (change**2).sum()
    for _ in range(20):
        other = random_.normal(size=(3, len(NM)))
        other += change - other @ factors @ change
        assert (np.diff(other, n=2) ** 2).sum() + 1e-3 * (other**2).sum() > bends * 0.98  # ends count a half


def test_exact_stays_within_what_a_surface_can_be() -> None:
    """Measured values beyond 0..1 stay as they are, and the change does not take them further."""
    library = smooth_library(40)
    values = library.values.copy()
    values[0] += 0.1
    values[1] -= 0.05
    library = Library(library.names, NM, values)
    colours = srgb().to_XYZ(noise(30, 30).reshape(-1, 3) / 255)
    source = spectra_source(D65, library, 0, exact=True)
    spectra = source.choose(colours).spectra(source.table)
    assert spectra.min() >= min(0, values.min()) - 1e-9
    assert spectra.max() <= max(1, values.max()) + 1e-9


@pytest.mark.parametrize("lamp", ["two-peaks-d65", "LPS"])
@pytest.mark.parametrize("how", [{"exact": True}, {"mix": 4, "exact": True}, {"recover": "smits"}])
def test_lamps_that_cannot_show_every_colour(lamp: str, how: dict[str, Any]) -> None:
    """Two lines, and one: what is reported is what is reached, and no worse than without the change."""
    light, library = Light.builtin(lamp), smooth_library(30)
    colours = library.XYZ(light)[:20] * [1.02, 1.0, 0.97]
    source = spectra_source(light, None if "recover" in how else library, **how)
    found = source.choose(colours)
    XYZ = found.spectra(source.table) @ light.weighting_factors(source.wavelengths_nm).matrix
    np.testing.assert_allclose(found.dE00, standards.dE00(XYZ, colours, light.XYZ()), atol=1e-6)
    if "recover" not in how:
        single = spectra_source(light, library).choose(colours)
        assert (found.dE00 <= single.dE00 + 1e-9).all()


# --- recovered


@pytest.mark.parametrize("method", ["smits", "mallett", "otsu"])
@pytest.mark.parametrize("lamp", ["D65", "FL11"])
def test_recovered_reflectances_have_the_colours(tmp_path: Path, method: str, lamp: str) -> None:
    """Under the lamp, though the methods are made for D65: a half float's rounding, and nothing else."""
    light, codes = Light.builtin(lamp), noise(24, 24)
    done = assign(write_image(tmp_path / "t.png", codes), light, tmp_path / "o.npz", recover=method)
    nm, spectra = all_rows(tmp_path / "o.npz")
    XYZ = spectra @ light.weighting_factors(nm).matrix
    wanted = srgb().to_XYZ(codes / 255) @ between(srgb().to_XYZ(np.ones(3)), light.XYZ()).T
    assert standards.dE00(XYZ, wanted, light.XYZ()).max() < 0.1  # a dark texel's half float
    assert done.dE00.max < 1e-6
    assert done.reflectances_used is None
    outside = ((spectra < -1e-6) | (spectra > 1 + 1e-6)).any(axis=-1).sum()
    assert done.outside_0_1 == pytest.approx(outside, abs=3)  # which half floats may round to 1
    assert done.outside_0_1 < 0.25 * done.pixels
    assert any("texels have a reflectance" in each for each in done.warnings) == bool(done.outside_0_1)


def test_recovery_is_the_methods_own_under_its_own_lamp() -> None:
    """Mallett's basis is exact for sRGB under D65 but for its own grid; 5e-3 is that."""
    source = spectra_source(D65, recover="mallett")
    for code in ([0.3, 0.5, 0.4], [0.7, 0.2, 0.6]):
        XYZ = standards.srgb_to_XYZ_matrix() @ np.array(code)
        nm, expected = standards.recovered_reflectance("mallett", XYZ)
        found = source.choose(XYZ[None]).spectra(source.table)[0]
        np.testing.assert_array_equal(source.wavelengths_nm, nm)
        np.testing.assert_allclose(found, expected, atol=5e-3)


def test_colours_outside_of_the_gamut_are_counted(tmp_path: Path) -> None:
    codes = np.zeros((4, 4, 3), dtype=np.uint8)
    codes[0, :3] = [0, 255, 0]
    done = assign(
        write_image(tmp_path / "t.png", codes), D65, tmp_path / "o.npz", recover="smits", profile="htc-vive-2021"
    )
    assert done.out_of_gamut == 3
    assert done.dE00.max > 1
    assert any("outside of sRGB's gamut" in each for each in done.warnings)


def test_unknown_ways(tmp_path: Path) -> None:
    library = smooth_library(10)
    for how in ({"mix": 10}, {"mix": 1}, {"mix": 99}, {"recover": "magic"}, {"recover": "smits", "mix": 3}):
        with pytest.raises(SpectrumError):
            spectra_source(D65, library, **how)  # type: ignore[arg-type]
    with pytest.raises(SpectrumError, match="no library"):
        spectra_source(D65)


# --- what codes mean


@pytest.fixture
def image(tmp_path: Path) -> RgbImage:
    return RgbImage(write_image(tmp_path / "t.png", noise(8, 8)))


def srgb_icc() -> bytes:
    cms = pytest.importorskip("PIL.ImageCms")
    return bytes(cms.ImageCmsProfile(cms.createProfile("sRGB")).tobytes())


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


# --- libraries


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
        "no variable 'data'": {"wavelength": NM},
        "no real numbers": {"data": "text", "wavelength": NM},
        "is no matrix": {"data": np.ones((31, 2, 2)), "wavelength": NM},
        "has 30 rows": {"data": library.values.T[:30], "wavelength": NM},
        "'data' holds no real": {"data": library.values.T * 1j, "wavelength": NM},
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
    with pytest.raises(SpectrumError, match="-v7"):
        read_library([tmp_path / "new.mat"])


# --- what it is worth


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


# --- the command


def test_the_command(run: Run, tmp_path: Path) -> None:
    image = write_image(tmp_path / "t.png", noise(12, 10))
    library = write_library(tmp_path / "l.csv", smooth_library(40))
    code, out, err = run(
        "assign", image, "--library", library, "--light", "FL11", "-o", tmp_path / "o.npz", "--judge", "A",
        "--judge", "D65", "--json",
    )  # fmt: skip
    assert code == 0, err
    document = json.loads(out)
    assert {"mean", "p95", "max"} == set(document["dE00"])
    assert 0 < document["reflectances_used"] <= document["library"] == 40
    assert (document["pixels"], document["colours"], document["bands"]) == (120, 120, 31)
    assert document["light"] == "FL11"
    assert document["profile"] == "sRGB"
    assert [each["light"] for each in document["held_out"]] == ["A", "D65"]
    assert document["held_out"][0]["rgb_texture"]["mean"] > 0
    assert "taken as sRGB" in err
    code, out, _ = run("texture", "pixel", tmp_path / "o.npz", 3, 4, "--light", "FL11", "--json")
    assert code == 0
    assert len(json.loads(out)["reflectance"]) == 31
    code, out, err = run("assign", image, "--library", "colorchecker", "--light", "D65", "-o", tmp_path / "p.exr",
                         "--mix", 4, "--exact", "--step", 10, "--judge", "A")  # fmt: skip
    assert code == 0, err
    assert "left out" in out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--light", "D65"], "no library"),
        (["--light", "D65", "--library", "none.csv"], "no such file"),
        (["--light", "moon", "--library", "colorchecker"], "moon"),
        (["--library", "colorchecker"], "--light"),
        (["--light", "D65", "--library", "colorchecker", "--mix", "24"], "mix fewer"),
        (["--light", "D65", "--recover", "smits", "--exact"], "neither mixed"),
        (["--light", "D65", "--recover", "smits", "--judge", "A"], "--library with --judge"),
        (["--light", "D65", "--library", "colorchecker", "--profile", "x.json"], "x.json"),
        (["--light", "D65", "--library", "colorchecker", "--icc", "x.icc"], "x.icc"),
        (["--light", "D65", "--library", "colorchecker", "--step", "nan"], "nan"),
        (["--light", "D65", "--recover", "smits", "--step", "5"], "--step is for a library"),
    ],
)
def test_bad_arguments(run: Run, tmp_path: Path, arguments: list[str], message: str) -> None:
    image = write_image(tmp_path / "t.png", noise(4, 4))
    code, out, err = run("assign", image, "-o", tmp_path / "o.npz", *arguments)
    assert code == 2
    assert out == ""
    assert err.count("\n") == 1
    assert message in err
    assert not (tmp_path / "o.npz").exists()


def test_output_that_cannot_be(tmp_path: Path) -> None:
    image, library = write_image(tmp_path / "t.png", noise(4, 4)), smooth_library(3)
    with pytest.raises(OutputError, match=r"'.tiff'"):
        assign(image, D65, tmp_path / "o.tiff", library)
    (tmp_path / "o.npz").mkdir()
    with pytest.raises(OutputError, match="folder"):
        assign(image, D65, tmp_path / "o.npz", library)


def test_a_stopped_run_leaves_what_was_there(tmp_path: Path) -> None:
    image, library = write_image(tmp_path / "t.png", noise(4, 4)), smooth_library(3)

    def stop(_: float, __: str) -> None:
        raise KeyboardInterrupt

    for suffix in (".npz", ".npy", ".exr"):
        (tmp_path / f"o{suffix}").write_text("old")
        with pytest.raises(KeyboardInterrupt):
            assign(image, D65, tmp_path / f"o{suffix}", library, progress=stop)
        assert (tmp_path / f"o{suffix}").read_text() == "old"
    assert sorted(each.name for each in tmp_path.iterdir()) == ["o.exr", "o.npy", "o.npz", "t.png"]


# --- images


@pytest.mark.parametrize("kind", ["uint8", "uint16"])
@pytest.mark.parametrize("suffix", [".png", ".tif", ".bmp", ".tga"])
def test_codes_come_as_they_are_stored(tmp_path: Path, suffix: str, kind: str) -> None:
    if kind == "uint16" and suffix in (".bmp", ".tga"):
        pytest.skip("formats of 8 bits")
    codes = noise(37, 21, kind=kind)
    for name, options in {"lines": {}, "tiles": {"tile_width": 16, "tile_height": 16}}.items():
        spec = oiio().ImageSpec(21, 37, 3, kind)
        if options and suffix != ".tif":
            continue
        for key, value in options.items():
            setattr(spec, key, value)
        path = tmp_path / f"{name}{suffix}"
        output = oiio().ImageOutput.create(str(path))
        assert output.open(str(path), spec)
        assert output.write_image(codes)
        output.close()
        image = RgbImage(path)
        assert (image.width, image.height, image.bits) == (21, 37, 8 if kind == "uint8" else 16)
        found = np.concatenate([image.rows(first, min(5, 37 - first)) for first in range(0, 37, 5)])
        np.testing.assert_array_equal(found, codes)


def test_alpha_and_grey_are_said(tmp_path: Path) -> None:
    codes = np.concatenate([noise(6, 6), np.full((6, 6, 1), 40, dtype=np.uint8)], axis=2)
    image = RgbImage(write_image(tmp_path / "a.png", codes, **{"oiio:UnassociatedAlpha": 1}))
    np.testing.assert_array_equal(image.rows(0, 6), codes[..., :3])  # not times alpha
    assert "alpha" in image.warnings[0]
    grey = RgbImage(write_image(tmp_path / "g.png", codes[..., :1]))
    np.testing.assert_array_equal(grey.rows(1, 2), np.repeat(codes[1:3, :, :1], 3, axis=2))
    assert "grey" in grey.warnings[0]
    turned = RgbImage(write_image(tmp_path / "t.tif", codes[..., :3], Orientation=6))
    assert "turned" in turned.warnings[0]


def test_images_that_are_none(tmp_path: Path) -> None:
    write_image(tmp_path / "float.tif", np.ones((3, 3, 3), dtype=np.float32))
    write_image(tmp_path / "many.tif", np.ones((3, 3, 5), dtype=np.uint8))
    write_image(tmp_path / "x.exr", np.ones((3, 3, 3), dtype=np.float32))
    (tmp_path / "text.png").write_text("no image")
    (tmp_path / "empty.png").write_bytes(b"")
    for name in ("float.tif", "many.tif", "x.exr", "text.png", "empty.png", "none.png", "."):
        with pytest.raises(TextureError, match=r"give|name"):
            RgbImage(tmp_path / name)


def test_a_header_that_promises_too_much(tmp_path: Path) -> None:
    data = bytearray(write_image(tmp_path / "t.png", noise(4, 4)).read_bytes())
    data[16:24] = struct.pack(">2I", 60_000, 60_000)
    data[29:33] = struct.pack(">I", zlib.crc32(data[12:29]))
    (tmp_path / "t.png").write_bytes(data)
    with pytest.raises(TextureError, match=r"promises 60000 x 60000|no image"):
        RgbImage(tmp_path / "t.png")


def test_damaged_inputs_are_refused_or_read(run: Run, tmp_path: Path) -> None:
    """Whatever the bytes of an image, a profile and a library: 0 and JSON, or 2 and one line. Seeded."""
    pytest.importorskip("PIL")
    random_ = random.Random(11)
    image = write_image(tmp_path / "t.png", noise(9, 9))
    tiff = write_image(tmp_path / "t.tif", noise(9, 9), compression="zip")
    profile = tmp_path / "p.icc"
    profile.write_bytes(srgb_icc())
    library = write_library(tmp_path / "l.csv", smooth_library(4))
    sources = [(image, "t.png"), (tiff, "t.tif"), (profile, "p.icc")]
    try:
        import scipy.io
    except ImportError:
        pass
    else:
        matlab = tmp_path / "l.mat"
        scipy.io.savemat(matlab, {"data": smooth_library(4).values.T, "wavelength": NM})
        sources.append((matlab, "l.mat"))
    for source, name in sources:
        good = source.read_bytes()
        for _ in range(40):
            damaged = bytearray(good)
            for _ in range(random_.randint(1, 4)):
                at = random_.randrange(min(len(damaged), random_.choice((64, 400, 4000))))
                damaged[at : at + random_.choice((0, 1, 1, 4))] = random_.choice(
                    (b"", b"\xff\xff\xff\xff", b"\0\0\0\0", b"\x7f\xff\xff\xff", random_.randbytes(3))
                )
            broken = tmp_path / f"broken{Path(name).suffix}"
            broken.write_bytes(bytes(damaged))
            arguments = {
                "t.png": [broken, "--library", library], "t.tif": [broken, "--library", library],
                "p.icc": [image, "--library", library, "--icc", broken], "l.mat": [image, "--library", broken],
            }[name]  # fmt: skip
            code, out, err = run("assign", *arguments, "--light", "D65", "-o", tmp_path / "o.npz", "--json")
            what = f"{name} {bytes(damaged[:80])!r}: {err}"
            assert code in (0, 2), what
            if code == 0:
                json.loads(out, parse_constant=lambda constant: pytest.fail(constant))
            else:
                assert out == "", what
                assert err.startswith("error: "), what
                assert err.count("\n") == 1, what
                assert len(err) < 1000, what


def test_a_written_archive_is_a_plain_one(tmp_path: Path) -> None:
    image, library = write_image(tmp_path / "t.png", noise(4, 5)), smooth_library(3)
    assign(image, D65, tmp_path / "o.npz", library)
    with zipfile.ZipFile(tmp_path / "o.npz") as archive:
        assert archive.testzip() is None
    with np.load(io.BytesIO((tmp_path / "o.npz").read_bytes()), allow_pickle=False) as loaded:
        assert loaded["reflectance"].shape == (4, 5, 31)
        assert loaded["reflectance"].dtype == np.float16


def test_every_error_is_one_of_ours(tmp_path: Path) -> None:
    with pytest.raises(SpectralBoothError, match="no such file"):
        assign(tmp_path / "none.png", D65, tmp_path / "o.npz", smooth_library(3))
