"""Codes that Blender's colour management gives a display, against the profile's: `verify --profile`."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from spectral_core.cli import main
from spectral_core.display.judging.shown import ShownPatch, compare_shown
from spectral_core.display.profile import DisplayProfile

Simulated = Callable[[str], DisplayProfile]


@pytest.fixture(scope="module")
def chart(tmp_path_factory: pytest.TempPathFactory, shrunk: Callable[[str], str]) -> Path:
    from spectral_core.scene import bundled_scene

    folder = tmp_path_factory.mktemp("display")
    text = bundled_scene("colorchecker").read_text(encoding="utf-8")
    (folder / "chart.toml").write_text(shrunk(text), encoding="utf-8")
    assert main(["build", str(folder / "chart.toml"), "-o", str(folder / "chart.blend")]) == 0
    return folder / "chart.blend"


@pytest.mark.parametrize("name", ["htc-vive-2020", "channel-lut", "channel-lut-corrected"])
def test_the_exported_display_gives_the_profiles_codes(
    chart: Path,
    tmp_path: Path,
    name: str,
    simulated_profile: Simulated,
    capfd: pytest.CaptureFixture,
) -> None:
    """A process with the display's OpenColorIO config renders; half an 8-bit level is asked for."""
    from spectral_core.display import write_profile

    given = name
    if name != "htc-vive-2020":
        given = str(tmp_path / f"{name}.json")
        write_profile(simulated_profile(name), Path(given))
    capfd.readouterr()
    assert main(["verify", str(chart), "--light", "A", "--profile", given, "--json"]) == 0
    document = json.loads(capfd.readouterr().out)
    (light,) = document["lights"]
    print(name, light)
    # OpenColorIO works in 32-bit floats and the PNG has 16 bits; the 3-D table is sampled anew.
    assert light["codes8"]["max"] < (0.3 if name == "channel-lut-corrected" else 0.05)
    assert light["patches"] == 24
    assert document["failed"] == []


def test_a_display_that_is_off_is_found(simulated_profile: Simulated) -> None:
    """A code a level too high is told as one level."""
    profile = simulated_profile("gamma-matrix-black")
    linear = np.full((40, 3), 0.4)
    from spectral_core.standards import srgb_to_XYZ_matrix

    codes = profile.to_codes(linear @ srgb_to_XYZ_matrix().T)
    found = compare_shown("L", [ShownPatch("grey", linear, codes + 1 / 255, linear[0])], profile)
    assert found.codes8.max == pytest.approx(1.0)
    assert found.theory8.max == pytest.approx(1.0)
    assert found.in_gamut == 1
    assert found.lost == ()
