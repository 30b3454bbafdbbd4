"""What a scene's shaders read live: custom properties of the scene, through View Layer attributes.

One write changes every material at once, whatever their number: no material is touched, no shader compiled.
Each property is four numbers, because a shader searches its list of them for every one that it reads.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import numpy as np

from spectral_core.arrays import Float64Array

PREFIX = "spectral_booth_live_"
# Colour of neutral gloss relative to the lamps; white unless the light is in the materials.
GLOSS = f"{PREFIX}gloss"
# 1 where surfaces are spectral, 0 where they are RGB (levels 0 and 1).
SPECTRAL = f"{PREFIX}spectral"


def quad(channel: int, row: int, index: int) -> str:
    """Four of the K numbers in a row of a channel's matrix."""
    return f"{PREFIX}{channel}{'xyz'[row]}{index}"


def lamp_rgb(channel: int) -> str:
    """RGB of the lamps of a channel at levels 0 and 1."""
    return f"{PREFIX}lamp{channel}"


def white_XYZ(channel: int) -> str:
    """XYZ of the perfect diffuser under a channel."""
    return f"{PREFIX}white{channel}"


def set_vector(scene: bpy.types.Scene, name: str, values: Float64Array) -> None:
    """Up to four numbers."""
    four = np.zeros(4)
    four[: len(values)] = values
    scene[name] = four.tolist()


def set_matrix(scene: bpy.types.Scene, channel: int, matrix: Float64Array) -> None:
    """A channel's matrix (3, K)."""
    for row, numbers in enumerate(matrix):
        for index in range(0, len(numbers), 4):
            set_vector(scene, quad(channel, row, index // 4), numbers[index : index + 4])


def show(scene: bpy.types.Scene) -> None:
    """Have what was set drawn.

    Setting any of the scene's own properties, even to what it is, evaluates the scene and nothing else;
    `update_tag` evaluates all its objects too, and has their shadows drawn anew.
    """
    scene.eevee.taa_samples = scene.eevee.taa_samples


def matrix(scene: bpy.types.Scene, channel: int, quads: int) -> Float64Array:
    """A channel's matrix (3, 4 * quads) as the shaders read it: float32."""
    rows = [[tuple(scene[quad(channel, row, index)]) for index in range(quads)] for row in range(3)]
    return np.array(rows, dtype=np.float32).reshape(3, 4 * quads).astype(np.float64)


def forget(scene: bpy.types.Scene) -> None:
    """Remove all of them."""
    for name in [each for each in scene.keys() if each.startswith(PREFIX)]:  # noqa: SIM118 (a scene is no dictionary)
        del scene[name]


@contextmanager
def white_gloss(scene: bpy.types.Scene) -> Iterator[None]:
    """Gloss of the lamps' own colour for the block."""
    kept = tuple(scene[GLOSS])
    set_vector(scene, GLOSS, np.ones(3))
    try:
        yield
    finally:
        set_vector(scene, GLOSS, np.array(kept))
