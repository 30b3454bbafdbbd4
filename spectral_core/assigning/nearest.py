"""The nearest colours by CIEDE2000, exactly and without comparing all with all.

Colours that are asked for are gathered in boxes, halved again and again; of a library's colours a box
keeps only those that may be nearest to one of its own, by proven bounds (`bounds`). What is left is bounded pair
by pair, and only what may still be nearest is compared by CIEDE2000 itself.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from spectral_core import standards
from spectral_core.arrays import BoolArray, Float64Array, IntArray
from spectral_core.assigning.bounds import Boxes, box_bounds, pair_lower_bound

# Sides of the smallest boxes, and how often they are doubled.
_SIDE, _LEVELS = 2.0, 5
_CELLS = 1 << 10
# Of the first cell: what lies beyond the cells goes to those at the edge.
_ORIGIN = np.array([0.0, -512.0, -512.0])
_TRIED = 3
# Pairs at a time: some tens of megabytes.
_PAIRS = 1 << 18
_COMPARED = 1 << 15
# Colours at a time.
_COLOURS = 1 << 15
# Rounding of the bounds: far above that of their arithmetic, far below any difference that matters.
_SLACK = 1 + 1e-9
_TINY = 1e-12


class Neighbours(NamedTuple):
    """The nearest colours of each colour, nearest first: which rows of the library and `dE00`, both (n, count)."""

    rows: IntArray
    dE00: Float64Array


class _Lists(NamedTuple):
    """Lists of different lengths, one after the other in `items`: where each begins, and its length."""

    first: IntArray
    length: IntArray
    items: IntArray


def nearest(colours: Float64Array, library: Float64Array, count: int = 1, own: IntArray | None = None) -> Neighbours:
    """The `count` nearest of a library to each colour; ties go to the first in the library.

    Parameters
    ----------
    colours, library
        L*a*b* (n, 3) and (m, 3).
    count
        Up to m, or m - 1 with `own`.
    own
        (n,), a member of the library that each colour must not get: to leave one out.
    """
    keys = _keys(colours)
    order = np.argsort(keys, kind="stable")
    found = Neighbours(np.empty((len(colours), count), dtype=np.int64), np.empty((len(colours), count)))

    def search(first: int) -> None:
        part = order[first : first + _COLOURS]
        one = _Search(colours[part], keys[part], library, count, None if own is None else own[part])
        found.rows[part], found.dE00[part] = one.run()

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(search, range(0, len(colours), _COLOURS)))
    return found


class _Search:
    """One search; colours stand in the order of a space-filling curve, so that a box is a range of them."""

    def __init__(
        self, colours: Float64Array, keys: IntArray, library: Float64Array, count: int, own: IntArray | None
    ) -> None:
        self.colours, self.keys = colours, keys
        self.library, self.count, self.own = library, count, own
        self.points = Boxes(library, library)
        self.members = np.ascontiguousarray(library.T)
        self.index = np.empty((len(colours), count), dtype=np.int64)
        self.dE00 = np.empty((len(colours), count))

    def run(self) -> Neighbours:
        first, last, _ = self._runs(_LEVELS, np.array([0]), np.array([len(self.keys)]))
        everything = np.arange(len(self.library))
        zero = np.zeros(len(first), dtype=np.int64)
        self._descend(_LEVELS, first, last, _Lists(zero, zero + len(everything), everything))
        return Neighbours(self.index, self.dE00)

    def _runs(self, level: int, first: IntArray, last: IntArray) -> tuple[IntArray, IntArray, IntArray]:
        """Boxes of a level inside ranges of colours: where they begin and end, and in which range."""
        inside, at = _expand(first, last - first)
        keys = self.keys[at] >> (3 * level)
        starts = np.flatnonzero(np.diff(keys, prepend=-1) | np.diff(inside, prepend=-1))
        ends = np.append(starts[1:], len(at))
        return at[starts], at[ends - 1] + 1, inside[starts]

    def _descend(self, level: int, first: IntArray, last: IntArray, candidates: _Lists) -> None:
        for part in _batches(candidates.length, _PAIRS):
            lists = _Lists(candidates.first[part], candidates.length[part], candidates.items)
            kept = self._pruned(first[part], last[part], lists, level <= _TRIED)
            colours = last[part] - first[part]
            few = (colours * kept.length).sum() <= 4 * kept.length.sum()
            if level == 0 or few:
                self._compare(first[part], colours, kept)
                continue
            starts, ends, parent = self._runs(level - 1, first[part], last[part])
            self._descend(level - 1, starts, ends, _Lists(kept.first[parent], kept.length[parent], kept.items))

    def _pruned(self, first: IntArray, last: IntArray, candidates: _Lists, tried: bool) -> _Lists:
        """Of each box's candidates those that may be among the nearest of one of its colours."""
        box, at = _expand(candidates.first, candidates.length)
        colour = candidates.items[at]
        # A range may end behind the last colour, where reduceat wants something to stand.
        colours = np.concatenate([self.colours, self.colours[-1:]])
        boxes = Boxes(*(each.reduceat(colours, _pairs(first, last))[::2] for each in (np.minimum, np.maximum)))
        lower, upper = box_bounds(boxes, box, self.points, colour)
        limit, best = self._furthest(upper, box, colour, candidates.length)
        if tried:
            limit = np.minimum(limit, self._reached(first, last, best) ** 2)
        kept = lower <= limit[box] * _SLACK + _TINY
        length = np.bincount(box[kept], minlength=len(first))
        return _Lists(np.cumsum(length) - length, length, colour[kept])

    def _furthest(
        self, upper: Float64Array, box: IntArray, colour: IntArray, length: IntArray
    ) -> tuple[Float64Array, IntArray]:
        """Of each box the square of a dE00 within which as many as wanted are, and which (boxes, n), -1 for none."""
        starts = np.cumsum(length) - length
        # One of them may be the colour's own, which does not count.
        wanted = self.count + (self.own is not None)
        if wanted == 1:
            limit = np.minimum.reduceat(upper, starts)
            hits = np.flatnonzero(upper == limit[box])
            return limit, colour[hits[np.searchsorted(box[hits], np.arange(len(length)))]][:, None]
        # Where it is not among a box's candidates, there may be one fewer.
        rank = np.arange(wanted)
        order = np.lexsort((upper, box))[starts[:, None] + np.minimum(rank, length[:, None] - 1)]
        return upper[order[:, -1]], np.where(rank < length[:, None], colour[order], -1)

    def _reached(self, first: IntArray, last: IntArray, members: IntArray) -> Float64Array:
        """Of each box how far, at most, the nearest of some members (boxes, n) are from its colours; -1 is none."""
        which, at = _expand(first, last - first)
        members = members[which]
        dE00 = self._dE00(at[:, None], members)
        dE00[members < 0] = np.inf
        if self.own is not None:
            dE00[members == self.own[at, None]] = np.inf
        reached = np.partition(dE00, self.count - 1, axis=1)[:, self.count - 1]
        return np.asarray(np.maximum.reduceat(reached, np.cumsum(last - first) - (last - first)))

    def _compare(self, first: IntArray, colours: IntArray, candidates: _Lists) -> None:
        """The nearest of each colour of each box among its candidates."""
        which, at = _expand(first, colours)
        # Colours with lists about as long stand side by side, in tables that are hardly longer.
        order = np.argsort(candidates.length[which], kind="stable")
        which, at = which[order], at[order]
        length = candidates.length[which]
        for part in _batches(length, _COMPARED):
            places = np.arange(length[part][-1])
            missing = places >= length[part, None]
            members = candidates.items[candidates.first[which[part], None] + np.where(missing, 0, places)]
            self._compare_some(at[part], members, missing)

    def _compare_some(self, at: IntArray, members: IntArray, missing: BoolArray) -> None:
        """The nearest of colours (n,) among members (n, most) of the library, of which some are only there to fill."""
        if self.own is not None:
            missing = missing | (members == self.own[at, None])
        colours = np.ascontiguousarray(self.colours[at].T)[..., None]
        lower = pair_lower_bound(colours, self.members[:, members])
        lower[missing] = np.inf
        # The most promising first: what they give rules out most of the others.
        promising = _smallest(lower, self.count)
        dE00 = np.full(members.shape, np.inf)
        rows = np.arange(len(at))[:, None]
        dE00[rows, promising] = self._dE00(at[:, None], members[rows, promising])
        limit = dE00[rows, promising].max(axis=1) ** 2 * _SLACK + _TINY
        lower[rows, promising] = np.inf
        row, column = np.nonzero(lower <= limit[:, None])
        dE00[row, column] = self._dE00(at[row], members[row, column])
        best = _smallest(dE00, self.count)
        self.index[at], self.dE00[at] = members[rows, best], dE00[rows, best]

    def _dE00(self, at: IntArray, member: IntArray) -> Float64Array:
        return standards.delta_E_2000(self.colours[at], self.library[member])


