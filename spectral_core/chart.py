"""The ColorChecker as objects: a frame and 24 patches, each with its own surface."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from spectral_core import standards
from spectral_core.shapes import rotation_matrix

if TYPE_CHECKING:
    from spectral_core.scene import SceneObject

COLUMNS, ROWS = 6, 4
# Share of a patch's pitch that is paint, as on the classic chart (40 mm of 45 mm).
_PAINT = 40 / 45
# Patches float this share of the chart's thickness above the frame, enough for no shadow acne.
_LIFT = 0.05


def chart_objects(chart: SceneObject) -> list[SceneObject]:
    """The frame (a box in the chart's own surface) and 24 patches called ``CHART 01`` to ``CHART 24``.

    Patch 1, dark skin, is at the upper left when the chart's y axis points up; the surface of a
    patch is ``colorchecker NAME``.
    """
    width, height, thickness = chart.size
    pitch = min(width / (COLUMNS + 0.25), height / (ROWS + 0.25))
    turn = rotation_matrix(chart.rotation_deg)
    objects = [replace(chart, shape="box")]
    for index, name in enumerate(standards.colorchecker()[0]):
        row, column = divmod(index, COLUMNS)
        offset = np.array(
            [(column - (COLUMNS - 1) / 2) * pitch, ((ROWS - 1) / 2 - row) * pitch, thickness * (1 + _LIFT)]
        )
        x, y, z = np.asarray(chart.location) + turn @ offset
        patch = replace(
            chart,
            name=f"{chart.name} {index + 1:02d}",
            shape="plane",
            location=(float(x), float(y), float(z)),
            size=(pitch * _PAINT, pitch * _PAINT, 0.0),
            surface=f"colorchecker {name}",
        )
        objects.append(patch)
    return objects


def patch_surfaces() -> dict[str, str]:
    """Surface name to patch name of the 24 patches."""
    return {f"colorchecker {name}": name for name in standards.colorchecker()[0]}
