"""Runtimes are simulated, read with noise, and must be found again."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import displays
import numpy as np
import pytest

from spectral_core.arrays import Float64Array, frozen
from spectral_core.display import DisplayProfile, write_profile
from spectral_core.display.characterising.characterise import characterise
from spectral_core.display.measuring.measurements import Measurements, read_measurements
from spectral_core.display.models import GammaMatrix, srgb_decode, srgb_encode
from spectral_core.display.probing.correction import correct, correction_document, unreachable_document
from spectral_core.display.probing.probe import Probe, probe
from spectral_core.display.probing.probe_patches import probe_patches
from spectral_core.display.probing.runtimes import Runtime, combined_runtimes, single_runtimes
from spectral_core.standards import XYZ_to_Lab, delta_E_2000

Run = Callable[..., tuple[int, str, str]]
WHITE = displays.additive(np.ones((1, 3)))[0]
PANEL = GammaMatrix(displays.GAMMA, displays.MATRIX / WHITE[1], displays.BLACK / WHITE[1])
TRUE_PARAMETERS = {
    "gamma": [1.2],
    "reinhard": [2.0],
    "filmic": [1.0],
    "gamut-matrix": [0.96, 0.07, 0.07, 0.05, 0.02, 0.03, 0.1, 0.8],
}
SINGLE = {runtime.name: runtime for runtime in single_runtimes(PANEL)}
COMBINED = {runtime.name: runtime for runtime in combined_runtimes(PANEL)}
TRIED_COMBINATIONS = (
    "rec709-to-native + srgb-encode",
    "native-to-rec709 + gamma",
    "gamut-matrix + filmic",
    "srgb-encode + range-squeezed",
    "rec709-to-p3 + range-expanded",
)


def parameters(runtime: Runtime) -> Float64Array:
    return np.array([value for stage in runtime.stages for value in TRUE_PARAMETERS.get(stage.name, [])])


def through(runtime: Runtime, display: displays.Display = displays.additive) -> displays.Display:
    """The display behind a runtime with its true parameters."""
    return lambda codes: display(runtime.forward(codes, parameters(runtime)[None])[0])


def read(runtime: Runtime, seed: int | None, codes: Float64Array | None = None) -> Measurements:
    return displays.measure(through(runtime), probe_patches() if codes is None else codes, seed)


def dE00(a: Float64Array, b: Float64Array) -> Float64Array:
    return delta_E_2000(XYZ_to_Lab(a, WHITE), XYZ_to_Lab(b, WHITE))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", SINGLE)
def test_every_runtime_is_found_with_its_parameters(name: str, seed: int) -> None:
    """An instrument of 1 % in luminance and 0.0015 in x and y; the diagonal of the confusion matrix."""
    found = probe(read(SINGLE[name], seed), PANEL)
    assert found.name == name
    assert found.margin > 6
    # Four standard deviations: 11 parameters in 3 runs exceed that by chance once in 500.
    assert (np.abs(found.best.parameters - parameters(SINGLE[name])) < 4 * found.best.deviations).all()


@pytest.mark.parametrize("name", TRIED_COMBINATIONS)
def test_combinations_are_found(name: str) -> None:
    found = probe(read(COMBINED[name], 0), PANEL)
    assert found.name == name
    assert (np.abs(found.best.parameters - parameters(COMBINED[name])) < 4 * found.best.deviations).all()


@pytest.mark.parametrize("name", ["gamma", "gamut-matrix"])
def test_stated_uncertainties_are_true(name: str) -> None:
    """Over 12 runs the deviations of 12 or more estimates have a mean square of 1 in their own units;
    they state a profile's error too, which is absent here, so that it may be less: 0.2 to 1.7.
    """
    off = []
    for seed in range(20, 32):
        best = probe(read(SINGLE[name], seed), PANEL).best
        off.append((best.parameters - parameters(SINGLE[name])) / best.deviations)
    assert 0.2 < np.square(off).mean() < 1.7


@pytest.mark.parametrize("name", ["none", "srgb-encode", "srgb-decode", "gamma", "filmic", "native-to-rec709"])
def test_the_correction_brings_the_error_to_the_noise(name: str) -> None:
    """Random colours sent through correction and runtime are read as well as codes set directly."""
    runtime = SINGLE[name]
    found = probe(read(runtime, 3), PANEL)
    made = correct(found.best.runtime, found.best.parameters)
    wanted = np.random.default_rng(1).uniform(0, 1, (300, 3))
    truth = displays.additive(wanted)
    noise = dE00(displays.measure(displays.additive, wanted, 8).XYZ, truth).mean()
    uncorrected = dE00(displays.measure(through(runtime), wanted, 8).XYZ, truth).mean()
    sent = np.clip(made.apply(wanted), 0, 1)
    corrected = dE00(displays.measure(through(runtime), sent, 8).XYZ, truth).mean()
    # 2 %: what parameters known to 0.5 % add to the noise.
    assert corrected < 1.02 * noise
    assert name == "none" or uncorrected > 3 * noise


@pytest.mark.parametrize("name", [*SINGLE, *TRIED_COMBINATIONS])
def test_corrections_undo_runtimes(name: str) -> None:
    """Wherever the panel can be reached, within a tenth of an 8-bit level: the table is linear
    between half levels, where the steepest curves bend near black. Rounding to 8 bits costs 0.5.
    """
    runtime = (SINGLE | COMBINED)[name]
    made = correct(runtime, parameters(runtime))
    wanted = np.random.default_rng(2).uniform(0, 1, (2000, 3))
    wanted = wanted[made.reaches(wanted)]
    assert len(wanted) > 50
    assert 255 * np.abs(made.shown(wanted) - wanted).max() < 0.1
    document = correction_document(made)
    assert document["round_trip_levels"] < 0.1
    json.dumps(document, allow_nan=False)


def test_what_is_out_of_reach() -> None:
    squeezed = unreachable_document(correct(SINGLE["range-squeezed"], np.zeros(0)))
    np.testing.assert_allclose(squeezed["grey_panel_codes"], [16 / 255, 235 / 255], atol=1e-9)
    # 13 of 17 steps of each channel lie within 16..235.
    assert squeezed["share_of_panel_codes"] == pytest.approx(1 - (13 / 17) ** 3)
    expanded = unreachable_document(correct(SINGLE["range-expanded"], np.zeros(0)))
    assert expanded == {"share_of_panel_codes": 0.0, "grey_panel_codes": [0.0, 1.0], "greys_clipped": 16 + 20}
    assert unreachable_document(correct(SINGLE["native-to-rec709"], np.zeros(0)))["share_of_panel_codes"] == 0
    assert unreachable_document(correct(SINGLE["rec709-to-native"], np.zeros(0)))["share_of_panel_codes"] > 0.1


def test_stages_are_what_they_say() -> None:
    """Against their definitions, written out here."""
    codes = np.random.default_rng(3).uniform(0, 1, (50, 3))

    def out(name: str, *values: float) -> Float64Array:
        return np.asarray(SINGLE[name].forward(codes, np.array([values]))[0])

    np.testing.assert_allclose(out("srgb-encode-twice"), srgb_encode(srgb_encode(codes)))
    np.testing.assert_allclose(out("gamma", 1.3), codes**1.3)
    light = srgb_decode(codes)
    np.testing.assert_allclose(srgb_decode(out("reinhard", 2.0)), 2 * light / (1 + 2 * light) * 1.5, atol=1e-12)
    aces = light * (2.51 * light + 0.03) / (light * (2.43 * light + 0.59) + 0.14)
    np.testing.assert_allclose(srgb_decode(out("filmic", 1.0)), aces / (2.54 / 3.16), atol=1e-12)
    np.testing.assert_allclose(out("range-expanded"), np.clip((255 * codes - 16) / 219, 0, 1), atol=1e-12)
    # White stays white, and Rec.709 red on a display of Rec.709 primaries stays red through a round trip.
    there = SINGLE["rec709-to-native"].forward(codes, np.zeros((1, 0)))[0]
    np.testing.assert_allclose(SINGLE["native-to-rec709"].forward(there, np.zeros((1, 0)))[0], codes, atol=1e-9)
    np.testing.assert_allclose(SINGLE["p3-to-rec709"].forward(np.ones((1, 3)), np.zeros((1, 0)))[0], 1.0)


@pytest.mark.parametrize("name", ["none", "srgb-decode", "filmic", "rec709-to-native"])
def test_one_bad_reading_changes_nothing(name: str) -> None:
    measured = read(SINGLE[name], 5)
    for index in range(0, len(measured.codes), 3):
        XYZ = measured.XYZ.copy()
        XYZ[index] = XYZ[index] * (1.5, 1.4, 1.2) + 0.5
        found = probe(replace(measured, XYZ=frozen(XYZ)), PANEL)
        assert found.name == name, index
    assert any("perhaps bad readings" in each for each in found.warnings)


def test_undecided_where_the_patches_do_not_tell() -> None:
    """Full drive alone is the same with every curve that keeps black and white."""
    corners = np.stack(np.meshgrid([0.0, 1.0], [0.0, 1.0], [0.0, 1.0]), axis=-1).reshape(-1, 3)
    found = probe(read(SINGLE["none"], 1, corners), PANEL)
    assert found.name == "undecided"
    assert {"srgb-encode", "srgb-decode"} <= {fit.runtime.name for fit in found.rivals}


@pytest.mark.parametrize("strange", [
    lambda codes: codes ** (1.0, 1.15, 0.9),
    lambda codes: codes * codes * (3 - 2 * codes),
    lambda codes: codes[:, [1, 2, 0]],
])  # fmt: skip
def test_undecided_where_no_hypothesis_explains(strange: Callable[[Float64Array], Float64Array]) -> None:
    """A gamma of its own for every channel, an S-curve, swapped channels."""
    measured = displays.measure(lambda codes: displays.additive(strange(codes)), probe_patches(), 1)
    found = probe(measured, PANEL)
    assert found.name == "undecided"
    assert "no hypothesis explains" in found.warnings[0]


def assumed(runtime: Runtime, gamma: float, seed: int) -> Probe:
    return probe(
        displays.measure(
            through(runtime, lambda codes: np.asarray(codes**gamma @ displays.MATRIX.T + displays.BLACK)),
            probe_patches(),
            seed,
        )
    )


@pytest.mark.parametrize("name", ["none", "srgb-encode", "srgb-encode-twice", "srgb-decode", "reinhard", "filmic"])
def test_without_a_profile(name: str) -> None:
    """Never wrong, and told in at least three of four runs: less is known than with a profile."""
    found = [assumed(SINGLE[name], 2.2, seed) for seed in range(4)]
    names = [each.name for each in found]
    assert set(names) <= {name, "undecided"}
    assert names.count(name) >= 3
    assert all("no profile" in each.warnings[-1] for each in found)


def test_without_a_profile_a_gamma_of_the_panel_is_none_of_the_runtime() -> None:
    """A panel of 1.9 behind a wrong gamma of 1.2 is a panel of 2.28."""
    assert assumed(SINGLE["gamma"], 1.9, 0).name == "none"
    found = assumed(SINGLE["gamma"], 2.55, 1)
    assert found.name == "gamma"
    # The panel's own 2.2 +- 0.2 is the larger part of the uncertainty.
    assert found.best.deviations[0] == pytest.approx(2.55 * 1.2 / 2.2 * 0.2 / 2.2, rel=0.2)


def test_a_squeezed_range_is_not_told_from_a_panel_of_its_own_curve() -> None:
    """Without a profile: (16 + 219 c) / 255 to the power 2.2, less black, is close to sRGB's curve."""
    assert assumed(SINGLE["range-squeezed"], 2.2, 0).name == "undecided"


