from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import displays
import numpy as np
import pytest

from spectral_core.arrays import Float64Array, frozen
from spectral_core.display.characterising import advice as module
from spectral_core.display.characterising.advice import advise
from spectral_core.display.characterising.characterise import characterise, errors
from spectral_core.display.characterising.simulated import assumed_display, simulated
from spectral_core.display.measuring.measurements import Measurements
from spectral_core.display.measuring.patch_sets import SMALLEST, extension, starting_set

Run = Callable[..., tuple[int, str, str]]
ANCHORS = np.array([[0, 0, 0], [1, 1, 1], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=np.float64)


@pytest.fixture
def few_sizes(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is tested shows with few sizes, and in a few seconds."""
    monkeypatch.setattr(module, "SIZES", (30, 60, 90))


def true_error(display: displays.Display, codes: Float64Array, seed: int) -> float:
    """Mean dE00, on 500 unseen colours, of the model that is chosen for a noisy measurement."""
    measured = displays.measure(display, codes, seed)
    scale = measured.white_XYZ[1]
    unseen = np.random.default_rng(99).uniform(0, 1, (500, 3))
    truth = Measurements(frozen(unseen), frozen(display(unseen) / scale))
    return float(errors(characterise(measured).chosen.model, truth, display(np.ones((1, 3)))[0] / scale).mean())


def is_8_bit(codes: Float64Array) -> bool:
    return bool((np.round(codes * 255) / 255 == codes).all())


@pytest.mark.parametrize("count", [SMALLEST, 29, 30, 45, 100, 234, 300])
def test_starting_sets_are_distinct_8_bit_codes_with_the_primaries(count: int) -> None:
    codes = starting_set(count, displays.additive)
    assert codes.shape == (count, 3)
    assert len(np.unique(codes, axis=0)) == count
    assert is_8_bit(codes)
    assert all((codes == anchor).all(axis=1).any() for anchor in ANCHORS)


@pytest.mark.parametrize("count", [1, 7, 40])
def test_an_extension_never_repeats_what_was_measured(count: int) -> None:
    known = starting_set(60, displays.additive)
    new = extension(known, count, displays.additive)
    assert new.shape == (count, 3)
    assert is_8_bit(new)
    assert len(np.unique(np.concatenate([known, new]), axis=0)) == 60 + count
    without_black = extension(ANCHORS[1:], 20, displays.additive)
    assert (without_black == 0).all(axis=1).any()


@pytest.mark.parametrize("count", [30, 60])
def test_advised_patches_beat_as_many_random_ones(count: int) -> None:
    """Mean of five measurements on the power-limited headset; the random sets have the primaries, white
    and black, without which they would be refused, and differ from each other too.
    """
    advised, random = [], []
    codes = starting_set(count, assumed_display().XYZ)  # of a display that nobody has measured
    for seed in range(5):
        mixes = np.random.default_rng(seed).integers(0, 256, (count - 5, 3)) / 255
        advised.append(true_error(displays.power_limited, codes, seed))
        random.append(true_error(displays.power_limited, np.concatenate([ANCHORS, mixes]), seed))
    assert np.mean(advised) < 0.9 * np.mean(random)


@pytest.mark.usefixtures("few_sizes")
@pytest.mark.parametrize("display", [displays.power_limited, displays.additive])
def test_measuring_the_advised_patches_reaches_the_prediction(display: displays.Display) -> None:
    """Three measurements of the extended set: each within the spread, which is for 19 of 20, or better."""
    start = starting_set(45, display)
    found = advise(displays.measure(display, start, 3), patches=45)
    assert (found.chosen.kind, found.chosen.patches, len(found.codes)) == ("extended", 90, 45)
    assert found.chosen.spread < found.chosen.mean * 1.5
    extended = np.concatenate([start, found.codes])
    for seed in (11, 12, 13):
        assert abs(true_error(display, extended, seed) - found.chosen.mean) <= found.chosen.spread


@pytest.mark.usefixtures("few_sizes")
def test_the_fewest_patches_for_an_accuracy_are_advised() -> None:
    coarse, fine = advise(accuracy=1.5), advise(accuracy=0.05)
    assert coarse.chosen.patches == 30
    assert not coarse.warnings
    assert coarse.chosen.mean <= 1.5
    assert any("0.05" in each for each in fine.warnings)
    assert fine.chosen.mean == min(each.mean for each in fine.predicted)
    assert (coarse.codes[0] == 1).all()  # white first


def excess(XYZ: Float64Array) -> float:
    """(R + G + B - 2 black) / white - 1 of the anchors' luminances."""
    Y = XYZ[:, 1]
    return float((Y[2:].sum() - 2 * Y[0]) / Y[1] - 1)


def test_the_simulated_display_is_as_far_from_additive_as_the_measured_one() -> None:
    """Four colours, and none: black, which does not dim, moves the sum by less than its own 0.4 %."""
    small = simulated(characterise(displays.measure(displays.power_limited, ANCHORS)))
    assert excess(small.XYZ(ANCHORS)) == pytest.approx(excess(displays.power_limited(ANCHORS)), abs=0.005)
    assert excess(assumed_display().XYZ(ANCHORS)) == pytest.approx(0.127, abs=0.01)


def test_the_noise_of_the_simulated_display_is_the_measured_one() -> None:
    """From 40 repeats of white the deviation is known to 1 / sqrt(80) = 11 %: three times that."""
    codes = np.concatenate([starting_set(60, displays.additive), np.ones((40, 3))])
    noise = simulated(characterise(displays.measure(displays.additive, codes, seed=8))).noise
    assert noise[0] == pytest.approx(0.01, rel=0.33)
    assert noise[1] == pytest.approx(0.0015, rel=0.33)


@pytest.mark.usefixtures("few_sizes")
def test_the_command_writes_patches_that_a_player_can_show(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "patches.csv"
    code, out, _ = run("characterise", "--advise", "--patches", 40, "-o", path, "--json")
    document = json.loads(out)
    assert code == 0
    assert len(document["patches"]) == 40
    assert set(document["predicted"][0]) >= {"patches", "dE00"}
    assert document["predicted"][-1]["patches"] == 40
    assert set(document["predicted"][0]["dE00"]) == {"mean", "spread"}
    assert document["why"]
    header, *lines = path.read_text().splitlines()
    assert header == "R,G,B"
    codes = np.array([[float(value) for value in line.split(",")] for line in lines])
    np.testing.assert_array_equal(codes, np.array(document["patches"]))
    assert is_8_bit(codes)


@pytest.mark.parametrize(
    "arguments",
    [
        (), ("--advise", "--patches", 3), ("--advise", "--accuracy", 0), ("--accuracy", 1), ("--advise", "none.csv"),
        ("--advise", "--model", "grey-lut"),
    ],
)  # fmt: skip
def test_questions_that_make_no_sense_get_one_line(run: Run, arguments: tuple[object, ...]) -> None:
    code, out, err = run("characterise", *arguments)
    assert (code, out) == (2, "")
    assert err.startswith("error: ")
    assert err.count("\n") == 1
