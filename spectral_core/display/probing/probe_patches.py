"""The short sequence of patches that tells runtimes apart."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from spectral_core.arrays import Float64Array, frozen
from spectral_core.files import atomic_path

# Greys close together in the toe (extra encodings, clipping at 16) and at the top (shoulder, clipping at 235).
_GREYS = (0, 8, 16, 28, 44, 64, 96, 128, 160, 192, 220, 235, 246, 255)
# Primaries at full drive (what is clipped) and half (curve against matrix); pale mixes, which no remap clips.
_COLOURS = (
    (255, 0, 0), (0, 255, 0), (0, 0, 255), (128, 0, 0), (0, 128, 0), (0, 0, 128),
    (192, 96, 96), (96, 192, 96), (96, 96, 192), (200, 160, 96),
)  # fmt: skip


def probe_patches() -> Float64Array:
    """Codes (24, 3), 0..1, in the order to measure: greys from white to black, then colours."""
    codes = np.array([(grey,) * 3 for grey in _GREYS[::-1]] + list(_COLOURS))
    return frozen(codes / 255)


def patches_text() -> str:
    """The sequence as CSV R,G,B, codes 0..255."""
    rows = [",".join(f"{code:.0f}" for code in row) for row in 255 * probe_patches()]
    return "\n".join(["R,G,B", *rows]) + "\n"


def write_patches(path: Path) -> None:
    """Write the sequence as CSV."""
    with atomic_path(path) as temporary:
        temporary.write_text(patches_text(), encoding="utf-8")
