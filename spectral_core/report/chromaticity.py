"""The CIE 1931 chromaticity diagram with the lights of a scene."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np

from spectral_core import standards
from spectral_core.arrays import Float64Array, frozen
from spectral_core.display import srgb, srgb_encode
from spectral_core.report.figures import GRID, INK, MUTED, new_figure, style, svg_uri

# Lights closer than this are one dot: at the size of the plot nobody could tell them apart.
_ONE_DOT = 8e-4
# Second radiation constant of Planck's law, ITS-90 as CIE 15 uses it, in nm K.
_C2_NM_K = 1.4388e7
_DIAGRAM = (0.0, 0.8, 0.0, 0.9)


@cache
def spectrum_locus() -> tuple[Float64Array, Float64Array]:
    """Wavelengths (n,) in nm and xy (n, 2) of the spectral colours, CIE 1931, 380 to 700 nm."""
    wavelengths, cmfs = standards.observer_table()
    # Beyond 700 nm the chromaticity no longer changes; the table's last digits would make it wander.
    known = (wavelengths >= 380) & (wavelengths <= 700)
    return frozen(wavelengths[known]), frozen(cmfs[known, :2] / cmfs[known].sum(axis=1, keepdims=True))


def planckian_xy(temperatures_K: Float64Array) -> Float64Array:
    """Chromaticity (n, 2) of Planckian radiators (n,)."""
    wavelengths, cmfs = standards.observer_table()
    nm = wavelengths[:, None]
    power = nm**-5.0 / np.expm1(_C2_NM_K / (nm * temperatures_K))
    XYZ = power.T @ cmfs
    return np.asarray(XYZ[:, :2] / XYZ.sum(axis=1, keepdims=True))


def chromaticity_plot(lights: Mapping[str, Float64Array]) -> str:
    """The whole diagram and a closer view, as SVG data URI; `lights` gives xy (2,) by name."""
    dots = _merged(lights)
    figure = new_figure(9.6, 4.9)
    with style():
        whole, near = figure.subplots(1, 2, gridspec_kw={"width_ratios": [1, 1.12]})
        box = _surroundings(np.array([xy for _, xy in dots]))
        for axes in (whole, near):
            draw_diagram(axes)
            axes.grid(color=GRID, linewidth=0.5, alpha=0.7)
            axes.set_aspect("equal")
            axes.set(xlabel="x", ylabel="y")
        _lines(whole, labelled=True)
        _lines(near, labelled=False)
        whole.set(xlim=(-0.05, _DIAGRAM[1]), ylim=(-0.03, _DIAGRAM[3]))
        near.set(xlim=box[:2], ylim=box[2:])
        whole.plot(*zip(*(xy for _, xy in dots), strict=True), "o", color=INK, markersize=3, markeredgewidth=0)
        corners = ((0, 2), (1, 2), (1, 3), (0, 3), (0, 2))
        whole.plot(*zip(*((box[x], box[y]) for x, y in corners), strict=True), color=MUTED, linewidth=0.7)
        _wavelength_labels(whole)
        near.plot(
            *zip(*(xy for _, xy in dots), strict=True), "o", color=INK, markersize=5, markeredgecolor="white", zorder=5
        )
        _place_labels(figure, near, dots)
    return svg_uri(figure)


def _merged(lights: Mapping[str, Float64Array]) -> list[tuple[str, Float64Array]]:
    """Labels and places of the dots: lights of one chromaticity share one."""
    dots: list[tuple[list[str], Float64Array]] = []
    for name, xy in lights.items():
        for names, place in dots:
            if np.hypot(*(place - xy)) < _ONE_DOT:
                names.append(name)
                break
        else:
            dots.append(([name], np.asarray(xy)))
    return [(", ".join(names), place) for names, place in dots]


def _surroundings(xy: Float64Array) -> tuple[float, float, float, float]:
    """A square around the dots with room for their labels."""
    centre = (xy.min(axis=0) + xy.max(axis=0)) / 2
    half = max(float(np.ptp(xy, axis=0).max()) / 2 * 1.3, 0.06)
    return (
        float(centre[0] - half),
        float(centre[0] + half),
        float(centre[1] - half),
        float(centre[1] + half),
    )


def draw_diagram(axes: Any) -> None:
    """The diagram's colours, pale, inside the locus only."""
    size = 256
    x = np.linspace(_DIAGRAM[0], _DIAGRAM[1], size)
    y = np.linspace(_DIAGRAM[2], _DIAGRAM[3], size)
    grid = np.stack(np.broadcast_arrays(x[None, :], np.maximum(y[:, None], 1e-3)), axis=-1)
    XYZ = np.stack([grid[..., 0], grid[..., 1], 1 - grid.sum(axis=-1)], axis=-1) / grid[..., 1:]
    linear = np.maximum(srgb().to_linear(XYZ), 0)
    rgb = srgb_encode(linear / linear.max(axis=-1, keepdims=True))
    image = axes.imshow(0.45 + 0.55 * rgb, extent=_DIAGRAM, origin="lower", aspect="auto", interpolation="bilinear")
    locus = axes.fill(*spectrum_locus()[1].T, facecolor="none", edgecolor=INK, linewidth=0.9)[0]
    image.set_clip_path(locus)


