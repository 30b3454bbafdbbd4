"""What is counted over the texels of a texture that gets spectra."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from spectral_core.arrays import IntArray
from spectral_core.assigning.choice import Choice
from spectral_core.assigning.judging import Spread

# Colour differences are counted in bins of this width: what the 95th percentile is off by at most.
_BIN, _BINS = 1e-3, 200_000
_MOST_USED = 12


class Tally:
    """What is counted over all texels."""

    def __init__(self, rows: int) -> None:
        self._bins = np.zeros(_BINS + 1, dtype=np.int64)
        self._sum = self._largest = 0.0
        self.used = np.zeros(rows)
        self.pixels = self.out_of_gamut = self.outside_0_1 = 0
        self.colours: int | None = None

    def add(self, choice: Choice, count: IntArray) -> None:
        """Count colours, so many texels of each."""
        bins = np.minimum(choice.dE00 / _BIN, _BINS).astype(np.int64)
        self._bins += np.bincount(bins, weights=count, minlength=_BINS + 1).astype(np.int64)
        self._sum += float(choice.dE00 @ count)
        self._largest = max(self._largest, float(choice.dE00.max()))
        weights = np.ones(choice.rows.shape) if choice.weights is None else choice.weights
        shares = (np.maximum(weights, 0.0) * count[:, None]).ravel()
        self.used += np.bincount(choice.rows.ravel(), weights=shares, minlength=len(self.used))
        self.pixels += int(count.sum())
        self.out_of_gamut += int(count[choice.outside].sum())

    def spread(self) -> Spread:
        """Mean, p95 and largest dE00 over the texels."""
        at = int(np.searchsorted(np.cumsum(self._bins), 0.95 * self.pixels))
        return Spread(self._sum / self.pixels, min((at + 1) * _BIN, self._largest), self._largest)

    def most_used(self, names: Sequence[str]) -> tuple[tuple[str, float], ...]:
        """Names and shares of the most used reflectances."""
        used = self.used[: len(names)]
        order = np.argsort(-used, kind="stable")[:_MOST_USED]
        return tuple((names[i], float(used[i] / self.pixels)) for i in order if used[i] > 0)
