"""Array types and the one helper all value objects share."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Float64Array = npt.NDArray[np.float64]
Float32Array = npt.NDArray[np.float32]
# What works in the precision it is given.
FloatArray = npt.NDArray[np.floating[Any]]
BoolArray = npt.NDArray[np.bool_]
IntArray = npt.NDArray[np.intp]


def frozen(values: npt.ArrayLike) -> Float64Array:
    """A float64 copy that cannot be written to: fields of frozen dataclasses stay what they were."""
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array