def _lines(axes: Any, labelled: bool) -> None:
    """The sRGB triangle, the Planckian locus and CIE daylight."""
    primaries = srgb().to_XYZ(np.eye(3))
    triangle = primaries[:, :2] / primaries.sum(axis=1, keepdims=True)
    axes.fill(*triangle.T, facecolor="none", edgecolor="white", linewidth=2.4)
    (srgb_line,) = axes.plot(*triangle[[0, 1, 2, 0]].T, color=MUTED, linewidth=1.0)
    planck = planckian_xy(1e6 / np.linspace(40, 800, 150))
    (planck_line,) = axes.plot(*planck.T, color=INK, linewidth=1.0)
    temperatures = 1e6 / np.linspace(40, 200, 40)
    daylight = np.array([standards.planckian_or_daylight_xy(float(each)) for each in temperatures])
    (daylight_line,) = axes.plot(*daylight.T, color=INK, linewidth=1.0, linestyle=(0, (3, 2)))
    if labelled:
        lines = (srgb_line, planck_line, daylight_line)
        axes.legend(lines, ("sRGB", "Planckian locus", "CIE daylight"), loc="upper right", frameon=False, fontsize=8)


def _wavelength_labels(axes: Any) -> None:
    wavelengths, locus = spectrum_locus()
    white = np.array([1 / 3, 1 / 3])
    for wavelength in (460, 480, 490, 500, 520, 540, 560, 580, 600, 620, 700):
        place = locus[int(np.argmin(np.abs(wavelengths - wavelength)))]
        away = (place - white) / np.hypot(*(place - white))
        axes.plot(*place, "o", color=INK, markersize=2)
        axes.annotate(
            f"{wavelength}", place, 11 * away, textcoords="offset points", fontsize=7, ha="center", va="center"
        )


def _place_labels(figure: Any, axes: Any, dots: list[tuple[str, Float64Array]]) -> None:
    """Put each label at the nearest place where it covers no dot and no other label."""
    figure.canvas.draw()
    renderer = figure.canvas.get_renderer()
    scale = figure.dpi / 72
    frame = axes.get_window_extent(renderer)
    points = axes.transData.transform(np.array([xy for _, xy in dots]))
    taken = [_box(point, 8 * scale, 8 * scale) for point in points]
    for (name, xy), point in zip(dots, points, strict=True):
        text = axes.text(0, 0, name, fontsize=8.5)
        extent = text.get_window_extent(renderer)
        text.remove()
        width, height = extent.width + 4 * scale, extent.height + 3 * scale
        offset = _free_place(point, width, height, taken, frame, scale)
        centre = point + offset
        taken.append(_box(centre, width, height))
        label = axes.annotate(
            name,
            xy,
            offset / scale,
            textcoords="offset points",
            fontsize=8.5,
            ha="center",
            va="center",
            arrowprops={"arrowstyle": "-", "color": INK, "linewidth": 0.6, "shrinkA": 1, "shrinkB": 3},
            bbox={"boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.65},
        )
        # Else the layout would shrink the axes for it, and all places with them.
        label.set_in_layout(False)


def _free_place(
    point: Float64Array,
    width: float,
    height: float,
    taken: list[tuple[float, float, float, float]],
    frame: Any,
    scale: float,
) -> Float64Array:
    """Offset in pixels of a label's centre from its dot; farther rings only where nearer ones are full."""
    angles = np.deg2rad([0, 180, 45, -45, 135, -135, 90, -90, 22, -22, 158, -158, 67, -67, 113, -113])
    others = [box for box in taken if not (box[0] < point[0] < box[1] and box[2] < point[1] < box[3])]
    for gap, angle in itertools.product(np.arange(9, 130, 6) * scale, angles):
        direction = np.array([np.cos(angle), np.sin(angle)])
        # The edge or corner nearest to the dot lies at the gap, whatever the label's length.
        offset = direction * gap + np.clip(1.6 * direction, -1, 1) * np.array([width, height]) / 2
        box = _box(point + offset, width, height)
        inside = frame.x0 < box[0] and box[1] < frame.x1 and frame.y0 < box[2] and box[3] < frame.y1
        leader = [_box(point + share * offset, 1, 1) for share in np.linspace(0.1, 1, 10)]
        if inside and not any(_overlap(each, other) for each in (box, *leader) for other in others):
            return np.asarray(offset)
    return np.array([0.0, 12.0 * scale])


def _box(centre: Float64Array, width: float, height: float) -> tuple[float, float, float, float]:
    x, y = float(centre[0]), float(centre[1])
    return (x - width / 2, x + width / 2, y - height / 2, y + height / 2)


def _overlap(a: tuple[float, float, float, float], b: tuple[float, float, float, float]) -> bool:
    return a[0] < b[1] and b[0] < a[1] and a[2] < b[3] and b[2] < a[3]
