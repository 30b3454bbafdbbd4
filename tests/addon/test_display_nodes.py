"""A profile's node group against the profile, from rendered pixels."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np
import pytest

from blender_addon.bridge.display_nodes import display_group, remove_group
from blender_addon.bridge.render import render_linear
from spectral_core.display import DisplayProfile, load_profile, srgb_decode, srgb_encode
from spectral_core.standards import XYZ_to_Lab, delta_E_2000

Simulated = Callable[[str], DisplayProfile]
_SIZE = 32


def _emitted(profile: DisplayProfile, XYZ: np.ndarray) -> np.ndarray:
    """What the group emits (n, 3) for XYZ (n, 3): a plane of _SIZE x _SIZE texels, one a pixel."""
    scene = bpy.context.scene
    scene.render.engine = "BLENDER_EEVEE" if bpy.app.version >= (5, 0, 0) else "BLENDER_EEVEE_NEXT"
    scene.render.resolution_x = scene.render.resolution_y = _SIZE
    scene.render.filter_size, scene.eevee.taa_render_samples = 0.0, 1
    bpy.ops.mesh.primitive_plane_add(size=2)
    plane = bpy.context.object
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.type, camera.data.ortho_scale, camera.location = "ORTHO", 2.0, (0, 0, 1)
    scene.collection.objects.link(camera)
    scene.camera = camera
    image = bpy.data.images.new("XYZ", _SIZE, _SIZE, float_buffer=True, is_data=True)
    image.use_half_precision = False
    rgba = np.ones((_SIZE * _SIZE, 4), dtype=np.float32)
    rgba[:, :3] = XYZ
    image.pixels.foreach_set(rgba.ravel())
    image.update()
    material = bpy.data.materials.new("display")
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    material.surface_render_method = "BLENDED"
    tree = material.node_tree
    tree.nodes.clear()
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image, texture.interpolation = image, "Closest"
    group = tree.nodes.new("ShaderNodeGroup")
    group.node_tree = display_group(profile, profile.name)
    emission = tree.nodes.new("ShaderNodeEmission")
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(texture.outputs["Color"], group.inputs["XYZ"])
    tree.links.new(group.outputs["Emission"], emission.inputs["Color"])
    tree.links.new(emission.outputs[0], output.inputs["Surface"])
    plane.data.materials.append(material)
    return render_linear(scene).pixels[::-1].reshape(-1, 3).astype(np.float64)


@pytest.mark.parametrize(
    ("name", "limit"),
    [
        # The software renderer computes powers to about 1e-4.
        ("sRGB", 5e-4),
        ("htc-vive-2021", 5e-4),
        ("htc-vive-2020", 5e-4),
        ("gain-offset-gamma", 5e-4),
        # The same, steeper in the dark by the table.
        ("channel-lut", 5e-4),
        ("grey-lut", 5e-4),
    ],
)
def test_the_group_emits_the_codes(simulated_profile: Simulated, name: str, limit: float) -> None:
    profile = simulated_profile(name)
    codes = np.random.default_rng(0).uniform(0.02, 0.98, (_SIZE * _SIZE, 3))
    XYZ = profile.to_XYZ(codes)
    emitted = _emitted(profile, XYZ)
    encoded = srgb_encode(emitted)
    # Below its threshold gain-offset-gamma is black at every code, and its inverse gives the threshold.
    difference = np.abs(encoded - profile.to_codes(XYZ))
    print(f"{name}: mean {255 * difference.mean():.4f}, max {255 * difference.max():.4f} of an 8-bit level")
    assert difference.max() < limit


def test_a_table_of_interacting_channels(simulated_profile: Simulated) -> None:
    """65 nodes of an inverse that has edges: in the dark, where a code is little light, some levels, but
    nothing that is seen.
    """
    profile = simulated_profile("channel-lut-corrected")
    XYZ = profile.to_XYZ(np.random.default_rng(0).uniform(0.02, 0.98, (_SIZE * _SIZE, 3)))
    codes = srgb_encode(_emitted(profile, XYZ))
    difference = 255 * np.abs(codes - profile.to_codes(XYZ))
    white = profile.to_XYZ(np.ones(3))
    dE00 = delta_E_2000(XYZ_to_Lab(profile.to_XYZ(codes), white), XYZ_to_Lab(XYZ, white))
    print(f"mean {difference.mean():.4f}, max {difference.max():.4f} of an 8-bit level; dE00 at most {dE00.max():.4f}")
    assert difference.mean() < 0.05
    assert dE00.max() < 0.1


def test_out_of_gamut_is_clipped_and_black_is_black() -> None:
    profile = load_profile("htc-vive-2020")
    XYZ = np.zeros((_SIZE * _SIZE, 3))
    XYZ[1] = 3.0, 3.0, 3.0
    XYZ[2] = 0.9, 0.1, 0.0
    wanted = srgb_decode(np.clip(profile.to_codes(XYZ), 0, 1))
    np.testing.assert_allclose(_emitted(profile, XYZ), wanted, atol=1e-4)


def test_a_group_goes_away_with_its_tables(simulated_profile: Simulated) -> None:
    before = len(bpy.data.images)
    tree = display_group(simulated_profile("channel-lut-corrected"), "display")
    assert len(bpy.data.images) == before + 2
    remove_group(tree)
    assert len(bpy.data.images) == before
    assert not bpy.data.node_groups
