from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import displays
import numpy as np
import pytest

from spectral_core import weights
from spectral_core.arrays import Float64Array, frozen
from spectral_core.display.characterising.checks import check
from spectral_core.display.characterising.verdicts import Verdict
from spectral_core.display.measuring.measurements import Measurements, read_measurements
from spectral_core.errors import DisplayError
from spectral_core.standards import observer_table

Run = Callable[..., tuple[int, str, str]]
# White twice at each end and in the middle of the published protocol.
WHITES = np.ones((2, 3))
CODES = np.concatenate(
    [WHITES, displays.published_protocol()[:120], WHITES, displays.published_protocol()[120:], WHITES]
)


def verdict(measured: Measurements, name: str) -> Verdict:
    return next(each for each in check(measured).verdicts if each.name == name)


def changed(measured: Measurements, factor: Float64Array) -> Measurements:
    """Readings (n,) times a factor."""
    return replace(measured, XYZ=frozen(measured.XYZ * factor[:, None]))


@pytest.mark.parametrize("seed", [None, 1, 2, 3])
def test_an_additive_display_passes_every_check(seed: int | None) -> None:
    measured = displays.measure(displays.additive, CODES, seed)
    failed = [each.name for each in check(measured).verdicts if each.passed is not True]
    assert failed == []


@pytest.mark.parametrize("seed", [None, 1, 2])
def test_a_power_limit_fails_what_rests_on_additivity(seed: int | None) -> None:
    measured = displays.measure(displays.power_limited, CODES, seed)
    failed = {each.name for each in check(measured).verdicts if each.passed is False}
    assert failed == {"additivity of white", "additivity of mixes", "channel independence"}


def test_mixes_are_compared_with_the_sum_of_their_channels() -> None:
    """Levels that are in the ramps: the sum is known exactly, whatever the curves between."""
    levels = np.array([0.25, 0.5, 0.75, 1.0])
    ramps = [axis * level for axis in np.eye(3) for level in levels]
    mixes = [np.array([a, b, c]) for a in (0, 0.5, 1) for b in (0.25, 0.75) for c in (0, 0.25)]
    codes = np.array([*ramps, *mixes, np.zeros(3), np.ones(3)])
    measured = displays.measure(displays.power_limited, codes)
    summed = np.sum([displays.power_limited(codes * axis) - displays.BLACK for axis in np.eye(3)], axis=0)
    white = displays.power_limited(np.ones((1, 3)))[0]
    percent = 100 * np.abs((measured.XYZ - summed - displays.BLACK) / white).max(axis=1)[measured.mixed]
    found = verdict(measured, "additivity of mixes").details
    # The projection on the primary leaves rounding, and a curve's smallest step of 1e-9 per node.
    assert found["mean_percent"] == pytest.approx(percent.mean(), abs=1e-3)
    assert found["max_percent"] == pytest.approx(percent.max(), abs=1e-3)
    assert found["mixes"] == measured.mixed.sum()


def test_channel_independence_finds_the_interaction() -> None:
    """Red takes 10 % of white's X, Y and Z from green in proportion to both: that is what must be found."""

    def display(codes: Float64Array) -> Float64Array:
        drive = codes**displays.GAMMA
        white = displays.additive(np.ones((1, 3)))[0]
        return displays.additive(codes) - 0.10 * white * (drive[:, 0] * drive[:, 1])[:, None]

    found = verdict(displays.measure(display, CODES), "channel independence")
    assert found.passed is False
    assert "red and green" in found.advice
    # White itself is 10 % darker, so that the share of the measured white is 11.1 %.
    assert found.value == pytest.approx(-100 / 9, abs=0.1)
    noisy = verdict(displays.measure(display, CODES, seed=2), "channel independence")
    assert noisy.value == pytest.approx(-100 / 9, abs=4 * noisy.details["standard_error_percent"])


@pytest.mark.parametrize("percent", [-8.0, 0.0, 8.0])
def test_drift_is_found_with_its_error(percent: float) -> None:
    """Six whites of 1 % at both ends and the middle give the trend within about 1 %: four standard errors."""
    measured = displays.measure(displays.additive, CODES, seed=5)
    trend = 1 + percent / 100 * np.linspace(0, 1, len(CODES))
    found = verdict(changed(measured, trend), "drift")
    error = found.details["standard_error_percent"]
    assert 0.2 < error < 2.5
    assert found.value == pytest.approx(percent, abs=4 * error)
    assert found.passed is (percent == 0)


