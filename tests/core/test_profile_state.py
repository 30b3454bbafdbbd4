from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import displays
import numpy as np
import pytest

from spectral_core.display import DisplayProfile, load_profile, read_profile, write_profile
from spectral_core.display.measuring.measurements import read_measurements
from spectral_core.display.measuring.state import HeadsetState, iso_date
from spectral_core.display.models import GammaMatrix
from spectral_core.errors import DisplayError

Run = Callable[..., tuple[int, str, str]]
STATE = HeadsetState(
    "Vive Pro Eye", "left", "80 %", 30.0, "2026-01-31T14:30", "CS-2000", (10.0, -5.0), "lens cleaned"
)  # fmt: skip
PATCHES = (
    "Color,L,x,y\nRed,30,0.65,0.33\nGreen,85,0.24,0.70\nBlue,8,0.14,0.05\nWhite,120,0.30,0.32\nBlack,0.4,0.3,0.3\n"
)


@pytest.fixture
def measured(tmp_path: Path) -> Path:
    path = tmp_path / "small.csv"
    path.write_text(PATCHES)
    return path


def ti3(path: Path, luminance: str = "120 125 130") -> Path:
    """Readings as Argyll normalises them."""
    codes = np.concatenate([np.eye(3), np.ones((1, 3)), np.zeros((1, 3))])
    XYZ = displays.additive(codes)
    table = np.concatenate([codes * 100, XYZ / XYZ[3, 1] * 100], axis=1)
    lines = [f"{index} " + " ".join(f"{value:.10g}" for value in row) for index, row in enumerate(table)]
    head = [
        "CTI3", 'CREATED "Sun Mar 20 02:15:01 2022"', 'TARGET_INSTRUMENT "X-Rite i1 Pro 2"',
        f'LUMINANCE_XYZ_CDM2 "{luminance}"', 'NORMALIZED_TO_Y_100 "YES"', "BEGIN_DATA_FORMAT",
        "SAMPLE_ID RGB_R RGB_G RGB_B XYZ_X XYZ_Y XYZ_Z", "END_DATA_FORMAT", "BEGIN_DATA",
    ]  # fmt: skip
    path.write_text("\n".join([*head, *lines, "END_DATA"]))
    return path


def test_the_whole_state_survives_json(tmp_path: Path) -> None:
    path = tmp_path / "p.json"
    model = load_profile("htc-vive-2020").model
    written = DisplayProfile("p", model, "s", 120.0, "cd/m2", None, STATE, 0.8)
    write_profile(written, path)
    back = read_profile(path)
    assert (back.state, back.unit, back.white_Y, back.scene_white) == (STATE, "cd/m2", 120.0, 0.8)
    assert back.white_luminance_cd_m2 == 120.0
    assert HeadsetState.from_json(HeadsetState().to_json()) == HeadsetState()


