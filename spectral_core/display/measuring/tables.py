"""Tables of codes and readings: CSV with one header, comma, semicolon or tab, ``#`` before comments."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.chromaticities import xyY_to_XYZ
from spectral_core.errors import DisplayError
from spectral_core.files import read_text

CODES = ("R", "G", "B")
COLOURS = (("X", "Y", "Z"), ("x", "y", "Y"))
# The sun's disc has 2e9 cd/m2: what is larger is no reading, and its powers overflow.
_LARGEST_NUMBER = 1e12


@dataclass(frozen=True)
class Table:
    """Rows of cells, all as long as the header.

    Attributes
    ----------
    path
        Where it is from, for messages.
    header, rows
        Cells without the blanks around them.
    lines
        The line of each row in the file.
    """

    path: Path
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]

    def where(self, row: int) -> str:
        """The place of a row, for messages."""
        return f"{self.path}, line {self.lines[row]}"

    def has(self, names: Iterable[str]) -> bool:
        """Whether all these columns are there."""
        return set(names) <= set(self.header)

    def require(self, names: Sequence[str]) -> None:
        """Raise `DisplayError` if one of these columns is missing."""
        missing = [each for each in names if each not in self.header]
        if missing:
            raise DisplayError(
                f"lacks the column {missing[0]}", where=self.path, remedy=f"the header is {','.join(names)}"
            )

    def numbers(self, names: Iterable[str]) -> Float64Array:
        """Finite numbers (rows, names) of the named columns."""
        return self.numbers_at([self.header.index(each) for each in names])

    def numbers_at(self, places: Sequence[int]) -> Float64Array:
        """Finite numbers (rows, places) of columns by their place."""
        values = [[self._number(row, place) for place in places] for row in range(len(self.rows))]
        return np.array(values, dtype=np.float64).reshape(len(self.rows), len(places))

    def XYZ(self, names: Sequence[str], values: Float64Array) -> Float64Array:
        """XYZ (rows, 3) of numbers (rows, 3) under the header `names`, one of `COLOURS`."""
        if names[0] != "x":
            return values
        _, y, Y = values.T
        wrong = np.flatnonzero(((y <= 0) & (Y != 0)) | (Y < 0))
        if len(wrong):
            raise DisplayError(
                f"the {'luminance Y' if Y[wrong[0]] < 0 else 'chromaticity y'} is not above 0",
                where=self.where(int(wrong[0])),
                remedy="correct the reading",
            )
        return xyY_to_XYZ(values)

    def _number(self, row: int, place: int) -> float:
        return finite_number(self.rows[row][place], self.where(row))


def finite_number(cell: str, where: str) -> float:
    """What a cell says, and not what else Python would read as a number (``1_0``, other scripts' digits).

    Raises
    ------
    DisplayError
        If it is no number, or one that no instrument reads.
    """
    try:
        value = math.nan if "_" in cell or not cell.isascii() else float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        hint = "correct the cell" + (" (with a decimal point)" if "," in cell else "")
        raise DisplayError(f"'{cell[:40]}' is no finite number", where=where, remedy=hint)
    if abs(value) > _LARGEST_NUMBER:
        raise DisplayError(f"'{cell[:40]}' is larger than any reading", where=where, remedy="correct the cell")
    return value


def read_table(path: Path, remedy: str, least: int = 1) -> Table:
    """Read a file as `parse_table` does its text."""
    return parse_table(read_text(path, DisplayError, remedy), path, remedy, least)


def parse_table(text: str, path: Path, remedy: str, least: int = 1) -> Table:
    """The table of a text; `remedy` says what to give where there is none.

    Raises
    ------
    DisplayError
        If it is no CSV, has fewer rows than `least`, or one that does not fit the header.
    """
    lines = [(n, line) for n, line in enumerate(text.split("\n"), 1) if line.strip() and not line.startswith("#")]
    if len(lines) < 1 + least:
        raise DisplayError(f"holds {'no' if least < 2 else f'fewer than {least}'} rows", where=path, remedy=remedy)
    delimiter = max(",;\t", key=lines[0][1].count)
    try:
        cells = list(csv.reader(io.StringIO("\n".join(line for _, line in lines)), delimiter=delimiter))
    except csv.Error as error:
        raise DisplayError(f"is no CSV ({error})", where=path, remedy=remedy) from None
    header, *rows = (tuple(cell.strip() for cell in row) for row in cells)
    numbers = tuple(number for number, _ in lines[1:])
    wrong = next(((n, row) for n, row in zip(numbers, rows, strict=False) if len(row) != len(header)), None)
    if wrong is not None:
        raise DisplayError(
            f"{len(wrong[1])} columns, the header has {len(header)}",
            where=f"{path}, line {wrong[0]}",
            remedy="correct the row",
        )
    if len(rows) != len(numbers):
        raise DisplayError("a quoted cell runs over several lines", where=path, remedy="write a row on one line")
    return Table(path, header, tuple(rows), numbers)


def unit_codes(codes: Float64Array) -> Float64Array:
    """Codes 0..1 of codes (n, 3) that are 0..255 if any is above 1."""
    return codes / (255.0 if codes.size and codes.max() > 1 else 1.0)
