"""Solids with flat faces. UVs are 0..1 on every face of four corners."""

from __future__ import annotations

from itertools import product

import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.shapes.mesh import Mesh, Size

_QUAD_UVS = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
_TRIANGLE_UVS = [[0.0, 0.0], [1.0, 0.0], [0.5, 1.0]]
# Chamfer of the cube's edges as a share of its shortest side: enough to catch the light.
_CHAMFER = 0.04


def plane(size: Size) -> Mesh:
    """A rectangle facing up; its height is not used."""
    x, y = size[0] / 2, size[1] / 2
    vertices = np.array([[-x, -y, 0], [x, -y, 0], [x, y, 0], [-x, y, 0]])
    return _flat(vertices, ((0, 1, 2, 3),))


def box(size: Size) -> Mesh:
    """A cuboid with sharp edges."""
    x, y, z = size[0] / 2, size[1] / 2, size[2]
    vertices = np.array([[i, j, k] for k in (0, z) for j in (-y, y) for i in (-x, x)], dtype=np.float64)
    faces = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
    return _flat(vertices, faces)


def cube(size: Size) -> Mesh:
    """A cuboid with chamfered edges, as a sanded wooden block has.

    Each of the eight corners becomes three vertices, one on each of the faces that met there.
    """
    half = np.asarray(size) / 2
    inset = half - _CHAMFER * min(size)
    corners = list(product((-1, 1), repeat=3))
    vertices = np.array(
        [[s * (half if i == a else inset)[i] for i, s in enumerate(c)] for c in corners for a in range(3)]
    )
    index = {(corner, axis): 3 * i + axis for i, corner in enumerate(corners) for axis in range(3)}
    sets = [{index[c, a] for c in corners if c[a] == s} for a in range(3) for s in (-1, 1)]
    for a, b in ((0, 1), (0, 2), (1, 2)):
        for s, t in product((-1, 1), repeat=2):
            sets.append({index[c, axis] for c in corners if (c[a], c[b]) == (s, t) for axis in (a, b)})
    sets += [{index[c, a] for a in range(3)} for c in corners]
    faces = tuple(_wound(vertices, sorted(each)) for each in sets)
    return _flat(vertices + np.array([0, 0, half[2]]), faces)


def prism(size: Size) -> Mesh:
    """A triangular prism lying on a rectangular face, its triangles in front and behind."""
    x, y, z = size[0] / 2, size[1] / 2, size[2]
    vertices = np.array([[-x, -y, 0], [x, -y, 0], [0, -y, z], [-x, y, 0], [x, y, 0], [0, y, z]])
    return _flat(vertices, ((0, 1, 2), (4, 3, 5), (0, 3, 4, 1), (1, 4, 5, 2), (3, 0, 2, 5)))


def pyramid(size: Size) -> Mesh:
    """A pyramid on a rectangular base."""
    x, y, z = size[0] / 2, size[1] / 2, size[2]
    vertices = np.array([[-x, -y, 0], [x, -y, 0], [x, y, 0], [-x, y, 0], [0, 0, z]])
    return _flat(vertices, ((3, 2, 1, 0), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)))


def _flat(vertices: Float64Array, faces: tuple[tuple[int, ...], ...]) -> Mesh:
    uvs = [uv for face in faces for uv in (_QUAD_UVS if len(face) == 4 else _TRIANGLE_UVS)]
    return Mesh(np.asarray(vertices, dtype=np.float64), faces, np.array(uvs))


def _wound(vertices: Float64Array, face: list[int]) -> tuple[int, ...]:
    """The corners of a flat face of a convex solid about the origin, counter-clockwise from outside."""
    points = vertices[face]
    normal = np.cross(points[1] - points[0], points[2] - points[0])
    normal *= np.sign(normal @ points[0]) / np.linalg.norm(normal)
    spokes = points - points.mean(axis=0)
    angles = np.arctan2(np.cross(spokes[0], spokes) @ normal, spokes @ spokes[0])
    return tuple(face[i] for i in np.argsort(angles))