def _keys(colours: Float64Array) -> IntArray:
    """Position (n,) on a curve that fills L*a*b*: bits of the three cell numbers, interleaved."""
    cells = np.clip(np.floor((colours - _ORIGIN) / _SIDE), 0, _CELLS - 1).astype(np.int64)
    keys = np.zeros(len(colours), dtype=np.int64)
    for bit in range(_CELLS.bit_length() - 1):
        for axis in range(3):
            keys |= (cells[:, axis] >> bit & 1) << (3 * bit + axis)
    return keys


def _expand(first: IntArray, length: IntArray) -> tuple[IntArray, IntArray]:
    """Every place of ranges, one range after the other: which range, and the place."""
    which = np.repeat(np.arange(len(first)), length)
    ends = np.cumsum(length)
    return which, np.arange(ends[-1] if len(ends) else 0) + (first - ends + length)[which]


def _batches(sizes: IntArray, most: int) -> Iterator[slice]:
    """Slices whose sizes add up to `most` or are a single one."""
    ends = np.cumsum(sizes)
    first = 0
    while first < len(sizes):
        before = ends[first - 1] if first else 0
        last = max(first + 1, int(np.searchsorted(ends, before + most, side="right")))
        yield slice(first, last)
        first = last


def _pairs(first: IntArray, last: IntArray) -> IntArray:
    return np.stack([first, last], axis=1).ravel()


def _smallest(values: Float64Array, count: int) -> IntArray:
    """Columns (n, count) of the smallest values of each row of (n, m), smallest first; ties in their order."""
    if count == 1:
        return np.asarray(values.argmin(axis=1)[:, None])
    columns = np.sort(np.argpartition(values, count - 1, axis=1)[:, :count], axis=1)
    chosen = np.take_along_axis(values, columns, axis=1)
    # Where more are as small as the last of them, it may be the wrong one.
    tied = np.flatnonzero((values <= chosen.max(axis=1, keepdims=True)).sum(axis=1) > count)
    columns[tied] = np.argsort(values[tied], axis=1, kind="stable")[:, :count]
    chosen[tied] = np.take_along_axis(values[tied], columns[tied], axis=1)
    return np.take_along_axis(columns, np.argsort(chosen, axis=1, kind="stable"), axis=1)