def test_what_a_profile_may_be_off_is_no_runtime() -> None:
    """A profile of a gamma that is 0.5 % too high, and readings without noise: none, and a word."""
    panel = GammaMatrix(displays.GAMMA * 1.005, PANEL.matrix, PANEL.black_XYZ)
    many = np.random.default_rng(4).uniform(0, 1, (150, 3))
    found = probe(read(SINGLE["none"], None, np.concatenate([probe_patches(), many])), panel)
    assert found.name == "none"
    assert any("less than a profile may be off" in each for each in found.warnings)


@pytest.mark.parametrize("model", ["gamma-matrix-black", "grey-lut"])
def test_a_measured_display_has_no_runtime(measured_data: Path, model: str) -> None:
    """Codes were set directly: 175 patches against profiles fitted to them."""
    for path in sorted((measured_data / "displays").glob("*.ti3")):
        measured = read_measurements(path)
        assert probe(measured, characterise(measured, model).chosen.model).name == "none"


def rows(measured: Measurements) -> str:
    lines = [
        ",".join(f"{value:.8g}" for value in (*code, *XYZ))
        for code, XYZ in zip(measured.codes, measured.XYZ, strict=True)
    ]
    return "\n".join(["R,G,B,X,Y,Z", *lines])


def test_probe_on_the_command_line(run: Run, tmp_path: Path) -> None:
    profile, readings, output = tmp_path / "panel.json", tmp_path / "readings.csv", tmp_path / "correction.json"
    write_profile(DisplayProfile("panel", PANEL, "simulated", float(WHITE[1])), profile)
    measured = read(SINGLE["gamma"], 1)
    readings.write_text(rows(replace(measured, XYZ=frozen(0.8 * measured.XYZ))))
    code, out, err = run("probe", readings, "--profile", profile, "-o", output, "--json")
    document = json.loads(out)
    assert code == 0
    assert document["runtime"] == "gamma"
    assert document["parameters"]["gamma"]["value"] == pytest.approx(1.2, abs=0.02)
    assert document["luminance"] == pytest.approx(0.8, rel=0.02)
    assert "0.80 of the profile's" in err
    scores = [each["score"] for each in document["evidence"]]
    assert scores == sorted(scores)
    assert set(document["evidence"][0]) == {"hypothesis", "dE00", "parameters", "score"}
    written = json.loads(output.read_text())
    assert written["correction"] == document["correction"]
    code, out, _ = run("probe", readings, "--profile", profile)
    assert code == 0
    assert "gamma" in out


