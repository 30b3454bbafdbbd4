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
# Of white's luminance: the Z of a bluish white is not three times it, and dark readings scatter about 0 by less.
_MOST, _LEAST = 10.0, -0.02
# In the file's unit: less is no light of a display, whatever the unit.
_DARKEST_WHITE = 1e-6
# Condition of the primaries' XYZ: displays have 3 to 30; beyond, instruments cannot tell them apart.
_MOST_ALIKE = 1e4
# Of white: a channel without light may read anything less.
_BACKWARD = 0.01


def refuse_contradictions(measured: Measurements, path: Path) -> None:
    """Refuse a set that lacks what every model needs, or that no display can have given.

    Raises
    ------
    DisplayError
        For codes outside 0..1, missing or dark primaries, primaries brighter than white or alike,
        readings far above white or below 0, white that repeats with contradictory readings, ramps that
        run backwards.
    """
    if (measured.codes < 0).any() or (measured.codes > 1 + _CODES).any():
        raise DisplayError("device codes outside 0..1 (or 0..255)", where=path, remedy="state codes 0..1 or 0..255")
    for name, code in _FULL.items():
        XYZ = measured.at(*code)
        if XYZ is None:
            raise DisplayError(
                f"full {name} was not measured",
                where=path,
                remedy="measure white and the three primaries at full drive (codes 1 or 255)",
            )
        if not XYZ[1] > 0 or (name == "white" and not XYZ.min() > max(_DARKEST_WHITE, 0.01 * XYZ[1])):
            raise DisplayError(f"full {name} reads {XYZ.tolist()}, not above 0", where=path, remedy="measure it again")
        if name != "white" and XYZ[1] > measured.white_XYZ[1]:
            raise DisplayError(
                f"{name} ({XYZ[1]:.4g}) is brighter than white ({measured.white_XYZ[1]:.4g}): "
                "the readings contradict each other",
                where=path,
                remedy=_AGAIN,
            )
    _refuse_bright_black(measured, path)
    _refuse_impossible_readings(measured, path)
    _refuse_contradictory_white(measured, path)
    _refuse_like_primaries(measured, path)
    _refuse_backward_ramps(measured, path)


def _refuse_impossible_readings(measured: Measurements, path: Path) -> None:
    share = measured.XYZ / measured.white_XYZ[1]
    wrong = ((share > _MOST) | (share < _LEAST)).any(axis=1)
    if wrong.any():
        patch = int(wrong.argmax())
        raise DisplayError(
            f"patch {patch + 1} reads {measured.XYZ[patch].tolist()} where white has {measured.white_XYZ[1]:.4g}: "
            "no light of a display",
            where=path,
            remedy="correct the row, or measure it again",
        )


def _refuse_like_primaries(measured: Measurements, path: Path) -> None:
    read = [measured.at(*_FULL[name]) for name in ("red", "green", "blue")]
    light = np.stack([XYZ - measured.black_XYZ for XYZ in read if XYZ is not None]) / measured.white_XYZ[1]
    if not np.linalg.cond(light) < _MOST_ALIKE:
        raise DisplayError(
            "the light of red, green and blue is too alike to be told apart",
            where=path,
            remedy=_AGAIN,
        )


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


def _refuse_bright_black(measured: Measurements, path: Path) -> None:
    black = measured.black_XYZ[1]
    if black >= measured.white_XYZ[1]:
        raise DisplayError(
            f"black ({black:.4g}) is as bright as white ({measured.white_XYZ[1]:.4g})", where=path, remedy=_AGAIN
        )
