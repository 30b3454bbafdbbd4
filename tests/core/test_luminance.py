from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from spectral_core.display import DisplayProfile, load_profile, write_profile
from spectral_core.display.limits.luminance import (
    LuminanceMapping,
    SceneColour,
    map_luminance,
    scene_to_display,
    scene_white,
)  # fmt: skip
from spectral_core.display.models import GammaMatrix
from spectral_core.errors import DisplayError
from spectral_core.lights import Light

Run = Callable[..., tuple[int, str, str]]
D65 = Light.builtin("D65").XYZ()
# 1000 lx on a perfect diffuser.
BOOTH = 1000 / np.pi


def vive(white: float | None = 120.0) -> DisplayProfile:
    """The published headset, black and all, with a white of 120 cd/m2 unless it is unknown."""
    return replace(load_profile("htc-vive-2020"), white_luminance_cd_m2=white)


def ask(profile: DisplayProfile, *colours: SceneColour, **asked: float) -> LuminanceMapping:
    return map_luminance(profile, colours, {"D65": D65}, **asked)


def grey(name: str, share: float) -> SceneColour:
    return SceneColour(name, "D65", D65 * share)


def test_a_real_booth_must_be_dimmed() -> None:
    """At its own luminance the white asks for 318 / 120 of the display's: all by hand."""
    found = ask(vive(), grey("half", 0.5), booth_white_cd_m2=BOOTH)
    matrix, black = vive().model.matrix, vive().model.black_XYZ  # type: ignore[attr-defined]
    # Drives are affine in the factor; the first to be full limits it.
    start, rise = -np.linalg.inv(matrix) @ black, np.linalg.inv(matrix) @ D65
    largest = float(((1 - start) / rise).min())
    assert found.factor == pytest.approx(BOOTH / 120)
    assert found.largest_factor == pytest.approx(largest, rel=1e-9)
    assert found.headset_white_cd_m2 == pytest.approx(BOOTH)
    assert found.largest_white_cd_m2 == pytest.approx(120 * largest)
    assert found.dimming_percent == pytest.approx(100 * (1 - largest * 120 / BOOTH))
    assert found.dimming_stops == pytest.approx(np.log2(BOOTH / 120 / largest))
    assert [each.name for each in found.beyond_peak] == ["perfect diffuser", "half"]
    assert found.beyond_peak[1].ratio == pytest.approx(BOOTH / 240 / largest)


def test_what_fits_is_not_dimmed() -> None:
    found = ask(vive(), booth_white_cd_m2=60.0)
    assert (found.factor, found.dimming_percent, found.dimming_stops) == (0.5, 0.0, 0.0)
    assert found.beyond_peak == ()


def test_dimming_as_told_makes_everything_fit() -> None:
    first = ask(vive(), grey("half", 0.5), booth_white_cd_m2=BOOTH)
    again = ask(vive(), grey("half", 0.5), fraction=first.largest_factor or 0.0)
    assert (again.dimming_percent, again.beyond_peak) == (0.0, ())
    assert vive().to_codes(D65 * again.factor).max() == pytest.approx(1.0, abs=1e-9)


def test_the_published_peak_of_d65_is_the_default() -> None:
    """Its red drive for D65 is 1.04 (Diaz-Barrancas et al. 2021): white is shown at 1 / 1.04."""
    profile = load_profile("htc-vive-2021")
    assert scene_white(profile) == pytest.approx(1 / (np.array([2.19, -0.69, -0.32]) @ D65), rel=1e-9)
    assert scene_white(profile) == pytest.approx(1 / 1.04, abs=0.005)
    np.testing.assert_allclose(scene_to_display(profile, D65), D65 * scene_white(profile))
    assert scene_white(load_profile("sRGB")) == pytest.approx(1.0, abs=1e-4)
    assert scene_white(replace(profile, scene_white=0.3)) == 0.3
    assert ask(replace(profile, scene_white=0.3)).factor == 0.3


def test_a_white_that_the_model_exaggerates_is_not_the_default() -> None:
    """Primaries that sum to 1.2 of the measured white: the default stays at 1, with a warning."""
    matrix = load_profile("sRGB").to_XYZ(np.eye(3)).T
    profile = DisplayProfile("p", GammaMatrix(np.full(3, 2.2), matrix * 1.2, np.zeros(3)))
    assert scene_white(profile) == 1.0
    assert any("1.200 times as bright" in each for each in ask(profile).warnings)


