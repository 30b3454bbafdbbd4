"""CGATS text tables, as Argyll's ``.ti3`` files are: keywords, a data format, data."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.display.measuring.tables import finite_number
from spectral_core.errors import DisplayError

_LARGEST_TABLE = 1_000_000
# Fields that are numbers whatever stands in them; others may be names.
_NUMERIC = ("RGB_", "XYZ_", "SPEC_")


@dataclass(frozen=True)
class CgatsTable:
    """The first table of a file: keywords, and the columns (rows,) of codes, XYZ and spectra by field name."""

    keywords: dict[str, str]
    columns: dict[str, Float64Array]

    def stacked(self, names: tuple[str, ...]) -> Float64Array | None:
        """Columns side by side (rows, names), None if one is missing."""
        if not all(name in self.columns for name in names):
            return None
        return np.stack([self.columns[name] for name in names], axis=1)


def parse_cgats(text: str, path: Path) -> CgatsTable:
    """Parse the first table of a CGATS text.

    Raises
    ------
    DisplayError
        If it has no table, or a row does not fit its format; the message names the line.
    """
    lines = text.splitlines()
    form = _section(lines, "BEGIN_DATA_FORMAT", "END_DATA_FORMAT", path)
    data = _section(lines, "BEGIN_DATA", "END_DATA", path)
    fields = [name for number in form for name in lines[number].split()]
    rows = [(number, _words(lines[number], f"{path}, line {number + 1}")) for number in data if lines[number].strip()]
    twice = next((name for name in fields if fields.count(name) > 1), None)
    if twice is not None:
        raise DisplayError(f"the field {twice} occurs twice", where=path, remedy="drop one of the columns")
    if not fields or not rows or len(fields) * len(rows) > _LARGEST_TABLE:
        raise DisplayError("holds no usable table of measurements", where=path, remedy="measure again")
    for number, words in rows:
        if len(words) != len(fields):
            raise DisplayError(
                f"{len(words)} values for {len(fields)} fields",
                where=f"{path}, line {number + 1}",
                remedy="correct the row",
            )
    columns = {
        name: np.array([finite_number(words[index], f"{path}, line {number + 1}") for number, words in rows])
        for index, name in enumerate(fields)
        if name.startswith(_NUMERIC)
    }
    return CgatsTable(_keywords(lines[: form.start]), columns)


def _section(lines: list[str], begin: str, end: str, path: Path) -> range:
    try:
        first = next(index for index, line in enumerate(lines) if line.strip() == begin)
        last = next(index for index, line in enumerate(lines) if index > first and line.strip() == end)
    except StopIteration:
        raise DisplayError(f"has no {begin} ... {end}", where=path, remedy="is it a CGATS file such as .ti3?") from None
    return range(first + 1, last)


def _keywords(lines: list[str]) -> dict[str, str]:
    pairs = (line.strip().partition(" ") for line in lines)
    return {key: value.strip().strip('"') for key, _, value in pairs if key and value}


def _words(line: str, where: str) -> list[str]:
    try:
        return shlex.split(line) if '"' in line else line.split()
    except ValueError:
        raise DisplayError("a quotation mark is not closed", where=where, remedy="correct the row") from None
