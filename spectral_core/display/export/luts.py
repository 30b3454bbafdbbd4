"""Tables as text files: .cube (Adobe Cube LUT 1.0, 3-D) and .spi1d (Sony Pictures Imageworks, 1-D)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.files import atomic_path


def write_cube(path: Path, table: Float64Array, comments: Sequence[str]) -> None:
    """Write ``table[r, g, b]`` (n, n, n, 3), red changing fastest, for inputs from 0 to 1."""
    head = [*(f"# {line}" for line in comments), f"LUT_3D_SIZE {len(table)}"]
    rows = table.transpose(2, 1, 0, 3).reshape(-1, 3)
    with atomic_path(path) as temporary, temporary.open("w", encoding="utf-8", newline="\n") as stream:
        np.savetxt(stream, rows, fmt="%.7f", header="\n".join(head), comments="")


def write_spi1d(path: Path, values: Float64Array) -> None:
    """Write values (n, 3) for even inputs from 0 to 1."""
    head = f"Version 1\nFrom 0.0 1.0\nLength {len(values)}\nComponents 3\n{{"
    with atomic_path(path) as temporary, temporary.open("w", encoding="utf-8", newline="\n") as stream:
        np.savetxt(stream, values, fmt="%.9g", header=head, footer="}", comments="")
