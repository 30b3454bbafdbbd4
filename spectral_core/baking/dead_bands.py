"""Bands that say nothing although their neighbours do: found before a bake, left out, and named.

A dead band would pass for a black line, or a bright one, in every spectrum. Where it is left out,
the weights' spline bridges it.
"""

from __future__ import annotations

import numpy as np

from spectral_core.arrays import BoolArray
from spectral_core.textures.base import HyperspectralTexture, Samples
from spectral_core.textures.derived import DerivedTexture

# Some hundred pixels all over the image.
_ROWS, _COLUMNS = 8, 64
# Enough pixels that no living band has the same value in all of them.
_FEWEST_PIXELS = 64
# A neighbour carries a signal if it is at least this bright on average: darker surfaces than 1 % hardly exist.
_SIGNAL = 0.01
# Between living bands: four neighbours of 10 nm may be dead; what is black over more may be so.
_LARGEST_GAP_NM = 50.0


def without_dead_bands(texture: HyperspectralTexture) -> HyperspectralTexture:
    """The texture itself, or with its dead bands marked as bad and named in its warnings.

    Looked for in mapped files and arrays only, in a few rows; in others that would mean reading them twice.
    """
    if not texture.concurrent or texture.height * texture.width < _FEWEST_PIXELS:
        return texture
    dead = dead_bands(texture)
    if not dead.any():
        return texture
    named = ", ".join(f"{nm:g}" for nm in texture.wavelengths_nm[dead][:8])
    more = f" and {dead.sum() - 8} more" if dead.sum() > 8 else ""
    return WithoutBands(texture, dead, f"dead bands left out: {named}{more} nm, the same value in all of some rows")


def dead_bands(texture: HyperspectralTexture) -> BoolArray:
    """(bands,): good bands that never hold a number beside a band with signal, and those that are stuck at zero or
    at their type's end between two bands with signal.

    What is black from some wavelength on, or over more than a gap, is the colour of a surface.
    """
    rows = np.unique(np.linspace(0, texture.height - 1, _ROWS).astype(int))
    step = -(-texture.width // _COLUMNS)
    stored = np.concatenate([texture.samples(int(row), 1)[0, ::step] for row in rows])
    values = np.concatenate([texture.rows(int(row), 1)[0, ::step] for row in rows])
    with np.errstate(invalid="ignore"):
        empty = np.isnan(values).all(axis=0)
        stuck = empty | ((values == values[0]).all(axis=0) & _at_end(stored))
        bright = ~stuck & texture.good & (np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0).mean(axis=0) > _SIGNAL)
    order = np.argsort(texture.wavelengths_nm)
    dead = np.zeros(texture.bands, dtype=bool)
    living = order[~stuck[order]]
    for band in order[stuck[order]]:
        after = int(np.searchsorted(texture.wavelengths_nm[living], texture.wavelengths_nm[band]))
        near = living[max(0, after - 1) : after + 1]
        gap_nm = float(np.ptp(texture.wavelengths_nm[near])) if 0 < after < len(living) else np.inf
        dead[band] = bright[near].any() if empty[band] else bright[near].all() and gap_nm <= _LARGEST_GAP_NM
    return np.asarray(dead & texture.good)


def _at_end(stored: Samples) -> BoolArray:
    """(bands,): whether the first pixel holds 0 or an integer type's largest value."""
    first = stored[0]
    if stored.dtype.kind in "iu":
        return np.asarray((first == 0) | (first == np.iinfo(stored.dtype).max))
    return np.asarray(first == 0)


class WithoutBands(DerivedTexture):
    """A texture with some of its bands marked as bad."""

    def __init__(self, texture: HyperspectralTexture, bad: BoolArray, warning: str) -> None:
        super().__init__(texture)
        self._bad = bad
        self.warnings = (*texture.warnings, warning)

    @property
    def good(self) -> BoolArray:
        """(bands,): good in the texture, and not among the bad."""
        return self._texture.good & ~self._bad
