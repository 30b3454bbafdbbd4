"""Users' own materials with a measured base colour: what they show, and that they are given back as they were."""

from __future__ import annotations

import math
import re
from pathlib import Path

import bpy
import dumped
import numpy as np
import pytest

from blender_addon.bridge import adopting, materials, measure, shading, state
from blender_addon.bridge.build import eevee_engine, set_black_world
from blender_addon.bridge.images import empty_image, write_image
from blender_addon.bridge.render import render_linear
from spectral_core.display import srgb_encode

Operators = bpy.ops.spectral_booth
BLENDER_5 = (5, 0, 0)


@pytest.fixture
def panel(tmp_path: Path) -> Path:
    """A small hyperspectral texture, brighter downwards and turning from red to blue."""
    x, y = np.linspace(0, 1, 16)[None, :, None], np.linspace(0, 1, 8)[:, None, None]
    long = np.linspace(0, 1, 36)
    reflectance = (0.1 + 0.4 * y + 0.4 * (x * (1 - long) + (1 - x) * long)).astype(np.float32)
    np.savez(tmp_path / "panel.npz", reflectance=reflectance, wavelengths_nm=np.linspace(380, 730, 36))
    return tmp_path / "panel.npz"


@pytest.fixture
def own() -> bpy.types.Scene:
    """A user's own scene: a sphere of a Principled material with a normal map, before a camera under one white sun."""
    scene = bpy.context.scene
    set_black_world(scene)
    scene.render.engine, scene.eevee.taa_render_samples = eevee_engine(scene), 1
    scene.render.resolution_x = scene.render.resolution_y = 96
    scene.view_settings.view_transform = "Standard"
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    sun.data.energy, sun.data.angle, sun.rotation_euler = math.pi, 0.0, (0.6, 0.3, 0.0)
    sun.data.color = (1.0, 0.9, 0.8)
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.location = (0, 0, 5)
    for item in (sun, camera):
        scene.collection.objects.link(item)
    scene.camera = camera
    _add_fruit("fruit", 0.0)
    return scene


def _add_fruit(name: str, x: float) -> bpy.types.Material:
    """A sphere whose base colour comes from an image that a Mapping node places."""
    bpy.ops.mesh.primitive_uv_sphere_add(segments=32, ring_count=16, location=(x, 0, 0))
    bpy.ops.object.shade_smooth()
    bpy.context.object.name = name
    bpy.context.object["mine"] = 3
    material = bpy.data.materials.new(name)
    bpy.context.object.data.materials.append(material)
    if bpy.app.version < BLENDER_5:
        material.use_nodes = True
    material["mine"] = "too"
    material.surface_render_method, material.use_transparency_overlap = "DITHERED", True
    tree = material.node_tree
    shader = tree.nodes["Principled BSDF"]
    shader.inputs["Roughness"].default_value = 0.3
    shader.inputs["Base Color"].default_value = (0.2, 0.5, 0.1, 1.0)
    coordinates, mapping = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeMapping")
    mapping.inputs["Scale"].default_value = (2.0, 1.0, 1.0)
    tree.links.new(coordinates.outputs["UV"], mapping.inputs["Vector"])
    colour, bumps = tree.nodes.new("ShaderNodeTexImage"), tree.nodes.new("ShaderNodeTexImage")
    colour.image, colour.name = bpy.data.images.new(f"{name} colour", 8, 8), "own colour"
    tree.links.new(mapping.outputs[0], colour.inputs["Vector"])
    tree.links.new(colour.outputs["Color"], shader.inputs["Base Color"])
    bumps.image = empty_image(f"{name} bumps", 16, 16)
    noise = 0.15 * np.random.default_rng(1).standard_normal((16, 16, 2))
    write_image(bumps.image, np.concatenate([0.5 + noise, np.ones((16, 16, 1))], axis=-1).astype(np.float32))
    normal = tree.nodes.new("ShaderNodeNormalMap")
    tree.links.new(bumps.outputs["Color"], normal.inputs["Color"])
    tree.links.new(normal.outputs[0], shader.inputs["Normal"])
    return material


def _codes(scene: bpy.types.Scene) -> np.ndarray:
    return 255 * srgb_encode(np.clip(render_linear(scene).pixels.astype(np.float64), 0.0, 1.0))


def _shown(scene: bpy.types.Scene) -> dict[str, np.ndarray]:
    """Codes with coloured and with coded lamps; the scene is shown by coloured ones again."""
    shown = {"COLOURED": _codes(scene)}
    assert Operators.set_way(way="CODED") == {"FINISHED"}
    shown["CODED"] = _codes(scene)
    assert Operators.set_way(way="COLOURED") == {"FINISHED"}
    return shown


