"""The patch player's stage: its pixels are the codes, and the file is afterwards as before.

Playing itself needs a window: tests/app.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np
import OpenImageIO
import pytest

from blender_addon.bridge import patches
from spectral_core.errors import BlenderError

# Black, white, both sides of the curve's join at 0.04045, primaries and mixtures.
CODES = np.array(
    [
        [0.0, 0.0, 0.0],
        [1.0, 1.0, 1.0],
        [8 / 255, 10 / 255, 12 / 255],
        [1.0, 0.0, 0.0],
        [0.25, 0.5, 0.75],
        [200 / 255, 17 / 255, 90 / 255],
    ]
)


def _rendered(scene: bpy.types.Scene, path: Path) -> np.ndarray:
    """The picture (height, width, 3) that the stage gives through its own view, 0..1."""
    scene.render.resolution_x = scene.render.resolution_y = 64
    scene.render.filepath = str(path)
    image = scene.render.image_settings
    image.file_format, image.color_mode, image.color_depth = "PNG", "RGB", "16"
    bpy.ops.render.render(write_still=True, scene=scene.name)
    pixels = OpenImageIO.ImageBuf(str(path)).get_pixels(OpenImageIO.FLOAT)
    return np.asarray(pixels)


def _names() -> dict[str, list[str]]:
    kinds = ("scenes", "objects", "meshes", "cameras", "materials", "worlds", "collections", "images", "texts")
    return {kind: sorted(each.name for each in getattr(bpy.data, kind)) for kind in kinds}


def test_a_pixel_of_the_capsule_is_the_code(tmp_path: Path) -> None:
    with patches.staged(bpy.context.scene, width_deg=20, surround=False) as scene:
        for code in CODES:
            patches.show(scene, code)
            picture = _rendered(scene, tmp_path / "patch.png")
            # Eevee's pixels are half floats, cut off, not rounded: a step is at most 2**-10 of the linear
            # value, 2**-10 / 2.4 of the code, a tenth of an 8-bit level; half a level of 16 bits on top.
            np.testing.assert_allclose(picture[24:40, 24:40], np.broadcast_to(code, (16, 16, 3)), atol=4.2e-4)
            assert picture[0, 0].max() == 0  # black round it


def test_the_capsule_stands_in_the_middle_and_has_the_width_that_was_asked(tmp_path: Path) -> None:
    with patches.staged(bpy.context.scene, width_deg=20, surround=False) as scene:
        patches.show(scene, np.ones(3))
        seen = _rendered(scene, tmp_path / "patch.png")[..., 1] > 0.5
    rows, columns = np.nonzero(seen)
    # The camera sees 40 degrees: tan(10) / tan(20) of the picture's 64 pixels, 31.0. The cylinder is
    # nearer than its axis, which makes it up to 2 % wider.
    assert np.ptp(columns) + 1 == pytest.approx(64 * np.tan(np.pi / 18) / np.tan(np.pi / 9), abs=1.5)
    assert (columns.mean(), rows.mean()) == pytest.approx((31.5, 31.5), abs=0.5)
    assert np.ptp(rows) > 1.3 * np.ptp(columns)


def test_a_user_who_looks_elsewhere_sees_the_capsule_in_the_middle(tmp_path: Path) -> None:
    with patches.staged(bpy.context.scene, width_deg=20, surround=False) as scene:
        patches.show(scene, np.ones(3))
        camera = scene.camera
        camera.location, camera.rotation_euler = (3.0, 2.0, 1.0), (1.1, 0.4, -2.0)
        bpy.context.view_layer.update()
        patches.place(scene, camera.location, camera.rotation_euler.to_quaternion())
        seen = _rendered(scene, tmp_path / "patch.png")[..., 1] > 0.5
    rows, columns = np.nonzero(seen)
    assert (columns.mean(), rows.mean()) == pytest.approx((31.5, 31.5), abs=0.5)
    assert np.ptp(rows) > 1.3 * np.ptp(columns)  # upright


@pytest.mark.parametrize("surround", [False, True])
def test_the_file_is_as_before(chart: bpy.types.Scene, surround: bool, tmp_path: Path) -> None:
    chart.view_settings.view_transform = "AgX"
    before, shown, dither = _names(), bpy.context.window.scene.name, chart.render.dither_intensity
    objects = [each.name for each in chart.objects]
    with patches.staged(chart, width_deg=20, surround=surround) as scene:
        patches.show(scene, np.array([0.5, 0.2, 0.1]))
        assert (set(objects) <= {each.name for each in scene.objects}) is surround
        assert [each.name for each in chart.objects] == objects
    assert (_names(), bpy.context.window.scene.name, chart.render.dither_intensity) == (before, shown, dither)
    assert chart.view_settings.view_transform == "AgX"


def test_it_is_as_before_after_an_error_too(chart: bpy.types.Scene) -> None:
    before = _names()
    with pytest.raises(RuntimeError, match="half-way"), patches.staged(chart, width_deg=20, surround=True):
        raise RuntimeError("half-way")
    assert _names() == before


def test_in_a_booth_the_capsule_stands_at_its_centre_seen_from_its_viewpoint(
    shrunk: Callable[[str], str], tmp_path: Path
) -> None:
    from spectral_core.scene import bundled_scene, load_scene

    path = tmp_path / "booth.toml"
    text = bundled_scene("booth").read_text(encoding="utf-8")
    path.write_text(re.sub(r"\[\[objects\]\].*?name = \"fruit.*", "", shrunk(text), flags=re.DOTALL), encoding="utf-8")
    assert bpy.ops.spectral_booth.build(filepath=str(path), calibrate=False) == {"FINISHED"}
    camera = load_scene(path).camera
    with patches.staged(bpy.context.scene, width_deg=10, surround=True) as scene:
        capsule = next(each for each in scene.collection.objects if patches.KEY in each and each.type == "MESH")
        assert tuple(capsule.matrix_world.translation) == pytest.approx(camera.target, abs=1e-6)
        assert tuple(scene.camera.matrix_world.translation) == pytest.approx(camera.location, abs=1e-6)


def test_a_file_in_another_working_space_is_refused() -> None:
    if not hasattr(bpy.data, "colorspace"):
        pytest.skip("this Blender has one working space")
    bpy.ops.wm.set_working_color_space(working_space="Linear Rec.2020", convert_colors=False)
    try:
        before = _names()
        with (
            pytest.raises(BlenderError, match=r"works in Linear Rec\.2020"),
            patches.staged(bpy.context.scene, 20, False),
        ):
            pass
        assert _names() == before
    finally:
        bpy.ops.wm.set_working_color_space(working_space="Linear Rec.709", convert_colors=False)


def test_playing_in_the_background_says_what_it_needs(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="shown in a window or a headset"):
        bpy.ops.spectral_booth.play_patches(folder=str(tmp_path))
    assert list(tmp_path.iterdir()) == []
