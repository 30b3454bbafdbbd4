"""What a panel shows of panel codes: its profile, or what is assumed of a panel without one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.display.models import DisplayModel, srgb_decode

# Panels without a profile: gamma 2.2 with this standard deviation, so that 1.8 to 2.6 covers what is sold.
_GAMMA, _GAMMA_SD = 2.2, 0.2
_GAMMA_BOUNDS = (1.8, 2.6)
# Relative weights of a linear fit level off below this share of white.
_DARK = 0.02
_REWEIGHTED = 4


class Reference(Protocol):
    """A panel with k parameters of its own; works on m sets of them at once."""

    @property
    def start(self) -> Float64Array:
        """(k,) parameters to start from."""

    @property
    def bounds(self) -> tuple[Float64Array, Float64Array]:
        """Least and largest parameters (k,)."""

    def predict(self, panel: Float64Array, own: Float64Array) -> Float64Array:
        """XYZ (m, n, 3) of panel codes (m, n, 3) with own parameters (m, k)."""

    def prior(self, own: Float64Array) -> Float64Array:
        """(m, q) what the parameters are off from expectation, in standard deviations."""


@dataclass(frozen=True)
class ProfiledPanel:
    """A characterised panel; the luminance scale is free: brightness settings change."""

    model: DisplayModel

    @property
    def start(self) -> Float64Array:
        """Luminance as in the profile."""
        return np.ones(1)

    @property
    def bounds(self) -> tuple[Float64Array, Float64Array]:
        """A thousandth to a thousandfold."""
        return np.array([1e-3]), np.array([1e3])

    def predict(self, panel: Float64Array, own: Float64Array) -> Float64Array:
        """The profile's XYZ times the luminance scale."""
        return np.asarray(self.model.forward(panel) * own[:, :, None])

    def prior(self, own: Float64Array) -> Float64Array:
        """Nothing is expected of the scale."""
        return np.zeros((len(own), 0))


@dataclass(frozen=True)
class AssumedPanel:
    """An additive panel with a power law or the sRGB curve; primaries and black from the readings.

    Attributes
    ----------
    XYZ
        (n, 3), the readings: primaries and black follow from them by linear regression.
    power
        Whether its curve is a power, gamma 2.2 with a standard deviation of 0.2; sRGB's if not.
    """

    XYZ: Float64Array
    power: bool

    @property
    def start(self) -> Float64Array:
        """Gamma 2.2."""
        return np.full(int(self.power), _GAMMA)

    @property
    def bounds(self) -> tuple[Float64Array, Float64Array]:
        """Gamma 1.8 to 2.6."""
        return np.full(int(self.power), _GAMMA_BOUNDS[0]), np.full(int(self.power), _GAMMA_BOUNDS[1])

    def predict(self, panel: Float64Array, own: Float64Array) -> Float64Array:
        """Regression of the readings on the drives, readings far off left to fade."""
        drive = panel ** own[:, :, None] if self.power else srgb_decode(panel)
        drive = np.concatenate([drive, np.ones((*drive.shape[:-1], 1))], axis=-1)
        relative = 1 / (self.XYZ[:, 1] + _DARK * self.XYZ[:, 1].max())
        weights = np.broadcast_to(relative**2, drive.shape[:-1])
        predicted = np.zeros_like(drive[..., :3])
        for _ in range(_REWEIGHTED):
            weighted = np.swapaxes(drive * weights[..., None], -1, -2)
            # A trace of ridge: curves that clip everything leave singular drives.
            matrix = np.linalg.solve(weighted @ drive + 1e-9 * np.eye(4), weighted @ self.XYZ)
            predicted = drive @ matrix
            off = np.abs((predicted - self.XYZ) * relative[:, None]).max(axis=-1)
            typical = 3 * np.median(off, axis=-1, keepdims=True) + 0.01
            weights = relative**2 / (1 + (off / typical) ** 2) ** 2
        return np.asarray(predicted)

    def prior(self, own: Float64Array) -> Float64Array:
        """Gamma's distance from 2.2."""
        return (own - _GAMMA) / _GAMMA_SD