def test_an_undecided_probe_writes_no_correction(run: Run, tmp_path: Path) -> None:
    readings, output = tmp_path / "readings.csv", tmp_path / "correction.json"
    corners = np.stack(np.meshgrid([0.0, 1.0], [0.0, 1.0], [0.0, 1.0]), axis=-1).reshape(-1, 3)
    readings.write_text(rows(read(SINGLE["none"], 1, corners)))
    code, out, err = run("probe", readings, "-o", output, "--json")
    document = json.loads(out)
    assert (code, document["runtime"], document["correction"]) == (0, "undecided", None)
    assert not output.exists()
    assert "no correction was written" in err


def test_patches_on_the_command_line(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "patches.csv"
    assert run("probe", "--patches", "-o", path)[0] == 0
    lines = path.read_text().splitlines()
    assert lines[0] == "R,G,B"
    codes = np.array([[int(cell) for cell in line.split(",")] for line in lines[1:]])
    np.testing.assert_allclose(codes / 255, probe_patches())
    assert 15 <= len(codes) <= 25
    assert run("probe", "--patches")[1].splitlines() == lines
    assert json.loads(run("probe", "--patches", "--json")[1])["patches"] == codes.tolist()


def test_bad_calls_get_one_line(run: Run, tmp_path: Path) -> None:
    code, out, err = run("probe")
    assert (code, out) == (2, "")
    assert "--patches" in err
    few = tmp_path / "few.csv"
    few.write_text(rows(read(SINGLE["none"], 1, np.concatenate([np.eye(3), np.ones((1, 3))]))))
    code, out, err = run("probe", few)
    assert (code, out) == (2, "")
    assert "4 patches cannot tell" in err
    assert err.count("\n") == 1
