"""The polygon mesh every shape is, and the helpers that all shapes share."""

from __future__ import annotations

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


def rotation_matrix(rotation_deg: tuple[float, float, float]) -> Float64Array:
    """(3, 3) of Euler angles in Blender's XYZ order: about x first."""
    x, y, z = np.radians(rotation_deg)
    about_x = np.array([[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]])
    about_y = np.array([[np.cos(y), 0, np.sin(y)], [0, 1, 0], [-np.sin(y), 0, np.cos(y)]])
    about_z = np.array([[np.cos(z), -np.sin(z), 0], [np.sin(z), np.cos(z), 0], [0, 0, 1]])
    return np.asarray(about_z @ about_y @ about_x)


def fitted(vertices: Float64Array, size: Size) -> Float64Array:
    """Vertices (n, 3) stretched into the bounding box `size`, standing on z = 0, centred in x and y."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    unit = (vertices - low) / (high - low)
    return np.asarray((unit - [0.5, 0.5, 0.0]) * np.asarray(size))