def test_adopted_and_released_it_is_node_for_node_what_it_was(own: bpy.types.Scene, panel: Path) -> None:
    before, rendered = dumped.everything(), _codes(own)
    assert Operators.adopt(filepath=str(panel), materials="fruit") == {"FINISHED"}
    assert own.spectral_booth.is_managed
    shown = _shown(own)
    # Base colour, normal map and gloss go through the same shader in both ways; what differs is that the film
    # holds half floats. One level is asked for.
    print(np.abs(shown["COLOURED"] - shown["CODED"]).max())
    assert np.abs(shown["COLOURED"] - shown["CODED"]).max() <= 1
    assert np.abs(shown["COLOURED"] - rendered).max() > 20
    assert shown["COLOURED"].max() > 250  # the gloss is in the picture
    assert Operators.release() == {"FINISHED"}
    assert dumped.differences(before, dumped.everything()) == []
    assert not own.spectral_booth.is_managed
    np.testing.assert_array_equal(_codes(own), rendered)


def test_encoded_it_shows_the_same(own: bpy.types.Scene, panel: Path) -> None:
    before = dumped.everything()
    assert Operators.adopt(filepath=str(panel), materials="fruit") == {"FINISHED"}
    baked = _codes(own)
    assert Operators.encode(tolerance=0.05) == {"FINISHED"}
    for codes in _shown(own).values():
        print(np.abs(codes - baked).max())
        assert np.abs(codes - baked).max() <= 1
    assert Operators.set_way(way="CODED") == {"FINISHED"}
    assert Operators.set_display(left="htc-vive-2021") == {"FINISHED"}
    assert Operators.release(materials="fruit") == {"FINISHED"}
    assert dumped.differences(before, dumped.everything()) == []


def test_gloss_alone_has_the_lights_colour(own: bpy.types.Scene, tmp_path: Path) -> None:
    """A black surface shows nothing but gloss: under D65 it is neutral, and the same in both ways."""
    (tmp_path / "black.csv").write_text("nm,black\n380,0\n780,0\n", encoding="utf-8")
    assert Operators.adopt(filepath=str(tmp_path / "black.csv"), materials="fruit") == {"FINISHED"}
    assert Operators.set_light(light="D65") == {"FINISHED"}
    shown = _shown(own)
    assert shown["COLOURED"].max() > 100
    assert np.abs(shown["COLOURED"] - shown["CODED"]).max() <= 1
    # D65 is the white of Rec.709, to four decimals of its published chromaticity.
    assert np.ptp(shown["CODED"], axis=-1).max() <= 0.5


def test_images_are_placed_as_the_old_one_was(own: bpy.types.Scene, panel: Path) -> None:
    Operators.adopt(filepath=str(panel), materials="fruit")
    for change in (lambda: None, lambda: Operators.set_way(way="CODED"), lambda: Operators.encode(tolerance=0.5)):
        change()
        tree = bpy.data.materials["fruit"].node_tree
        new = [node for node in tree.nodes if node.type == "TEX_IMAGE" and shading.OVERLAY_KEY in node]
        assert new != []
        assert {node.inputs["Vector"].links[0].from_node.name for node in new} == {"Mapping"}


def test_a_surface_without_an_image_before_has_the_objects_own_coordinates(own: bpy.types.Scene, panel: Path) -> None:
    material = bpy.data.materials["fruit"]
    material.node_tree.nodes.remove(material.node_tree.nodes["own colour"])
    before = dumped.everything()
    Operators.adopt(filepath=str(panel), materials="fruit")
    (new,) = [node for node in material.node_tree.nodes if shading.OVERLAY_KEY in node and node.type == "TEX_IMAGE"]
    assert not new.inputs["Vector"].links
    Operators.release()
    assert dumped.differences(before, dumped.everything()) == []


def test_what_cannot_be_adopted_is_refused(own: bpy.types.Scene, panel: Path, tmp_path: Path) -> None:
    plain = bpy.data.materials.new("plain")
    if bpy.app.version < BLENDER_5:
        plain.use_nodes = True
    diffuse = plain.node_tree.nodes.new("ShaderNodeBsdfDiffuse")
    materials.show(plain, diffuse.outputs[0])
    bare = bpy.data.materials.new("bare")
    if bpy.app.version < BLENDER_5:
        bare.use_nodes = True
    bare.node_tree.nodes.clear()
    (tmp_path / "broken.npz").write_bytes(b"no archive")
    (tmp_path / "broken.csv").write_text("nm,red\n400,x\n", encoding="utf-8")
    bpy.context.view_layer.objects.active = None
    before = dumped.everything()
    for arguments, message in (
        ({"filepath": str(panel), "materials": "fruit; plain"}, "the surface of 'plain' is not one Principled BSDF; "),
        ({"filepath": str(panel), "materials": "bare"}, "the surface of 'bare' is not one Principled BSDF; "),
        ({"filepath": str(panel), "materials": "nope"}, "no material is called 'nope'; "),
        ({"filepath": str(panel)}, "no material was chosen; "),
        ({"materials": "fruit"}, "no surface was named; "),
        ({"filepath": str(tmp_path / "nowhere.npz"), "materials": "fruit"}, "nowhere.npz: no such file"),
        ({"filepath": str(tmp_path / "broken.npz"), "materials": "fruit"}, "broken.npz: "),
        ({"filepath": str(tmp_path / "broken.csv"), "materials": "fruit"}, "broken.csv, line 2: "),
    ):
        with pytest.raises(RuntimeError, match=f"^Error: [^\n]*{re.escape(message)}[^\n]*$"):
            Operators.adopt(**arguments)
        assert dumped.differences(before, dumped.everything()) == []
    assert Operators.adopt(filepath=str(panel), materials="fruit") == {"FINISHED"}
    before = dumped.everything()
    with pytest.raises(RuntimeError, match=r"^Error: 'fruit' is managed already; [^\n]*$"):
        Operators.adopt(filepath=str(panel), materials="fruit")
    with pytest.raises(RuntimeError, match=r"^Error: 'plain' was not adopted; [^\n]*$"):
        Operators.release(materials="fruit;plain")
    assert dumped.differences(before, dumped.everything()) == []


