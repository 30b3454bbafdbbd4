"""Seeded damage to files of textures: each opens and reads, or says why not in one line."""

from __future__ import annotations

import random
import warnings
from pathlib import Path

import numpy as np
from test_fuzz import mutate_bytes

from spectral_core.errors import SpectralBoothError
from spectral_core.textures import Reading, open_texture

# A single damaged size may promise a large image of zeros that the format's own compression really holds.
_LARGEST_READ = 1 << 24


def opens_or_says_why(path: Path, whole: bytes, random_: random.Random, runs: int, reading: Reading) -> int:
    """Damage `whole` `runs` times at `path`; how many of them open and give their first and last row."""
    opened = 0
    with warnings.catch_warnings():
        # NumPy tells of headers that Python 2 might have written.
        warnings.filterwarnings("ignore", message="Reading `.npy` or `.npz` file required additional header parsing")
        for _ in range(runs):
            path.write_bytes(mutate_bytes(whole, random_))
            opened += opens(path, reading)
    return opened


def opens(path: Path, reading: Reading, named: Path | str | None = None) -> bool:
    """Whether a texture opens and gives its first and last row; if not, it must say why in one line."""
    message = _read_ends(named or path, reading)
    if message is None:
        return True
    what = f"{path.read_bytes()[:2000]!r} gave {message}" if path.is_file() else message
    assert "\n" not in message, what
    assert len(message) < 1500, what
    return False


def _read_ends(path: Path | str, reading: Reading) -> str | None:
    """None if it reads, else why not."""
    try:
        texture = open_texture(path, reading)
        if texture.width * texture.bands > _LARGEST_READ:
            return "a row too large for a test"
        for first in (0, texture.height - 1):
            rows = texture.rows(first, 1)
            assert rows.shape == (1, texture.width, texture.bands)
            assert rows.dtype == np.float32
    except SpectralBoothError as error:
        return str(error)
    return None
