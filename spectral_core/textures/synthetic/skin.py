"""Patterns on a globe for procedural skins: noise and spots that know no seam and no pole.

Everything is made from directions on the unit sphere, so a map in longitude and latitude wraps
round without a seam and closes at its poles.
"""

from __future__ import annotations

import numpy as np

from spectral_core.arrays import Float32Array

_SPOT_REACH = 2.0  # radii beyond which a spot's Gaussian, below 2 %, is cut off smoothly


def directions(height: int, width: int) -> Float32Array:
    """Unit vectors (height, width, 3) at the centres of a map's pixels, the upper pole (+z) on top."""
    polar = (np.arange(height, dtype=np.float32) + 0.5) * np.float32(np.pi / height)
    turn = (np.arange(width, dtype=np.float32) + 0.5) * np.float32(2 * np.pi / width)
    result = np.empty((height, width, 3), dtype=np.float32)
    result[..., 0] = np.sin(polar)[:, None] * np.cos(turn)
    result[..., 1] = np.sin(polar)[:, None] * np.sin(turn)
    result[..., 2] = np.cos(polar)[:, None]
    return result


def mottle(where: Float32Array, frequency: float, octaves: int, seed: int) -> Float32Array:
    """Cloudy noise (...,) in about -1..1 at directions (..., 3): value noise of Perlin's kind.

    `frequency` is in cells per radius; each octave doubles it and halves its weight.
    """
    total = np.zeros(where.shape[:-1], dtype=np.float32)
    weights = 0.5 ** np.arange(octaves)
    for octave, weight in enumerate(weights / weights.sum()):
        total += np.float32(2 * weight) * (_value_noise(where, frequency * 2**octave, seed + octave) - np.float32(0.5))
    return total


def _value_noise(where: Float32Array, frequency: float, seed: int) -> Float32Array:
    """Random values 0..1 on a cubic lattice, interpolated smoothly."""
    side = int(np.ceil(2 * frequency)) + 2
    lattice = np.random.default_rng(seed).random((side, side, side), dtype=np.float32)
    at = (where + np.float32(1)) * np.float32(frequency)
    cell = at.astype(np.int32)
    t = at - cell
    t = t * t * (3 - 2 * t)
    flat = lattice.reshape(-1)
    start = (cell[..., 0] * side + cell[..., 1]) * side + cell[..., 2]
    total = np.zeros(where.shape[:-1], dtype=np.float32)
    for corner in range(8):
        i, j, k = corner >> 2 & 1, corner >> 1 & 1, corner & 1
        share = (t[..., 0] if i else 1 - t[..., 0]) * (t[..., 1] if j else 1 - t[..., 1])
        total += flat[start + (i * side + j) * side + k] * share * (t[..., 2] if k else 1 - t[..., 2])
    return total


def spots(height: int, width: int, count: int, radius_deg: float, seed: int, spread: float = 0.4) -> Float32Array:
    """Soft round spots (height, width), 0..1: pores, glands, lenticels.

    Centres lie on a jittered Fibonacci lattice: even as in nature, yet without rows. Where spots
    meet the stronger wins.

    Parameters
    ----------
    height, width
        Of the map, in pixels.
    count
        Spots on the whole globe.
    radius_deg
        Mean angular radius at half height or so (the Gaussian's standard deviation).
    seed
        Of all that is random.
    spread
        Largest relative deviation of radius and strength.
    """
    random = np.random.default_rng(seed)
    index = np.arange(count)
    z = np.clip(1 - (2 * index + 1) / count + random.normal(0, 0.6 / count**0.5, count) * 0.5, -1, 1)
    turn = index * (np.pi * (3 - 5**0.5)) + random.normal(0, 0.9 / count**0.5, count)
    polar = np.arccos(z)
    vary = 1 + spread * (2 * random.random((2, count)) - 1)
    result = np.zeros((height, width), dtype=np.float32)
    where = directions(height, width)
    for p, t, size, strength in zip(polar, turn, np.radians(radius_deg) * vary[0], vary[1], strict=True):
        _add_spot(result, where, float(p), float(t), float(size), float(strength) / (1 + spread))
    return result


def _add_spot(
    target: Float32Array, where: Float32Array, polar: float, turn: float, radius: float, strength: float
) -> None:
    """Draw one spot into its own small window only, which widens towards the poles and wraps round."""
    height, width = target.shape
    reach = _SPOT_REACH * radius
    first = max(0, int((polar - reach) / np.pi * height))
    last = min(height, int((polar + reach) / np.pi * height) + 2)
    ring = min(np.sin(max(polar - reach, 0.0)), np.sin(min(polar + reach, np.pi)))
    half = min(width // 2, int(np.ceil(reach / max(ring, 1e-3) / (2 * np.pi) * width)) + 1)
    middle = int(turn / (2 * np.pi) * width)
    columns = np.arange(middle - half, middle + half) % width
    centre = np.array([np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)], dtype=np.float32)
    window = np.ix_(np.arange(first, last), columns)
    squared = (2 - 2 * (where[window] @ centre)) / np.float32(radius**2)
    edge = np.float32(np.exp(-(_SPOT_REACH**2) / 2))
    spot = np.float32(strength) * np.maximum(np.exp(-squared / 2) - edge, 0) / (1 - edge)
    target[window] = np.maximum(target[window], spot)
