"""Colours that have got their reflectance already: a texture has far fewer colours than texels."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from spectral_core.arrays import Float64Array, IntArray
from spectral_core.assigning.choice import Choice
from spectral_core.assigning.image import Codes

# More colours are forgotten and looked for again: some hundred megabytes.
_MOST = 1 << 22


class KnownColours:
    """Choices by code.

    Parameters
    ----------
    choose
        From codes (n, 3), 0 to 1, to their choice.
    bits
        Of a code.

    Attributes
    ----------
    found
        How many colours were looked for; of those that were forgotten some twice.
    forgotten
        Whether there were too many to remember.
    """

    def __init__(self, choose: Callable[[Float64Array], Choice], bits: int) -> None:
        self._choose, self._bits = choose, bits
        self._keys = np.empty(0, dtype=np.int64)
        self._choice: Choice | None = None
        self.found, self.forgotten = 0, False

    def choices(self, codes: Codes) -> tuple[IntArray, IntArray, Choice]:
        """Of codes (n, 3): which choice each gets (n,), how many get each choice, and the choices."""
        keys = np.zeros(len(codes), dtype=np.int64)
        for channel in range(3):
            keys = keys << self._bits | codes[:, channel].astype(np.int64)
        own, which, count = np.unique(keys, return_inverse=True, return_counts=True)
        if len(self._keys) > _MOST:
            self._keys, self._choice, self.forgotten = self._keys[:0], None, True
        new = own[~np.isin(own, self._keys, assume_unique=True)]
        if len(new):
            self._learn(new)
        assert self._choice is not None  # it was empty, and something was new
        return which.ravel(), count, self._choice.part(np.searchsorted(self._keys, own))

    def _learn(self, keys: IntArray) -> None:
        most = (1 << self._bits) - 1
        channels = [keys >> (self._bits * shift) & most for shift in (2, 1, 0)]
        choice = self._choose(np.stack(channels, axis=1) / most)
        self.found += len(keys)
        if self._choice is None:
            self._keys, self._choice = keys, choice
            return
        keys, choice = np.concatenate([self._keys, keys]), self._choice.with_more(choice)
        order = np.argsort(keys, kind="stable")
        self._keys, self._choice = keys[order], choice.part(order)
