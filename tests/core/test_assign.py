"""Spectra for RGB textures: the search is exact, mixtures are smooth, colours come back from the written file."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from assign_samples import (
    BLUE,
    D65,
    FL11,
    HALF,
    NM,
    Lab_at_random,
    all_dE00,
    all_rows,
    noise,
    smooth_library,
    write_image,
)

from spectral_core import standards
from spectral_core.assigning import Library, assign, spectra_source
from spectral_core.assigning.bounds import Boxes, box_bounds, pair_lower_bound
from spectral_core.assigning.change import smoothest_change
from spectral_core.assigning.codes import between
from spectral_core.assigning.nearest import nearest
from spectral_core.display import srgb
from spectral_core.errors import SpectrumError
from spectral_core.lights import Light


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
