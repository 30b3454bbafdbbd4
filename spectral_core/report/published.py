"""Published figures that the report sets beside ours; all from Diaz-Barrancas et al. 2020, Sensors 20:5658."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import cache
from importlib import resources

import numpy as np

from spectral_core.arrays import Float64Array, frozen

SOURCE = "Díaz-Barrancas et al. 2020, Sensors 20(19):5658"
# The names in the published tables and those of our lights.
_LIGHTS = {
    "CIE D65": "D65",
    "D65 simulator (6-peak LED)": "d65-simulator",
    "Simulator D65": "d65-simulator",
    "D65 two peaks": "two-peaks-d65",
    "D65 Two Peaks": "two-peaks-d65",
    "CIE D50": "D50",
}


@dataclass(frozen=True)
class PublishedLight:
    """A row of the table of lights: CIE 1931 xy, CCT, CIE 224 Rf, and 8-bit sRGB at Y = 85."""

    xy: tuple[float, float]
    cct_K: float
    rf: float
    rgb_8bit: tuple[int, int, int]


@dataclass(frozen=True)
class PublishedDifference:
    """Screen capture against theory under one light at one level: 8-bit mean and sd of R, G, B."""

    mean: tuple[float, float, float]
    sd: tuple[float, float, float]


@cache
def published_lights() -> dict[str, PublishedLight]:
    """The published table of lights, by the names of our lights."""
    found = {}
    for row in _rows("published/lights_table3.csv"):
        rgb = (int(row["R8"]), int(row["G8"]), int(row["B8"]))
        xy = (float(row["x"]), float(row["y"]))
        found[_LIGHTS[row["light"]]] = PublishedLight(xy, float(row["CCT_K"]), float(row["Rf"]), rgb)
    return found


@cache
def published_differences() -> dict[tuple[str, int], PublishedDifference]:
    """Published rendering differences by (our light's name, level 1 or 2)."""
    found = {}
    for row in _rows("published/rgb_difference_level1_level2.csv"):
        for level in (1, 2):
            mean, sd = (
                (
                    float(row[f"level{level}_R_{what}"]),
                    float(row[f"level{level}_G_{what}"]),
                    float(row[f"level{level}_B_{what}"]),
                )
                for what in ("mean", "sd")
            )
            found[_LIGHTS[row["light"]], level] = PublishedDifference(mean, sd)
    return found


@cache
def published_hyperspectral_srgb() -> Float64Array:
    """(24, 3) 8-bit sRGB under D65 that the published hyperspectral image of a ColorChecker gives."""
    rows = _rows("colorchecker_srgb_d65.csv")
    return frozen(np.array([[float(row[f"hyperspectral_{channel}"]) for channel in "RGB"] for row in rows]))


def _rows(name: str) -> list[dict[str, str]]:
    text = resources.files("spectral_core").joinpath("data", name).read_text(encoding="utf-8")
    return list(csv.DictReader(text.splitlines()))
