"""Gamuts of displays: chromaticity triangles, how much of each other they cover, and volume in CIELAB."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from spectral_core import standards
from spectral_core.arrays import Float64Array
from spectral_core.chromaticities import XYZ_to_xy

# Steps along each edge of the cube of codes; the volume of sRGB then changes by less than 0.1 %.
_STEPS = 32
# What spaces the codes evenly in lightness, about; the volume does not depend on it.
_EVEN_GAMMA = 2.4


@dataclass(frozen=True)
class Coverage:
    """How a gamut compares with a reference in a diagram, as fractions of the reference's area.

    Attributes
    ----------
    covered
        Of the intersection, at most 1.
    area
        Of the whole gamut, inside the reference or not.
    """

    covered: float
    area: float


def reference_xy(gamut: str) -> Float64Array:
    """Chromaticities (3, 2) of the primaries of one of `standards.GAMUTS`."""
    return XYZ_to_xy(standards.rgb_to_XYZ_matrix(gamut).T)


def coverage(gamut: Float64Array, reference: Float64Array) -> Coverage:
    """Of two triangles (3, 2) in the same diagram."""
    whole = area(reference)
    return Coverage(area(_intersection(gamut, reference)) / whole, area(gamut) / whole)


def area(corners: Float64Array) -> float:
    """Of a polygon (n, 2) by its corners in order; 0 for fewer than three."""
    if len(corners) < 3:
        return 0.0
    x, y = corners.T
    return float(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2)


def volume(forward: Callable[[Float64Array], Float64Array], white_XYZ: Float64Array) -> float:
    """Volume in CIELAB, relative to a white XYZ (3,), of the colours that codes 0..1 give.

    The surface of the cube of codes is mapped and the divergence theorem applied to its triangles.
    """
    faces = [_face_volume(forward, white_XYZ, axis, side) for axis in range(3) for side in (0.0, 1.0)]
    # Green and blue turn the other way in CIELAB than in the cube of codes.
    return abs(sum(faces))


@cache
def reference_volume(gamut: str) -> float:
    """Volume in CIELAB of one of `standards.GAMUTS`, relative to its own white, D65."""
    matrix = standards.rgb_to_XYZ_matrix(gamut)
    return volume(lambda codes: np.asarray(codes**_EVEN_GAMMA @ matrix.T), matrix.sum(axis=1))


def _intersection(polygon: Float64Array, convex: Float64Array) -> Float64Array:
    """A convex polygon (n, 2) cut by the sides of another (Sutherland and Hodgman 1974)."""
    centre = convex.mean(axis=0)
    for start, end in zip(convex, np.roll(convex, -1, axis=0), strict=True):
        normal = np.array([start[1] - end[1], end[0] - start[0]])
        normal = normal * np.sign((centre - start) @ normal)
        polygon = _cut(polygon, (polygon - start) @ normal)
    return polygon


def _cut(polygon: Float64Array, height: Float64Array) -> Float64Array:
    """The part of a polygon (n, 2) whose corners' heights (n,) above a line are not negative."""
    kept = []
    after = np.roll(polygon, -1, axis=0), np.roll(height, -1)
    for here, there, low, high in zip(polygon, after[0], height, after[1], strict=True):
        if low >= 0:
            kept.append(here)
        if low * high < 0:
            kept.append(here + (there - here) * low / (low - high))
    return np.array(kept).reshape(-1, 2)


def _face_volume(
    forward: Callable[[Float64Array], Float64Array], white_XYZ: Float64Array, axis: int, side: float
) -> float:
    """Signed volume between the origin of CIELAB and one face of the cube: where one code is 0 or 1."""
    steps = np.linspace(0.0, 1.0, _STEPS + 1)
    face = np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1)
    codes = np.insert(face, axis, side, axis=-1)
    Lab = standards.XYZ_to_Lab(forward(codes.reshape(-1, 3)), white_XYZ).reshape(codes.shape)
    a, b, c, d = Lab[:-1, :-1], Lab[1:, :-1], Lab[1:, 1:], Lab[:-1, 1:]
    outward = (1 if side else -1) * (-1) ** axis
    return float(outward * ((a * np.cross(b, c)).sum() + (a * np.cross(c, d)).sum()) / 6)
