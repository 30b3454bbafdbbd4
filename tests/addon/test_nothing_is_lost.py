"""Changes of how a scene is lit that fail, and scenes that users changed: nothing is lost, nothing left half done."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest

from blender_addon.bridge import adopting, encoded, lighting, materials, shading, state, ways
from spectral_core.errors import BlenderError, DisplayError, LightError, SpectrumError, TextureError
from spectral_core.steps import finished

GREY = adopting.Source({"reflectance": 0.5})


def _material(name: str) -> bpy.types.Material:
    material = bpy.data.materials.new(name)
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    return material


def _object(scene: bpy.types.Scene, material: bpy.types.Material) -> bpy.types.Object:
    data = bpy.data.meshes.new(material.name)
    data.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    data.materials.append(material)
    made = bpy.data.objects.new(material.name, data)
    scene.collection.objects.link(made)
    return made


def _sun(scene: bpy.types.Scene, name: str) -> bpy.types.Object:
    made = bpy.data.objects.new(name, bpy.data.lights.new(name, "SUN"))
    scene.collection.objects.link(made)
    return made


@pytest.fixture
def own() -> bpy.types.Scene:
    """A user's own scene: materials ``leaf`` and ``wall``, lamps ``left`` and ``right``."""
    scene = bpy.context.scene
    for name in ("leaf", "wall"):
        _object(scene, _material(name))
    for name in ("left", "right"):
        _sun(scene, name)
    return scene


@pytest.fixture
def leaf(tmp_path: Path) -> Path:
    """A hyperspectral texture."""
    path = tmp_path / "leaf.npz"
    values = np.random.default_rng(0).uniform(0.1, 0.9, (6, 6, 8)).astype(np.float32)
    np.savez(path, reflectance=values, wavelengths_nm=np.linspace(380, 730, 8))
    return path


def _adopt(scene: bpy.types.Scene, name: str, source: adopting.Source = GREY) -> bpy.types.Material:
    material = bpy.data.materials[name]
    adopting.adopt(scene, [material], source)
    return material


def _nodes(scene: bpy.types.Scene) -> dict[str, list[str]]:
    return {each.name: sorted(node.name for node in each.node_tree.nodes) for each in bpy.data.materials}


def _everything(scene: bpy.types.Scene) -> tuple[object, ...]:
    kept = scene.spectral_booth
    return (
        kept.way, kept.target, kept.light, kept.basis_error, kept.basis and kept.basis.as_string(), _nodes(scene),
        sorted(each.name for each in bpy.data.node_groups), sorted(each.name for each in bpy.data.images),
        [tuple(lamp.data.color) for lamp in state.managed_lamps(scene)],
    )  # fmt: skip


def test_a_profile_that_is_gone_changes_nothing(own: bpy.types.Scene) -> None:
    _adopt(own, "wall")
    ways.set_way(own, "CODED")
    before = _everything(own)
    own.spectral_booth.display_left = "/nowhere/profile.json"
    with pytest.raises(DisplayError):
        ways.set_way(own, "CODED", "HEADSET")
    assert _everything(own) == before


def test_coefficients_are_kept_where_their_texture_is_gone(own: bpy.types.Scene, leaf: Path) -> None:
    material = _adopt(own, "leaf", adopting.Source({"texture": str(leaf)}))
    ways.show_encoded(own, finished(encoded.encoding_steps(own, encoded.lights_of(own), 1.0, False)))
    before, coefficients = _everything(own), shading.stored_coefficients(material)
    leaf.unlink()
    with pytest.raises(TextureError):
        ways.show_baked(own)
    assert _everything(own) == before
    np.testing.assert_array_equal(shading.stored_coefficients(material), coefficients)
    ways.light(own, "A", 2)  # needs no file


def test_a_basis_whose_text_was_spoilt_can_be_left(own: bpy.types.Scene) -> None:
    _adopt(own, "wall")
    ways.show_encoded(own, finished(encoded.encoding_steps(own, encoded.lights_of(own), 1.0, False)))
    own.spectral_booth.basis.write("not JSON")
    with pytest.raises(SpectrumError, match="no JSON"):
        ways.light(own, "A", 2)
    assert bpy.ops.spectral_booth.bake_colours() == {"FINISHED"}
    assert bpy.ops.spectral_booth.set_light(light="A") == {"FINISHED"}


def test_a_copy_of_a_material_is_relit_too(own: bpy.types.Scene) -> None:
    copy = _adopt(own, "wall").copy()
    _object(own, copy)
    ways.set_way(own, "CODED")
    assert shading.CODED in copy.node_tree.nodes
    ways.set_way(own, "COLOURED")
    ways.light(own, "LPS", 2)
    shown = [shading.stored_colours(each)[0] for each in (bpy.data.materials["wall"], copy)]
    np.testing.assert_array_equal(*shown)


