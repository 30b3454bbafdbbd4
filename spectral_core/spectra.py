"""Tables of spectra: SPDs and reflectances, and reading them from CSV and ENVI spectral libraries."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from spectral_core.arrays import Float64Array, frozen
from spectral_core.errors import SpectrumError
from spectral_core.files import atomic_path, read_text

Quantity = Literal["power", "reflectance"]

# Wider than any file a colour scientist has: UV to short-wave infrared.
_PLAUSIBLE_NM = (100.0, 5000.0)
_VISIBLE_NM = (360.0, 830.0)
# Above this a reflectance is a percentage or a raw count; fluorescent samples stay below it.
_LARGEST_REFLECTANCE = 2.0
# 0.02 nm over the visible range; finer tables only cost memory.
_MOST_WAVELENGTHS = 20_000
# The text that every MATLAB file since version 5 begins with.
_MATLAB = b"MATLAB "


@dataclass(frozen=True)
class Spectra:
    """Spectra on one wavelength grid.

    Attributes
    ----------
    names
        One per spectrum.
    wavelengths_nm
        (n,), ascending.
    values
        (spectra, n).
    named
        False if the file had no header and the names are numbers.
    lines
        True if the values are powers of spectral lines at the wavelengths, not samples of a curve.
    warnings
        What a user should know of the table.
    """

    names: tuple[str, ...]
    wavelengths_nm: Float64Array
    values: Float64Array
    named: bool = True
    lines: bool = False
    warnings: tuple[str, ...] = ()


def read_spectra(path: str | Path, quantity: Quantity) -> Spectra:
    """Read a CSV of spectra, or an ENVI spectral library by its header or its data file.

    CSV: first column nm, one column a spectrum, header optional. Comma, semicolon or tab separated;
    ``#`` starts a comment; ``# kind: lines`` makes every row an exact spectral line. A table from
    long to short wavelengths is turned round. A MATLAB file is read as `spectral_core.matlab_spectra` says.

    Raises
    ------
    SpectrumError
        With file and line, for anything that is not such a table.
    """
    path = Path(path)
    from spectral_core import spectral_library  # which needs textures, which may need tables of spectra

    if spectral_library.is_envi(path):
        return _from_library(path, quantity)
    if _starts_with(path, _MATLAB):
        return _matlab(path, quantity)
    rows, lines = _rows(path)
    header, body = _split_header(path, rows)
    width = len(_cells(path, *body[0]))
    if width < 2:
        raise SpectrumError(
            "one column only",
            where=_at(path, body[0].number),
            remedy="give wavelengths in nm and at least one spectrum, separated by commas",
        )
    if len(body) > _MOST_WAVELENGTHS:
        raise SpectrumError(
            f"{len(body)} wavelengths, more than {_MOST_WAVELENGTHS}", where=path, remedy="average neighbouring rows"
        )
    # Row by row: lists of all cells would take many times the file's size.
    table = np.array([np.array(_numbers(path, row, width)) for row in body])
    wavelengths, values = _ascending(path, body, table[:, 0], table[:, 1:].T)
    _check_wavelengths(path, wavelengths, needs_curve=not lines)
    warnings = _check_values(path, wavelengths, values, quantity)
    if header is not None and len(header) != width:
        raise SpectrumError(
            f"the header has {len(header)} columns, the data {width}", where=path, remedy="name every column"
        )
    names = tuple(name.strip() for name in header[1:]) if header else tuple(str(i + 1) for i in range(width - 1))
    return Spectra(names, frozen(wavelengths), frozen(values), header is not None, lines, tuple(warnings))


def _from_library(path: Path, quantity: Quantity) -> Spectra:
    from spectral_core import spectral_library

    library = spectral_library.read_library(path)
    _check_wavelengths(path, library.wavelengths_nm, needs_curve=True)
    warnings = _check_values(path, library.wavelengths_nm, library.values, quantity)
    return Spectra(
        library.names or tuple(str(index + 1) for index in range(len(library.values))),
        frozen(library.wavelengths_nm),
        frozen(library.values),
        bool(library.names),
        warnings=(*library.warnings, *warnings),
    )


def _matlab(path: Path, quantity: Quantity) -> Spectra:
    from spectral_core import matlab_spectra  # which needs textures, which may need tables of spectra

    wavelengths, values = matlab_spectra.matlab_table(path)
    if not (np.isfinite(wavelengths).all() and np.isfinite(values).all()):
        raise SpectrumError("holds something that is not a finite number", where=path, remedy="correct it")
    order = np.argsort(wavelengths, kind="stable")
    wavelengths, values = wavelengths[order], values[:, order]
    repeated = wavelengths[1:][np.diff(wavelengths) == 0]
    if len(repeated):
        raise SpectrumError(f"wavelength {repeated[0]:g} nm occurs twice", where=path, remedy="keep one of them")
    if len(wavelengths) > _MOST_WAVELENGTHS:
        raise SpectrumError(
            f"{len(wavelengths)} wavelengths, more than {_MOST_WAVELENGTHS}", where=path, remedy="average"
        )
    _check_wavelengths(path, wavelengths, needs_curve=True)
    warnings = _check_values(path, wavelengths, values, quantity)
    names = tuple(str(index + 1) for index in range(len(values)))
    return Spectra(names, frozen(wavelengths), frozen(values), named=False, warnings=tuple(warnings))


def _starts_with(path: Path, signature: bytes) -> bool:
    """False for what cannot be read: whoever reads it next says why."""
    try:
        with path.open("rb") as stream:
            return stream.read(len(signature)) == signature
    except (OSError, ValueError):
        return False


def write_spectra(
    path: Path, wavelengths_nm: Float64Array, values: Float64Array, names: tuple[str, ...], lines: bool = False
) -> None:
    """Write spectra (spectra, n) as CSV that `read_spectra` gives back bit for bit."""
    with atomic_path(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as stream:
        if lines:
            stream.write("# kind: lines\n")
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(["wavelength_nm", *names])
        for index, wavelength in enumerate(wavelengths_nm):
            writer.writerow([repr(float(wavelength)), *(repr(float(row[index])) for row in values)])


class _Row(NamedTuple):
    """A line of the file with its number, not yet split."""

    number: int
    text: str
    delimiter: str


def _rows(path: Path) -> tuple[list[_Row], bool]:
    """Every row that is not blank or a comment, and whether rows are spectral lines."""
    text = read_text(path, SpectrumError, "give a table of spectra as CSV in UTF-8")
    content = [(number, line.strip()) for number, line in enumerate(text.splitlines(), start=1)]
    lines = any(line.replace(" ", "").casefold() == "#kind:lines" for _, line in content)
    kept = [(number, line.split("#")[0].strip()) for number, line in content if line and not line.startswith("#")]
    if not kept:
        raise SpectrumError("the file holds no data", where=path, remedy="give one row per wavelength: nm, value")
    delimiter = max(";\t,", key=kept[0][1].count)
    return [_Row(number, line, delimiter) for number, line in kept], lines


def _cells(path: Path, number: int, text: str, delimiter: str) -> list[str]:
    try:
        return [cell.strip() for cell in next(csv.reader([text], delimiter=delimiter))]
    except csv.Error as error:
        raise SpectrumError(str(error), where=_at(path, number), remedy="is it a table of spectra?") from None


def _split_header(path: Path, rows: list[_Row]) -> tuple[list[str] | None, list[_Row]]:
    """A first row whose first cell is no number is the header.

    A cell that begins like one (``380 nm``, ``380,0``) is a mistake in the data, not a name.
    """
    header = _cells(path, *rows[0])
    if header[0][:1].isdigit() or _is_number(header[0]):
        return None, rows
    if len(rows) == 1:
        raise SpectrumError("a header and no data", where=path, remedy="give one row per wavelength: nm, value")
    return header, rows[1:]


def _number(cell: str) -> float:
    """What is written, and not what else Python would read as a number (``4_00``, other scripts' digits)."""
    if "_" in cell or not cell.isascii():
        raise ValueError(cell)
    return float(cell)


def _is_number(cell: str) -> bool:
    try:
        _number(cell)
    except ValueError:
        return False
    return True


def _numbers(path: Path, row: _Row, width: int) -> list[float]:
    cells = _cells(path, *row)
    if len(cells) != width:
        raise SpectrumError(
            f"{len(cells)} columns, the rows before have {width}",
            where=_at(path, row.number),
            remedy="give every row the same columns",
        )
    numbers = []
    for cell in cells:
        try:
            value = _number(cell)
        except ValueError:
            what = "an empty cell" if not cell else f"'{cell[:40]}' is not a number"
            raise SpectrumError(
                what, where=_at(path, row.number), remedy="use decimal points and no units in cells"
            ) from None
        if not math.isfinite(value):
            raise SpectrumError(
                f"'{cell[:40]}' is not a finite number",
                where=_at(path, row.number),
                remedy="measure, interpolate or drop that row",
            )
        numbers.append(value)
    return numbers


def _ascending(
    path: Path, body: list[_Row], wavelengths: Float64Array, values: Float64Array
) -> tuple[Float64Array, Float64Array]:
    steps = np.diff(wavelengths)
    if (steps > 0).all():
        return wavelengths, values
    if (steps < 0).all():
        return wavelengths[::-1], values[:, ::-1]
    if (steps == 0).any():
        at = int(np.argmax(steps == 0)) + 1
        raise SpectrumError(
            f"wavelength {wavelengths[at]:g} nm occurs twice",
            where=_at(path, body[at].number),
            remedy="keep one row per wavelength",
        )
    rising = (steps > 0).sum() >= (steps < 0).sum()
    at = int(np.argmax(steps < 0 if rising else steps > 0)) + 1
    repeated = f"; {wavelengths[at]:g} nm occurs twice" if wavelengths[at] in wavelengths[:at] else ""
    raise SpectrumError(
        f"wavelength {wavelengths[at]:g} nm is out of order after {wavelengths[at - 1]:g} nm{repeated}",
        where=_at(path, body[at].number),
        remedy="sort the rows by wavelength",
    )


def _check_wavelengths(path: Path, wavelengths: Float64Array, needs_curve: bool) -> None:
    low, high = float(wavelengths[0]), float(wavelengths[-1])
    for unit, factor in (("metres", 1e9), ("micrometres", 1e3)):
        if low > 0 and _PLAUSIBLE_NM[0] <= low * factor and high * factor <= _PLAUSIBLE_NM[1] and high < 10:
            raise SpectrumError(
                f"wavelengths from {low:g} to {high:g} look like {unit}",
                where=path,
                remedy=f"multiply them by {factor:g} to give nanometres",
            )
    if low < _PLAUSIBLE_NM[0] or high > _PLAUSIBLE_NM[1]:
        raise SpectrumError(
            f"wavelengths from {low:g} to {high:g} are not nanometres of light",
            where=path,
            remedy="give the first column in nm",
        )
    if high < _VISIBLE_NM[0] or low > _VISIBLE_NM[1]:
        raise SpectrumError(
            f"wavelengths from {low:g} to {high:g} nm miss the visible range",
            where=path,
            remedy="give data between 380 and 780 nm",
        )
    if needs_curve and len(wavelengths) < 2:
        raise SpectrumError("one wavelength only", where=path, remedy="give a table, or mark it '# kind: lines'")


def _check_values(path: Path, wavelengths: Float64Array, values: Float64Array, quantity: Quantity) -> list[str]:
    """Errors for values that cannot be, warnings for reflectances outside 0..1, which are kept."""
    if quantity == "power":
        return []
    if values.max() > _LARGEST_REFLECTANCE:
        raise SpectrumError(
            f"reflectance up to {values.max():g}",
            where=path,
            remedy="divide percentages by 100, and counts by the white reference",
        )
    if values.min() < -0.5:
        raise SpectrumError(f"reflectance down to {values.min():g}", where=path, remedy="correct the dark signal")
    outside = ((values < 0) | (values > 1)).any(axis=0)
    if not outside.any():
        return []
    return [
        f"reflectance from {values.min():g} to {values.max():g}, outside 0..1 at {int(outside.sum())} wavelengths; "
        "kept as measured"
    ]


def _at(path: Path, line: int) -> str:
    return f"{path}, line {line}"


def colorchecker_spectra() -> Spectra:
    """The 24 reflectances of the ColorChecker (BabelColor Average, 380 to 730 nm in 10 nm)."""
    from spectral_core import standards

    names, wavelengths, values = standards.colorchecker()
    return Spectra(names, wavelengths, values)
