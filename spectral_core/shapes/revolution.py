"""Smooth shapes swept round an axis, with the UVs of a globe.

u runs round the axis and v from the lower pole (0) to the upper (1), so that a texture made for
the sphere (see `spectral_core.textures.synthetic.pigments`) fits them all. Vertices along the seam are
shared: normals run on across it, only the UVs of its corners differ.
"""

from __future__ import annotations

import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.shapes.mesh import Mesh, Size, fitted

RINGS, SEGMENTS = 64, 96
# A renderer that repeats an image blends its top and bottom rows at v = 0 and 1. Poles stay half
# a pixel of an image of 256 rows inside.
_POLE_MARGIN = 0.5 / 256


def sphere(size: Size) -> Mesh:
    """An ellipsoid."""
    angle = latitudes()
    return swept(np.stack([np.cos(angle), np.sin(angle)], axis=1), size)


def capsule(size: Size) -> Mesh:
    """A standing cylinder with a half ellipsoid at each end; a sphere if it is no higher than wide."""
    angle = latitudes()
    straight = max(size[2] / size[0] - 1.0, 0.0)
    height = np.sin(angle) + np.sign(np.round(angle, 12)) * straight
    return swept(np.stack([np.cos(angle), height], axis=1), size)


def latitudes() -> Float64Array:
    """(RINGS + 1,) angles from the lower pole, -pi/2, to the upper, pi/2."""
    return np.linspace(-np.pi / 2, np.pi / 2, RINGS + 1)


def longitudes() -> Float64Array:
    """(SEGMENTS,) angles round the axis."""
    return np.arange(SEGMENTS) * (2 * np.pi / SEGMENTS)


def swept(
    profile: Float64Array,
    size: Size,
    swell: Float64Array | None = None,
    lift: Float64Array | None = None,
    axis: str = "z",
) -> Mesh:
    """A closed surface swept round an axis and fitted into `size`.

    Parameters
    ----------
    profile
        (RINGS + 1, 2), distance from the axis and height, from the lower pole to the upper.
    size
        Bounding box (x, y, z).
    swell
        (RINGS + 1, SEGMENTS), factor of the distance from the axis: lobes and irregularities.
    lift
        (RINGS + 1, SEGMENTS), added to the height.
    axis
        ``z`` standing, ``x`` lying.
    """
    angle = longitudes()
    distance = profile[:, :1] * (1.0 if swell is None else swell) * np.ones(SEGMENTS)
    height = profile[:, 1:] + (0.0 if lift is None else lift) + np.zeros(SEGMENTS)
    points = np.stack([distance * np.cos(angle), distance * np.sin(angle), height], axis=-1)
    vertices = np.concatenate([points[:1, 0], points[1:-1].reshape(-1, 3), points[-1:, 0]])
    if axis == "x":
        vertices = vertices[:, [2, 0, 1]]
    faces, uvs = _globe(len(profile) - 1, SEGMENTS)
    return Mesh(fitted(vertices, size), faces, uvs, smooth=True)


def _globe(rings: int, segments: int) -> tuple[tuple[tuple[int, ...], ...], Float64Array]:
    """Faces and UVs (corners, 2) of a globe whose vertices run pole, rings, pole."""

    def vertex(ring: int, segment: int) -> int:
        if ring == 0:
            return 0
        if ring == rings:
            return 1 + (rings - 1) * segments
        return 1 + (ring - 1) * segments + segment % segments

    def uv(ring: int, segment: float) -> tuple[float, float]:
        return segment / segments, float(np.clip(ring / rings, _POLE_MARGIN, 1 - _POLE_MARGIN))

    faces: list[tuple[int, ...]] = []
    uvs: list[tuple[float, float]] = []
    for r in range(rings):
        for s in range(segments):
            if r == 0:  # A pole has no longitude: the triangle's middle.
                corners: list[tuple[int, float]] = [(0, s + 0.5), (1, s + 1), (1, s)]
            elif r == rings - 1:
                corners = [(r, s), (r, s + 1), (r + 1, s + 0.5)]
            else:
                corners = [(r, s), (r, s + 1), (r + 1, s + 1), (r + 1, s)]
            faces.append(tuple(vertex(ring, int(segment)) for ring, segment in corners))
            uvs.extend(uv(*corner) for corner in corners)
    return tuple(faces), np.array(uvs)
