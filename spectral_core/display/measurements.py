"""Measurements of a display: device codes and the XYZ they gave, from every format people have."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from spectral_core.arrays import BoolArray, Float64Array, frozen
from spectral_core.display.cgats import parse_cgats
from spectral_core.display.contradictions import refuse_contradictions
from spectral_core.display.emission import Agreement, Emission, agreement, emission, wavelength
from spectral_core.display.state import iso_date
from spectral_core.display.tables import Rows, finite_number, number_columns, parse_table
from spectral_core.errors import DisplayError
from spectral_core.files import read_text
from spectral_core.standards import DEFAULT_OBSERVER

_NAMED_CODES = {
    "red": (1.0, 0.0, 0.0), "green": (0.0, 1.0, 0.0), "blue": (0.0, 0.0, 1.0),
    "white": (1.0, 1.0, 1.0), "black": (0.0, 0.0, 0.0),
}  # fmt: skip
_LUMINANCE_HEADERS = ("l", "y_relative", "lv", "luminance", "luminance_cd_m2", "y_cd_m2")
# Codes of the same patch may differ by the rounding of their file, less than a quarter of an 8-bit level.
SAME_CODE = 1e-3


@dataclass(frozen=True)
class Measurements:
    """Patches of a display.

    Attributes
    ----------
    codes
        (n, 3), 0..1.
    XYZ
        (n, 3), in the file's units.
    unit
        ``cd/m2`` or ``relative`` (white at about 100).
    instrument
        What measured, as the file says.
    warnings
        What a user should know of the file.
    date
        When it was measured, ISO 8601; None if the file does not say.
    white_luminance_cd_m2
        Of white, where the file says it although its unit is relative.
    agreement
        Of spectra with the instrument's XYZ, where the file has both.
    """

    codes: Float64Array
    XYZ: Float64Array
    unit: str = "relative"
    instrument: str = ""
    warnings: tuple[str, ...] = ()
    date: str | None = None
    white_luminance_cd_m2: float | None = None
    agreement: Agreement | None = None

    def subset(self, chosen: BoolArray | np.ndarray) -> Measurements:  # type: ignore[type-arg]
        """The patches of a mask or of indices."""
        return replace(self, codes=frozen(self.codes[chosen]), XYZ=frozen(self.XYZ[chosen]))

    @property
    def grey(self) -> BoolArray:
        """(n,) True for equal codes, black and white included."""
        return np.asarray(np.ptp(self.codes, axis=1) < SAME_CODE)

    def channel(self, index: int) -> BoolArray:
        """(n,) True where only one channel is driven."""
        others = np.delete(self.codes, index, axis=1)
        return np.asarray((others < SAME_CODE).all(axis=1) & (self.codes[:, index] >= SAME_CODE))

    @property
    def mixed(self) -> BoolArray:
        """(n,) True for colours that are neither grey nor of one channel."""
        return ~(self.grey | self.channel(0) | self.channel(1) | self.channel(2))

    def at(self, *code: float) -> Float64Array | None:
        """Mean XYZ (3,) of the patches with this code, None if there is none."""
        found = (np.abs(self.codes - code) < SAME_CODE).all(axis=1)
        return np.asarray(self.XYZ[found].mean(axis=0)) if found.any() else None

    @property
    def white_XYZ(self) -> Float64Array:
        """Mean XYZ (3,) of white."""
        white = self.at(1, 1, 1)
        assert white is not None  # checked when the file was read
        return white

    @property
    def black_XYZ(self) -> Float64Array:
        """Mean XYZ (3,) of black; zero if it was not measured."""
        black = self.at(0, 0, 0)
        return np.zeros(3) if black is None else black


def read_measurements(path: str | Path, observer: str = DEFAULT_OBSERVER) -> Measurements:
    """Read ``.ti3``, CSV with ``R,G,B,X,Y,Z`` or ``R,G,B,x,y,Y``, or CSV with named rows (Red, ...).

    Spectral columns (``SPEC_380`` ... or ``380`` ...) may follow, or stand instead of XYZ. The
    instrument's XYZ are used where there are any, unless another observer is asked for.

    Raises
    ------
    DisplayError
        If the file is none of these, lacks white or a primary, or contradicts itself; if it lacks the
        spectra that an observer other than the default needs.
    """
    path = Path(path)
    text = read_text(path, DisplayError, "give a .ti3 or CSV of measurements")
    measured, spectra = _from_cgats(text, path) if "BEGIN_DATA_FORMAT" in text else _from_csv(text, path)
    if spectra is not None:
        measured = _with_spectra(measured, spectra, observer, path)
    elif observer != DEFAULT_OBSERVER:
        raise DisplayError(
            f"holds no spectra, so that {observer} cannot be applied",
            where=path,
            remedy="leave --observer out: X, Y, Z are the instrument's own",
        )
    refuse_contradictions(measured, path)
    return measured


def _with_spectra(measured: Measurements, spectra: Emission, observer: str, path: Path) -> Measurements:
    """XYZ by another observer, or where the instrument gave none; else the agreement of the two."""
    spectral, by_default = spectra.XYZ(observer), spectra.XYZ()
    white = int(by_default[:, 1].argmax())
    if not by_default[white, 1] > 0:
        raise DisplayError("its spectra hold no light", where=path, remedy="measure again")
    warnings = (*measured.warnings, *spectra.warnings)
    if not len(measured.XYZ):
        return replace(measured, XYZ=frozen(100 * spectral / spectral[white, 1]), unit="relative", warnings=warnings)
    if not measured.XYZ[white, 1] > 0:
        raise DisplayError(f"patch {white + 1} has a spectrum but no luminance", where=path, remedy="correct the row")
    found = agreement(measured.XYZ, by_default, white)
    measured = replace(measured, warnings=warnings, agreement=found)
    if observer == DEFAULT_OBSERVER:
        return measured
    # Luminance belongs to the default observer: white keeps what the instrument says.
    scaled = spectral * (measured.XYZ[white, 1] / spectral[white, 1])
    note = f"X, Y, Z are integrated from the spectra with {observer}; the instrument's own are not used"
    return replace(measured, XYZ=frozen(scaled), warnings=(*warnings, note))


def _from_cgats(text: str, path: Path) -> tuple[Measurements, Emission | None]:
    table = parse_cgats(text, path)
    codes = table.stacked(("RGB_R", "RGB_G", "RGB_B"))
    XYZ = table.stacked(("XYZ_X", "XYZ_Y", "XYZ_Z"))
    names = [name for name in table.columns if name.startswith("SPEC_")]
    spectra = emission(names, [table.columns[name] for name in names], path)
    if codes is None or (XYZ is None and spectra is None):
        raise DisplayError("lacks RGB_R... or XYZ_X... columns", where=path, remedy="give a .ti3 of a display")
    # Spectra alone are scaled to a white of 100, whatever the file says of XYZ that it has not.
    relative = XYZ is None or _is_normalised(table.keywords.get("NORMALIZED_TO_Y_100", "").upper(), XYZ)
    stated = _stated_luminance(table.keywords.get("LUMINANCE_XYZ_CDM2", ""))
    measured = Measurements(
        frozen(codes / 100),
        frozen(np.zeros((0, 3)) if XYZ is None else XYZ),
        "relative" if relative else "cd/m2",
        table.keywords.get("TARGET_INSTRUMENT", ""),
        date=iso_date(table.keywords.get("CREATED", "")),
        white_luminance_cd_m2=stated if relative else None,
    )
    return measured, spectra


def _is_normalised(keyword: str, XYZ: Float64Array) -> bool:
    """Whether XYZ (n, 3) of a ``.ti3`` are relative; a file that does not say it is judged as a CSV is."""
    return keyword == "YES" or (keyword != "NO" and is_about_100(XYZ))


def is_about_100(XYZ: Float64Array) -> bool:
    """Whether the brightest of XYZ (n, 3) is so near to 100 that it was made 100."""
    return abs(float(XYZ[:, 1].max()) - 100) < 1


def _stated_luminance(text: str) -> float | None:
    """Luminance in cd/m2 of Argyll's ``X Y Z`` of white; None if it is none."""
    try:
        _, luminance, _ = (float(part) for part in text.split())
    except ValueError:
        return None
    return luminance if 0 < luminance < math.inf else None


