"""A change of light in a window with 200 spectral materials: as fast as if there were none.

With a spectral basis it sets numbers of the scene alone: no image is uploaded, no shader compiled, no material touched.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import OpenImageIO
import pytest
from many_materials import TEXTURES, UNIFORM, write_scene
from real_blender import WORK, Application, assert_clean

FOLDER = WORK / "live"
WAYS = ("COLOURED", "CODED")
# A small view: software draws it.
WINDOW = ("--window-geometry", "0", "0", "640", "480")


@pytest.fixture(scope="module")
def session(application: Application, installed: Path) -> dict:
    """What happened in the application, see live_switch.py."""
    FOLDER.mkdir(parents=True)
    scene, result = write_scene(FOLDER), FOLDER / "result.json"
    script = Path(__file__).with_name("live_switch.py")
    assert_clean(application("window", *WINDOW, "--python", script, "--", result, scene, FOLDER))
    found = json.loads(result.read_text(encoding="utf-8"))
    assert "exception" not in found, found["exception"]
    return found


def _ms(seconds: object) -> str:
    low, middle, high = np.percentile(1e3 * np.array(seconds), [10, 50, 90])
    return f"median {middle:.2f} ms (10 to 90 %: {low:.2f} to {high:.2f})"


@pytest.mark.parametrize("way", WAYS)
def test_a_change_of_light_keeps_the_main_thread_for_at_most_5_ms(session: dict, way: str) -> None:
    """What was asked for: less than half a frame of a headset at 90 Hz.

    Asserted of the main thread's processor time in the quietest of the blocks: other processes do not add to it but
    take the caches. The clock, which also shows waiting for the dependency graph's threads, is printed beside it.
    """
    blocks = np.array(session[way]["switches_s"])
    quietest = blocks[np.median(blocks[..., 2], axis=1).argmin()]
    for name, times in (("quietest block", quietest), ("all", blocks.reshape(-1, 3))):
        clock = times[:, 0] + times[:, 1]
        print(f"{way}, {name}: light {_ms(times[:, 0])}, dependency graph {_ms(times[:, 1])}, both {_ms(clock)}")
        print(f"{way}, {name}: main thread's processor time {_ms(times[:, 2])}")
    assert np.median(blocks[..., 2], axis=1).min() <= 5e-3


@pytest.mark.parametrize("way", WAYS)
def test_the_first_redraw_takes_no_longer_than_later_ones(session: dict, way: str) -> None:
    """Compiling a shader takes seconds here, see the longest of the warm-up; 1.3 leaves the shadows of a lamp whose
    colour changed, and a busy machine its noise. Each first redraw is compared with the later ones right after it.
    """
    first, later = np.array(session[way]["first_s"]), np.array(session[way]["later_s"])
    ratios = first / later.mean(axis=1)
    print(
        f"{way}: first redraw {_ms(first)}, later {_ms(later)}, ratio of medians "
        f"{np.median(first) / np.median(later):.3f}, median of ratios {np.median(ratios):.3f} "
        f"(10 to 90 %: {np.percentile(ratios, 10):.2f} to {np.percentile(ratios, 90):.2f})"
    )
    print(f"{way}: longest redraw while shaders are compiled {max(session[way]['warm_up_s']):.2f} s")
    assert np.median(ratios) <= 1.3


@pytest.mark.parametrize("way", WAYS)
def test_no_material_image_or_shader_is_touched(session: dict, way: str) -> None:
    # A material and its nodes each, and an image at least of each texture.
    assert session[way]["things"] >= UNIFORM + 2 * TEXTURES
    assert session[way]["touched"] == []
    # The scene, which the numbers are set in, and the lamp: nothing else is evaluated anew.
    assert session[way]["updated"] == ["Object sun", "Scene Many surfaces", "SunLight sun"]


@pytest.mark.parametrize("way", WAYS)
def test_the_first_redraw_shows_the_new_light(session: dict, way: str) -> None:
    left, bottom, width, height = session[way]["region"]
    means = []
    for number in range(3):
        picture = OpenImageIO.ImageBuf(str(FOLDER / f"{way}-{number}.png")).get_pixels(OpenImageIO.UINT8)
        shown = np.asarray(picture)[::-1][bottom : bottom + height, left : left + width, :3]
        means.append(shown.mean(axis=(0, 1)))
    # D65, a mixture, A: ever less blue beside red.
    blue = [mean[2] / mean[0] for mean in means]
    print(f"{way}: blue over red {np.round(blue, 3).tolist()}")
    assert blue[0] > 1.1 * blue[1] > 1.2 * blue[2]
