"""Tables of readings as people write them: CSV of any separator, told by file and line when wrong."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.errors import DisplayError

# The sun's disc has 2e9 cd/m2: what is larger is no reading, and its powers overflow.
_LARGEST_NUMBER = 1e12

Rows = list[tuple[int, list[str]]]


def parse_table(text: str, path: Path, remedy: str) -> tuple[list[str], Rows]:
    """The header, and the rows with their line numbers, all as long as the header.

    Separated by commas, semicolons or tabs, whichever the header has most of; blank lines and those
    that begin with ``#`` do not count.

    Raises
    ------
    DisplayError
        If there is no row, or one is longer or shorter than the header.
    """
    lines = [(number, line) for number, line in enumerate(text.split("\n"), 1) if line.strip() and line[0] != "#"]
    if len(lines) < 2:
        raise DisplayError("holds no rows", where=path, remedy=remedy)
    delimiter = max(",;\t", key=lines[0][1].count)
    (_, header), *rows = ((number, _cells(line, delimiter, f"{path}, line {number}")) for number, line in lines)
    for number, row in rows:
        if len(row) != len(header):
            raise DisplayError(
                f"{len(row)} columns, the header has {len(header)}",
                where=f"{path}, line {number}",
                remedy="correct the row",
            )
    return header, rows


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


def number_columns(rows: Rows, places: list[int], path: Path) -> Float64Array:
    """Columns (rows, places) of a table."""
    values = [[finite_number(row[place], f"{path}, line {number}") for place in places] for number, row in rows]
    return np.array(values, dtype=np.float64).reshape(len(rows), len(places))


def _cells(line: str, delimiter: str, where: str) -> list[str]:
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter))]
    except csv.Error as error:
        raise DisplayError(f"is no CSV ({error})", where=where, remedy="correct the row") from None
