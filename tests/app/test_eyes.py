"""A scene shown in a simulated headset through a profile per eye: each eye gets its own profile's codes."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import OpenImageIO
import pytest
from real_blender import WORK, Application, assert_clean

from spectral_core.display import load_profile
from spectral_core.display.limits.luminance import scene_white
from spectral_core.lighting import make_lighting
from spectral_core.lights import Light
from spectral_core.scene import load_scene
from spectral_core.standards import srgb_to_XYZ_matrix
from spectral_core.surfaces import scene_surfaces

FOLDER = WORK / "eyes"
EYES = ("htc-vive-2020", "sRGB")
_HEADSET_PIXELS = 800
_LIT = 3
# A patch of the chart covers a few hundred pixels of the picture, of which its edges and the frame take some.
_FEWEST_PIXELS = 60
# The chart upright, one sun square on it: each patch is of one colour.
SCENE = """
format = 1
name = "Chart in the headset"
lights = ["A"]
[white]
object = "white"
[camera]
location = [0.0, -1.0, 0.0]
target = [0.0, 0.0, 0.0]
[[lamps]]
name = "sun"
type = "sun"
location = [0.0, -1.0, 0.0]
target = [0.0, 0.0, 0.0]
[surfaces.frame]
reflectance = 0.03
[[objects]]
name = "chart"
shape = "colorchecker"
location = [0.0, 0.0, 0.0]
rotation = [90.0, 0.0, 0.0]
size = [0.60, 0.40, 0.004]
surface = "frame"
[[objects]]
name = "white"
shape = "plane"
location = [0.0, 5.0, 0.0]
size = [0.1, 0.1, 0.0]
surface = "frame"
"""


@pytest.fixture(scope="module")
def session(application: Application, installed: Path) -> dict:
    """What happened in the application, see eyes.py."""
    FOLDER.mkdir(parents=True)
    scene, result = FOLDER / "chart.toml", FOLDER / "result.json"
    scene.write_text(SCENE, encoding="utf-8")
    script = Path(__file__).with_name("eyes.py")
    assert_clean(application("headset", "--python", script, "--", result, scene, FOLDER, *EYES))
    found = json.loads(result.read_text(encoding="utf-8"))
    assert "exception" not in found, found["exception"]
    return found


def _wanted(name: str) -> np.ndarray:
    """Codes (24, 3) in 8 bits of the patches through a profile: theory, from the spectra on."""
    scene = load_scene(FOLDER / "chart.toml")
    lighting = make_lighting(Light.load("A"), 2, scene.white.luminance)
    surfaces = scene_surfaces(scene)
    patches = [each for each in scene.objects if each.surface.startswith("colorchecker ")]
    # Blender's working space holds no negative channels.
    linear = np.maximum([lighting.exact_rgb(surfaces[each.surface]) for each in patches], 0)
    profile = load_profile(name)
    return 255 * np.clip(profile.to_codes(linear @ srgb_to_XYZ_matrix().T * scene_white(profile)), 0, 1)


def _eyes(path: Path) -> list[np.ndarray]:
    """The picture of each eye (pixels, 3): two runs of lit columns, black between."""
    pixels = np.asarray(OpenImageIO.ImageBuf(str(path)).get_pixels(OpenImageIO.UINT8))[:, :_HEADSET_PIXELS, :3]
    lit = (pixels.max(axis=2) > _LIT).any(axis=0)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], lit, [0]]))).reshape(-1, 2)
    runs = [pixels[:, left:right].reshape(-1, 3) for left, right in edges if right - left > 20]
    assert len(runs) == 2, f"{path}: {len(runs)} pictures"
    return runs


def test_each_eye_gets_its_own_profiles_codes_however_the_head_moves(session: dict) -> None:
    wanted = [_wanted(name) for name in EYES]
    assert np.abs(wanted[0] - wanted[1]).max() > 10  # the profiles are told apart
    for number in range(len(session["heads"])):
        for name, codes, pixels in zip(EYES, wanted, _eyes(FOLDER / f"eyes{number}.png"), strict=True):
            # Half a level is rounding; powers of the software renderer and half floats take the rest.
            near = (np.abs(pixels[:, None] - codes) <= 1.0).all(axis=2).sum(axis=0)
            assert (near >= _FEWEST_PIXELS).all(), f"{name}, photograph {number}: {near.tolist()}"
    assert np.ptp(session["heads"], axis=0).max() > 0.005


def test_the_panel_says_what_each_eye_shows(session: dict) -> None:
    assert "Left: htc-vive-2020" in session["notes"]
    assert "Right: sRGB" in session["notes"]
