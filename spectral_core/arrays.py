"""Array types, and what all arrays of colours share."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import numpy.typing as npt

Float64Array = npt.NDArray[np.float64]
Float32Array = npt.NDArray[np.float32]
# What works in the precision it is given.
FloatArray = npt.NDArray[np.floating[Any]]
BoolArray = npt.NDArray[np.bool_]
IntArray = npt.NDArray[np.signedinteger[Any]]


def frozen(values: npt.ArrayLike) -> Float64Array:
    """A float64 copy that cannot be written to: fields of frozen dataclasses stay what they were."""
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


# Pixels at a time: what is in between stays in the processor's cache, and threads are not held up by the
# interpreter between numpy's calls. A quarter of it takes half as long again.
_BLOCK = 65_536
# Fewer than these are done before threads have started.
_FEWEST_FOR_THREADS = 4 * _BLOCK


def in_blocks(function: Callable[[Float64Array], Float64Array], colours: npt.ArrayLike) -> Float64Array:
    """A function of channels (3, n) on colours (..., 3), some tens of thousands at a time.

    Images go to all processors: what numpy does in a block runs beside the interpreter.
    """
    colours = np.asarray(colours, dtype=np.float64)
    flat = colours.reshape(-1, 3)
    result = np.empty_like(flat)

    def one(first: int) -> None:
        block = slice(first, first + _BLOCK)
        result[block] = function(np.ascontiguousarray(flat[block].T)).T

    starts = range(0, len(flat), _BLOCK)
    if len(flat) < _FEWEST_FOR_THREADS:
        for first in starts:
            one(first)
    else:
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            list(pool.map(one, starts))
    return np.asarray(result.reshape(colours.shape))
