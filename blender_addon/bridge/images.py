"""Arrays of colours as Blender images."""

from __future__ import annotations

import bpy
import numpy as np

from spectral_core.arrays import Float32Array


def new_image(name: str, pixels: Float32Array) -> bpy.types.Image:
    """A float image of linear RGB (height, width, 3) from the top row; kept in the file although nothing uses it yet.

    Full precision: Blender's half floats would move an 8-bit level by a tenth.
    """
    height, width, _ = pixels.shape
    image = bpy.data.images.new(name, width, height, float_buffer=True, is_data=True)
    image.use_half_precision = False
    image.use_fake_user = True
    write_image(image, pixels)
    return image


def write_image(image: bpy.types.Image, pixels: Float32Array) -> None:
    """Fill an image with linear RGB (height, width, 3) from the top row."""
    height, width, _ = pixels.shape
    rgba = np.ones((height, width, 4), dtype=np.float32)
    rgba[..., :3] = pixels[::-1]  # Blender's rows run from the bottom
    image.pixels.foreach_set(rgba.ravel())
    image.update()
    image.pack()  # generated pixels are lost on saving otherwise
