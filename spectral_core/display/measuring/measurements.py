"""Measurements of a display: device codes and the XYZ they gave, from every format people have."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from spectral_core.arrays import BoolArray, Float64Array, frozen
from spectral_core.display.measuring.cgats import parse_cgats
from spectral_core.display.measuring.contradictions import refuse_contradictions
from spectral_core.display.measuring.emission import Agreement, Emission, agreement, emission, wavelength
from spectral_core.display.measuring.state import iso_date
from spectral_core.display.measuring.tables import CODES, COLOURS, Table, parse_table, unit_codes
from spectral_core.errors import DisplayError
from spectral_core.files import read_text
from spectral_core.standards import DEFAULT_OBSERVER

_NAMED_CODES = {
    "red": (1.0, 0.0, 0.0), "green": (0.0, 1.0, 0.0), "blue": (0.0, 0.0, 1.0),
    "white": (1.0, 1.0, 1.0), "black": (0.0, 0.0, 0.0),
}  # fmt: skip
_REMEDY = "give a .ti3 or a CSV of measurements: a header and one row a patch"
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
    text = read_text(path, DisplayError, _REMEDY)
    is_cgats = "BEGIN_DATA_FORMAT" in text
    measured, spectra = _from_cgats(text, path) if is_cgats else _from_csv(parse_table(text, path, _REMEDY))
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


def _from_csv(table: Table) -> tuple[Measurements, Emission | None]:
    if table.header[0].casefold() in ("color", "colour", "channel", "name", "patch"):
        return _named_rows(table), None
    return _code_rows(table)


def _code_rows(table: Table) -> tuple[Measurements, Emission | None]:
    """Rows of codes with X, Y, Z or x, y, Y or a spectrum; the other columns do not count."""
    header = table.header
    colour = header[3:6] if header[3:6] in COLOURS else ()
    bands = [index for index in range(3 + len(colour), len(header)) if wavelength(header[index]) is not None]
    usable = header[:3] == CODES
    values = table.numbers_at([*range(3 + len(colour)), *bands]) if usable else np.zeros((0, 0))
    spectra = (
        emission([header[index] for index in bands], list(values.T[3 + len(colour) :]), table.path) if usable else None
    )
    if not usable or not (colour or spectra):
        raise DisplayError(
            f"the header is {','.join(header[:6])}",
            where=table.path,
            remedy="give R,G,B,X,Y,Z or R,G,B,x,y,Y or R,G,B,380,385,..., or named rows with L,x,y",
        )
    XYZ = table.XYZ(colour, values[:, 3:6]) if colour else np.zeros((0, 3))
    relative = not colour or is_about_100(XYZ)
    return Measurements(frozen(unit_codes(values[:, :3])), frozen(XYZ), "relative" if relative else "cd/m2"), spectra


def _named_rows(table: Table) -> Measurements:
    """Rows Red, Green, Blue, White, perhaps Black, with luminance, x and y."""
    header, keys = table.header, [name.casefold() for name in table.header]
    luminance = next((keys.index(each) for each in _LUMINANCE_HEADERS if each in keys), None)
    if luminance is None and "Y" in header:
        luminance = header.index("Y")
    if luminance is None or "x" not in keys or "y" not in keys:
        raise DisplayError(
            f"the header is {','.join(header)}", where=table.path, remedy="give a name, the luminance, x and y"
        )
    columns = (
        header.index("x") if "x" in header else keys.index("x"),
        header.index("y") if "y" in header else keys.index("y"),
    )
    codes = []
    for number, row in enumerate(table.rows):
        name = row[0].casefold()
        if name not in _NAMED_CODES:
            raise DisplayError(
                f"'{row[0]}' is no known patch", where=table.where(number), remedy=f"use {', '.join(_NAMED_CODES)}"
            )
        codes.append(_NAMED_CODES[name])
    XYZ = table.XYZ(COLOURS[1], table.numbers_at((*columns, luminance)))
    relative = keys[luminance] == "y_relative"
    return Measurements(frozen(codes), frozen(XYZ), "relative" if relative else "cd/m2")
