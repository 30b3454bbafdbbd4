"""A scene shown through a headset's profile: what its materials emit, per eye."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
import pytest

from blender_addon.bridge import measure, ways
from blender_addon.bridge.render import render_linear
from blender_addon.eyes import EYE_PROPERTY
from spectral_core.display import load_profile, srgb_encode, write_profile
from spectral_core.display.limits.luminance import scene_white
from spectral_core.standards import srgb_to_XYZ_matrix


def _shown(scene: bpy.types.Scene) -> np.ndarray:
    return render_linear(scene).pixels.astype(np.float64)


def _differences(scene: bpy.types.Scene, linear: np.ndarray, profile: str, scale: float) -> np.ndarray:
    """8-bit differences of the codes that a headset gets from those of the profile, over all patches."""
    mask = np.any(list(measure.identify(scene).masks.values()), axis=0)
    emitted = _shown(scene)[mask]
    codes = load_profile(profile).to_codes(linear[mask] @ srgb_to_XYZ_matrix().T * scale)
    return 255 * np.abs(srgb_encode(emitted) - np.clip(codes, 0, 1))


def test_materials_emit_what_makes_the_headset_show_the_profiles_codes(chart: bpy.types.Scene) -> None:
    linear = _shown(chart)
    assert bpy.ops.spectral_booth.set_display(left="htc-vive-2020") == {"FINISHED"}
    scale = scene_white(load_profile("htc-vive-2020"))
    # The software renderer's powers, see test_display_nodes.
    assert _differences(chart, linear, "htc-vive-2020", scale).max() < 0.2
    assert "htc-vive-2020" in chart.spectral_booth.display_notes


def test_each_eye_has_its_own_profile(chart: bpy.types.Scene) -> None:
    linear = _shown(chart)
    ways.show_in_headset(chart, "htc-vive-2020", "sRGB")
    for eye, name in enumerate(("htc-vive-2020", "sRGB")):
        chart[EYE_PROPERTY] = float(eye)
        chart.update_tag()
        assert _differences(chart, linear, name, scene_white(load_profile(name))).max() < 0.2


def test_eyes_of_known_luminance_show_the_same(chart: bpy.types.Scene, tmp_path: Path) -> None:
    paths = []
    for name, luminance in (("left", 100.0), ("right", 80.0)):
        profile = replace(load_profile("htc-vive-2020"), name=name, white_luminance_cd_m2=luminance, unit="relative")
        paths.append(tmp_path / f"{name}.json")
        write_profile(profile, paths[-1])
    left, right = ways.show_in_headset(chart, *map(str, paths)).scene_whites
    assert 100 * left == pytest.approx(80 * right)
    assert right == scene_white(load_profile("htc-vive-2020"))


def test_it_goes_away_without_a_trace(chart: bpy.types.Scene) -> None:
    before = _shown(chart)
    nodes = {material.name: len(material.node_tree.nodes) for material in bpy.data.materials}
    for _ in range(2):
        ways.show_in_headset(chart, "htc-vive-2020", "htc-vive-2021")
    assert len(bpy.data.node_groups) == 3
    assert bpy.ops.spectral_booth.clear_display() == {"FINISHED"}
    assert not bpy.data.node_groups
    assert {material.name: len(material.node_tree.nodes) for material in bpy.data.materials} == nodes
    np.testing.assert_array_equal(_shown(chart), before)


def test_measuring_sees_the_scenes_own_colours(chart: bpy.types.Scene) -> None:
    ways.show_in_headset(chart, "htc-vive-2020")
    assert bpy.ops.spectral_booth.calibrate_white() == {"FINISHED"}
    with ways.scene_linear(chart):
        inside = _shown(chart)
    ways.show_in_window(chart)
    np.testing.assert_array_equal(_shown(chart), inside)


def test_what_cannot_be_shown_is_told(chart: bpy.types.Scene) -> None:
    with pytest.raises(RuntimeError, match=r"nowhere\.json"):
        bpy.ops.spectral_booth.set_display(left="nowhere.json")
    assert chart.spectral_booth.display_left == ""
    assert not bpy.data.node_groups


def test_a_group_for_materials_of_ones_own() -> None:
    assert bpy.ops.spectral_booth.add_display_group(profile="htc-vive-2021") == {"FINISHED"}
    tree = bpy.data.node_groups["Display htc-vive-2021"]
    assert [each.name for each in tree.interface.items_tree] == ["Emission", "XYZ"]
    assert tree.use_fake_user