def test_profiles_without_a_state_are_still_read(tmp_path: Path) -> None:
    path = tmp_path / "p.json"
    write_profile(load_profile("htc-vive-2020"), path)
    document = json.loads(path.read_text())
    for key in ("unit", "state", "scene_white", "white_luminance_cd_m2"):
        del document[key]
    path.write_text(json.dumps({**document, "white_Y": 118}))
    back = read_profile(path)
    # Nothing says that 118 was cd/m2.
    assert (back.white_Y, back.unit, back.white_luminance_cd_m2) == (118.0, "relative", None)
    assert back.state == HeadsetState()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"unit": "nits"}, "unit"),
        ({"unit": ["cd/m2"]}, "unit"),
        ({"white_Y": True}, "white_Y"),
        ({"white_Y": float("nan")}, "white_Y"),
        ({"white_luminance_cd_m2": -1}, "white_luminance_cd_m2"),
        ({"white_luminance_cd_m2": 10**400}, "white_luminance_cd_m2"),
        ({"unit": "cd/m2", "white_Y": 100, "white_luminance_cd_m2": 90}, "90"),
        ({"scene_white": 1.5}, "scene_white"),
        ({"scene_white": "all"}, "scene_white"),
        ({"state": []}, "state"),
        ({"state": {"eyes": "left"}}, "unknown key"),
        ({"state": {"eye": "middle"}}, "no eye"),
        ({"state": {"eye": ["left"]}}, "no text"),
        ({"state": {"model": ""}}, "no text"),
        ({"state": {"note": "x" * 1001}}, "no text"),
        ({"state": {"brightness": 80}}, "no text"),
        ({"state": {"warm_up_minutes": float("nan")}}, "warm_up"),
        ({"state": {"warm_up_minutes": -1}}, "warm_up"),
        ({"state": {"warm_up_minutes": True}}, "warm_up"),
        ({"state": {"date": "yesterday"}}, "ISO"),
        ({"state": {"field_deg": [1]}}, "two numbers"),
        ({"state": {"field_deg": [1, float("inf")]}}, "field_deg"),
        ({"state": {"field_deg": [1, "2"]}}, "field_deg"),
    ],
)
def test_damaged_states_are_refused_with_the_file(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    path = tmp_path / "p.json"
    write_profile(load_profile("htc-vive-2020"), path)
    path.write_text(json.dumps({**json.loads(path.read_text()), **change}))
    with pytest.raises(DisplayError, match=message) as caught:
        read_profile(path)
    assert caught.value.where == str(path)


def test_dates_of_instruments_become_iso() -> None:
    assert iso_date("Sun Mar 20 02:15:01 2022") == "2022-03-20T02:15:01"
    assert iso_date("2022-03-20") == "2022-03-20T00:00:00"
    for text in ("", "soon", "Sun Mar 99 02:15:01 2022", "x" * 500, "Sun Mar 20 99:99:99 2022"):
        assert iso_date(text) is None


def test_the_file_fills_what_it_says(run: Run, tmp_path: Path) -> None:
    """Argyll's luminance of white is kept beside the relative readings, whose unit stays."""
    source, profile = ti3(tmp_path / "d.ti3"), tmp_path / "d.json"
    assert read_measurements(source).white_luminance_cd_m2 == 125.0
    code, _, _ = run("characterise", source, "-o", profile, "--eye", "right", "--field", "-10,2.5")
    assert code == 0
    found = read_profile(profile)
    assert found.state == HeadsetState(
        eye="right", date="2022-03-20T02:15:01", instrument="X-Rite i1 Pro 2", field_deg=(-10.0, 2.5)
    )
    assert (found.unit, found.white_Y, found.white_luminance_cd_m2) == ("relative", pytest.approx(100.0), 125.0)
    _, _, err = run("characterise", source, "-o", profile, "--white-luminance", 90, "--instrument", "mine")
    assert "the file says that white has 125 cd/m2; --white-luminance 90 is used" in err
    assert read_profile(profile).white_luminance_cd_m2 == 90.0
    assert read_profile(profile).state.instrument == "mine"


@pytest.mark.parametrize("luminance", ["no idea", "1 2", "1 nan 3", "1 -5 3"])
def test_a_luminance_that_is_none_is_not_taken(run: Run, tmp_path: Path, luminance: str) -> None:
    profile = tmp_path / "d.json"
    code, _, err = run("characterise", ti3(tmp_path / "d.ti3", luminance), "-o", profile)
    assert code == 0
    assert "absolute luminance is unknown" in err
    assert read_profile(profile).white_luminance_cd_m2 is None


def test_readings_in_cd_m2_give_the_luminance(run: Run, measured: Path, tmp_path: Path) -> None:
    profile = tmp_path / "p.json"
    assert run("characterise", measured, "-o", profile)[0] == 0
    assert (read_profile(profile).unit, read_profile(profile).white_luminance_cd_m2) == ("cd/m2", 120.0)
    assert run("characterise", measured, "-o", profile, "--white-luminance", 121)[0] == 0
    assert read_profile(profile).white_luminance_cd_m2 == 120.0  # the same, as instruments go
    _, _, err = run("characterise", measured, "-o", profile, "--white-luminance", 60)
    assert "taken as relative" in err
    found = read_profile(profile)
    assert (found.unit, found.white_Y, found.white_luminance_cd_m2) == ("relative", 120.0, 60.0)


def test_profile_show(run: Run, measured: Path, tmp_path: Path) -> None:
    profile = tmp_path / "p.json"
    run("characterise", measured, "-o", profile, "--headset", "Vive [/b]", "--warm-up", 20)
    code, out, _ = run("profile", "show", profile, "--json")
    found = json.loads(out)
    assert code == 0
    assert found["state"] == {"model": "Vive [/b]", "warm_up_minutes": 20.0}
    assert found["primaries"]["R"]["xy"] == pytest.approx(
        _xy(np.array([0.65 / 0.33, 1, 0.02 / 0.33]) * 30 - np.array([1, 1, 4 / 3]) * 0.4), abs=1e-9
    )
    # The additive model's white is the sum of its primaries, 123.2 here; black adds 0.4.
    assert found["peak_luminance_cd_m2"] == pytest.approx(123 - 2 * 0.4, abs=1e-9)
    assert found["contrast"] == pytest.approx((123 - 0.8) / 0.4)
    assert found["gamma"]["G"]["value"] == pytest.approx(2.2, abs=1e-9)
    code, out, _ = run("profile", "show", profile)
    assert "Vive [/b]" in out


def _xy(XYZ: np.ndarray) -> list[float]:
    return [float(value) for value in XYZ[:2] / XYZ.sum()]


def test_relative_profiles_say_so(run: Run) -> None:
    code, out, err = run("profile", "show", "sRGB", "--json")
    found = json.loads(out)
    assert (code, found["peak_luminance_cd_m2"], found["contrast"]) == (0, None, None)
    assert "absolute luminance is unknown" in err
    # Regression of sRGB's piecewise curve, commonly called 2.2.
    assert found["gamma"]["R"]["value"] == pytest.approx(2.2, abs=0.03)
    assert found["model"] == "sRGB"


def test_a_display_without_d65_is_still_shown(run: Run, tmp_path: Path) -> None:
    """Three reds: no white to speak of."""
    path = tmp_path / "reds.json"
    reds = np.array([[0.5, 0.4, 0.3], [0.3, 0.2, 0.1], [0.01, 0.02, 0.0]])
    write_profile(DisplayProfile("reds", GammaMatrix(np.full(3, 2.2), reds, np.zeros(3))), path)
    code, out, _ = run("profile", "show", path, "--json")
    assert (code, json.loads(out)["scene_white"]) == (0, None)
    code, _, err = run("luminance", "--profile", path)
    assert code == 2
    assert "cannot show D65" in err


def test_profile_set_keeps_the_model(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "p.json"
    code, _, _ = run(
        "profile", "set", "htc-vive-2020", "-o", path, "--eye", "left", "--white-luminance", 210, "--scene-white", 0.5
    )
    assert code == 0
    code, _, _ = run("profile", "set", path, "-o", path, "--note", "again")
    found = read_profile(path)
    assert found.state == HeadsetState(eye="left", note="again")
    assert (found.white_luminance_cd_m2, found.scene_white) == (210.0, 0.5)
    assert isinstance(found.model, GammaMatrix)
    np.testing.assert_array_equal(found.to_XYZ(np.eye(3)), load_profile("htc-vive-2020").to_XYZ(np.eye(3)))


@pytest.mark.parametrize(
    "arguments",
    [
        (), ("--date", "tomorrow"), ("--field", "1"), ("--field", "nan,0"), ("--warm-up", "nan"), ("--eye", "third"),
        ("--scene-white", 2), ("--white-luminance", 0), ("--headset", " "),
    ],
)  # fmt: skip
def test_wrong_settings_get_one_line(run: Run, tmp_path: Path, arguments: tuple[object, ...]) -> None:
    code, out, err = run("profile", "set", "htc-vive-2020", "-o", tmp_path / "p.json", *arguments)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert err.startswith("error: ")
    assert not (tmp_path / "p.json").exists()
