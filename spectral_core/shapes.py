"""Geometry of the scene's shapes as arrays. Each stands on z = 0, centred on x = y = 0; metres."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from spectral_core.arrays import Float64Array

Size = tuple[float, float, float]


@dataclass(frozen=True)
class Mesh:
    """A polygon mesh.

    Attributes
    ----------
    vertices
        (n, 3).
    faces
        Vertex indices per face, counter-clockwise from outside.
    uvs
        (corners, 2), one per corner of each face in order, v up.
    smooth
        Whether normals are interpolated.
    """

    vertices: Float64Array
    faces: tuple[tuple[int, ...], ...]
    uvs: Float64Array
    smooth: bool = False


def build_mesh(shape: str, size: Size) -> Mesh:
    """The mesh of a shape with bounding box `size` (x, y, z)."""
    return SHAPES[shape](size)


def rotation_matrix(rotation_deg: tuple[float, float, float]) -> Float64Array:
    """(3, 3) of Euler angles in Blender's XYZ order: about x first."""
    x, y, z = np.radians(rotation_deg)
    about_x = np.array([[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]])
    about_y = np.array([[np.cos(y), 0, np.sin(y)], [0, 1, 0], [-np.sin(y), 0, np.cos(y)]])
    about_z = np.array([[np.cos(z), -np.sin(z), 0], [np.sin(z), np.cos(z), 0], [0, 0, 1]])
    return np.asarray(about_z @ about_y @ about_x)


def _plane(size: Size) -> Mesh:
    """A rectangle facing up; its height is not used."""
    x, y = size[0] / 2, size[1] / 2
    vertices = np.array([[-x, -y, 0], [x, -y, 0], [x, y, 0], [-x, y, 0]])
    return Mesh(vertices, ((0, 1, 2, 3),), np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]]))


def _box(size: Size) -> Mesh:
    x, y, z = size[0] / 2, size[1] / 2, size[2]
    vertices = np.array([[i, j, k] for k in (0, z) for j in (-y, y) for i in (-x, x)], dtype=np.float64)
    faces = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
    return Mesh(vertices, faces, np.tile([[0.0, 0], [1, 0], [1, 1], [0, 1]], (6, 1)))


SHAPES: dict[str, Callable[[Size], Mesh]] = {"plane": _plane, "box": _box}
