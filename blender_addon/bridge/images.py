"""Arrays as Blender images; rows run from the top here, from the bottom in Blender."""

from __future__ import annotations

import bpy
import numpy as np

from spectral_core.arrays import Float32Array


def new_image(name: str, pixels: Float32Array) -> bpy.types.Image:
    """A float image of linear RGB (height, width, 3); kept in the file although nothing uses it yet."""
    image = empty_image(name, pixels.shape[1], pixels.shape[0])
    image.use_fake_user = True
    write_image(image, pixels)
    return image


def empty_image(name: str, width: int, height: int, half: bool = False) -> bpy.types.Image:
    """An image of data: four floats a pixel of which each means itself, negative ones too.

    Full precision unless `half`: half floats would move an 8-bit level of a colour by a tenth.
    """
    image = bpy.data.images.new(name, width, height, float_buffer=True, is_data=True, alpha=True)
    image.use_half_precision, image.alpha_mode = half, "CHANNEL_PACKED"
    return image


def write_image(image: bpy.types.Image, pixels: Float32Array) -> None:
    """Fill an image with three or four numbers a pixel (height, width, 3 or 4)."""
    height, width, channels = pixels.shape
    rgba = np.ones((height, width, 4), dtype=np.float32)
    rgba[..., :channels] = pixels[::-1]
    image.pixels.foreach_set(rgba.ravel())
    image.update()
    image.pack()  # generated pixels are lost on saving otherwise


def read_image(image: bpy.types.Image) -> Float32Array:
    """What an image holds: (height, width, 4)."""
    width, height = image.size
    pixels = np.empty(width * height * 4, dtype=np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(height, width, 4)[::-1]
