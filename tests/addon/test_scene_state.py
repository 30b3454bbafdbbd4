"""Building, lights, levels, undo, saving: what a managed scene holds is what theory says."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest

from blender_addon.bridge import shading, state
from spectral_core.lighting import make_lighting
from spectral_core.lights import Light
from spectral_core.surfaces import scene_surfaces

# One of daylight, one warm, one with lines, one whose blue no lamp can carry.
LIGHTS = ("D50", "A", "FL11", "HP1")
# Materials and lamps hold float32: half a unit in the last place is 6e-8, of colours up to a few units.
FLOAT32 = 5e-7


def _held(scene: bpy.types.Scene) -> dict[str, np.ndarray]:
    held = {name: shading.stored_colours(item)[0] for name, item in state.managed_materials(scene).items()}
    held.update({f"lamp {lamp[state.LAMP_KEY]}": np.array(lamp.data.color) for lamp in state.managed_lamps(scene)})
    return held


def _theory(scene: bpy.types.Scene, light: str, level: int) -> dict[str, np.ndarray]:
    description = state.description(scene)
    lighting = make_lighting(Light.load(light), level, description.white.luminance)
    reference = Light.load(description.reference)
    held = {
        name: np.maximum(lighting.material_rgb(surface, reference), 0.0)
        for name, surface in scene_surfaces(description).items()
    }
    held.update({f"lamp {lamp.power}": lighting.lamp_rgb for lamp in description.lamps})
    return held


def _assert_shows(scene: bpy.types.Scene, light: str, level: int) -> None:
    shown = scene.spectral_booth
    assert (shown.light, shown.level) == (light, str(level))
    held, theory = _held(scene), _theory(scene, light, level)
    assert held.keys() == theory.keys()
    for name, colour in theory.items():
        np.testing.assert_allclose(held[name], colour, rtol=FLOAT32, atol=FLOAT32, err_msg=name)


def test_build_makes_the_scene_that_the_description_says(chart: bpy.types.Scene) -> None:
    assert bpy.context.scene == chart
    assert len(list(state.managed_objects(chart))) == 26  # 24 patches, frame, white
    assert [each.name for each in chart.spectral_booth.lights] == list(state.description(chart).lights)
    _assert_shows(chart, "D65", 2)


@pytest.mark.parametrize("preset", ["booth", "colorchecker"])
def test_presets_come_with_the_addon(preset: str) -> None:
    assert bpy.ops.spectral_booth.build(preset=preset, calibrate=False) == {"FINISHED"}
    assert bpy.context.scene.spectral_booth.is_managed


@pytest.mark.parametrize("light", LIGHTS)
def test_light_and_level_set_the_colours_of_theory(chart: bpy.types.Scene, light: str) -> None:
    for level in (2, 0, 1):
        assert bpy.ops.spectral_booth.set_level(level=level) == {"FINISHED"}
        assert bpy.ops.spectral_booth.set_light(light=light) == {"FINISHED"}
        _assert_shows(chart, light, level)


def test_a_folded_light_says_so_in_the_notes(chart: bpy.types.Scene) -> None:
    bpy.ops.spectral_booth.set_light(light="HP1")
    assert "blue" in chart.spectral_booth.notes
    bpy.ops.spectral_booth.set_light(light="D65")
    assert chart.spectral_booth.notes == ""


def test_a_light_from_a_file_beside_the_description(chart: bpy.types.Scene, tmp_path: Path) -> None:
    table = "nm,lamp\n" + "".join(f"{nm},{1 + nm / 1000}\n" for nm in range(380, 785, 5))
    (tmp_path / "lamp.csv").write_text(table, encoding="utf-8")
    assert bpy.ops.spectral_booth.set_light(light="lamp.csv") == {"FINISHED"}
    white = _held(chart)["white"]
    np.testing.assert_allclose(white, 1.0, rtol=1e-6)  # the perfect diffuser has the lamp's own colour


def test_save_and_open_keep_everything(textured: bpy.types.Scene, tmp_path: Path) -> None:
    bpy.ops.spectral_booth.set_light(light="FL11")
    bpy.ops.spectral_booth.set_level(level=1)
    before = _held(textured)
    path = tmp_path / "saved.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.wm.open_mainfile(filepath=str(path))
    scene = bpy.context.scene
    after = _held(scene)
    assert before.keys() == after.keys()
    for name, colour in before.items():
        np.testing.assert_array_equal(after[name], colour, err_msg=name)  # float32 is packed as float32
    bpy.ops.spectral_booth.set_level(level=2)
    _assert_shows(scene, "FL11", 2)


def test_the_texture_is_packed_in_full_precision(textured: bpy.types.Scene, tmp_path: Path) -> None:
    bpy.ops.spectral_booth.set_light(light="A")
    image = shading.images_in(textured)[0]
    assert image.is_float
    assert image.use_half_precision is False
    assert image.packed_file is not None
    expected = _theory(textured, "A", 2)["panel"]
    path = tmp_path / "texture.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    (tmp_path / "panel.npz").unlink()  # the .blend must not need it to show what it showed
    bpy.ops.wm.open_mainfile(filepath=str(path))
    scene = bpy.context.scene
    image = shading.images_in(scene)[0]
    assert image.colorspace_settings.is_data
    stored = shading.stored_colours(state.managed_materials(scene)["panel"])[0]
    # float16 would miss by up to 5e-4; values here lie around 1.
    np.testing.assert_allclose(stored, expected, rtol=FLOAT32, atol=FLOAT32)


def test_undo_and_redo_keep_light_materials_and_textures_together(textured: bpy.types.Scene) -> None:
    bpy.ops.ed.undo_push(message="built")
    for light in ("A", "FL11"):
        assert bpy.ops.spectral_booth.set_light("EXEC_DEFAULT", True, light=light) == {"FINISHED"}
    assert bpy.ops.spectral_booth.set_level("EXEC_DEFAULT", True, level=1) == {"FINISHED"}
    steps = [("FL11", 2), ("A", 2), ("D65", 2)]
    for light, level in steps:
        bpy.ops.ed.undo()
        _assert_shows(bpy.context.scene, light, level)
    for light, level in [*steps[-2::-1], ("FL11", 1)]:
        bpy.ops.ed.redo()
        _assert_shows(bpy.context.scene, light, level)


def test_build_can_be_undone(chart_toml: Path) -> None:
    bpy.ops.ed.undo_push(message="empty")
    name = bpy.context.scene.name
    bpy.ops.spectral_booth.build("EXEC_DEFAULT", True, filepath=str(chart_toml), calibrate=False)
    assert len(bpy.data.scenes) == 2
    bpy.ops.ed.undo()
    assert [scene.name for scene in bpy.data.scenes] == [name]


def test_scenes_of_the_user_stay_as_they_are(chart_toml: Path) -> None:
    scene = bpy.context.scene
    mesh = bpy.data.meshes.new("white")
    item = bpy.data.objects.new("white", mesh)  # the name that the description's white target has
    material = bpy.data.materials.new("white")
    mesh.materials.append(material)
    material.diffuse_color = (0.1, 0.2, 0.3, 1.0)
    scene.collection.objects.link(item)
    scene.view_settings.view_transform = "Raw"
    scene.render.resolution_x = 123
    bpy.ops.spectral_booth.build(filepath=str(chart_toml), calibrate=False)
    bpy.ops.spectral_booth.set_light(light="A")
    built = bpy.context.scene
    assert built != scene
    assert [each.name for each in scene.objects] == ["white"]
    assert tuple(material.diffuse_color) == pytest.approx((0.1, 0.2, 0.3, 1.0))
    assert scene.view_settings.view_transform == "Raw"
    assert scene.render.resolution_x == 123
    assert not scene.spectral_booth.is_managed
    assert state.described_object(built, "white").name == "white.001"


def test_two_scenes_in_one_file_have_their_own_light(chart_toml: Path) -> None:
    bpy.ops.spectral_booth.build(filepath=str(chart_toml), calibrate=False)
    first = bpy.context.scene
    bpy.ops.spectral_booth.build(filepath=str(chart_toml), calibrate=False)
    bpy.ops.spectral_booth.set_light(light="A")
    _assert_shows(first, "D65", 2)
    _assert_shows(bpy.context.scene, "A", 2)


def _contents() -> list[str]:
    kinds = ("scenes", "objects", "meshes", "lights", "cameras", "materials", "images", "worlds", "texts")
    return sorted(f"{kind}/{each.name}" for kind in kinds for each in getattr(bpy.data, kind))


def test_bad_descriptions_are_refused_and_leave_nothing(chart_toml: Path, tmp_path: Path) -> None:
    before = _contents()
    with pytest.raises(RuntimeError, match=r"nowhere\.toml: no such file; name a scene's TOML file"):
        bpy.ops.spectral_booth.build(filepath=str(tmp_path / "nowhere.toml"))
    text = chart_toml.read_text(encoding="utf-8")
    chart_toml.write_text(text.replace("[surfaces.frame]\nreflectance = 0.03", '[surfaces.frame]\ntexture = "no.npz"'))
    with pytest.raises(RuntimeError, match=r"no\.npz: no such file"):
        bpy.ops.spectral_booth.build(filepath=str(chart_toml), calibrate=False)
    assert _contents() == before


def test_errors_are_reported_and_change_nothing(chart: bpy.types.Scene) -> None:
    with pytest.raises(RuntimeError, match="no built-in light and no file called 'nope'"):
        bpy.ops.spectral_booth.set_light(light="nope")
    with pytest.raises(RuntimeError, match="no picture was named"):
        bpy.ops.spectral_booth.render(filepath="")
    with pytest.raises(RuntimeError, match="save it first"):
        bpy.ops.spectral_booth.verify(lights="CURRENT", write_json=True)
    _assert_shows(chart, "D65", 2)
    chart.spectral_booth.description.clear()
    with pytest.raises(RuntimeError, match="'format' is missing"):
        bpy.ops.spectral_booth.set_light(light="A")


@pytest.mark.parametrize("name", ["set_light", "set_level", "calibrate_white", "render", "verify"])
def test_an_unmanaged_scene_is_refused_with_a_reason(name: str) -> None:
    operator = getattr(bpy.ops.spectral_booth, name)
    assert operator.poll() is False
    with pytest.raises(RuntimeError, match="no spectral scene; build one first"):
        operator()
