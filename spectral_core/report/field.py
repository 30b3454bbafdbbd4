"""A picture of a headset's field: the smooth map of white's luminance and the points it was read at."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from spectral_core.display.judging.field import FieldReport, PatchReport
from spectral_core.files import atomic_path
from spectral_core.report.extras import extra
from spectral_core.report.figures import GRID, INK, new_figure, style

_GRID_POINTS = 201
_FLAT = 1e-6
_MARGIN, _SMALLEST_MARGIN_DEG = 0.12, 1.0


def write_field_plot(found: FieldReport, path: Path) -> None:
    """White's luminance over the field, relative to the centre, as PNG.

    The map is drawn between the points only: beyond them it would be a guess.
    """
    white = found.patches[0]
    figure = new_figure(6.4, 5.2)
    with style():
        axes = figure.add_subplot()
        axes.set_aspect("equal")
        axes.grid(color=GRID, linewidth=0.5)
        axes.set_axisbelow(True)
        axes.set(xlabel="degrees to the right", ylabel="degrees up", title=_title(white))
        low, high = white.luminance.min, white.luminance.max
        margin = max(0.02 * (high - low), 1e-3)
        colours = {"cmap": "viridis", "vmin": low - margin, "vmax": high + margin}
        if white.map is not None:
            _contours(axes, white, colours)
        dots = axes.scatter(
            *white.points_deg.T, c=white.relative, s=46, edgecolors="white", linewidths=1.2, zorder=4, **colours
        )
        for point, value in zip(white.points_deg, white.relative, strict=True):
            axes.annotate(
                f"{value:.3f}", point, (0, 7), textcoords="offset points", ha="center", fontsize=7, color=INK, zorder=5,
                bbox={"boxstyle": "square,pad=0.12", "facecolor": "white", "edgecolor": "none", "alpha": 0.7},
            )  # fmt: skip
        # Room for the outermost points and their labels; contours alone would end at the points.
        margins = np.maximum(_MARGIN * np.ptp(white.points_deg, axis=0), _SMALLEST_MARGIN_DEG)
        (left, below), (right, above) = white.points_deg.min(axis=0) - margins, white.points_deg.max(axis=0) + margins
        axes.set(xlim=(left, right), ylim=(below, above))
        figure.colorbar(dots, ax=axes, label="luminance, centre = 1", shrink=0.85)
        with atomic_path(path) as temporary:
            figure.savefig(temporary, format="png", dpi=150, facecolor="white", metadata={"Software": None})


def _contours(axes: Any, white: PatchReport, colours: dict[str, Any]) -> None:
    assert white.map is not None
    corners = np.unique(white.points_deg, axis=0)
    ends = np.stack([corners.min(axis=0), corners.max(axis=0)], axis=1)
    x, y = np.meshgrid(*(np.linspace(low, high, _GRID_POINTS) for low, high in ends))
    between = extra("matplotlib.tri").Triangulation(*corners.T).get_trifinder()(x, y) >= 0
    values = white.map.at(np.stack([x.ravel(), y.ravel()], axis=1)).reshape(x.shape)
    shown = np.where(between, values, np.nan)
    if np.ptp(values) < _FLAT:
        return  # a field without a slope has no contours
    axes.contourf(x, y, shown, levels=24, alpha=0.85, **colours)
    lines = axes.contour(x, y, shown, levels=6, colors=INK, linewidths=0.6, alpha=0.7)
    axes.clabel(lines, fmt="%.2f", fontsize=7)


def _title(white: PatchReport) -> str:
    if white.map is None:
        return "White, no map: too few points"
    return f"White: map of degree {white.map.degree}, held-out error {100 * white.map.held_out_rms:.2g} % of the centre"
