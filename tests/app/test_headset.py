"""Codes that the patch player shows in a simulated headset, photographed from the picture both eyes get."""

from __future__ import annotations

import csv
import json
import os
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenImageIO
import pytest
from real_blender import APPLICATION, PROJECT, WORK, Application, assert_clean

FOLDER = WORK / "headset"
# Blender's window begins here, see application.sh: the headset's picture is left of it.
_HEADSET_PIXELS = 800
# Below every code but black; the headset shows nothing but the capsule.
_LIT = 3
_SMALLEST_PATCH = 20
# The ends and the curve's join (10.3), primaries, secondaries, greys, and colours of all sorts. Black
# comes between others, so that a patch that stayed would be seen.
CODES = [
    (255, 255, 255), (0, 0, 0), (255, 0, 0), (0, 255, 0), (0, 0, 255), (0, 255, 255), (255, 0, 255), (255, 255, 0),
    (8, 10, 12), (11, 20, 30), (64, 64, 64), (128, 128, 128), (192, 192, 192), (115, 82, 68), (194, 150, 130),
    (98, 122, 157), (87, 108, 67), (214, 126, 44), (133, 61, 201), (5, 250, 127),
]  # fmt: skip


@pytest.fixture(scope="module")
def session(application: Application, installed: Path) -> dict:
    """What happened in the application, see headset.py."""
    FOLDER.mkdir(parents=True)
    patches = FOLDER / "patches.csv"
    patches.write_text("R,G,B\n" + "".join(f"{r},{g},{b}\n" for r, g, b in CODES), encoding="utf-8")
    result = FOLDER / "result.json"
    script = Path(__file__).with_name("headset.py")
    # Keys are sent by the script; without the option Blender takes them from people only.
    done = application("headset", "--enable-event-simulate", "--python", script, "--", result, patches, FOLDER)
    assert_clean(done)
    found = json.loads(result.read_text(encoding="utf-8"))
    assert "exception" not in found, found["exception"]
    return found


@pytest.fixture(scope="module")
def eyes(session: dict) -> np.ndarray:
    """Codes (patch, eye, 3) that the photographs show, 0..255."""
    found = np.full((len(CODES), 2, 3), np.nan)
    spread = 0.0
    for index, code in enumerate(CODES):
        picture = _photograph(index)[:, :_HEADSET_PIXELS]
        if not any(code):
            assert picture.max() == 0  # and there is no patch to be found
            found[index] = 0
            continue
        regions = _patches(picture)
        assert len(regions) == 2, f"{code}: {len(regions)} patches"
        for eye, region in enumerate(regions):
            spread = max(spread, np.ptp(region.reshape(-1, 3), axis=0).max())
            found[index, eye] = region.mean(axis=(0, 1))
    assert spread <= 1  # one colour over the middle of the capsule, up to rounding
    return found


def _photograph(index: int) -> np.ndarray:
    """The whole screen (height, width, 3), 0..255, while patch `index` (from 0) was shown."""
    pixels = OpenImageIO.ImageBuf(str(FOLDER / f"{index + 1:03}.png")).get_pixels(OpenImageIO.UINT8)
    return np.asarray(pixels)[..., :3].astype(np.float64)


def _patches(picture: np.ndarray) -> list[np.ndarray]:
    """The middle half of each patch, from left to right: the eyes' pictures stand side by side."""
    lit = picture.max(axis=2) > _LIT
    columns = np.flatnonzero(np.diff(np.concatenate([[0], lit.any(axis=0), [0]])))
    regions = []
    for left, right in columns.reshape(-1, 2):
        rows = np.flatnonzero(lit[:, left:right].any(axis=1))
        if right - left >= _SMALLEST_PATCH:
            middle = slice(*_middle_half(left, right)), slice(*_middle_half(rows[0], rows[-1] + 1))
            regions.append(picture[middle[1], middle[0]])
    return regions


def _middle_half(first: int, last: int) -> tuple[int, int]:
    quarter = (last - first) // 4
    return first + quarter, last - quarter


