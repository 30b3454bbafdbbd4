"""Hyperspectral textures as images of a Blender file."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest

import blender_addon
from spectral_core.baking import bake_to_memory
from spectral_core.lights import Light
from spectral_core.textures import open_texture

NM = np.arange(400.0, 701.0, 10)


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    cube = np.random.default_rng(0).random((40, 30, len(NM)), dtype=np.float32)
    np.savez(tmp_path / "leaf.npz", reflectance=cube, wavelengths_nm=NM)
    return tmp_path / "leaf.npz"


def test_a_texture_becomes_one_image_per_light(capture: Path) -> None:
    assert bpy.ops.spectral_booth.bake_texture(filepath=str(capture), lights="D65; A") == {"FINISHED"}
    exact = bake_to_memory(open_texture(capture), [Light.builtin("D65"), Light.builtin("A")]).images
    for name, expected in zip(("D65", "A"), exact, strict=True):
        image = bpy.data.images[f"leaf under {name}"]
        assert image.is_float
        assert image.packed_file is not None
        pixels = np.empty(40 * 30 * 4, dtype=np.float32)
        image.pixels.foreach_get(pixels)
        np.testing.assert_array_equal(pixels.reshape(40, 30, 4)[::-1, :, :3], expected)


def test_the_image_menu_offers_it() -> None:
    """A menu's own list of what others added to it; once, and gone when the add-on is."""
    added = [each.__module__ for each in bpy.types.IMAGE_MT_image._dyn_ui_initialize()]
    assert added.count("blender_addon.ui.menus") == 1
    blender_addon.unregister()
    try:
        added = [each.__module__ for each in bpy.types.IMAGE_MT_image._dyn_ui_initialize()]
        assert "blender_addon.ui.menus" not in added
    finally:
        blender_addon.register()


def test_counts_are_refused_in_one_line(capture: Path, tmp_path: Path) -> None:
    np.save(tmp_path / "raw.npy", np.ones((4, 5, 2), dtype=np.uint16))
    (tmp_path / "raw.wavelengths.csv").write_text("500\n600\n")
    with pytest.raises(RuntimeError, match="--white"):
        bpy.ops.spectral_booth.bake_texture(filepath=str(tmp_path / "raw.npy"))
    with pytest.raises(RuntimeError, match="no texture was named"):
        bpy.ops.spectral_booth.bake_texture()
    assert len(bpy.data.images) == 0
    assert bpy.ops.spectral_booth.bake_texture(filepath=str(tmp_path / "raw.npy"), scale=4.0) == {"FINISHED"}
    image = bpy.data.images["raw under D65"]
    # A grey of a quarter: the white point of D65 in sRGB to 1e-4.
    np.testing.assert_allclose(image.pixels[:3], 0.25, atol=1e-4)
