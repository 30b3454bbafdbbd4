"""A 3-D table on an even lattice with tetrahedral interpolation, exactly invertible.

Each cell of the lattice is split into six tetrahedra along its diagonal (Sakamoto and Itooka 1981), in
each of which the table is affine. Looking a colour up is then one gather of an affine map; looking it
up backwards is the same with the inverse maps, once its tetrahedron is known. That is found by
walking: solve in a guessed tetrahedron, move to the one where the solution lies, until both agree.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import permutations

import numpy as np

from spectral_core.arrays import Float64Array, FloatArray, IntArray, frozen, in_blocks
from spectral_core.errors import DisplayError

# Cells to look up the inverse's first tetrahedron in: fine enough that most need no step.
_GUESSES = 48
# A walk visits a neighbour or two; these many steps end one that does not settle, far out of gamut.
_STEPS = 40
# A tetrahedron whose volume is smaller than this share of an undistorted one is folded or nearly so.
_SMALLEST_VOLUME = 1e-3
# Comparisons (r > g, g > b, r > b) of the place in a cell give the number of its tetrahedron.
_SLOTS = 8


@dataclass(frozen=True)
class LatticeTable:
    """Colours (n, n, n, 3) at the nodes of an even lattice over 0..1: ``nodes[r, g, b]``.

    Beyond the lattice the outermost tetrahedra continue, so that both directions are defined for all
    real numbers.
    """

    nodes: Float64Array

    def __post_init__(self) -> None:
        nodes = frozen(self.nodes)
        if nodes.ndim != 4 or nodes.shape[3] != 3 or len(set(nodes.shape[:3])) != 1 or not 2 <= len(nodes) <= 129:
            raise DisplayError("a table must be n x n x n x 3 numbers, n from 2 to 129", remedy="correct the profile")
        if not np.isfinite(nodes).all() or np.abs(nodes).max() > 10:
            raise DisplayError("a table holds something that is no device colour", remedy="correct the profile")
        object.__setattr__(self, "nodes", nodes)
        if self._smallest_volume < _SMALLEST_VOLUME:
            raise DisplayError("a table folds onto itself and cannot be inverted", remedy="correct the profile")

    @classmethod
    def unfolded(cls, nodes: Float64Array) -> LatticeTable | None:
        """A table, None if it folded onto itself."""
        try:
            return cls(nodes)
        except DisplayError:
            return None

    @property
    def _smallest_volume(self) -> float:
        """Of all tetrahedra, relative to the undistorted one; not above 0 where the table folds."""
        return float(np.linalg.det(self._maps.T.reshape(-1, 3, 4)[:, :, :3]).min() * self._cells**3)

    def forward(self, colours: FloatArray) -> Float64Array:
        """Table values (..., 3) at colours (..., 3)."""
        return in_blocks(self.forward_channels, colours)

    def inverse(self, values: FloatArray) -> Float64Array:
        """Colours (..., 3) at which the table has values (..., 3); exact to rounding inside the table."""
        return in_blocks(self.inverse_channels, values)

    def forward_channels(self, colours: Float64Array) -> Float64Array:
        """Table values (3, n) at colours (3, n)."""
        at = colours * self._cells
        return _apply(self._maps, self._tetrahedron(at), at)

    def inverse_channels(self, values: Float64Array) -> Float64Array:
        """Colours (3, n) at which the table has values (3, n)."""
        low, scale, guesses = self._guesses
        r, g, b = _whole((values - low) * scale, _GUESSES - 1)
        at = self._walk(values, np.take(guesses, (r * _GUESSES + g) * _GUESSES + b, mode="clip"))
        at /= self._cells
        return at

    def _walk(self, values: Float64Array, tetrahedron: IntArray) -> Float64Array:
        """Places (3, n) in the lattice by steps from a first guess of the tetrahedron (n,)."""
        at = _apply(self._inverse_maps, tetrahedron, values)
        found = self._tetrahedron(at)
        waiting = np.flatnonzero(found != tetrahedron)
        tetrahedron = found[waiting]
        for _ in range(_STEPS):
            if not len(waiting):
                break
            moved = _apply(self._inverse_maps, tetrahedron, values[:, waiting])
            at[:, waiting] = moved
            found = self._tetrahedron(moved)
            still = found != tetrahedron
            waiting, tetrahedron = waiting[still], found[still]
        return at

    def _tetrahedron(self, at: Float64Array) -> IntArray:
        """Number (n,) of the tetrahedron at places (3, n) in the lattice."""
        cell = _whole(at, self._cells - 1)
        r, g, b = at - cell
        number = ((cell[0] * self._cells + cell[1]) * self._cells + cell[2]) * _SLOTS
        number += (r > g) * np.int32(4) + (g > b) * np.int32(2) + (r > b)
        # What `take` wants, once instead of at each of its calls.
        return np.asarray(number.astype(np.intp))

    @property
    def _cells(self) -> int:
        return len(self.nodes) - 1

    @cached_property
    def _maps(self) -> Float64Array:
        """(12, tetrahedra): for each value the three factors of the place in the lattice, and the offset."""
        nodes, cells = self.nodes, self._cells
        low = nodes[:-1, :-1, :-1]
        corner = np.stack(np.meshgrid(*[np.arange(cells)] * 3, indexing="ij"), axis=-1)
        maps = np.empty((cells, cells, cells, _SLOTS, 3, 4))
        for order in permutations(range(3)):
            matrix, at, before = np.empty((*low.shape, 3)), [0, 0, 0], low
            for axis in order:
                at[axis] = 1
                after = nodes[tuple(slice(start, start + cells) for start in at)]
                matrix[..., axis], before = after - before, after
            offset = low - np.einsum("abcij,abcj->abci", matrix, corner)
            rank = [order.index(axis) for axis in range(3)]
            slot = (rank[0] < rank[1]) * 4 + (rank[1] < rank[2]) * 2 + (rank[0] < rank[2])
            maps[..., slot, :, :3], maps[..., slot, :, 3] = matrix, offset
        # No place has r > g > b without r > b; the two numbers left over repeat a neighbour.
        maps[..., 1, :, :], maps[..., 6, :, :] = maps[..., 0, :, :], maps[..., 7, :, :]
        return np.ascontiguousarray(maps.reshape(-1, 12).T)

    @cached_property
    def _inverse_maps(self) -> Float64Array:
        maps = self._maps.T.reshape(-1, 3, 4)
        matrix = np.linalg.inv(maps[:, :, :3])
        offset = -matrix @ maps[:, :, 3:]
        return np.ascontiguousarray(np.concatenate([matrix, offset], axis=2).reshape(-1, 12).T)

    @cached_property
    def _guesses(self) -> tuple[Float64Array, Float64Array, IntArray]:
        """Lowest value and places per value (3,) of an even grid of values, and a tetrahedron at each of its cells."""
        flat = self.nodes.reshape(-1, 3).T
        low, high = flat.min(axis=1)[:, None], flat.max(axis=1)[:, None]
        middle = (np.arange(_GUESSES) + 0.5) / _GUESSES
        values = low + (high - low) * np.stack(np.meshgrid(*[middle] * 3, indexing="ij")).reshape(3, -1)
        first = self._tetrahedron(np.clip(values, 0, 1) * self._cells)
        return low, _GUESSES / (high - low), self._tetrahedron(self._walk(values, first))


def lattice(nodes: int) -> Float64Array:
    """Colours (n, n, n, 3) of an even lattice: the table that changes nothing."""
    steps = np.linspace(0.0, 1.0, nodes)
    return np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1)


def _whole(values: Float64Array, largest: int) -> IntArray:
    """Whole numbers from 0; what is no number becomes 0 and stays no number in the map's result."""
    with np.errstate(invalid="ignore"):
        whole = np.minimum(values, largest).astype(np.int32)
    return np.maximum(whole, 0, out=whole)


def _apply(maps: Float64Array, tetrahedron: IntArray, values: Float64Array) -> Float64Array:
    """Each value (3, n) through the affine map of its tetrahedron (n,)."""
    result = np.empty_like(values)
    for row, (r, g, b, offset) in zip(result, maps.reshape(3, 4, -1), strict=True):
        np.take(r, tetrahedron, out=row, mode="clip")
        row *= values[0]
        row += np.take(g, tetrahedron, mode="clip") * values[1]
        row += np.take(b, tetrahedron, mode="clip") * values[2]
        row += np.take(offset, tetrahedron, mode="clip")
    return result