def test_saturated_codes_are_found() -> None:
    """Codes from 230 on read the same: 25 of 255, of which the ramp in steps of 5 shows all."""
    measured = displays.measure(lambda codes: displays.additive(np.minimum(codes, 230 / 255)), CODES)
    found = verdict(measured, "saturated codes")
    assert found.passed is False
    assert found.value == pytest.approx(25)
    assert verdict(displays.measure(displays.power_limited, CODES), "saturated codes").value == 0


def test_a_clipped_instrument_is_found() -> None:
    """Everything above 60 % of white's luminance reads the same."""
    measured = displays.measure(displays.additive, CODES)
    top = 0.6 * measured.white_XYZ
    clipped = np.where(measured.XYZ[:, 1:2] > top[1], top, measured.XYZ)
    found = verdict(replace(measured, XYZ=frozen(clipped)), "clipped readings")
    codes = np.unique(measured.codes[measured.XYZ[:, 1] > top[1]], axis=0)
    assert found.passed is False
    assert found.value == len(codes)


def test_a_repeat_that_disagrees_is_named() -> None:
    codes = np.concatenate([CODES, np.repeat([[0.2, 0.4, 0.6]], 3, axis=0)])
    measured = displays.measure(displays.additive, codes, seed=4)
    assert verdict(measured, "duplicates agree").passed
    factor = np.ones(len(codes))
    factor[-1] = 0.4
    found = verdict(changed(measured, factor), "duplicates agree")
    assert found.passed is False
    assert "0.20/0.40/0.60" in found.advice
    assert "1.00" not in found.advice


def test_a_falling_ramp_is_named_unless_noise_explains_it() -> None:
    measured = displays.measure(displays.additive, CODES)
    factor = np.where((measured.codes == np.array([0, 200 / 255, 0])).all(axis=1), 0.8, 1.0)
    found = verdict(changed(measured, factor), "ramps rise")
    assert found.passed is False
    assert "green ramp falls at code 0.784" in found.advice


def test_a_lifted_black_fails_and_a_missing_one_is_untold() -> None:
    lifted = displays.measure(lambda codes: displays.additive(codes) + 3.0, CODES)
    found = verdict(lifted, "black level")
    assert found.passed is False
    assert found.value == pytest.approx(100 * 3.02 / 133.02)
    assert found.details["black_Y"] == pytest.approx(3.02)
    without = verdict(lifted.subset(lifted.codes.max(axis=1) > 0), "black level")
    assert (without.passed, without.value) == (None, None)


def rows(codes: Float64Array, values: Float64Array, header: str) -> str:
    table = np.concatenate([codes, values], axis=1)
    return "\n".join([header, "# a comment", *(",".join(f"{value:.10g}" for value in row) for row in table)])


SMALL = np.array([[1, 1, 1], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0]], dtype=np.float64)


@pytest.mark.parametrize(
    ("extra", "luminance", "message"),
    [
        (np.ones((1, 3)), [60.0], "white reads 60 in patch 6"),  # half of the other: no warm-up
        (np.ones((4, 3)), [130, 130, 98, 130], "more than drift or noise"),
        (np.repeat([[0.25], [0.5], [0.75]], 3, axis=1), [90.0, 60.0, 30.0], "grey ramp runs backwards"),
        (np.array([[0.25, 0, 0], [0.5, 0, 0], [0.75, 0, 0]]), [60.0, 50.0, 40.0], "red ramp runs backwards"),
    ],
)
def test_sets_that_contradict_themselves_are_refused(
    tmp_path: Path, extra: Float64Array, luminance: list[float], message: str
) -> None:
    codes = np.concatenate([SMALL, extra])
    XYZ = np.concatenate([displays.additive(SMALL), np.outer(luminance, [0.95, 1, 1.09])])
    path = tmp_path / "d.csv"
    path.write_text(rows(codes, XYZ, "R,G,B,X,Y,Z"))
    with pytest.raises(DisplayError, match=message):
        read_measurements(path)


@pytest.mark.parametrize("seed", range(5))
def test_noise_and_warming_up_are_no_contradiction(tmp_path: Path, seed: int) -> None:
    """1 % of noise, and 20 % more light at the end than at the start."""
    measured = displays.measure(displays.power_limited, CODES, seed)
    measured = changed(measured, np.linspace(1, 1.2, len(CODES)))
    path = tmp_path / "d.csv"
    path.write_text(rows(measured.codes, measured.XYZ, "R,G,B,X,Y,Z"))
    assert len(read_measurements(path).codes) == len(CODES)


