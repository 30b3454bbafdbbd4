"""A display model taken apart into the steps that every colour engine knows, from XYZ to codes.

1. ``drive = matrix @ XYZ + offset``: linear drive per channel, 1 at code 1.
2. Where the channels interact: the CIE lightness of drive through a 3-D table, to what each channel
   must be given by itself.
3. A curve per channel: a power, sRGB's, or a table.

Exporters and shaders read these and nothing else of a model.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spectral_core.arrays import Float64Array, FloatArray, frozen
from spectral_core.display.models import (
    DisplayModel,
    GammaMatrix,
    SRGBCurve,
    signed_power,
    srgb_decode,
    srgb_encode,
)
from spectral_core.display.models.corrected import CorrectedLut, drive_of_lightness, lightness
from spectral_core.display.models.curves import ToneCurve
from spectral_core.display.models.lattice import LatticeTable, lattice
from spectral_core.display.models.tone_models import GainOffsetGamma, LutMatrix
from spectral_core.errors import DisplayError

# Tables of curves are even in drive to this power, where a display's codes are nearly straight.
SHAPER = 1 / 2.4


@dataclass(frozen=True)
class Power:
    """``code = (1 - threshold) drive^(1 / gamma) + threshold``; both (3,), the threshold often 0."""

    gamma: Float64Array
    threshold: Float64Array

    def codes(self, drive: FloatArray) -> Float64Array:
        """Codes (..., 3) of drive (..., 3), by odd symmetry of the power."""
        return np.asarray(signed_power(drive, 1 / self.gamma) * (1 - self.threshold) + self.threshold)

    def drive(self, codes: FloatArray) -> Float64Array:
        """Drive (..., 3) of codes (..., 3), 0 below the threshold."""
        scaled = (np.asarray(codes) - self.threshold) / (1 - self.threshold)
        return signed_power(np.maximum(scaled, 0.0), self.gamma)


@dataclass(frozen=True)
class SRGB:
    """The piecewise curve of IEC 61966-2-1."""

    def codes(self, drive: FloatArray) -> Float64Array:
        """Codes (..., 3) of drive (..., 3)."""
        return srgb_encode(np.asarray(drive))

    def drive(self, codes: FloatArray) -> Float64Array:
        """Drive (..., 3) of codes (..., 3)."""
        return srgb_decode(np.asarray(codes))


@dataclass(frozen=True)
class Tables:
    """A rising table per channel, from code to drive (to lightness after an interaction); 1 at code 1."""

    curves: tuple[ToneCurve, ToneCurve, ToneCurve]

    def codes(self, drive: FloatArray) -> Float64Array:
        """Codes (..., 3) of drive (..., 3)."""
        return np.stack([curve.inverse(drive[..., i]) for i, curve in enumerate(self.curves)], axis=-1)

    def drive(self, codes: FloatArray) -> Float64Array:
        """Drive (..., 3) of codes (..., 3)."""
        return np.stack([curve.forward(codes[..., i]) for i, curve in enumerate(self.curves)], axis=-1)

    def sampled(self, count: int) -> Float64Array:
        """Codes (count, 3) at even steps from 0 to 1 of drive to the power `SHAPER`."""
        drive = np.linspace(0.0, 1.0, count) ** (1 / SHAPER)
        return self.codes(np.repeat(drive[:, None], 3, axis=1))


@dataclass(frozen=True)
class Interaction:
    """What the channels do to each other, over the CIE lightness of drive.

    Attributes
    ----------
    table
        From each channel's own lightness to what they amount to together; it is looked up backwards.
    top
        (3,), own lightness at code 1, by which the result is divided.
    """

    table: LatticeTable
    top: Float64Array

    def own(self, together: FloatArray) -> Float64Array:
        """Own lightness over `top` (..., 3) for lightness together (..., 3)."""
        return np.asarray(self.table.inverse(together) / self.top)

    def together(self, own: FloatArray) -> Float64Array:
        """Lightness together (..., 3) of own lightness over `top` (..., 3)."""
        return self.table.forward(np.asarray(own) * self.top)

    @property
    def span(self) -> tuple[Float64Array, Float64Array]:
        """Lowest and highest lightness together (3,) of codes from 0 to 1."""
        # The table is affine between its nodes: its extremes are at nodes.
        values = self.together(lattice(len(self.table.nodes))).reshape(-1, 3)
        return values.min(axis=0), values.max(axis=0)

    def sampled(self, nodes: int) -> Float64Array:
        """`own` (n, n, n, 3) on an even lattice over `span`; outside 0..1 where no code gives the colour."""
        low, high = self.span
        return self.own(low + (high - low) * lattice(nodes))


@dataclass(frozen=True)
class Stages:
    """The steps of a model; drive 1 gives code 1.

    Attributes
    ----------
    matrix, offset
        (3, 3) and (3,), XYZ (white Y = 1) to drive.
    interaction
        Between drive and the curve, None where channels add up.
    curve
        From drive, or from own lightness after an interaction, to codes.
    """

    matrix: Float64Array
    offset: Float64Array
    interaction: Interaction | None
    curve: Power | SRGB | Tables

    def encode(self, XYZ: FloatArray) -> Float64Array:
        """Device codes (..., 3) of XYZ (..., 3), not clipped: the model's inverse."""
        drive = np.asarray(XYZ) @ self.matrix.T + self.offset
        if self.interaction is not None:
            drive = self.interaction.own(lightness(drive))
        return self.curve.codes(drive)

    def decode(self, codes: FloatArray) -> Float64Array:
        """XYZ (..., 3) of device codes (..., 3) from 0 to 1: the model forward."""
        drive = self.curve.drive(codes)
        if self.interaction is not None:
            drive = drive_of_lightness(self.interaction.together(drive))
        return np.asarray((drive - self.offset) @ np.linalg.inv(self.matrix).T)


def stages(model: DisplayModel) -> Stages:
    """The steps of any model that a profile can hold."""
    match model:
        case GammaMatrix():
            return _stages(model.matrix, model.black_XYZ, Power(model.gamma, np.zeros(3)))
        case SRGBCurve():
            return _stages(model.matrix, np.zeros(3), SRGB())
        case GainOffsetGamma():
            return _stages(model.matrix, model.black_XYZ, Power(model.gamma, model.threshold))
        case LutMatrix():
            curves, top = _to_one(model.curves)
            return _stages(model.matrix * top, model.black_XYZ, curves)
        case CorrectedLut():
            curves, top = _to_one(model.curves)
            return _stages(model.matrix, model.black_XYZ, curves, Interaction(model.table, frozen(top)))
    raise DisplayError(f"a model of type {type(model).__name__} has no steps to export")


def _stages(
    to_XYZ: Float64Array, black: Float64Array, curve: Power | SRGB | Tables, interaction: Interaction | None = None
) -> Stages:
    matrix = np.linalg.inv(to_XYZ)
    return Stages(frozen(matrix), frozen(-matrix @ black), interaction, curve)


def _to_one(curves: tuple[ToneCurve, ToneCurve, ToneCurve]) -> tuple[Tables, Float64Array]:
    """Curves that end at 1, and where they ended (3,)."""
    red, green, blue = (ToneCurve(curve.values / curve.values[-1]) for curve in curves)
    return Tables((red, green, blue)), np.array([curve.values[-1] for curve in curves])
