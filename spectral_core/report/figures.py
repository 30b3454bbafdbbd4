"""Matplotlib figures as SVG data URIs, the same bytes on every run."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

from spectral_core.errors import OutputError
from spectral_core.files import atomic_path
from spectral_core.report.embedding import data_uri
from spectral_core.report.extras import extra

INK = "#2b3038"
MUTED = "#8a919c"
GRID = "#e4e7eb"
# Okabe and Ito's colours, told apart by colour-blind readers too.
LEVEL_COLOURS = {0: "#9aa1ab", 1: "#d55e00", 2: "#0072b2"}
LEVEL_MARKERS = {0: "o", 1: "s", 2: "D"}
LEVEL_NAMES = {0: "level 0, unmanaged", 1: "level 1, lamps", 2: "level 2, spectral"}
SERIES_COLOURS = ("#e69f00", "#56b4e9", "#009e73", "#cc79a7", "#d55e00", "#0072b2", "#8a919c", "#2b3038")
# Of PNG: sharp on a screen of twice the usual density, and in print.
_DOTS_PER_INCH = 200
_STYLE = {
    # Outlines instead of text: labels keep their places whatever fonts the reader has.
    "svg.fonttype": "path",
    "svg.hashsalt": "spectral-booth",
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.edgecolor": MUTED,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "text.color": INK,
}


def new_figure(width_in: float, height_in: float, layout: str = "constrained") -> Any:
    """An empty figure; matplotlib's global state (pyplot, interactive backends) is not touched."""
    with style():
        figure = extra("matplotlib.figure").Figure(figsize=(width_in, height_in), layout=layout)
        # A canvas of its own can measure text, which labels need before they are placed.
        extra("matplotlib.backends.backend_agg").FigureCanvasAgg(figure)
        return figure


def style() -> Any:
    """The report's style as a context; axes take it when they are made, SVG when it is written."""
    return extra("matplotlib").rc_context(_STYLE)


def plain_ticks(axis: Any) -> None:
    """Tick labels 0.01, 0.1, 1, 10 rather than powers."""
    ticker = extra("matplotlib.ticker")
    axis.set_major_formatter(ticker.FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(ticker.NullFormatter())


def svg_uri(figure: Any) -> str:
    """A figure as an SVG data URI without date and version."""
    buffer = io.BytesIO()
    with style():
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None}, transparent=True)
    return data_uri(buffer.getvalue(), "svg+xml")


def write_figure(figure: Any, path: Path) -> None:
    """Write a figure as ``.png`` or ``.svg``, whichever the path names.

    Raises
    ------
    OutputError
        If it names another, or cannot be written.
    """
    kind = path.suffix.casefold().removeprefix(".")
    if kind not in ("png", "svg"):
        raise OutputError("is no .png or .svg", where=path, remedy="name one")
    metadata = {"Date": None, "Creator": None} if kind == "svg" else {"Software": None}
    with style(), atomic_path(path) as temporary:
        figure.savefig(temporary, format=kind, metadata=metadata, dpi=_DOTS_PER_INCH)
