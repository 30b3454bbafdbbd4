"""Plots of the display report: gamut and white, ramps, greys, errors, additivity."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import Any

import numpy as np

from spectral_core import standards
from spectral_core.arrays import Float64Array
from spectral_core.chromaticities import XYZ_to_uv, XYZ_to_xy, xy_to_uv
from spectral_core.display.characterising.characterise import Characterisation
from spectral_core.display.limits.coverage import reference_xy
from spectral_core.display.measuring.measurements import Measurements
from spectral_core.report.diagram import CIE_1976, background, daylight_xy, planckian_xy, wavelength_labels
from spectral_core.report.display_data import HeldOut, Ramp, primaries_XYZ
from spectral_core.report.extras import extra
from spectral_core.report.figures import GRID, INK, MUTED, SERIES_COLOURS, new_figure, plain_ticks, style, svg_uri
from spectral_core.report.numerals import percent

# Okabe and Ito's colours; the dashes tell the gamuts apart without them.
_GAMUT_LINES = {"sRGB": ("#d55e00", "-"), "P3": ("#009e73", (0, (6, 2))), "Rec.2020": ("#0072b2", (0, (1, 1.2)))}
_EYE_LINES = ((INK, "-", "o"), ("#cc79a7", (0, (5, 2)), "s"))
_DASHES = ("-", (0, (5, 2)), (0, (1.5, 1.5)))
_LABELLED_K = (4000, 5000, 5500, 6000, 6500, 7500, 9300, 15000)
# Residuals are linear up to this many percent and logarithmic beyond, so that dark readings fit in.
_LINEAR_PERCENT = 2.0
# Dark for large errors, which shall be seen on white paper.
_ERRORS = "viridis_r"
_RESIDUAL_LIMITS = (2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0)


def gamut_plot(eyes: Mapping[str, Measurements]) -> str:
    """The primaries of each eye among the reference gamuts, and its white among daylights, in u', v'."""
    figure = new_figure(9.6, 4.9)
    with style():
        whole, near = figure.subplots(1, 2, gridspec_kw={"width_ratios": [1.1, 1]})
        for axes in (whole, near):
            background(axes, CIE_1976)
            axes.grid(color=GRID, linewidth=0.5, alpha=0.7)
            axes.set_aspect("equal")
            axes.set(xlabel=CIE_1976.labels[0], ylabel=CIE_1976.labels[1])
        _triangles(whole, eyes)
        wavelength_labels(whole, CIE_1976)
        whole.set(xlim=(-0.03, CIE_1976.extent[1]), ylim=(-0.02, 0.62))
        whites = {name: XYZ_to_uv(each.white_XYZ) for name, each in eyes.items()}
        _whites(near, whites)
    return svg_uri(figure)


def _triangles(axes: Any, eyes: Mapping[str, Measurements]) -> None:
    for name, (colour, dashes) in _GAMUT_LINES.items():
        corners = xy_to_uv(reference_xy(name))[[0, 1, 2, 0]]
        axes.plot(*corners.T, color=colour, linestyle=dashes, linewidth=1.5, label=name)
    for (name, measured), (colour, dashes, marker) in zip(eyes.items(), _EYE_LINES, strict=False):
        corners = XYZ_to_uv(primaries_XYZ(measured))[[0, 1, 2, 0]]
        axes.plot(*corners.T, color=colour, linestyle=dashes, linewidth=2.0, marker=marker, markersize=5, label=name)
        axes.plot(*XYZ_to_uv(measured.white_XYZ), marker, color=colour, markersize=4, markeredgecolor="white")
    axes.legend(loc="lower right", frameon=False, fontsize=8.5)


def _whites(axes: Any, whites: Mapping[str, Float64Array]) -> None:
    temperatures = 1e6 / np.linspace(40, 250, 80)
    axes.plot(*xy_to_uv(planckian_xy(temperatures)).T, color=MUTED, linewidth=1.0, label="Planckian locus")
    daylight = xy_to_uv(daylight_xy(temperatures[temperatures >= 5000]))
    axes.plot(*daylight.T, color=INK, linewidth=1.1, linestyle=(0, (3, 2)), label="CIE daylight")
    d65 = XYZ_to_uv(standards.srgb_to_XYZ_matrix().sum(axis=1))
    axes.plot(*d65, "x", color="#d55e00", markersize=8, markeredgewidth=2, label="D65")
    for (name, place), (colour, _, marker) in zip(whites.items(), _EYE_LINES, strict=False):
        axes.plot(*place, marker, color=colour, markersize=6, markeredgecolor="white", label=f"white, {name}", zorder=5)
    places = np.array([*whites.values(), d65])
    centre = (places.min(axis=0) + places.max(axis=0)) / 2
    half = max(float(np.ptp(places, axis=0).max()) * 0.75, 0.02)
    axes.set(xlim=(centre[0] - half, centre[0] + half), ylim=(centre[1] - half, centre[1] + half))
    for kelvin in _LABELLED_K:
        place = xy_to_uv(daylight_xy(np.array([float(kelvin)])))[0]
        if (np.abs(place - centre) < 0.9 * half).all():
            axes.plot(*place, "|", color=INK, markersize=7)
            axes.annotate(f"{kelvin} K", place, (6, -9), textcoords="offset points", fontsize=7.5, color=INK)
    axes.legend(loc="upper left", frameon=True, framealpha=0.8, edgecolor="none", fontsize=8)


def ramp_plot(ramps: Sequence[Ramp], models: Sequence[str], chosen: str) -> str:
    """Measured ramps with every model's curve: linear, logarithmic, and residuals, one column a ramp."""
    figure = new_figure(9.8, 7.4)
    lines = _model_lines(models, chosen)
    with style():
        rows = figure.subplots(
            3, len(ramps), sharex="row", sharey="row", squeeze=False, gridspec_kw={"height_ratios": [1, 1, 1.15]}
        )
        for column, ramp in enumerate(ramps):
            linear, logarithmic, residual = rows[:, column]
            linear.set_title(ramp.name, fontsize=10)
            for name in models:
                for axes in (linear, logarithmic):
                    axes.plot(ramp.even_codes, ramp.curves[name], **lines[name])
                residual.plot(ramp.codes, ramp.residual_percent[name], **lines[name])
            for axes in (linear, logarithmic):
                axes.plot(
                    ramp.codes, ramp.luminance, "o", color=INK, markersize=3.2, markerfacecolor="white", zorder=3.5
                )
            if ramp.black > 0:
                logarithmic.axhline(ramp.black, color=MUTED, linewidth=0.8, linestyle=(0, (4, 3)))
            residual.axhline(0, color=MUTED, linewidth=0.8)
            for axes in (linear, logarithmic, residual):
                axes.grid(color=GRID, linewidth=0.6)
                axes.set_axisbelow(True)
                axes.set_xlabel("code")
        _ramp_scales(rows, min(ramp.darkest for ramp in ramps), max(ramp.largest_residual for ramp in ramps))
        handles = [extra("matplotlib.lines").Line2D([], [], **lines[name], label=name) for name in models]
        figure.legend(handles=handles, loc="outside upper center", ncols=4, frameon=False, fontsize=8.5)
    return svg_uri(figure)


