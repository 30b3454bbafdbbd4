"""Chromaticity diagrams to draw on: spectrum locus, colours, Planckian and daylight loci."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from spectral_core import standards
from spectral_core.arrays import Float64Array, frozen
from spectral_core.chromaticities import XYZ_to_xy, uv_to_xy, xy_to_uv
from spectral_core.display import srgb, srgb_encode
from spectral_core.report.figures import INK

# Second radiation constant of Planck's law, ITS-90 as CIE 15 uses it, in nm K.
_C2_NM_K = 1.4388e7


@dataclass(frozen=True)
class Diagram:
    """A chromaticity diagram: axis labels, extent (left, right, bottom, top), from and to CIE 1931 xy."""

    labels: tuple[str, str]
    extent: tuple[float, float, float, float]
    from_xy: Callable[[Float64Array], Float64Array]
    to_xy: Callable[[Float64Array], Float64Array]


CIE_1931 = Diagram(("x", "y"), (0.0, 0.8, 0.0, 0.9), np.asarray, np.asarray)
CIE_1976 = Diagram(("u′", "v′"), (0.0, 0.65, 0.0, 0.6), xy_to_uv, uv_to_xy)


@cache
def spectrum_locus() -> tuple[Float64Array, Float64Array]:
    """Wavelengths (n,) in nm and xy (n, 2) of the spectral colours, CIE 1931, 380 to 700 nm."""
    wavelengths, cmfs = standards.observer_table()
    # Beyond 700 nm the chromaticity no longer changes; the table's last digits would make it wander.
    known = (wavelengths >= 380) & (wavelengths <= 700)
    return frozen(wavelengths[known]), frozen(XYZ_to_xy(cmfs[known]))


def planckian_xy(temperatures_K: Float64Array) -> Float64Array:
    """Chromaticity (n, 2) of Planckian radiators (n,)."""
    wavelengths, cmfs = standards.observer_table()
    nm = wavelengths[:, None]
    power = nm**-5.0 / np.expm1(_C2_NM_K / (nm * temperatures_K))
    XYZ = power.T @ cmfs
    return XYZ_to_xy(XYZ)


def daylight_xy(temperatures_K: Float64Array) -> Float64Array:
    """Chromaticity (n, 2) of CIE daylight (Planckian below 5000 K) of temperatures (n,)."""
    return np.array([standards.planckian_or_daylight_xy(float(each)) for each in temperatures_K])


def background(axes: Any, diagram: Diagram) -> None:
    """The diagram's colours, pale, inside the locus only."""
    size = 256
    left, right, bottom, top = diagram.extent
    across, up = np.linspace(left, right, size), np.maximum(np.linspace(bottom, top, size), 1e-3)
    xy = diagram.to_xy(np.stack(np.meshgrid(across, up), axis=-1))
    XYZ = np.stack([xy[..., 0], xy[..., 1], 1 - xy.sum(axis=-1)], axis=-1) / xy[..., 1:]
    linear = np.maximum(srgb().to_linear(XYZ), 0)
    rgb = srgb_encode(linear / linear.max(axis=-1, keepdims=True))
    pale = 0.45 + 0.55 * rgb
    image = axes.imshow(pale, extent=diagram.extent, origin="lower", aspect="auto", interpolation="bilinear")
    locus = diagram.from_xy(spectrum_locus()[1])
    outline = axes.fill(*locus.T, facecolor="none", edgecolor=INK, linewidth=0.9)[0]
    image.set_clip_path(outline)


def wavelength_labels(axes: Any, diagram: Diagram) -> None:
    """Dots and numbers along the spectrum locus."""
    wavelengths, xy = spectrum_locus()
    locus, white = diagram.from_xy(xy), diagram.from_xy(np.array([1 / 3, 1 / 3]))
    for wavelength in (460, 480, 490, 500, 520, 540, 560, 580, 600, 620, 700):
        place = locus[int(np.argmin(np.abs(wavelengths - wavelength)))]
        away = (place - white) / np.hypot(*(place - white))
        axes.plot(*place, "o", color=INK, markersize=2)
        axes.annotate(
            f"{wavelength}", place, 11 * away, textcoords="offset points", fontsize=7, ha="center", va="center"
        )
