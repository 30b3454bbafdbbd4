from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from spectral_core import light_design, standards, weights
from spectral_core.display import srgb, srgb_encode
from spectral_core.errors import LightError
from spectral_core.lights import Light, builtin_names
from spectral_core.spectra import read_spectra, write_spectra


@pytest.mark.parametrize("name", [name for name in standards.published_chromaticities() if not name.startswith("ISO")])
def test_cie_illuminants_have_their_published_chromaticities(name: str) -> None:
    """6e-5: the publications print four or five decimals (CIE 015:2018); the ISO 7589 tables are
    left out, since they end at 690 nm and their published values rest on longer ones."""
    published = standards.published_chromaticities()[name]
    np.testing.assert_allclose(Light.builtin(name).xy(), published, atol=6e-5)


def test_there_are_52_cie_illuminants() -> None:
    assert sum(not name.startswith("ISO") for name in standards.published_chromaticities()) == 52


@pytest.mark.parametrize(
    ("name", "expected"), [("D65", (237, 237, 237)), ("D50", (255, 235, 205)), ("A", (310, 218, 123))]
)
def test_published_lamp_colours(name: str, expected: tuple[int, int, int]) -> None:
    """Diaz-Barrancas et al. 2020, Table 3, printed in whole levels: 0.6 is their rounding and a
    tenth for the rounding of the matrix they used."""
    codes = 255 * srgb_encode(srgb().to_linear(Light.builtin(name).XYZ()) * 0.85)
    np.testing.assert_allclose(codes, expected, atol=0.6)


@pytest.mark.parametrize(
    ("name", "cct"), [("D65", 6503), ("D50", 5000), ("two-peaks-d65", 6501), ("d65-simulator", 6568)]
)
def test_published_colour_temperatures(name: str, cct: float) -> None:
    """3 K: Ohno's method and theirs (not named) differ by up to that; 30 K for the simulator."""
    assert Light.builtin(name).quality().cct_K == pytest.approx(cct, abs=30 if name == "d65-simulator" else 3)


def test_published_fidelity() -> None:
    assert Light.builtin("D65").quality().rf == pytest.approx(100, abs=0.05)
    assert Light.builtin("D50").quality().rf == pytest.approx(100, abs=0.05)
    two_peaks = Light.builtin("two-peaks-d65").quality().rf
    assert two_peaks is not None
    assert two_peaks < 10


def test_the_simulator_is_the_published_one() -> None:
    light = Light.builtin("d65-simulator")
    np.testing.assert_allclose(light.xy(), (0.3107, 0.3344), atol=5e-4)
    assert light.quality().rf == pytest.approx(88, abs=1.5)


@pytest.mark.parametrize("peak", np.arange(430.0, 475.5, 2.5).tolist())
def test_two_peaks_match_d65(peak: float) -> None:
    """1e-6 is asked; the lever rule gives float64 rounding."""
    target = Light.builtin("D65").xy()
    light = light_design.two_peak_metamer(target, peak)
    np.testing.assert_allclose(light.xy(), target, atol=1e-12)
    assert light.wavelengths_nm[0] == peak
    assert (light.powers > 0).all()


@pytest.mark.parametrize("peak", [500.0, 540.0, 370.0, 720.0])
def test_a_peak_without_a_partner_says_so(peak: float) -> None:
    with pytest.raises(LightError, match=r"no second line|outside 380 to 700"):
        light_design.two_peak_metamer(Light.builtin("D65").xy(), peak)


def test_two_peaks_for_an_observer_that_begins_later() -> None:
    """The CIE 2015 tables begin at 390 nm; below there is no chromaticity to solve for."""
    target = Light.builtin("D65").xy("cie2015-2")
    light = light_design.two_peak_metamer(target, 456.0, "cie2015-2")
    np.testing.assert_allclose(light.xy("cie2015-2"), target, atol=1e-12)
    with pytest.raises(LightError, match="outside 390 to 700"):
        light_design.two_peak_metamer(target, 385.0, "cie2015-2")