def _from_csv(text: str, path: Path) -> tuple[Measurements, Emission | None]:
    header, body = parse_table(text, path, "give a header and one row a patch")
    if header[0].casefold() in ("color", "colour", "channel", "name", "patch"):
        return _named_rows(header, body, path), None
    return _code_rows(header, body, path)


def _code_rows(header: list[str], body: Rows, path: Path) -> tuple[Measurements, Emission | None]:
    """Rows of codes with X, Y, Z or x, y, Y or a spectrum; the other columns do not count."""
    colour = header[3:6] if header[3:6] in (["X", "Y", "Z"], ["x", "y", "Y"]) else []
    bands = [index for index in range(3 + len(colour), len(header)) if wavelength(header[index]) is not None]
    used = [*range(3 + len(colour)), *bands]
    usable = header[:3] == ["R", "G", "B"]
    table = number_columns(body if usable else [], used, path)
    spectra = emission([header[index] for index in bands], list(table.T[3 + len(colour) :]), path) if usable else None
    if not usable or not (colour or spectra):
        raise DisplayError(
            f"the header is {','.join(header[:6])}",
            where=path,
            remedy="give R,G,B,X,Y,Z or R,G,B,x,y,Y or R,G,B,380,385,..., or named rows with L,x,y",
        )
    codes = table[:, :3] / (255.0 if table[:, :3].max() > 1 else 1.0)
    XYZ = table[:, 3:6] if colour else np.zeros((0, 3))
    XYZ = _xyY_to_XYZ(XYZ, path) if colour[:1] == ["x"] else XYZ
    relative = not colour or is_about_100(XYZ)
    return Measurements(frozen(codes), frozen(XYZ), "relative" if relative else "cd/m2"), spectra