def test_one_of_several_is_released(own: bpy.types.Scene, panel: Path, tmp_path: Path) -> None:
    _add_fruit("leaf", 3.0)
    before = dumped.everything()
    (tmp_path / "paints.csv").write_text("nm,red,grey\n380,0.1,0.4\n580,0.1,0.4\n600,0.8,0.4\n780,0.8,0.4\n")
    assert Operators.adopt(filepath=str(panel), materials="fruit") == {"FINISHED"}
    only_fruit = dumped.everything()
    paint = {"filepath": str(tmp_path / "paints.csv"), "materials": "leaf", "spectrum": "red"}
    assert Operators.adopt(**paint) == {"FINISHED"}
    assert sorted(each.name for each in adopting.adopted(own)) == ["fruit", "leaf"]
    assert sorted(state.description(own).surfaces) == ["fruit", "leaf"]
    assert Operators.release(materials="leaf") == {"FINISHED"}
    assert dumped.differences(only_fruit, dumped.everything()) == []
    assert Operators.adopt(**paint) == {"FINISHED"}
    assert Operators.release(materials="fruit") == {"FINISHED"}
    assert list(state.description(own).surfaces) == ["leaf"]
    assert Operators.release() == {"FINISHED"}
    assert dumped.differences(before, dumped.everything()) == []


@pytest.mark.parametrize("shown", ["baked", "encoded"])
def test_in_a_scene_that_was_built(chart: bpy.types.Scene, panel: Path, shown: str) -> None:
    material = _add_fruit("white", 0.0)  # as a surface of the scene is called
    if shown == "encoded":
        assert Operators.encode(tolerance=0.5) == {"FINISHED"}
    before = dumped.everything()
    assert Operators.adopt(filepath=str(panel), materials=material.name) == {"FINISHED"}
    name = str(material[state.SURFACE_KEY])
    assert name not in ("white", "frame")
    assert name in state.description(chart).surfaces
    assert len(shading.images_of(material)) >= 1
    assert (chart.spectral_booth.basis is not None) == (shown == "encoded")
    for way in ("CODED", "COLOURED"):
        assert Operators.set_way(way=way) == {"FINISHED"}
        assert Operators.set_light(light="A") == {"FINISHED"}
    assert Operators.set_light(light="D65") == {"FINISHED"}
    assert Operators.release() == {"FINISHED"}
    after = dumped.everything()
    if shown == "encoded":
        # The basis was fitted to the panel too, and stays: only coefficients of the other surfaces may differ.
        kept = ("nodes/Spectral Colour/inputs", "/groups/", "basis", "live_", "/texts/")
        assert [each for each in dumped.differences(before, after) if not any(key in each for key in kept)] == []
    else:
        assert dumped.differences(before, after) == []
    assert chart.spectral_booth.is_managed


def test_adopting_is_undone_and_kept_in_the_file(own: bpy.types.Scene, panel: Path, tmp_path: Path) -> None:
    bpy.ops.ed.undo_push(message="own")
    before = dumped.everything()
    assert Operators.adopt("EXEC_DEFAULT", True, filepath=str(panel), materials="fruit") == {"FINISHED"}
    adopted = dumped.everything()
    assert Operators.set_light("EXEC_DEFAULT", True, light="A") == {"FINISHED"}
    bpy.ops.ed.undo()
    assert dumped.differences(adopted, dumped.everything()) == []
    bpy.ops.ed.undo()
    assert dumped.differences(before, dumped.everything()) == []
    bpy.ops.ed.redo()
    assert dumped.differences(adopted, dumped.everything()) == []
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "own.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "own.blend"))
    assert Operators.release() == {"FINISHED"}
    found = [each for each in dumped.differences(before, dumped.everything()) if "filepath" not in each]
    assert found == []


def test_what_the_base_reflects_is_measured(own: bpy.types.Scene, panel: Path) -> None:
    """The all-white render that irradiance is read from leaves an adopted material as it was."""
    Operators.adopt(filepath=str(panel), materials="fruit")
    before = dumped.everything()
    found = measure.illumination(own)
    assert dumped.differences(before, dumped.everything()) == []
    assert 0.5 < found.irradiance.max() <= 1.01
    assert found.gloss.max() > 0