def test_chromaticities_out_of_reach_are_no_matter_of_dimming() -> None:
    sodium = SceneColour("lamp", "LPS", Light.load("LPS").XYZ() * 0.1)
    found = ask(vive(), sodium, fraction=0.5)
    assert [each.name for each in found.outside_chromaticity] == ["lamp"]
    assert found.outside_chromaticity[0].delta_uv > 0.005
    assert found.dimming_percent == 0.0
    assert all(each.name != "lamp" for each in found.beyond_peak)


def test_nothing_to_fit_has_no_largest_factor() -> None:
    found = map_luminance(vive(), (), {"LPS": Light.load("LPS").XYZ()}, fraction=1.0)
    assert (found.largest_factor, found.largest_white_cd_m2, found.white_largest_factor) == (None, None, {"LPS": None})


def test_black_takes_contrast() -> None:
    """Black is 0.4 % of white: with white at a tenth, colours below 4 % of the diffuser are lost."""
    found = ask(vive(), grey("soot", 0.01), grey("coal", 0.03), grey("slate", 0.2), fraction=0.1)
    assert found.black.scene_Y == pytest.approx(0.04)
    assert found.black.luminance_cd_m2 == pytest.approx(0.48)
    assert found.black.crushed == ("soot under D65", "coal under D65")
    assert (found.black.contrast_scene, found.black.contrast_shown) == (pytest.approx(100), pytest.approx(25))
    assert found.black.contrast_lost_stops == pytest.approx(2)
    assert found.black.darkest == "soot under D65"
    shown = vive().to_XYZ(np.array([1.0, 0.3, 0.3]))
    red = SceneColour("deep red", "D65", shown * 0.05 / shown[1])
    assert ask(vive(), red, fraction=0.1).black.tinted == ("deep red under D65",)
    assert ask(vive(), red, fraction=0.9).black.tinted == ()


def test_dim_headsets_are_mesopic() -> None:
    assert any("rods" in each for each in ask(vive(4.0)).warnings)
    assert not any("rods" in each for each in ask(vive(120.0)).warnings)


def test_what_cannot_be_told_is_refused() -> None:
    with pytest.raises(DisplayError, match="unknown"):
        ask(vive(None), booth_white_cd_m2=BOOTH)
    with pytest.raises(DisplayError, match="exclude each other"):
        ask(vive(), booth_white_cd_m2=BOOTH, fraction=0.5)
    with pytest.raises(DisplayError, match="no luminance"):
        ask(vive(), SceneColour("void", "D65", np.zeros(3)))
    assert ask(vive(None), fraction=0.5).headset_white_cd_m2 is None


def test_the_command(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "vive.json"
    write_profile(vive(), path)
    code, out, _ = run("luminance", "--profile", path, "--white", 318, "--light", "D65", "--light", "A", "--json")
    found = json.loads(out)
    assert code == 0
    assert found["colours"] == 50
    assert found["lights"] == ["D65", "A"]
    assert found["headset_white_cd_m2"] == pytest.approx(318)
    # Illuminant A is redder than the display's white: less of it fits.
    assert found["white_largest_factor"]["A"] < found["white_largest_factor"]["D65"]
    assert found["largest_factor"] <= min(found["white_largest_factor"].values())
    assert found["dimming_stops"] == pytest.approx(np.log2(318 / found["largest_white_cd_m2"]))
    code, out, _ = run("luminance", "--profile", path, "--white", 318)
    assert "stops" in out
    assert run("luminance", "--profile", "sRGB", "--white", 318)[0] == 2
    assert run("luminance", "--profile", path, "--white", 318, "--fraction", 1)[0] == 2


def test_the_command_takes_own_colours(run: Run, tmp_path: Path) -> None:
    file = tmp_path / "library.csv"
    file.write_text("nm,leaf,tile\n400,0.05,0.5\n550,0.2,0.5\n700,0.4,0.5\n")
    code, out, _ = run("luminance", "--profile", "htc-vive-2020", "--colours", file, "--fraction", 4, "--json")
    found = json.loads(out)
    assert code == 0
    assert found["colours"] == 3
    assert {each["name"] for each in found["beyond_peak"]} >= {"tile", "perfect diffuser"}
