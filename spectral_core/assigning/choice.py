"""What a way of giving spectra to colours hands over."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np

from spectral_core.arrays import BoolArray, Float32Array, Float64Array, IntArray

_Table = TypeVar("_Table", Float32Array, Float64Array)


@dataclass(frozen=True)
class Choice:
    """Reflectances of colours: mixtures of rows of a table.

    Attributes
    ----------
    rows
        (n, parts), which rows.
    weights
        (n, parts); None where one row is taken as it is.
    dE00
        (n,), how far the reflectance's colour is from what was asked for, under the same light.
    outside
        (n,), True where the colour is one that the table is not made for.
    """

    rows: IntArray
    weights: Float64Array | None
    dE00: Float64Array
    outside: BoolArray

    def part(self, which: slice | IntArray | BoolArray) -> Choice:
        """That of some of the colours."""
        weights = None if self.weights is None else self.weights[which]
        return Choice(self.rows[which], weights, self.dE00[which], self.outside[which])

    def with_more(self, other: Choice) -> Choice:
        """These colours and then those of another choice of the same kind."""
        weights = None
        if self.weights is not None and other.weights is not None:
            weights = np.concatenate([self.weights, other.weights])
        rows, dE00, outside = (
            np.concatenate([getattr(self, name), getattr(other, name)]) for name in ("rows", "dE00", "outside")
        )
        return Choice(rows, weights, dE00, outside)

    def spectra(self, table: _Table) -> _Table:
        """The mixtures (n, bands) of a table's rows (m, bands), in its precision."""
        if self.weights is None:
            first: _Table = table[self.rows[:, 0]]
            return first
        result = np.zeros_like(table, shape=(len(self.rows), table.shape[1]))
        for part in range(self.rows.shape[1]):
            result += self.weights[:, part, None].astype(table.dtype) * table[self.rows[:, part]]
        return result


class SpectraOfColours(Protocol):
    """A way of giving spectra to colours under one light.

    Attributes
    ----------
    method
        What it is called.
    wavelengths_nm
        (bands,).
    table
        (m, bands), reflectances that are mixed.
    """

    method: str
    wavelengths_nm: Float64Array
    table: Float64Array

    def choose(self, XYZ: Float64Array, own: IntArray | None = None) -> Choice:
        """Reflectances for colours XYZ (n, 3), perfect diffuser Y = 1.

        `own` (n,) is a row of the table that each must not use: to leave one out.
        """
