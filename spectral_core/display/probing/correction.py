"""The function that undoes a runtime: applied to codes before they are sent, the panel gets what was meant."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from spectral_core.arrays import BoolArray, Float64Array, frozen
from spectral_core.display.models import srgb_decode, srgb_encode
from spectral_core.display.probing.runtimes import Runtime
from spectral_core.files import atomic_path

# A node for every 8-bit code and one between: linear interpolation then costs less than rounding.
_NODES = 511
_HALVINGS = 54
_REACHED, _BLACK = 1e-6, 1e-12
_HOW = (
    "per channel: look the wanted panel code up in table (linear between its evenly spaced values, for codes 0 to 1); "
    "if there is a matrix: decode by the sRGB curve, multiply by it, encode by the sRGB curve; clip to 0..1 and send"
)


@dataclass(frozen=True)
class Correction:
    """Panel codes that are wanted to codes to send: a table, then a matrix in linear light.

    Attributes
    ----------
    runtime, parameters
        What it undoes; parameters (k,).
    table
        (511,) for panel codes evenly from 0 to 1, the same for every channel.
    matrix
        (3, 3) on sRGB-decoded codes after the table, None without a gamut remap.
    reachable
        Least and largest panel code that greys can have.
    """

    runtime: Runtime
    parameters: Float64Array
    table: Float64Array
    matrix: Float64Array | None
    reachable: tuple[float, float]

    def apply(self, panel: Float64Array) -> Float64Array:
        """Codes (..., 3) to send for panel codes (..., 3), not clipped: outside 0..1 is out of reach."""
        codes = np.interp(panel, np.linspace(0.0, 1.0, len(self.table)), self.table)
        return codes if self.matrix is None else srgb_encode(srgb_decode(codes) @ self.matrix.T)

    def reaches(self, panel: Float64Array) -> BoolArray:
        """True (...,) where a panel code (..., 3) can still be had."""
        sent = self.apply(panel)
        low, high = self.reachable
        within = ((panel >= low - _REACHED) & (panel <= high + _REACHED)).all(axis=-1)
        return np.asarray(within & ((sent >= -_REACHED) & (sent <= 1 + _REACHED)).all(axis=-1))

    def shown(self, panel: Float64Array, levels: int = 0) -> Float64Array:
        """Panel codes (n, 3) that come of wanted ones through the runtime, sent with `levels` steps (0: exactly)."""
        sent = np.clip(self.apply(panel), 0.0, 1.0)
        sent = np.round(sent * levels) / levels if levels else sent
        return np.asarray(self.runtime.forward(sent, self.parameters[None])[0])


def correct(runtime: Runtime, parameters: Float64Array) -> Correction:
    """The inverse of a runtime with its parameters (k,)."""
    gamut = [stage for stage in runtime.stages if stage.matrix is not None]
    curves = Runtime(tuple(stage for stage in runtime.stages if stage.matrix is None))
    count = sum(len(stage.parameters) for stage in gamut)

    def forward(codes: Float64Array) -> Float64Array:
        return np.asarray(curves.forward(codes[:, None], parameters[None, count:])[0, :, 0])

    # Of all codes that give black the largest: what is sent then starts where light does.
    wanted = np.maximum(np.linspace(0.0, 1.0, _NODES), _BLACK)
    low, high = np.zeros(_NODES), np.ones(_NODES)
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        above = forward(middle) >= wanted
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    ends = np.round(forward(np.array([0.0, 1.0])), 12)
    matrix = None
    if gamut:
        assert gamut[0].matrix is not None
        matrix = frozen(np.linalg.inv(gamut[0].matrix(parameters[None, :count])[0]))
    return Correction(runtime, parameters, frozen(high), matrix, (float(ends[0]), float(ends[1])))


def correction_document(made: Correction) -> dict[str, Any]:
    """The correction as plain numbers, with its errors in 8-bit levels of the panel."""
    greys = np.repeat(np.linspace(0.0, 1.0, 1001)[:, None], 3, axis=1)
    wanted = np.concatenate([_cube(), greys])
    wanted = wanted[made.reaches(wanted)]
    exact = 255 * np.abs(made.shown(wanted) - wanted)
    rounded = 255 * np.abs(made.shown(wanted, 255) - wanted)
    return {
        "how": _HOW,
        "table": made.table.tolist(),
        "matrix": None if made.matrix is None else made.matrix.tolist(),
        "round_trip_levels": float(exact.max(initial=0.0)),
        "sent_in_8_bits_levels": {"mean": float(rounded.mean()), "max": float(rounded.max())} if len(rounded) else None,
    }


def unreachable_document(made: Correction) -> dict[str, Any]:
    """What the panel can no longer show, and which codes no longer differ."""
    greys = np.repeat(np.arange(256)[:, None] / 255, 3, axis=1)
    shown = np.asarray(made.runtime.forward(greys, made.parameters[None])[0])[:, 0]
    return {
        "share_of_panel_codes": float(1 - made.reaches(_cube()).mean()),
        "grey_panel_codes": list(made.reachable),
        "greys_clipped": int((shown <= 0).sum() + (shown >= 1).sum() - (shown[0] <= 0) - (shown[-1] >= 1)),
    }


def write_correction(document: dict[str, Any], path: Path) -> None:
    """Write a correction's document as JSON."""
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")


def _cube() -> Float64Array:
    """Panel codes (4913, 3) all over the cube."""
    levels = np.linspace(0.0, 1.0, 17)
    return np.asarray(np.stack(np.meshgrid(levels, levels, levels), axis=-1).reshape(-1, 3))
