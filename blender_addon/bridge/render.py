"""Render a scene and get its pixels back as an array."""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from spectral_core.arrays import Float32Array
from spectral_core.display.export import XYZ_VIEW
from spectral_core.errors import BlenderError
from spectral_core.files import atomic_path

from . import state

# The mean distance of adults' pupils (Dodgson 2004).
INTEROCULAR_M = 0.063


@dataclass(frozen=True)
class Rendered:
    """Scene-linear pixels (height, width, 3) from the top row, and how long they took."""

    pixels: Float32Array
    seconds: float


def render_linear(scene: bpy.types.Scene) -> Rendered:
    """Render to 32-bit OpenEXR and read it back: scene-linear, no view transform."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "render.exr"
        started = time.perf_counter()
        with _output(scene, path, "OPEN_EXR", "32"):
            _render(scene)
        seconds = time.perf_counter() - started
        return Rendered(_read(path), seconds)


def render_png(scene: bpy.types.Scene, path: Path, stereo: bool = False) -> float:
    """Render to an 8-bit PNG through the scene's view transform; returns the seconds it took.

    With `stereo` both eyes side by side, left eye left, converging where the camera looks.
    """
    kept, view = scene.spectral_booth, scene.view_settings.view_transform
    if kept.is_managed and kept.target == "WIDE" and view != XYZ_VIEW:
        raise BlenderError(
            f"surfaces emit XYZ, which the view '{view}' does not show",
            remedy=f"start Blender with an exported config and its view '{XYZ_VIEW}', or choose the target Window",
        )
    started = time.perf_counter()
    with atomic_path(path) as temporary, _output(scene, temporary, "PNG", "8"), _both_eyes(scene, stereo):
        _render(scene)
    return time.perf_counter() - started


def save_shown(scene: bpy.types.Scene, path: Path) -> Float32Array:
    """Codes (height, width, 3) of the last render through the scene's display, from a 16-bit PNG at `path`."""
    with _output(scene, path, "PNG", "16"):
        bpy.data.images["Render Result"].save_render(str(path), scene=scene)
    return _read(path)


@contextmanager
def _both_eyes(scene: bpy.types.Scene, stereo: bool) -> Iterator[None]:
    if not stereo:
        yield
        return
    image, eyes = scene.render.image_settings, scene.camera.data.stereo
    kept = (scene.render.use_multiview, scene.render.views_format, eyes.interocular_distance, eyes.convergence_distance)
    scene.render.use_multiview, scene.render.views_format = True, "STEREO_3D"
    image.views_format = "STEREO_3D"
    image.stereo_3d_format.display_mode = "SIDEBYSIDE"
    image.stereo_3d_format.use_squeezed_frame = False
    eyes.interocular_distance = INTEROCULAR_M
    # Parallel to what the camera looks at: there the two pictures coincide.
    eyes.convergence_distance = _distance_to_target(scene)
    try:
        yield
    finally:
        scene.render.views_format, eyes.interocular_distance, eyes.convergence_distance = kept[1:]
        scene.render.use_multiview = kept[0]


def _distance_to_target(scene: bpy.types.Scene) -> float:
    camera = state.description(scene).camera
    return math.dist(camera.location, camera.target)


def _render(scene: bpy.types.Scene) -> None:
    if "FINISHED" not in bpy.ops.render.render(write_still=True, scene=scene.name):
        raise BlenderError(f"'{scene.name}' was not rendered", remedy="does the scene have a camera?")


@contextmanager
def _output(scene: bpy.types.Scene, path: Path, file_format: str, depth: str) -> Iterator[None]:
    render, image = scene.render, scene.render.image_settings
    kept = (render.filepath, render.use_file_extension, image.file_format, image.color_depth, image.color_mode)
    render.filepath, render.use_file_extension = str(path), False
    image.file_format, image.color_mode = file_format, "RGB"
    image.color_depth = depth
    try:
        yield
    finally:
        render.filepath, render.use_file_extension, image.file_format = kept[:3]
        image.color_mode = kept[4]
        image.color_depth = kept[3]


def _read(path: Path) -> Float32Array:
    if not path.exists() or not path.stat().st_size:
        raise BlenderError(
            "Blender wrote no image", remedy="is there room in the temporary folder, and a graphics driver?"
        )
    image = bpy.data.images.load(str(path), check_existing=False)
    try:
        image.colorspace_settings.name = "Non-Color"
        width, height = image.size
        pixels = np.empty(width * height * 4, dtype=np.float32)
        image.pixels.foreach_get(pixels)
    finally:
        bpy.data.images.remove(image)
    return np.ascontiguousarray(pixels.reshape(height, width, 4)[::-1, :, :3])
