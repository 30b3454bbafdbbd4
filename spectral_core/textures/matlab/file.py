"""What the readers of both kinds of MATLAB files have in common."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.textures.base import Samples


@dataclass(frozen=True)
class Variable:
    """A real numeric array of a file.

    Attributes
    ----------
    name
        As MATLAB would write it: ``cube``, ``scan.cube``, ``scans(2).cube``.
    shape
        In MATLAB's order.
    dtype
        Of its class in MATLAB; it may be stored as a smaller one.
    """

    name: str
    shape: tuple[int, ...]
    dtype: np.dtype[Any]


class MatFile(Protocol):
    """What the readers of both kinds of files offer."""

    format: str

    @property
    def variables(self) -> Sequence[Variable]:
        """All real numeric arrays, also those in structs."""

    def rows(self, cube: Variable) -> tuple[Callable[[int, int], Samples], bool]:
        """A function of (first row, count) to (count, width, bands), and whether threads may call it at once."""

    def vector(self, variable: Variable) -> Float64Array:
        """All numbers of a small array."""