def _ramp_scales(rows: Any, darkest: float, largest_residual: float) -> None:
    ticker = extra("matplotlib.ticker")
    for logarithmic in rows[1]:
        logarithmic.set(xscale="log", yscale="log", ylim=(darkest / 3, 2))
        plain_ticks(logarithmic.xaxis)
        logarithmic.yaxis.set_minor_formatter(ticker.NullFormatter())
    for residual in rows[2]:
        residual.set_yscale("symlog", linthresh=_LINEAR_PERCENT, linscale=1.5)
        limit = next((each for each in _RESIDUAL_LIMITS if each > largest_residual), 1.2 * largest_residual)
        residual.set_ylim(-limit, limit)
        residual.yaxis.set_major_locator(ticker.FixedLocator([-100, -10, -1, 0, 1, 10, 100]))
        residual.yaxis.set_major_formatter(ticker.FuncFormatter(lambda value, _: f"{value:+g}" if value else "0"))
        residual.yaxis.set_minor_locator(ticker.NullLocator())
    for row in (0, 1):
        rows[row][0].set_ylabel("Y over Y at full drive")
    rows[2][0].set_ylabel("residual, % of measured")


def _model_lines(models: Sequence[str], chosen: str) -> dict[str, dict[str, Any]]:
    """Line properties by model: the chosen one thick and on top."""
    looks = zip(models, cycle(SERIES_COLOURS[:7]), [dash for dash in _DASHES for _ in range(7)], strict=False)
    return {
        name: {"color": INK, "linewidth": 1.8, "zorder": 4}
        if name == chosen
        else {"color": colour, "linestyle": dash, "linewidth": 0.9, "zorder": 3}
        for name, colour, dash in looks
    }


