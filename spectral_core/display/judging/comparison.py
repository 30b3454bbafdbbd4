"""Two sets of colours side by side, predicted and measured, in dE00."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from spectral_core.arrays import Float64Array, IntArray, frozen
from spectral_core.display.measuring.measurements import SAME_CODE, is_about_100, read_measurements
from spectral_core.display.measuring.tables import CODES, COLOURS, parse_table, unit_codes
from spectral_core.display.profile import DisplayProfile
from spectral_core.errors import DisplayError
from spectral_core.files import read_text
from spectral_core.standards import DEFAULT_OBSERVER, XYZ_to_Lab, delta_E_2000

_NAMES = ("name", "patch", "sample", "sample_name", "colour", "color", "dot")
# The hue of what has less chroma than this is noise.
_LEAST_CHROMA = 1.0
# A colour beyond this many times the white of L*a*b* is in another unit: dE00 would tell nothing.
_MOST_WHITES = 1e6
# Sets whose luminances differ by more than this factor are in different units.
_SAME_UNIT = 2.0
_REMEDY = "give a CSV with X,Y,Z or x,y,Y (R,G,B and a name are optional) or a .ti3"


@dataclass(frozen=True)
class Colours:
    """A set of colours: XYZ (n, 3), with codes (n, 3) or names (n) where the file has them."""

    XYZ: Float64Array
    codes: Float64Array | None = None
    names: tuple[str, ...] | None = None
    unit: str = ""

    def labels(self) -> tuple[str, ...]:
        """Names (n); else codes in 8 bits; else row numbers."""
        if self.names is not None:
            return self.names
        if self.codes is not None:
            return tuple("/".join(f"{255 * code:.4g}" for code in row) for row in self.codes)
        return tuple(str(index + 1) for index in range(len(self.XYZ)))

    def white_XYZ(self) -> Float64Array | None:
        """Mean XYZ (3,) of codes 1 1 1, else of rows named white; None without."""
        white = np.zeros(len(self.XYZ), dtype=bool)
        if self.codes is not None:
            white = (np.abs(self.codes - 1) < SAME_CODE).all(axis=1)
        elif self.names is not None:
            white = np.array([name.casefold() == "white" for name in self.names])
        return np.asarray(self.XYZ[white].mean(axis=0)) if white.any() else None


@dataclass(frozen=True)
class Comparison:
    """Pairs (n) of colours: XYZ (n, 3), dE00 (n), and measured less predicted L*, C* and hue (n).

    Hue is in degrees, NaN-free: 0 where `hue_known` (n) is False because a colour of the pair is grey.
    """

    labels: tuple[str, ...]
    predicted_XYZ: Float64Array
    measured_XYZ: Float64Array
    white_XYZ: Float64Array
    dE00: Float64Array
    dL: Float64Array
    dC: Float64Array
    dh: Float64Array
    hue_known: tuple[bool, ...]


def compare(predicted: Colours, measured: Colours, white_XYZ: Float64Array) -> Comparison:
    """Pair two sets, by codes or names where both have them, by order else, and take the differences.

    Raises
    ------
    DisplayError
        If a colour of one has no partner in the other.
    """
    partner = _partners(predicted, measured)
    predicted_XYZ, measured_XYZ = predicted.XYZ[partner], measured.XYZ
    if max(np.abs(predicted_XYZ).max(), np.abs(measured_XYZ).max()) > _MOST_WHITES * white_XYZ.min():
        raise DisplayError(
            f"a colour is more than {_MOST_WHITES:g} times the white {white_XYZ.tolist()}",
            remedy="correct it, or give --white in the unit of the colours",
        )
    Lab = [XYZ_to_Lab(XYZ, white_XYZ) for XYZ in (predicted_XYZ, measured_XYZ)]
    chroma = [np.hypot(each[:, 1], each[:, 2]) for each in Lab]
    hue = [np.degrees(np.arctan2(each[:, 2], each[:, 1])) for each in Lab]
    known = np.minimum(*chroma) >= _LEAST_CHROMA
    return Comparison(
        measured.labels() if measured.names or not predicted.names else tuple(predicted.names[i] for i in partner),
        frozen(predicted_XYZ),
        frozen(measured_XYZ),
        frozen(white_XYZ),
        frozen(delta_E_2000(Lab[0], Lab[1])),
        frozen(Lab[1][:, 0] - Lab[0][:, 0]),
        frozen(chroma[1] - chroma[0]),
        frozen(np.where(known, (hue[1] - hue[0] + 180) % 360 - 180, 0.0)),
        tuple(known.tolist()),
    )


def predict(measured: Colours, display: DisplayProfile) -> tuple[Colours, bool]:
    """What a profile predicts for codes, and whether its white had to be scaled to the measured one.

    It has to be where the two have no absolute unit in common.

    Raises
    ------
    DisplayError
        If the readings have no codes, or no white to scale to.
    """
    if measured.codes is None:
        raise DisplayError("the readings have no codes", remedy="give R,G,B beside their colours")
    if ((measured.codes < 0) | (measured.codes > 1)).any():
        raise DisplayError("device codes outside 0..1 (or 0..255)", remedy="state codes 0..1 or 0..255")
    XYZ = display.to_XYZ(measured.codes)
    absolute = measured.unit == "cd/m2" and display.white_Y != 1.0
    white = measured.white_XYZ()
    if not absolute and white is None:
        raise DisplayError(
            "white was not measured and the profile has no luminance in cd/m2", remedy="measure white too"
        )
    scale = display.white_Y if white is None or absolute else white[1] / display.to_XYZ(np.ones(3))[1]
    return Colours(frozen(XYZ * scale), measured.codes, measured.names, measured.unit), not absolute


def unit_warnings(compared: Comparison) -> list[str]:
    """One warning if the two sets look as if they were in different units."""
    ratio = float(np.median(compared.measured_XYZ[:, 1]) / max(np.median(compared.predicted_XYZ[:, 1]), 1e-12))
    if 1 / _SAME_UNIT < ratio < _SAME_UNIT:
        return []
    return [f"measured luminances are {ratio:.3g} times the predicted: are both in the same unit?"]


def read_colours(path: Path, observer: str = DEFAULT_OBSERVER) -> Colours:
    """Read a CSV with ``X,Y,Z`` or ``x,y,Y``, with codes and a name if it has them, or any measurements.

    Raises
    ------
    DisplayError
        If the file is none of these; the message names the line.
    """
    text = read_text(path, DisplayError, _REMEDY)
    table = None if "BEGIN_DATA_FORMAT" in text else parse_table(text, path, _REMEDY)
    columns = None if table is None else next((names for names in COLOURS if table.has(names)), None)
    if table is None or columns is None:
        measured = read_measurements(path, observer)
        return Colours(measured.XYZ, measured.codes, unit=measured.unit)
    XYZ = table.XYZ(columns, table.numbers(columns))
    codes = frozen(unit_codes(table.numbers(CODES))) if table.has(CODES) else None
    names = tuple(row[0] for row in table.rows) if table.header[0].casefold() in _NAMES else None
    relative = is_about_100(XYZ)
    return Colours(frozen(XYZ), codes, names, "relative" if relative else "cd/m2")


def _partners(predicted: Colours, measured: Colours) -> IntArray:
    """For each measured colour (n,) the row of its prediction; repeats pair in their order."""
    keys = _keys(predicted, measured)
    if keys is None:
        if len(predicted.XYZ) != len(measured.XYZ):
            raise DisplayError(
                f"{len(predicted.XYZ)} colours against {len(measured.XYZ)}, and no names or codes in both to pair by",
                remedy="give both the same rows, names or codes",
            )
        return np.arange(len(measured.XYZ))
    places: dict[object, list[int]] = defaultdict(list)
    for index, key in enumerate(keys[0]):
        places[key].append(index)
    partner = []
    for index, key in enumerate(keys[1]):
        if not places[key]:
            raise DisplayError(
                f"'{measured.labels()[index]}' (row {index + 1}) of the second has no partner in the first",
                remedy="give both the same names or codes",
            )
        partner.append(places[key].pop(0))
    left = sorted(index for rest in places.values() for index in rest)
    if left:
        raise DisplayError(
            f"'{predicted.labels()[left[0]]}' (row {left[0] + 1}) of the first has no partner in the second",
            remedy="give both the same names or codes",
        )
    return np.array(partner, dtype=np.intp)


def _keys(predicted: Colours, measured: Colours) -> tuple[list[object], list[object]] | None:
    """What pairs two sets: codes, else names, if both have them."""
    if predicted.codes is not None and measured.codes is not None:
        rounded = [np.round(each.codes / SAME_CODE).astype(int).tolist() for each in (predicted, measured)
                   if each.codes is not None]  # fmt: skip
        return [tuple(row) for row in rounded[0]], [tuple(row) for row in rounded[1]]
    if predicted.names is not None and measured.names is not None:
        return [name.casefold() for name in predicted.names], [name.casefold() for name in measured.names]
    return None