@pytest.mark.parametrize("rf", [60.0, 75.0, 88.0])
def test_led_mixtures_meet_chromaticity_and_fidelity(rf: float) -> None:
    target = np.array([0.33, 0.34])
    light = light_design.led_mixture(target, rf)
    np.testing.assert_allclose(light.xy(), target, atol=1e-12)
    assert light.quality().rf == pytest.approx(rf, abs=1e-6)


def test_many_leds_take_seconds() -> None:
    """The search works on a spread of the mixtures of three: all 110 of twelve LEDs took minutes."""
    target = np.array([0.33, 0.34])
    evaluations = 0
    score = light_design._rf

    def counted(mixture: np.ndarray, leds: np.ndarray) -> float:
        nonlocal evaluations
        evaluations += 1
        return score(mixture, leds)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(light_design, "_rf", counted)
        light = light_design.led_mixture(target, 90.0, 12)
    assert light.quality().rf == pytest.approx(90, abs=1e-6)
    assert evaluations < 1500


def test_an_impossible_mixture_names_what_is_possible() -> None:
    with pytest.raises(LightError, match="ask for"):
        light_design.led_mixture(np.array([0.31, 0.33]), 99.9, 3)
    with pytest.raises(LightError, match="outside the gamut"):
        light_design.led_mixture(np.array([0.1, 0.8]), 50)


def test_every_builtin_light_has_finite_colour() -> None:
    for name in builtin_names():
        light = Light.builtin(name)
        assert np.isfinite(light.XYZ()).all()
        quality = light.quality()
        assert quality.cct_K is None or np.isfinite(quality.cct_K)
        assert quality.rf is None or np.isfinite(quality.rf)


def test_names_are_forgiving_and_mistakes_are_helped() -> None:
    assert Light.load("tl84").name == "Philips TL-84"
    assert Light.load("led b3").name == "LED-B3"
    with pytest.raises(LightError, match="FL11"):
        Light.load("FL111")


def test_designed_lights_survive_their_csv(tmp_path: Path) -> None:
    for light in (Light.builtin("two-peaks-d65"), Light.builtin("d65-simulator")):
        from spectral_core.documents import design_table

        powers, lines = design_table(light)
        path = tmp_path / "light.csv"
        write_spectra(path, light.wavelengths_nm, powers[None, :], (light.name,), lines)
        assert read_spectra(path, "power").lines == lines
        np.testing.assert_allclose(Light.load(path).XYZ(), light.XYZ(), rtol=1e-14)


def test_a_line_in_a_fine_table_agrees_with_an_exact_line() -> None:
    """A line at a whole nanometre as a 1 nm table and as a node: the same colour."""
    grid = np.arange(380.0, 781.0)
    table = Light.from_table("table", grid, (grid == 546).astype(float) + (grid == 436) * 0.5)
    exact = Light.from_lines("lines", [436, 546], [0.5, 1.0])
    np.testing.assert_allclose(table.XYZ(), exact.XYZ(), rtol=1e-14)
    assert table.quality() == exact.quality()


def test_indices_see_the_table_and_not_its_uneven_ends() -> None:
    """Dark samples far outside leave Rf and Ra alone, although the first visible one now stands for more."""
    grid = np.arange(380.0, 781.0, 5)
    powers = 1 + 0.3 * np.sin(grid / 20)
    plain = Light.from_table("plain", grid, powers).quality()
    longer = Light.from_table("longer", np.r_[300, 310, grid, 800], np.r_[0, 0, powers, 0]).quality()
    assert longer.rf == pytest.approx(plain.rf, abs=1e-9)
    assert longer.ra == pytest.approx(plain.ra, abs=1e-9)


def test_missing_ends_and_coarse_tables_are_told() -> None:
    short = Light.from_table("short", np.arange(420.0, 641.0, 5), np.ones(45))
    assert any("missing" in each for each in short.warnings)
    coarse = Light.from_table("coarse", np.arange(380.0, 781.0, 20), np.ones(21))
    assert any("5 nm" in each for each in coarse.warnings)
    assert not Light.builtin("D65").warnings