def grey_plot(greys: Mapping[str, Measurements], found: Mapping[str, Characterisation]) -> str:
    """CCT, and u', v' from white's, of the greys along the ramp; lines: the chosen models."""
    figure = new_figure(9.6, 3.3)
    with style():
        left, right = figure.subplots(1, 2)
        for (name, grey), (colour, _, marker) in zip(greys.items(), _EYE_LINES, strict=False):
            white, model = found[name].measured.white_XYZ, found[name].chosen.model
            codes = grey.codes[:, 0]
            uv, modelled = (
                XYZ_to_uv(grey.XYZ) - XYZ_to_uv(white),
                XYZ_to_uv(model.forward(grey.codes)) - XYZ_to_uv(white),
            )
            left.plot(
                codes, _cct(grey.XYZ), marker, color=colour, markersize=3.5, fillstyle="none", label=f"{name}, measured"
            )
            left.plot(codes, _cct(model.forward(grey.codes)), color=colour, linewidth=1.1, label=f"{name}, model")
            for axis, dash in ((0, "-"), (1, (0, (4, 2)))):
                label = f"Δ{CIE_1976.labels[axis]}, {name}"
                right.plot(codes, uv[:, axis], "^v"[axis], color=colour, markersize=3.5, fillstyle="none")
                right.plot(codes, modelled[:, axis], color=colour, linestyle=dash, linewidth=1.1, label=label)
        left.set(xlabel="code of grey", ylabel="CCT in K")
        right.set(xlabel="code of grey", ylabel="distance from white in u′, v′")
        right.axhline(0, color=MUTED, linewidth=0.8)
        for axes in (left, right):
            axes.grid(color=GRID, linewidth=0.6)
            axes.legend(frameon=False, fontsize=8)
    return svg_uri(figure)


def _cct(XYZ: Float64Array) -> Float64Array:
    """CCT (n,) in kelvin of greys (n, 3); NaN, which plots leave out, where there is none (Duv beyond 0.05)."""
    found = [standards.cct_and_duv(XYZ_to_xy(each)) for each in XYZ]
    return np.array([cct if abs(duv) <= 0.05 else np.nan for cct, duv in found])