def test_copies_of_a_scene_do_not_share_what_one_of_them_changes(own: bpy.types.Scene) -> None:
    _adopt(own, "wall")
    ways.show_encoded(own, finished(encoded.encoding_steps(own, encoded.lights_of(own), 1.0, False)))
    bpy.ops.scene.new(type="FULL_COPY")
    copy = bpy.context.scene
    assert copy != own
    ways.show_baked(copy)
    assert own.spectral_booth.basis is not None
    assert any(own.name in note for note in ways.notes(copy))  # Blender lets them share their materials
    _adopt(copy, "leaf")
    assert "leaf" not in state.description(own).surfaces


def test_a_material_of_another_scene_is_named(own: bpy.types.Scene) -> None:
    _adopt(own, "wall")
    stranger = _material("stranger")
    stranger[state.SURFACE_KEY] = "elsewhere"
    item = _object(own, stranger)
    with pytest.raises(BlenderError, match="stranger"):
        ways.light(own, "A", 2)
    bpy.data.objects.remove(item)
    ways.light(own, "A", 2)


def test_a_material_that_lost_its_shader_is_named(own: bpy.types.Scene) -> None:
    nodes = _adopt(own, "wall").node_tree.nodes
    nodes.remove(nodes["Principled BSDF"])
    with pytest.raises(BlenderError, match="wall"):
        ways.set_way(own, "CODED")
    assert own.spectral_booth.way == "COLOURED"


@pytest.mark.parametrize("way", ["COLOURED", "CODED"])
@pytest.mark.parametrize("name", ["0 A + 0 D65", "1e999 A + 1 D65"])
def test_lamps_refuse_shares_that_make_no_mixture(own: bpy.types.Scene, way: str, name: str) -> None:
    _adopt(own, "wall")
    ways.set_way(own, way)
    before = _everything(own)
    with pytest.raises(LightError, match="shares"):
        ways.set_lamp_light(own, ["left"], name)
    assert _everything(own) == before
    assert state.LAMP_LIGHT_KEY not in bpy.data.objects["left"]


def test_small_shares_of_a_mixture_are_understood(own: bpy.types.Scene) -> None:
    _adopt(own, "wall")
    assert bpy.ops.spectral_booth.set_mixture(light_1="A", share_1=1e-5, light_2="D65", share_2=1.0) == {"FINISHED"}


def test_files_with_columns_of_one_name_are_two_lights(own: bpy.types.Scene, tmp_path: Path) -> None:
    _adopt(own, "wall")
    ways.set_way(own, "CODED")
    for lamp, slope in (("left", 1.0), ("right", -1.0)):
        rows = [f"{nm},{1 + slope * (nm - 580) / 300}" for nm in range(380, 781, 5)]
        (tmp_path / f"{lamp}.csv").write_text("\n".join(["nm,power", *rows]), encoding="utf-8")
        applied = ways.set_lamp_light(own, [lamp], str(tmp_path / f"{lamp}.csv"))
    assert applied.coded is not None
    assert len(applied.coded.lights) == 2
    colours = [tuple(bpy.data.objects[lamp].data.color) for lamp in ("left", "right")]
    assert colours == [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0)]


def test_lamps_that_share_their_data_have_one_light(own: bpy.types.Scene) -> None:
    _adopt(own, "wall")
    bpy.data.objects["right"].data = bpy.data.objects["left"].data
    with pytest.raises(BlenderError, match="'right'"):
        ways.set_lamp_light(own, ["left"], "A")
    ways.set_lamp_light(own, ["left", "right"], "A")


def test_clipped_lamps_are_told_in_every_way(own: bpy.types.Scene) -> None:
    _adopt(own, "wall")
    ways.set_way(own, "CODED")
    assert any("clipped" in note for note in ways.light(own, "LPS", 1).lighting.notes)
    assert not ways.light(own, "LPS", 2).lighting.notes  # nothing is lost there
    ways.light(own, "D65", 2)
    ways.set_way(own, "COLOURED")
    assert any("clipped" in note for note in ways.set_lamp_light(own, ["left"], "LPS").lighting.notes)


def test_what_is_wrong_with_a_texture_is_told_when_it_is_encoded(own: bpy.types.Scene, leaf: Path) -> None:
    with np.load(leaf) as held:
        values, nm = held["reflectance"].copy(), held["wavelengths_nm"]
    values[0, 0, 3] = np.nan
    np.savez(leaf, reflectance=values, wavelengths_nm=nm)
    _adopt(own, "wall")
    assert bpy.ops.spectral_booth.encode(tolerance=1.0) == {"FINISHED"}
    assert not own.spectral_booth.texture_notes
    told = adopting.adopt(own, [bpy.data.materials["leaf"]], adopting.Source({"texture": str(leaf)}))
    assert any(note.startswith("leaf: ") for note in told)
    assert own.spectral_booth.texture_notes.startswith("leaf: ")


def test_adopting_refuses_before_it_changes_anything(own: bpy.types.Scene) -> None:
    wall, unused = bpy.data.materials["wall"], _material("unused")
    with pytest.raises(BlenderError, match="unused"):
        adopting.adopt(own, [wall, unused], GREY)
    assert not state.is_managed(own)
    assert not list(wall.keys())


