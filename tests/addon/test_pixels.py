"""Rendered pixels against theory; each of these renders in software and takes seconds."""

from __future__ import annotations

import json
from pathlib import Path

import bpy
import pytest

from blender_addon.bridge import lighting, state, verify


def test_rendered_colours_are_those_of_theory(chart: bpy.types.Scene) -> None:
    (result,) = verify.verify(chart, ["A"])
    level0, level1, level2 = (result.levels[level] for level in (0, 1, 2))
    assert level2.patches == 24
    # Forward shading in float32 renders within 0.07 of an 8-bit level; the colours that Blender's
    # working space holds must be that exact.
    assert all(spread.max < 0.1 for spread in level2.rgb8_in_gamut.values())
    assert level2.dE00_in_gamut.max < 0.05
    # RGB under incandescent light is far off, which is why level 2 exists.
    assert level0.dE00.mean > 10
    assert 1 < level1.dE00.mean < level0.dE00.mean
    assert (chart.spectral_booth.light, chart.spectral_booth.level) == ("D65", "2")


def test_calibration_brings_the_white_to_its_luminance(chart: bpy.types.Scene) -> None:
    (sun,) = state.managed_lamps(chart)
    exact = sun.data.energy
    sun.data.energy = 3 * exact
    assert bpy.ops.spectral_booth.calibrate_white() == {"FINISHED"}
    # Half a unit of float32 per step of the render; a wrong factor would be off by percents.
    assert sun.data.energy == pytest.approx(exact, rel=1e-4)
    assert lighting.calibrate_white(chart).before == pytest.approx(0.85, rel=1e-4)


def test_calibration_says_why_it_cannot(chart: bpy.types.Scene) -> None:
    state.described_object(chart, "white").location.y = 5.0
    with pytest.raises(RuntimeError, match="the camera does not see the white target"):
        bpy.ops.spectral_booth.calibrate_white()


def test_a_white_out_of_sight_leaves_no_half_built_scene(chart_toml: Path) -> None:
    text = chart_toml.read_text(encoding="utf-8").replace(
        "location = [0.0, -0.105, 0.0042]", "location = [0.0, 9.0, 0.0]"
    )
    chart_toml.write_text(text, encoding="utf-8")
    scenes, objects = len(bpy.data.scenes), len(bpy.data.objects)
    with pytest.raises(RuntimeError, match="does not see the white target"):
        bpy.ops.spectral_booth.build(filepath=str(chart_toml))
    assert (len(bpy.data.scenes), len(bpy.data.objects)) == (scenes, objects)


def test_the_operator_verifies_and_writes_its_figures(chart_toml: Path, tmp_path: Path) -> None:
    bpy.ops.spectral_booth.build(filepath=str(chart_toml), calibrate=False)
    scene = bpy.context.scene
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "chart.blend"))
    assert bpy.ops.spectral_booth.verify(lights="CURRENT", write_json=True) == {"FINISHED"}
    first, *levels = scene.spectral_booth.result.split("\n")
    assert first == "D65, 24 colours"
    assert [line.split(":")[0] for line in levels] == ["Level 0", "Level 1", "Level 2", "In gamut"]
    document = json.loads((tmp_path / "chart.verify.json").read_text(encoding="utf-8"))
    assert [light["name"] for light in document["lights"]] == ["D65"]
    assert {"level0", "level1", "level2"} <= document["lights"][0].keys()


def test_a_verification_that_stops_early_puts_the_light_back(chart: bpy.types.Scene) -> None:
    lit = [tuple(lamp.data.color) for lamp in state.managed_lamps(chart)]
    steps = verify.verify_steps(chart, ["A", "FL11"])
    done = [next(steps) for _ in range(3)]
    assert [step.what for step in done[1:]] == ["A, level 0", "A, level 1"]
    assert [step.fraction for step in done] == sorted(step.fraction for step in done)
    steps.close()
    assert chart.spectral_booth.light == "D65"
    assert [tuple(lamp.data.color) for lamp in state.managed_lamps(chart)] == lit


def test_a_texture_renders_as_its_spectra_say(textured: bpy.types.Scene) -> None:
    (result,) = verify.verify(textured, ["A"], levels=(2,))
    panel = result.textures["panel"]
    print(panel)
    # The renderer's bilinear fraction has 8 bits, and one sample a pixel stands beside its centre:
    # half a level on average, which the mean over the object does away with. A texture flipped or a
    # texel off is off by tens.
    assert panel.pixels.mean < 0.5
    assert panel.mean_colour < 0.2
    # Only the frame and the white stay in sight beside it: they are what is counted then.
    assert result.levels[2].patches == 2


def test_render_writes_a_picture(chart: bpy.types.Scene, tmp_path: Path) -> None:
    assert bpy.ops.spectral_booth.render(filepath=str(tmp_path / "chart")) == {"FINISHED"}
    image = bpy.data.images.load(str(tmp_path / "chart.png"))
    assert tuple(image.size) == (160, 120)
    # The white target in the picture, 8-bit: the colour of theory rounded.
    x, y = 80, int(120 * (0.5 - 0.105 / 0.27))
    index = 4 * (y * 160 + x)
    shown = [round(255 * value) for value in image.pixels[index : index + 3]]
    expected = 255 * (1.055 * 0.85 ** (1 / 2.4) - 0.055)
    assert shown == pytest.approx([expected] * 3, abs=0.6)
