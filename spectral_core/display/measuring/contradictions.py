"""Sets of measurements that contradict themselves: no model could be right about them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from spectral_core.errors import DisplayError

if TYPE_CHECKING:
    from spectral_core.display.measuring.measurements import Measurements

_FULL = {"white": (1.0, 1.0, 1.0), "red": (1.0, 0.0, 0.0), "green": (0.0, 1.0, 0.0), "blue": (0.0, 0.0, 1.0)}
_AGAIN = "measure again with the display's state fixed"
_CODES = 1e-3
# White may change this much from first to last while a display warms up; more is another state of it.
_LARGEST_DRIFT = 1.5
# What is left of white's readings about their trend, (largest - smallest) / mean: instruments repeat to
# 1 or 2 %, so that ten readings span at most a tenth.
_LARGEST_SPREAD = 0.2
_FEWEST_LEVELS = 3
# Of white: a channel without light may read anything less.
_BACKWARD = 0.01


def refuse_contradictions(measured: Measurements, path: Path) -> None:
    """Refuse a set that lacks what every model needs, or that no display can have given.

    Raises
    ------
    DisplayError
        For codes outside 0..1, missing or dark primaries, primaries brighter than white, white that
        repeats with contradictory readings, ramps that run backwards.
    """
    if (measured.codes < 0).any() or (measured.codes > 1 + _CODES).any():
        raise DisplayError("device codes outside 0..1 (or 0..255)", where=path, remedy="state codes 0..1 or 0..255")
    for name, code in _FULL.items():
        XYZ = measured.at(*code)
        if XYZ is None:
            raise DisplayError(
                f"full {name} was not measured",
                where=path,
                remedy="measure white and the three primaries at full drive",
            )
        if not XYZ[1] > 0 or (name == "white" and not (XYZ > 0).all()):
            raise DisplayError(f"full {name} reads {XYZ.tolist()}, not above 0", where=path, remedy="measure it again")
        if name != "white" and XYZ[1] > measured.white_XYZ[1]:
            raise DisplayError(
                f"{name} ({XYZ[1]:.4g}) is brighter than white ({measured.white_XYZ[1]:.4g}): "
                "the readings contradict each other",
                where=path,
                remedy=_AGAIN,
            )
    _refuse_contradictory_white(measured, path)
    _refuse_backward_ramps(measured, path)


def _refuse_contradictory_white(measured: Measurements, path: Path) -> None:
    place = np.flatnonzero((np.abs(measured.codes - 1.0) < _CODES).all(axis=1))
    Y = measured.XYZ[place, 1]
    trend = np.polyval(np.polyfit(place, Y, 1), place) if len(Y) > 2 else Y
    spread = float(np.ptp(Y - trend) / Y.mean())
    if Y.min() > 0 and Y.max() / Y.min() <= _LARGEST_DRIFT and spread <= _LARGEST_SPREAD:
        return
    low, high = int(place[Y.argmin()]), int(place[Y.argmax()])
    raise DisplayError(
        f"white reads {Y.min():.4g} in patch {low + 1} and {Y.max():.4g} in patch {high + 1}, more than "
        "drift or noise explains: the readings contradict each other",
        where=path,
        remedy=f"{_AGAIN}, or drop the wrong reading",
    )


def _refuse_backward_ramps(measured: Measurements, path: Path) -> None:
    """A ramp is backwards if its upper half is darker on average than its lower half, ends left out."""
    margin = _BACKWARD * measured.white_XYZ[1]
    for index, name in enumerate(("red", "green", "blue", "grey")):
        ramp = measured.subset(measured.grey if name == "grey" else measured.channel(index))
        code = ramp.codes.max(axis=1)
        inner = (code > _CODES) & (code < 1 - _CODES)
        levels = np.unique(code[inner].round(4))
        if len(levels) < _FEWEST_LEVELS:
            continue
        low = ramp.XYZ[inner & (code < np.median(levels) - _CODES), 1]
        high = ramp.XYZ[inner & (code > np.median(levels) + _CODES), 1]
        if high.mean() < low.mean() - margin:
            raise DisplayError(
                f"the {name} ramp runs backwards: {low.mean():.4g} on average over its lower codes, "
                f"{high.mean():.4g} over its upper ones",
                where=path,
                remedy="correct the codes, or measure again",
            )
    black = measured.black_XYZ[1]
    if black >= measured.white_XYZ[1]:
        raise DisplayError(
            f"black ({black:.4g}) is as bright as white ({measured.white_XYZ[1]:.4g})", where=path, remedy=_AGAIN
        )
