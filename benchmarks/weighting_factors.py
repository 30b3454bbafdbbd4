"""What sampling a reflectance costs: dE00 of weighting factors against the lamp's own nodes.

Run: ``python benchmarks/weighting_factors.py`` (add ``--json`` for one JSON object).

The 24 spectra are colour-science's *ColorChecker N Ohta* (5 nm). The reference is the same lamp
nodes in float64 with the reflectance's own spline at them. The spectra are sampled from that
spline at 4, 5, 10 and 20 nm from 380 to 780 nm, and weighted with cubic and linear interpolation.
Also shown: what a missing end costs, and what interpolating the lamp's table would change.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable

import numpy as np

from spectral_core import light_design, standards, weights
from spectral_core.lights import Light, builtin_names

STEPS_NM = (4, 5, 10, 20)
SMOOTH = ("A", "D50", "D65", "E", "Incandescent", "LED-B1")
SPIKY = ("FL11", "Philips TL-84", "HP1", "LED-B3")
PEAKS_NM = tuple(range(430, 476, 5))


class Reference:
    """The chart's colours with the reflectances' own spline at the lamp's nodes."""

    def __init__(self) -> None:
        _, self.nm, self.reflectance = standards.colorchecker("ColorChecker N Ohta")

    def at(self, nm: np.ndarray) -> np.ndarray:
        """Reflectances (24, n) at any wavelengths, ends repeated."""
        return self.reflectance @ weights.interpolation_operator(self.nm, nm).T

    def Lab(self, light: Light) -> np.ndarray:
        """L*a*b* (24, 3) under the light, by direct summation over its nodes."""
        per_node = light.powers[:, None] * weights.colour_matching(light.wavelengths_nm)
        return _lab(self.at(light.wavelengths_nm) @ per_node / per_node[:, 1].sum(), light)

    def error(self, light: Light, bands: np.ndarray, interpolation: str = "cubic") -> np.ndarray:
        """dE00 (24,) of weighting factors at `bands`."""
        XYZ = self.at(bands) @ light.weighting_factors(bands, interpolation=interpolation).matrix
        return standards.delta_E_2000(_lab(XYZ, light), self.Lab(light))


def _lab(XYZ: np.ndarray, light: Light) -> np.ndarray:
    return standards.XYZ_to_Lab(XYZ, light.XYZ())


def sampling(reference: Reference) -> list[dict[str, object]]:
    """Per light and step: mean and largest dE00, cubic and linear."""
    rows = []
    for name in builtin_names():
        for step in STEPS_NM:
            bands = np.arange(380.0, 781.0, step)
            row: dict[str, object] = {"light": name, "step_nm": step}
            for kind in ("cubic", "linear"):
                error = reference.error(Light.builtin(name), bands, kind)
                row[kind] = {"mean": float(error.mean()), "max": float(error.max())}
            rows.append(row)
    return rows


def two_peaks(reference: Reference) -> list[dict[str, object]]:
    """The same at 4 nm for two-peak metamers of D65 with first peaks from 430 to 475 nm."""
    bands = np.arange(380.0, 781.0, 4)
    rows = []
    for peak in PEAKS_NM:
        light = light_design.two_peak_metamer(Light.builtin("D65").xy(), peak)
        errors = {kind: float(reference.error(light, bands, kind).max()) for kind in ("cubic", "linear")}
        rows.append({"peaks_nm": light.wavelengths_nm.tolist(), **errors})
    return rows


def missing_ends(reference: Reference) -> list[dict[str, object]]:
    """What grids that end early cost, and what is reported of it."""
    rows = []
    for name in ("E", "D65", "A", "FL11"):
        for first, last in ((400, 1000), (400, 700), (380, 730), (420, 680)):
            bands = np.arange(first, last + 1.0, 4)
            light = Light.builtin(name)
            error = reference.error(light, bands)
            extended = light.weighting_factors(bands).extended
            rows.append({"light": name, "bands_nm": [first, last], "extended": extended, "max": float(error.max())})
    return rows


def lamp_interpolation(reference: Reference) -> list[dict[str, object]]:
    """How far the colours move if the lamp's table is interpolated to 1 nm (cubic spline) first,
    against the sum at its own samples, and the xy shift of the white.
    """
    rows = []
    grid = np.arange(380.0, 781.0)
    for name in (*SMOOTH, *SPIKY):
        light = Light.builtin(name)
        table = light.powers / weights.quadrature_widths(light.wavelengths_nm)
        dense = np.maximum(weights.interpolation_operator(light.wavelengths_nm, grid) @ table, 0.0)
        other = Light.from_table(f"{name} at 1 nm", grid, dense)
        difference = standards.delta_E_2000(reference.Lab(light), reference.Lab(other))
        shift = np.abs(light.xy() - other.xy()).max()
        rows.append({"light": name, "max": float(difference.max()), "xy_shift": float(shift)})
    return rows


def _print(title: str, rows: list[dict[str, object]], line: Callable[[dict[str, object]], str]) -> None:
    print(f"\n{title}")
    for row in rows:
        print("  " + line(row))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--all", action="store_true", help="print every built-in light, not ten of them")
    arguments = parser.parse_args()
    reference = Reference()
    result = {
        "sampling": sampling(reference),
        "two_peaks": two_peaks(reference),
        "missing_ends": missing_ends(reference),
        "lamp_interpolation": lamp_interpolation(reference),
    }
    if arguments.json:
        print(json.dumps(result))
        return
    shown = [row for row in result["sampling"] if arguments.all or row["light"] in (*SMOOTH, *SPIKY)]
    _print(
        "dE00 over 24 spectra by sampling step: cubic mean, max | linear mean, max",
        shown,
        lambda row: (
            f"{row['light']:<28} {row['step_nm']:>3} nm   {row['cubic']['mean']:.5f} {row['cubic']['max']:.5f}"
            f" | {row['linear']['mean']:.5f} {row['linear']['max']:.5f}"
        ),
    )
    _print(
        "two-peak metamers of D65 at 4 nm, max dE00: cubic | linear",
        result["two_peaks"],
        lambda row: (
            f"{row['peaks_nm'][0]:.0f} + {row['peaks_nm'][1]:.2f} nm   {row['cubic']:.5f} | {row['linear']:.5f}"
        ),
    )
    _print(
        "missing ends at 4 nm: share of the white that is extended, max dE00",
        result["missing_ends"],
        lambda row: (
            f"{row['light']:<6} {row['bands_nm'][0]}-{row['bands_nm'][1]} nm   {row['extended']:.3%}   {row['max']:.4f}"
        ),
    )
    _print(
        "lamp's table interpolated to 1 nm instead of summed at its samples: max dE00, xy shift",
        result["lamp_interpolation"],
        lambda row: f"{row['light']:<16} {row['max']:.4f}   {row['xy_shift']:.6f}",
    )


if __name__ == "__main__":
    main()