def test_each_code_arrives_in_both_eyes_within_one_level(eyes: np.ndarray) -> None:
    difference = np.abs(eyes - np.array(CODES)[:, None])
    print(f"{len(CODES)} codes, left and right: largest {difference.max((0, 2))}, mean {difference.mean((0, 2))}")
    # The picture has 8 bits: rounding alone is half a level.
    assert difference.max() <= 1.0


def test_each_code_arrives_in_the_window_too(session: dict) -> None:
    x, y = session["middle"]
    x += _HEADSET_PIXELS
    for index, code in enumerate(CODES):
        middle = _photograph(index)[y - 40 : y + 40, x - 40 : x + 40]
        assert np.abs(middle - code).max() <= 1.0, code


def test_the_headset_ran_and_the_head_moved(session: dict) -> None:
    heads = [each["head"] for each in session["playing"] if each["headset"]]
    assert len(heads) > len(CODES)
    assert np.ptp(np.array(heads), axis=0).max() > 0.01


def test_the_list_of_what_was_shown_pairs_with_the_readings(session: dict, tmp_path: Path) -> None:
    from spectral_core.display.measuring.patches import pair

    shown = FOLDER / "patches-shown.csv"
    with shown.open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    codes = np.array([[float(row[channel]) for channel in "RGB"] for row in rows])
    np.testing.assert_allclose(255 * codes, CODES, atol=1e-6)  # nine digits
    assert [int(row["index"]) for row in rows] == list(range(1, len(CODES) + 1))
    readings = tmp_path / "readings.csv"
    readings.write_text("X,Y,Z\n" + "1,1,1\n" * len(CODES), encoding="utf-8")
    assert len(pair(shown, readings).rows) == len(CODES)


def test_the_command_plays_a_list_in_the_window(application: Application, installed: Path) -> None:
    # The command starts what BLENDER names: here the application as these tests know it.
    own = os.environ.get("BLENDER")
    blender = WORK / "blender.sh"
    blender.write_text(
        f"#!/bin/sh\n{f'export BLENDER={shlex.quote(own)}' if own else 'unset BLENDER'}\n"
        f'exec bash {shlex.quote(str(APPLICATION))} window "$@"\n',
        encoding="utf-8",
    )
    blender.chmod(0o755)
    folder = WORK / "command"
    patches = _command(blender, "play", FOLDER / "nowhere.csv", "-o", folder)
    assert (patches.returncode, "nowhere.csv: no such file" in patches.stderr) == (2, True)
    three = WORK / "three.csv"
    three.write_text("R,G,B\n1,0,0\n0,1,0\n0,0,1\n", encoding="utf-8")
    patches = _command(blender, "play", three, "-o", folder, "--advance", "timer", "--seconds", "0.1", "--json")
    assert patches.returncode == 0, patches.stderr
    assert json.loads(patches.stdout) == {
        "state": "done", "patches": 3, "last": 3, "shown": str(folder / "patches-shown.csv"),
    }  # fmt: skip
    assert len((folder / "patches-shown.csv").read_text(encoding="utf-8").splitlines()) == 4
    patches = _command(blender, "play", three, "-o", three / "below")
    assert patches.returncode == 2, patches.stderr
    assert patches.stderr.startswith("error: ")
    assert "Traceback" not in patches.stderr


def _command(blender: Path, *arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "spectral_core.cli", "patches", *map(str, arguments)],
        cwd=PROJECT,
        env={**os.environ, "BLENDER": str(blender), "BLENDER_USER_RESOURCES": str(WORK / "user")},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )


def test_keys_step_forward_and_back_and_stop(session: dict) -> None:
    assert session["keys"] == [1, 2, 3, 2]
    assert session["stopped"] == "stopped"


def test_all_is_as_before_and_undo_knows_nothing_of_it(session: dict) -> None:
    assert session["before"]["panel"] == ""
    assert session["playing"][0]["panel"].startswith("Patch 1 of 20")
    # The runtime's session begins with the 3D view's shading, whoever starts it.
    for state in (session["before"], session["after"], session["after_keys"]):
        del state["headset"][2]
    assert session["after"] == session["after_keys"] == session["before"]
    assert session["cube"] == pytest.approx(1.0)
    assert session["undone"] == pytest.approx(0.0)  # the one step that the user made
