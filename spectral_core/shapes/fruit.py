"""Fruit: profiles swept round their axis, with the lobes, dimples and tips that tell them apart.

Proportions are drawn by eye after common cultivars. Each is fitted into the bounding box it is
asked for, so real sizes stand in the scene.
"""

from __future__ import annotations

import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.shapes.mesh import Mesh, Size, fitted
from spectral_core.shapes.revolution import latitudes, longitudes, swept

_STEM_RINGS, _STEM_SEGMENTS = 12, 12
_SEPALS = 5


def lemon(size: Size) -> Mesh:
    """A lemon lying along x: pointed at both ends, the blossom end (-x) with the larger nipple."""
    angle = latitudes()
    along = np.sin(angle)
    body = np.cos(angle) ** 1.2
    height = 1.22 * along - 0.26 * _bump(along, -1, 0.045) + 0.10 * _bump(along, 1, 0.03)
    return swept(np.stack([body, height], axis=1), size, swell=_irregular(0.018, 3), axis="x")


def tomato(size: Size) -> Mesh:
    """A beef tomato: flat, with lobes that fade from the stem's dimple towards the blossom end."""
    angle = latitudes()
    along = np.sin(angle)
    height = 0.62 * along - 0.20 * _bump(along, 1, 0.10) + 0.05 * _bump(along, -1, 0.10)
    shoulder = np.clip((along + 0.5) / 1.5, 0, 1)[:, None] ** 1.5
    lobes = np.abs(np.cos(longitudes() * _SEPALS / 2 + 0.4)) ** 0.6 - 0.66
    swell = _irregular(0.02, 5) + 0.20 * shoulder * lobes * np.cos(angle)[:, None] ** 0.5
    lift = 0.16 * shoulder**2 * lobes * np.cos(angle)[:, None]
    return swept(np.stack([np.cos(angle) ** 0.85, height], axis=1), size, swell=swell, lift=lift)


def apple(size: Size) -> Mesh:
    """An apple: broadest above the middle, a deep cavity for the stem, five bumps at the calyx."""
    angle = latitudes()
    along = np.sin(angle)
    width = np.cos(angle) * (1 + 0.12 * along)
    height = 0.95 * along - 0.34 * _bump(along, 1, 0.07) + 0.20 * _bump(along, -1, 0.05)
    low = np.clip(-along, 0, 1)[:, None] ** 3
    lobes = np.cos(longitudes() * _SEPALS)
    swell = _irregular(0.015, 7) + 0.04 * low * lobes * np.cos(angle)[:, None]
    return swept(
        np.stack([width, height], axis=1), size, swell=swell, lift=-0.03 * low * lobes * np.cos(angle)[:, None]
    )


def orange(size: Size) -> Mesh:
    """An orange: a sphere slightly flattened, with a shallow dimple at the stem."""
    angle = latitudes()
    along = np.sin(angle)
    height = 0.97 * along - 0.09 * _bump(along, 1, 0.06) + 0.04 * _bump(along, -1, 0.03)
    return swept(np.stack([np.cos(angle), height], axis=1), size, swell=_irregular(0.008, 11))


def stem(size: Size) -> Mesh:
    """A woody stalk, bent towards +x, thicker at the top where it was picked."""
    t = np.linspace(0, 1, _STEM_RINGS + 1)
    radius = 0.5 * (0.75 - 0.5 * t + 0.8 * t**3)
    bend = 1.2 * t**2
    return _tube(radius, np.stack([bend, np.zeros_like(t), 6 * t], axis=1), size)


def calyx(size: Size) -> Mesh:
    """A tomato's green star: five curled sepals about a short stalk, one closed surface.

    A globe whose equator is drawn out into the sepals, thin everywhere but at the stalk; the
    sepals rise from the dimple and fall again towards their tips.
    """
    angle = latitudes()
    along = np.sin(angle)
    turn = longitudes()
    petal = np.abs(np.cos(turn * _SEPALS / 2))
    reach = np.cos(angle)[:, None] * (0.16 + 0.84 * petal[None] ** 3)
    arch = 1.2 * reach * (1 - reach) + 0.25 * reach**3
    thickness = 0.03 * along[:, None] * (1 - 0.5 * reach)
    stalk = 0.60 * np.exp(-((reach / 0.10) ** 4)) * (along[:, None] > 0)
    surface = swept(
        np.stack([np.ones_like(angle), np.zeros_like(angle)], axis=1), (2.0, 2.0, 1.0), reach, arch + thickness + stalk
    )
    return Mesh(fitted(surface.vertices, size), surface.faces, surface.uvs, smooth=True)


def _bump(along: Float64Array, pole: int, width: float) -> Float64Array:
    """A smooth bump at a pole: 1 at ``along == pole``, falling within `width`."""
    return np.asarray(np.exp(-(((along - pole) / width) ** 2) * 0.5))


def _irregular(amount: float, seed: int) -> Float64Array:
    """(rings, segments) factors about 1 that make a surface of revolution less perfect.

    Two low waves round the axis, gone at the poles so that the surface stays smooth there.
    """
    turn = longitudes()[None]
    angle = latitudes()[:, None]
    waves = np.cos(2 * turn + seed + np.sin(angle)) + 0.6 * np.cos(3 * turn + 2.3 * seed - 2 * np.sin(angle))
    return np.asarray(1 + amount * np.cos(angle) * waves)


def _tube(radius: Float64Array, centres: Float64Array, size: Size) -> Mesh:
    """A closed tube of rings (n,) about centres (n, 3), fitted into `size`; u round, v along."""
    turn = np.arange(_STEM_SEGMENTS) * (2 * np.pi / _STEM_SEGMENTS)
    circle = np.stack([np.cos(turn), np.sin(turn), np.zeros_like(turn)], axis=1)
    vertices = (centres[:, None] + radius[:, None, None] * circle).reshape(-1, 3)
    rings, n = len(radius) - 1, _STEM_SEGMENTS
    faces: list[tuple[int, ...]] = []
    uvs: list[list[float]] = []
    for r in range(rings):
        for s in range(n):
            faces.append((r * n + s, r * n + (s + 1) % n, (r + 1) * n + (s + 1) % n, (r + 1) * n + s))
            uvs += [[(s + i) / n, (r + j) / rings] for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))]
    for cap in (tuple(reversed(range(n))), tuple(rings * n + s for s in range(n))):
        faces.append(cap)
        uvs += (0.5 + 0.5 * circle[np.array(cap) % n, :2]).tolist()
    return Mesh(fitted(vertices, size), tuple(faces), np.array(uvs), smooth=True)