def _named_rows(header: list[str], body: Rows, path: Path) -> Measurements:
    """Rows Red, Green, Blue, White, perhaps Black, with luminance, x and y."""
    keys = [name.casefold() for name in header]
    luminance = next((keys.index(each) for each in _LUMINANCE_HEADERS if each in keys), None)
    if luminance is None and "Y" in header:
        luminance = header.index("Y")
    if luminance is None or "x" not in keys or "y" not in keys:
        raise DisplayError(
            f"the header is {','.join(header)}", where=path, remedy="give a name, the luminance, x and y"
        )
    columns = (
        header.index("x") if "x" in header else keys.index("x"),
        header.index("y") if "y" in header else keys.index("y"),
    )
    codes, xyY = [], []
    for number, row in body:
        name = row[0].casefold()
        if name not in _NAMED_CODES:
            raise DisplayError(
                f"'{row[0]}' is no known patch", where=f"{path}, line {number}", remedy=f"use {', '.join(_NAMED_CODES)}"
            )
        codes.append(_NAMED_CODES[name])
        xyY.append([finite_number(row[index], f"{path}, line {number}") for index in (*columns, luminance)])
    relative = keys[luminance] == "y_relative"
    return Measurements(frozen(codes), frozen(_xyY_to_XYZ(np.array(xyY), path)), "relative" if relative else "cd/m2")


def _xyY_to_XYZ(xyY: Float64Array, path: Path) -> Float64Array:
    x, y, Y = xyY.T
    if not ((y > 0) | (Y == 0)).all() or (Y < 0).any():
        raise DisplayError("a chromaticity y or a luminance is not above 0", where=path, remedy="correct the reading")
    safe = np.where(y > 0, y, 1.0)
    return np.stack([x / safe * Y, Y, (1 - x - y) / safe * Y], axis=1)