def test_a_material_named_twice_is_adopted_once(own: bpy.types.Scene) -> None:
    wall = bpy.data.materials["wall"]
    adopting.adopt(own, [wall, wall], GREY)
    assert adopting.adopted(own) == [wall]


def test_names_beyond_16_bits_are_adopted(own: bpy.types.Scene) -> None:
    bpy.data.materials["wall"].name = "wall \N{DECIDUOUS TREE}"
    _adopt(own, "wall \N{DECIDUOUS TREE}")
    assert "wall \N{DECIDUOUS TREE}" in state.description(own).surfaces


def test_the_output_that_eevee_renders_is_the_one(own: bpy.types.Scene) -> None:
    tree = bpy.data.materials["wall"].node_tree
    principled, shown = tree.nodes["Principled BSDF"], tree.nodes["Material Output"]
    added, other = tree.nodes.new("ShaderNodeAddShader"), tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(principled.outputs[0], added.inputs[0])
    tree.links.new(added.outputs[0], other.inputs["Surface"])
    shown.target, other.target, other.is_active_output = "EEVEE", "CYCLES", True
    wall = _adopt(own, "wall")
    assert materials.base_shader(wall).node == principled
    ways.set_way(own, "CODED")
    adopting.release(own, [wall])
    assert shown.inputs["Surface"].links[0].from_node == principled
    assert other.inputs["Surface"].links[0].from_node == added


def test_release_tells_what_a_user_removed(own: bpy.types.Scene) -> None:
    tree = bpy.data.materials["wall"].node_tree
    picture = tree.nodes.new("ShaderNodeTexImage")
    tree.links.new(picture.outputs["Color"], tree.nodes["Principled BSDF"].inputs["Base Color"])
    wall = _adopt(own, "wall")
    tree.nodes.remove(picture)
    assert [note for note in adopting.release(own, [wall]) if "wall" in note]
    assert not state.is_managed(own)
    _adopt(own, "leaf")
    with pytest.raises(BlenderError, match="not adopted"):
        adopting.release(own, [wall])


def test_a_built_object_has_its_surface_back_after_a_release(chart: bpy.types.Scene) -> None:
    item = next(state.managed_objects(chart))
    surface, mine = state.surface_name(item), _material("mine")
    item.material_slots[0].material = mine
    adopting.adopt(chart, [mine], GREY)
    assert state.surface_name(item) == "mine"
    adopting.release(chart, [mine])
    assert state.surface_name(item) == surface


def test_undo_of_a_lamps_own_light_reads_the_images_again(own: bpy.types.Scene, leaf: Path) -> None:
    from blender_addon import handlers

    _adopt(own, "leaf", adopting.Source({"texture": str(leaf)}))
    before = handlers._shown()
    ways.set_lamp_light(own, ["left"], "A")
    assert handlers._shown() != before


def test_a_headset_leaves_nothing_in_a_released_scene(own: bpy.types.Scene) -> None:
    before = set(own.keys())
    wall = _adopt(own, "wall")
    ways.show_in_headset(own, "htc-vive-2021")
    adopting.release(own, [wall])
    assert set(own.keys()) <= before | {"spectral_booth"}
    assert lighting.live.PREFIX not in str(list(own.keys()))


def test_images_that_a_user_removed_are_missed(own: bpy.types.Scene, leaf: Path) -> None:
    material = _adopt(own, "leaf", adopting.Source({"texture": str(leaf)}))
    bpy.data.images.remove(shading.images_of(material)[0])
    with pytest.raises(BlenderError, match="Bake Colours"):
        ways.light(own, "A", 2)
    ways.show_baked(own)
    ways.light(own, "A", 2)
    ways.show_encoded(own, finished(encoded.encoding_steps(own, encoded.lights_of(own), 0.01, False)))
    first, *rest = shading.images_of(material)
    assert rest  # more than four numbers
    bpy.data.images.remove(first)
    with pytest.raises(BlenderError, match="leaf"):  # what is left is not taken for the first
        ways.set_way(own, "CODED")
    assert own.spectral_booth.way == "COLOURED"
    ways.show_baked(own)
    ways.light(own, "A", 2)


def test_tints_that_coded_lamps_take_for_lights_are_named(own: bpy.types.Scene) -> None:
    tint = bpy.data.materials["wall"].node_tree.nodes["Principled BSDF"].inputs["Specular Tint"]
    tint.default_value = (0.5, 0.5, 0.5, 1.0)
    wall = _adopt(own, "wall")
    ways.set_way(own, "CODED")
    assert not materials.not_coded(wall)
    tint.default_value = (1.0, 0.5, 0.5, 1.0)
    assert any("Specular Tint" in note for note in ways.notes(own))


def test_an_object_with_another_material_shows_no_surface(chart: bpy.types.Scene) -> None:
    item = next(state.managed_objects(chart))
    item.material_slots[0].material = _material("mine")
    assert item not in list(state.managed_objects(chart))