def error_plot(held: HeldOut) -> str:
    """Held-out dE00 over chromaticity and lightness, the direction of errors, and their histogram."""
    figure = new_figure(9.6, 7.8)
    figure.get_layout_engine().set(hspace=0.05, wspace=0.04)
    with style():
        (place, light), (direction, histogram) = figure.subplots(2, 2)
        shading = {"c": held.dE00, "cmap": _ERRORS, "vmin": 0.0}
        place.plot(*held.triangle[[0, 1, 2, 0]].T, color=MUTED, linewidth=1.0)
        dots = place.scatter(*held.uv.T, s=26, edgecolors="white", linewidths=0.4, **shading)
        place.set(xlabel=CIE_1976.labels[0], ylabel=CIE_1976.labels[1], aspect="equal", title="over chromaticity")
        figure.colorbar(dots, ax=place, label="dE00", shrink=0.85)
        light.scatter(held.measured[:, 0], held.dE00, s=22, edgecolors="white", linewidths=0.4, **shading)
        light.set(xlabel="measured L*", ylabel="dE00", title="over lightness", ylim=(0, None))
        a_b, change = held.measured[:, 1:], held.change[:, 1:]
        direction.axhline(0, color=GRID, linewidth=0.8)
        direction.axvline(0, color=GRID, linewidth=0.8)
        direction.quiver(
            *a_b.T, *(held.magnification * change).T, held.dE00, cmap=_ERRORS, clim=(0, held.dE00.max()),
            angles="xy", scale_units="xy", scale=1, width=0.005, headwidth=3.5,
        )  # fmt: skip
        direction.plot(*a_b.T, ".", color=INK, markersize=2)
        reach = np.concatenate([a_b, a_b + held.magnification * change])
        low, high = reach.min(axis=0) - 6, reach.max(axis=0) + 6
        direction.set(
            xlabel="a*", ylabel="b*", title=f"direction, {held.magnification:g} times enlarged",
            xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal",
        )  # fmt: skip
        histogram.hist(
            held.dE00,
            bins=min(24, max(6, len(held.dE00) // 4)),
            range=(0.0, held.dE00.max()),
            color="#0072b2",
            edgecolor="white",
            linewidth=0.5,
        )
        _marked(histogram, {"mean": held.dE00.mean(), "95 %": float(np.percentile(held.dE00, 95))})
        histogram.set(xlabel="dE00", ylabel="colours", title="histogram", xlim=(0, None))
        histogram.yaxis.set_major_locator(extra("matplotlib.ticker").MaxNLocator(integer=True))
        for axes in (place, light, direction, histogram):
            axes.title.set_fontsize(10)
            axes.grid(color=GRID, linewidth=0.6)
            axes.set_axisbelow(True)
    return svg_uri(figure)


def _marked(axes: Any, values: Mapping[str, float]) -> None:
    top = axes.get_ylim()[1]
    axes.set_ylim(0, 1.15 * top)
    for name, value in values.items():
        axes.axvline(value, color=INK, linewidth=1.0, linestyle=(0, (4, 3)))
        axes.annotate(f"{name} {value:.2f}", (value, 1.15 * top), (3, -9), textcoords="offset points", fontsize=8)


def additivity_plot(measured: Measurements) -> str:
    """Red, green and blue less black stacked on black, over white, for X, Y and Z."""
    figure = new_figure(5.6, 2.9)
    black, white = measured.black_XYZ, measured.white_XYZ
    parts = {"black": black, **dict(zip(("red", "green", "blue"), primaries_XYZ(measured) - black, strict=True))}
    colours = {"black": INK, "red": "#d55e00", "green": "#009e73", "blue": "#0072b2"}
    with style():
        axes = figure.subplots()
        start = np.zeros(3)
        for name, part in parts.items():
            share = 100 * part / white
            axes.barh(range(3), share, left=start, color=colours[name], edgecolor="white", linewidth=0.8, label=name)
            for row in np.flatnonzero(share > 6):
                middle = start[row] + share[row] / 2
                axes.text(middle, row, f"{share[row]:.1f}", ha="center", va="center", color="white", fontsize=8)
            start = start + share
        for row in range(3):
            axes.text(max(start[row], 100) + 1.5, row, percent(start[row] / 100 - 1, 1, True), va="center", fontsize=9)
        # Behind the bars: between them it is seen, and no number is struck through.
        axes.axvline(100, color=INK, linewidth=1.4, zorder=0)
        axes.set(yticks=range(3), ylim=(2.6, -0.6), xlim=(0, max(start.max(), 100) + 16), xlabel="% of white")
        axes.set_yticklabels(("X", "Y", "Z"))
        axes.tick_params(axis="y", length=0)
        figure.legend(loc="outside upper center", ncols=4, frameon=False, fontsize=8.5)
    return svg_uri(figure)