MIXTURE = "0.5 A + 0.3 D65 + 0.2 FL11"
SHARES = {"A": 0.5, "D65": 0.3, "FL11": 0.2}


def test_a_mixture_has_its_lights_colour_by_their_shares_of_luminance() -> None:
    mixture = Light.load(MIXTURE)
    assert mixture.name == MIXTURE
    assert {light.name: share for light, share in mixture.parts} == pytest.approx(SHARES)
    XYZ = sum(share * Light.load(name).XYZ() for name, share in SHARES.items())
    np.testing.assert_allclose(mixture.XYZ(), XYZ, rtol=1e-13)  # sums of hundreds of float64 numbers
    for bands in (np.arange(400.0, 701.0, 10), np.arange(380.0, 781.0)):
        factors = sum(share * Light.load(name).weighting_factors(bands).matrix for name, share in SHARES.items())
        np.testing.assert_allclose(mixture.weighting_factors(bands).matrix, factors, atol=1e-13)


def test_a_mixtures_indices_are_those_of_the_sum_of_tables() -> None:
    """A, D65 and FL11 have tables every 5 nm, which are made one of 1 nm, linear in between, as the mixture's."""
    nm = np.arange(380.0, 781.0)
    total = np.zeros(len(nm))
    for name, share in SHARES.items():
        light = Light.load(name)
        table = np.interp(nm, light.wavelengths_nm, light.powers / weights.quadrature_widths(light.wavelengths_nm))
        total += share * table / light.luminance()
    summed = Light.from_table("sum", nm, total).quality()
    found = Light.load(MIXTURE).quality()
    # Chromaticities differ: the sum of 1 nm tables is not that of the lights' own samples.
    assert found.cct_K == pytest.approx(summed.cct_K, rel=2e-3)
    assert found.duv == pytest.approx(summed.duv, abs=2e-4)
    # The same table in, the same index out, but for the test's own interpolation beyond the ends.
    assert found.rf == pytest.approx(summed.rf, abs=1e-6)
    assert found.ra == pytest.approx(summed.ra, abs=1e-6)
    assert found.rf != pytest.approx(Light.load("A").quality().rf, abs=1)


def test_a_light_mixed_with_itself_is_itself() -> None:
    twice, once = Light.load("1 LPS + 3 LPS"), Light.load("LPS")
    np.testing.assert_allclose(twice.XYZ(), once.XYZ(), rtol=1e-14)
    assert twice.lines.sum() == 2 * once.lines.sum()


@pytest.mark.parametrize("file", [False, True])
def test_only_ratios_of_shares_count(tmp_path: Path, file: bool) -> None:
    name = "D65"
    if file:
        name = str(tmp_path / "lamp.csv")
        light = Light.load("D65")
        table = light.powers / weights.quadrature_widths(light.wavelengths_nm)
        write_spectra(Path(name), light.wavelengths_nm, table[None], ("lamp",))
    for text in (f"1 A + 3 {name}", f".25 A + 0.75 {name}", f"25. A + 75 {name}"):
        np.testing.assert_allclose(Light.load(text).XYZ(), Light.load("0.25 A + 0.75 D65").XYZ(), rtol=1e-13)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0 A + 0 D65", "the shares 0, 0 make no mixture; give numbers above 0"),
        (f"{'9' * 400} A + 1 D65", "the shares inf, 1 make no mixture"),
        ("0.5 A + 0.5 nope", "no built-in light and no file called 'nope'"),
        ("0.5 A + D65", "no built-in light and no file called '0.5 A + D65'"),
        ("-0.5 A + 1 D65", "no built-in light and no file called '-0.5 A + 1 D65'"),
        ("0.5 A +", "no built-in light"),
        ("0.5 A + 0.5 ", "no built-in light"),
        ("0.5 A", "no built-in light"),
    ],
)
def test_bad_mixtures_are_refused_in_one_line(text: str, message: str) -> None:
    with pytest.raises(LightError) as caught:
        Light.load(text)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
