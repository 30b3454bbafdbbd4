"""Plots of the report: spectra, error by light and level, error against run time, error per patch."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from spectral_core import weights
from spectral_core.arrays import Float64Array, frozen
from spectral_core.display import srgb, srgb_encode
from spectral_core.lights import Light
from spectral_core.report.extras import extra
from spectral_core.report.figures import (
    GRID,
    INK,
    LEVEL_COLOURS,
    LEVEL_MARKERS,
    LEVEL_NAMES,
    MUTED,
    new_figure,
    plain_ticks,
    style,
    svg_uri,
)

VISIBLE_NM = (380.0, 780.0)
# A difference of 1 is about what an observer can just tell; half a level is what rounding costs.
JUST_NOTICEABLE_DE00 = 1.0
ROUNDING_LEVELS = 0.5
# Plots with a logarithmic axis have no zero: smaller errors are drawn here.
_SMALLEST = 1e-4


@dataclass(frozen=True)
class ErrorPoint:
    """One light at one level: dE00 in gamut, 8-bit levels, and seconds to switch and render."""

    light: str
    level: int
    dE00_mean: float
    dE00_max: float
    levels_mean: float
    levels_max: float
    seconds: float


@dataclass(frozen=True)
class PatchError:
    """One patch: exact and rendered 8-bit sRGB (level 1, level 2), and their dE00."""

    exact: tuple[float, ...]
    rendered: dict[int, tuple[float, ...]]
    dE00: dict[int, float]
    in_gamut: bool


@cache
def spectrum_rgb() -> Float64Array:
    """(401, 3) sRGB codes that stand for 380 to 780 nm: hue of the spectral colour, in gamut by
    adding white, fading towards the ends as the eye does.
    """
    wavelengths = np.arange(VISIBLE_NM[0], VISIBLE_NM[1] + 1)
    XYZ = weights.colour_matching(wavelengths)
    linear = srgb().to_linear(XYZ)
    linear = linear - np.minimum(linear.min(axis=1, keepdims=True), 0)
    linear = linear / linear.max(axis=1, keepdims=True)
    strength = np.clip(XYZ.sum(axis=1, keepdims=True) / 0.25, 0, 1) ** 0.5
    return frozen(srgb_encode(linear * strength))


def spd_plot(light: Light) -> str:
    """An SPD as SVG data URI: a table as density per nm, its largest visible value 1; lines as stems."""
    figure = new_figure(3.6, 2.0)
    with style():
        axes, strip = figure.subplots(2, 1, sharex=True, gridspec_kw={"height_ratios": [14, 1], "hspace": 0.0})
        nm = light.wavelengths_nm
        table = ~light.lines
        visible = (nm >= VISIBLE_NM[0]) & (nm <= VISIBLE_NM[1])
        if table.sum() > 1:
            density = light.powers[table] / weights.quadrature_widths(nm[table])
            density = density / density[visible[table]].max()
            axes.fill_between(nm[table], density, color=INK, alpha=0.10, linewidth=0)
            axes.plot(nm[table], density, color=INK, linewidth=1.1)
        if light.lines.any():
            powers = light.powers[light.lines] / light.powers[light.lines & visible].max()
            axes.vlines(nm[light.lines], 0, powers, color=INK, linewidth=1.8)
            axes.plot(nm[light.lines], powers, "o", color=INK, markersize=3.5)
            for wavelength, power in zip(nm[light.lines], powers, strict=True):
                axes.annotate(
                    f"{wavelength:.0f} nm", (wavelength, power), (5, -3), textcoords="offset points", fontsize=8
                )
        axes.set(xlim=VISIBLE_NM, ylim=(0, 1.08), yticks=(0, 0.5, 1))
        axes.grid(axis="y", color=GRID, linewidth=0.6)
        axes.set_axisbelow(True)
        axes.tick_params(axis="x", bottom=False, labelbottom=False)
        axes.set_ylabel("relative power")
        strip.imshow(spectrum_rgb()[None], extent=(VISIBLE_NM[0] - 0.5, VISIBLE_NM[1] + 0.5, 0, 1), aspect="auto")
        strip.set(xlim=VISIBLE_NM, yticks=(), xticks=range(400, 800, 100), xlabel="wavelength in nm")
        for side in ("left", "bottom"):
            strip.spines[side].set_visible(False)
    return svg_uri(figure)


def level_plot(points: Sequence[ErrorPoint]) -> str:
    """Error per light at each level on logarithmic axes, as SVG data URI: mean (mark) to maximum (bar)."""
    lights = list(dict.fromkeys(point.light for point in points))
    figure = new_figure(9.6, 0.9 + 0.36 * len(lights))
    with style():
        left, right = figure.subplots(1, 2, sharey=True)
        for point in points:
            y = lights.index(point.light) + 0.2 * (point.level - 1)
            _range(left, point.level, y, point.dE00_mean, point.dE00_max)
            _range(right, point.level, y, point.levels_mean, point.levels_max)
        _reference(left, JUST_NOTICEABLE_DE00, "just noticeable")
        _reference(right, ROUNDING_LEVELS, "rounding")
        left.set(yticks=range(len(lights)), ylim=(len(lights) - 0.4, -0.75))
        left.set_yticklabels(lights, fontsize=9.5)
        left.set_xlabel("CIEDE2000 difference, patches in gamut")
        right.set_xlabel("8-bit sRGB levels, all patches and channels")
        for axes in (left, right):
            axes.set_xscale("log")
            axes.grid(axis="x", color=GRID, linewidth=0.6)
            axes.tick_params(axis="y", length=0)
            axes.spines["left"].set_visible(False)
            axes.set_axisbelow(True)
            plain_ticks(axes.xaxis)
        _level_legend(figure, sorted({point.level for point in points}))
    return svg_uri(figure)


def time_plot(points: Sequence[ErrorPoint]) -> str:
    """Mean dE00 in gamut against seconds to switch and render, one mark per light and level."""
    figure = new_figure(5.6, 4.0)
    with style():
        axes = figure.subplots()
        for level in sorted({point.level for point in points}):
            chosen = [point for point in points if point.level == level]
            axes.plot(
                [point.seconds for point in chosen],
                [max(point.dE00_mean, _SMALLEST) for point in chosen],
                LEVEL_MARKERS[level],
                color=LEVEL_COLOURS[level],
                markersize=6,
                markeredgecolor="white",
                markeredgewidth=0.6,
            )
        axes.set(xscale="log", yscale="log", xlabel="switching and rendering, in s", ylabel="mean CIEDE2000, in gamut")
        _nice_log_limits(axes, [point.seconds for point in points])
        axes.axhline(JUST_NOTICEABLE_DE00, color=MUTED, linewidth=0.8, linestyle=(0, (4, 3)))
        axes.annotate(
            "just noticeable",
            (1, JUST_NOTICEABLE_DE00),
            (-2, 3),
            xycoords=("axes fraction", "data"),
            textcoords="offset points",
            ha="right",
            fontsize=7.5,
            color=MUTED,
        )
        axes.grid(color=GRID, linewidth=0.6)
        axes.set_axisbelow(True)
        plain_ticks(axes.xaxis)
        plain_ticks(axes.yaxis)
        _level_legend(figure, sorted({point.level for point in points}))
    return svg_uri(figure)


def patch_map(patches: Sequence[PatchError], columns: int = 6) -> str:
    """Patches in the exact colour with level 1 (left) and level 2 (right) set into it; dE00 below each."""
    rows = math.ceil(len(patches) / columns)
    figure = new_figure(4.2, 4.2 * rows / columns, layout="none")
    with style():
        axes = figure.add_axes((0, 0, 1, 1))
        axes.set(xlim=(0, columns), ylim=(rows, 0))
        axes.axis("off")
        for index, patch in enumerate(patches):
            row, column = divmod(index, columns)
            _draw_patch(axes, column, row, patch)
    return svg_uri(figure)


def _draw_patch(axes: Any, column: int, row: int, patch: PatchError) -> None:
    _square(axes, column + 0.03, row + 0.03, 0.94, 0.94, patch.exact)
    for level, x in ((1, 0.2), (2, 0.5)):
        if level in patch.rendered:
            _square(axes, column + x, row + 0.2, 0.3, 0.34, patch.rendered[level])
    bright = float(np.dot(np.clip(patch.exact, 0, 255), (0.3, 0.6, 0.1))) > 120
    ink = "#000000" if bright else "#ffffff"
    numbers = "   ".join(_short(patch.dE00[level]) for level in (1, 2) if level in patch.dE00)
    mark = "" if patch.in_gamut else " *"
    axes.text(column + 0.5, row + 0.76, numbers + mark, color=ink, ha="center", va="center", fontsize=8)


def _short(dE00: float) -> str:
    """Two digits, so that two numbers and a mark fit into a patch."""
    return f"{dE00:.1f}" if dE00 < 9.95 else f"{dE00:.0f}"


def _square(axes: Any, x: float, y: float, width: float, height: float, rgb_8bit: Sequence[float]) -> None:
    colour = tuple((np.clip(rgb_8bit, 0, 255) / 255).tolist())
    axes.fill([x, x + width, x + width, x], [y, y, y + height, y + height], color=colour, linewidth=0)


def _range(axes: Any, level: int, y: float, mean: float, maximum: float) -> None:
    ends = [max(mean, _SMALLEST), max(maximum, _SMALLEST)]
    axes.plot(ends, [y, y], color=LEVEL_COLOURS[level], linewidth=2.2, alpha=0.45, solid_capstyle="butt")
    axes.plot(ends[0], y, LEVEL_MARKERS[level], color=LEVEL_COLOURS[level], markersize=5)


def _reference(axes: Any, value: float, label: str) -> None:
    axes.axvline(value, color=MUTED, linewidth=0.8, linestyle=(0, (4, 3)))
    axes.annotate(label, (value, -0.72), (4, -1), textcoords="offset points", va="top", fontsize=7.5, color=MUTED)


def _nice_log_limits(axes: Any, values: Sequence[float]) -> None:
    """Limits at 1, 2 or 5 times a power of ten around the values, with ticks at all of these."""
    ticks = [step * 10.0**power for power in range(-5, 6) for step in (1, 2, 5)]
    low = max((tick for tick in ticks if tick < min(values)), default=ticks[0])
    high = min((tick for tick in ticks if tick > max(values)), default=ticks[-1])
    axes.set_xlim(low, high)
    axes.set_xticks([tick for tick in ticks if low <= tick <= high])


def _level_legend(figure: Any, levels: Sequence[int]) -> None:
    line = extra("matplotlib.lines").Line2D
    handles = [
        line([], [], color=LEVEL_COLOURS[each], marker=LEVEL_MARKERS[each], linestyle="", label=LEVEL_NAMES[each])
        for each in levels
    ]
    figure.legend(handles=handles, loc="outside upper center", ncols=len(handles), frameon=False, fontsize=9)