def spectral_display() -> tuple[Float64Array, Float64Array, Float64Array]:
    """Codes, wavelengths and spectra of three Gaussian primaries on a faint black."""
    nm = np.arange(380.0, 781.0, 5.0)
    peaks = np.exp(-(((nm - np.array([[620.0], [530.0], [455.0]])) / 20) ** 2) / 2)
    codes = np.concatenate([SMALL, [[0.5, 0.5, 0.5], [0.2, 0.4, 0.9]]])
    return codes, nm, codes**2.2 @ peaks + 1e-4


@pytest.mark.parametrize("observer", ["cie1931-2", "cie2015-10"])
def test_spectra_in_a_table_give_any_observers_colours(tmp_path: Path, observer: str) -> None:
    """Against a sum over the observer's own 1 nm table at the same wavelengths: rounding of the file."""
    codes, nm, powers = spectral_display()
    path = tmp_path / "d.csv"
    path.write_text(rows(codes, powers, "R,G,B," + ",".join(f"{each:g}" for each in nm)))
    found = read_measurements(path, observer)
    table_nm, table = observer_table(observer)
    at = np.stack([np.interp(nm, table_nm, column, 0, 0) for column in table.T], axis=1)
    expected = powers @ at
    np.testing.assert_allclose(found.XYZ, 100 * expected / expected[0, 1], rtol=1e-8)
    assert found.unit == "relative"
    assert found.agreement is None


def test_spectra_beside_xyz_are_compared_and_used_for_other_observers(tmp_path: Path) -> None:
    codes, nm, powers = spectral_display()
    by_1931 = powers @ weights.colour_matching(nm) * 3.7  # the instrument's unit
    XYZ = by_1931.copy()
    XYZ[6, 1] *= 1.05
    path = tmp_path / "d.csv"
    header = "R,G,B,X,Y,Z," + ",".join(f"{each:g} nm" for each in nm)
    path.write_text(rows(codes, np.concatenate([XYZ, powers], axis=1), header))
    found = read_measurements(path)
    np.testing.assert_allclose(found.XYZ, XYZ, rtol=1e-8)
    assert found.agreement is not None
    assert found.agreement.max_percent == pytest.approx(100 * 0.05 * by_1931[6, 1] / by_1931[0, 1], rel=1e-6)
    # One patch of seven differs: the mean is a seventh of the largest.
    assert found.agreement.mean_dE00 == pytest.approx(found.agreement.max_dE00 / 7, rel=1e-3)
    assert verdict(found, "spectra against XYZ").value == found.agreement.mean_dE00
    other = read_measurements(path, "cie1964-10")
    by_1964 = powers @ weights.colour_matching(nm, "cie1964-10")
    np.testing.assert_allclose(other.XYZ, by_1964 * XYZ[0, 1] / by_1964[0, 1], rtol=1e-8)  # white's luminance stays
    assert any("cie1964-10" in each for each in other.warnings)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("R,G,B,X,Y,Z\n1,1,1,95,100,108\n", "holds no spectra"),
        ("R,G,B,400,500,500\n1,1,1,1,1,1\n", "occurs twice"),
        ("R,G,B,400,500,600\n1,1,1,0,0,0\n", "no light"),
        ("R,G,B,400,500\n1,1,1,1,1\n", "header"),
    ],
)
def test_an_observer_without_usable_spectra_is_an_error(run: Run, tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "d.csv"
    path.write_text(text)
    code, out, err = run("characterise", path, "--observer", "cie2015-2")
    assert (code, out) == (2, "")
    assert err.startswith(f"error: {path}")
    assert message in err


def test_the_command_lists_every_check(run: Run, tmp_path: Path) -> None:
    measured = displays.measure(displays.power_limited, CODES, seed=1)
    path = tmp_path / "d.csv"
    path.write_text(rows(measured.codes, measured.XYZ, "R,G,B,X,Y,Z"))
    code, out, err = run("characterise", path, "--json")
    document = json.loads(out)
    assert code == 0
    names = [each["name"] for each in document["checks"]]
    assert len(names) == len(set(names)) == 10
    assert {"name", "value", "unit", "limit", "limit_from", "passed", "advice"} <= set(document["checks"][0])
    failed = [each["advice"] for each in document["checks"] if each["passed"] is False]
    assert len(failed) == 3
    assert all(each in err for each in failed)
    assert "FAIL" in run("characterise", path)[1]
