"""The built zip in a real Blender: installed as users do it, used in its window and in the background.

``application.sh`` says which Blender that is, and how to use your own.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from real_blender import PROJECT, WORK, Application, assert_clean, log_of

OLDEST = (4, 5)
LIGHTS = ("D50", "A", "two-peaks-d65")


@pytest.fixture(scope="session")
def window(application: Application, installed: Path) -> dict:
    """What a user's session in the window found, see window.py."""
    result = WORK / "result.json"
    done = application("window", "--python", Path(__file__).with_name("window.py"), "--", result, WORK)
    assert_clean(done)
    found = json.loads(result.read_text(encoding="utf-8"))
    assert "exception" not in found, found["exception"]
    return found


def test_it_is_a_supported_blender(application: Application) -> None:
    done = application("blender", "--version")
    version = re.search(r"^Blender (\d+)\.(\d+)", done.stdout, re.MULTILINE)
    assert version, log_of(done)
    print(version[0])
    assert (int(version[1]), int(version[2])) >= OLDEST


def test_blender_finds_the_zip_valid(application: Application, archive: Path) -> None:
    assert_clean(application("blender", "--command", "extension", "validate", archive))


def test_building_in_the_window_adds_a_scene_and_keeps_the_users(window: dict) -> None:
    assert window["scenes"] == ["Light booth", "Scene"]
    assert window["user_objects_kept"]


def test_three_lights_at_three_levels(window: dict) -> None:
    shown = window["shown"]
    assert {(each["light"], each["level"]) for each in shown.values()} == {
        (light, level) for light in LIGHTS for level in "012"
    }
    colours = {name: json.dumps(each["colours"], sort_keys=True) for name, each in shown.items()}
    # Level 0 knows no light; every other pair of light and level looks different.
    assert len({colours[f"{light} 0"] for light in LIGHTS}) == 1
    assert len(set(colours.values())) == 7


def test_undo_and_redo_keep_state_and_colours_together(window: dict) -> None:
    assert window["undone"] == window["shown"]["two-peaks-d65 1"]
    assert window["redone"] == window["shown"]["two-peaks-d65 2"]


def test_verifying_in_the_window_shows_its_result_in_the_panel(window: dict) -> None:
    assert window["verify"] == ["RUNNING_MODAL"]
    assert window["result"].startswith("two-peaks-d65, ")
    in_gamut = re.search(r"In gamut: dE00 [\d.]+, max ([\d.]+)", window["result"])
    # Forward shading in float32: see tests/addon/test_pixels.py; at a quarter of the size the curved
    # surfaces are averaged over few pixels.
    assert float(in_gamut[1]) < 0.2


def test_a_texture_is_baked_in_the_window(window: dict) -> None:
    """In steps, as Blender's window stays alive; half of D65 is half in sRGB to 1e-4."""
    assert window["bake"] == ["RUNNING_MODAL"]
    assert window["baked"] == pytest.approx([0.5] * 3, abs=2e-4)


def test_the_panel_was_photographed(window: dict) -> None:
    assert window["start"] == window["panel"] == 0
    # A black screen compresses to a few kB: something was drawn.
    assert (WORK / "panel.png").stat().st_size > 50_000


def test_a_saved_file_opens_as_it_was(application: Application, window: dict) -> None:
    result = WORK / "reopened.json"
    script = Path(__file__).with_name("reopen.py")
    assert_clean(application("blender", "-b", WORK / "booth.blend", "--python", script, "--", result))
    assert json.loads(result.read_text(encoding="utf-8")) == window["saved"]


def test_commands_build_verify_and_render(application: Application, installed: Path) -> None:
    text = (PROJECT / "blend_scenes" / "colorchecker.toml").read_text(encoding="utf-8")
    for key, value in (("width", 160), ("height", 120), ("samples", 1)):
        text = re.sub(rf"^{key} = \d+$", f"{key} = {value}", text, flags=re.MULTILINE)
    (WORK / "chart.toml").write_text(text, encoding="utf-8")
    chart, verified, picture = WORK / "chart.blend", WORK / "verify.json", WORK / "chart.png"
    command = ("--command", "spectral_booth")
    assert_clean(application("blender", "-b", *command, "build", WORK / "chart.toml", "-o", chart))
    # The file before --command is the one that is verified.
    arguments = ("verify", "--light", "A", "--level", "2", "--result", verified)
    assert_clean(application("blender", "-b", chart, *command, *arguments))
    (light,) = json.loads(verified.read_text(encoding="utf-8"))["lights"]
    assert light["level2"]["dE00_in_gamut"]["max"] < 0.05  # see tests/addon/test_pixels.py
    assert_clean(application("blender", "-b", chart, *command, "render", "--light", "D50", "-o", picture))
    assert picture.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("build", "nowhere.toml", "-o", "x.blend"), "nowhere.toml: no such file"),
        (("verify", "nowhere.blend"), "nowhere.blend: no such file"),
        (("verify",), "holds no spectral scene"),
        (("dance",), "invalid choice: 'dance'"),
    ],
)
def test_commands_refuse_bad_input(
    application: Application, installed: Path, arguments: tuple[str, ...], message: str
) -> None:
    done = application("blender", "-b", "--command", "spectral_booth", *arguments)
    assert done.returncode == 2, log_of(done)
    errors = [line for line in done.stderr.splitlines() if line.startswith("error: ")]
    assert len(errors) == 1, log_of(done)
    assert message in errors[0]
    assert "Traceback" not in log_of(done)
