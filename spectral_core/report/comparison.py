"""Predicted against measured colours: the chromaticity diagram, and how large the differences are."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.chromaticities import XYZ_to_xy
from spectral_core.display.judging.comparison import Comparison
from spectral_core.report.diagram import CIE_1931, background
from spectral_core.report.extras import extra
from spectral_core.report.figures import GRID, INK, MUTED, new_figure, style, write_figure

# Nine lines of ten are at most this share of the diagram's width, magnified if they would be shorter.
_DRAWN = 0.08
# The diagram shows at least this width in xy around the colours.
_NARROWEST = 0.16
_MAGNIFICATIONS = (1, 2, 5, 10, 20, 50, 100)
# Colours of dE00, light to dark on the pale diagram, from what nobody sees to what everybody does.
_COLOURS = ((0.0, "#3b8bc4"), (0.35, "#2f4b7c"), (0.65, "#a0328c"), (1.0, "#d6261f"))
# Bars of the histogram at least; chromaticity of what is darker than this share of white is no chromaticity.
_BARS, _DARK = 12, 5e-3


def write_comparison_plot(compared: Comparison, path: Path) -> None:
    """Draw the pairs to ``.png`` or ``.svg``: lines from predicted to measured xy, and a histogram of dE00."""
    lit = compared.measured_XYZ[:, 1] > _DARK * compared.white_XYZ[1]
    lit &= compared.predicted_XYZ[:, 1] > _DARK * compared.white_XYZ[1]
    start, end = (XYZ_to_xy(each[lit]) for each in (compared.predicted_XYZ, compared.measured_XYZ))
    centre, width = _limits(np.concatenate([start, end]))
    magnified = _magnification(start, end, width)
    figure = new_figure(9.6, 4.9)
    with style():
        diagram, histogram = figure.subplots(1, 2, gridspec_kw={"width_ratios": [1.15, 1]})
        colours = _colour_map()
        scale = extra("matplotlib.colors").Normalize(0, max(float(compared.dE00.max()), 1e-6))
        _draw_pairs(diagram, start, start + magnified * (end - start), colours(scale(compared.dE00[lit])))
        diagram.set(xlim=centre[0] + width * np.array([-0.5, 0.5]), ylim=centre[1] + width * np.array([-0.5, 0.5]))
        _draw_labels(diagram, int(len(lit) - lit.sum()), magnified)
        _draw_histogram(histogram, compared.dE00, colours, scale)
    write_figure(figure, path)


def _magnification(start: Float64Array, end: Float64Array, width: float) -> int:
    """The largest round factor that leaves nine lines of ten short."""
    long = float(np.percentile(np.hypot(*(end - start).T), 90)) if len(start) else 0.0
    return max((each for each in _MAGNIFICATIONS if each * long <= _DRAWN * width), default=1)


def _limits(xy: Float64Array) -> tuple[Float64Array, float]:
    """Centre (2,) and width of a square around the colours, the whole diagram at most."""
    whole = np.array([0.38, 0.42])
    if not len(xy):
        return whole, 0.9
    width = max(1.45 * float(np.ptp(xy, axis=0).max()), _NARROWEST)
    return (whole, 0.9) if width > 0.6 else ((xy.min(axis=0) + xy.max(axis=0)) / 2, width)


def _colour_map() -> Any:
    return extra("matplotlib.colors").LinearSegmentedColormap.from_list("dE00", _COLOURS)


def _draw_pairs(axes: Any, start: Float64Array, end: Float64Array, colours: Float64Array) -> None:
    background(axes, CIE_1931)
    axes.grid(color=GRID, linewidth=0.5, alpha=0.7)
    axes.set_axisbelow(True)
    lines = extra("matplotlib.collections").LineCollection(
        np.stack([start, end], axis=1), colors=colours, linewidths=1.3, capstyle="round", zorder=3
    )
    axes.add_collection(lines)
    axes.scatter(*start.T, s=13, facecolors="white", edgecolors=INK, linewidths=0.7, zorder=4)
    axes.scatter(*end.T, s=9, c=colours, edgecolors="none", zorder=5)
    axes.set(xlabel="x", ylabel="y")
    axes.set_aspect("equal")


def _draw_labels(axes: Any, left_out: int, magnified: int) -> None:
    line = extra("matplotlib.lines").Line2D
    predicted = line([], [], marker="o", linestyle="", markersize=4, markerfacecolor="white", markeredgecolor=INK)
    measured = line([], [], marker="o", color=INK, markersize=3.5, linewidth=1.3)
    axes.legend(
        (predicted, measured), ("predicted", "measured"), loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2,
        frameon=False, fontsize=8.5, borderaxespad=0.2, columnspacing=1.2,
    )  # fmt: skip
    if magnified > 1:
        axes.set_title(f"differences \u00d7 {magnified}", loc="left", fontsize=8.5, color=MUTED, pad=4)
    if left_out:
        axes.set_xlabel(f"x   ({left_out} pairs too dark for a chromaticity are left out)")


def _draw_histogram(axes: Any, dE00: Float64Array, colours: Any, scale: Any) -> None:
    """Bars in the colours of the diagram, with mean and 95th percentile."""
    bars = max(_BARS, min(30, int(np.sqrt(len(dE00)) * 1.5)))
    edges = np.linspace(0, max(float(dE00.max()), 1e-6), bars + 1)
    counts, _ = np.histogram(dE00, edges)
    middles = (edges[1:] + edges[:-1]) / 2
    axes.bar(middles, counts, width=0.9 * np.diff(edges), color=colours(scale(middles)), linewidth=0)
    top = float(counts.max())
    for value, name, height in ((float(dE00.mean()), "mean", 1.13), (float(np.percentile(dE00, 95)), "95 %", 1.05)):
        axes.plot([value, value], [0, height * top], color=INK, linewidth=0.9, linestyle=(0, (4, 3)))
        side = -1 if value > 0.6 * edges[-1] else 1
        axes.annotate(f"{name} {value:.2f}", (value, height * top), (4 * side, -1), textcoords="offset points",
                      va="center", ha="left" if side > 0 else "right", fontsize=8.5)  # fmt: skip
    axes.set(xlabel="CIEDE2000 difference", ylabel="colours", xlim=(0, edges[-1] * 1.02), ylim=(0, 1.2 * top))
    axes.yaxis.set_major_locator(extra("matplotlib.ticker").MaxNLocator(integer=True))
    axes.grid(axis="y", color=GRID, linewidth=0.6)
    axes.set_axisbelow(True)
