"""Lists of patches to show on a display, and their pairing with an instrument's readings."""

from __future__ import annotations

import csv
import datetime
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from spectral_core.arrays import Float64Array, frozen
from spectral_core.display.tables import Rows, number_columns, parse_table
from spectral_core.errors import DisplayError
from spectral_core.files import atomic_path, read_text

PUBLISHED = "published"
_CODES = ["R", "G", "B"]
_NAMES = ("name", "patch", "colour", "color")
SHOWN_HEADER = [*_CODES, "index", "name", "shown", "ready", "gone"]
_COLOURS = (["X", "Y", "Z"], ["x", "y", "Y"])
# The 50 colours of the published protocol are random; a fixed seed gives everyone the same.
_SEED = 2021


@dataclass(frozen=True)
class PatchList:
    """Patches in the order in which they are shown.

    Attributes
    ----------
    codes
        (n, 3) device codes, 0..1.
    names
        One per patch, may be empty.
    """

    codes: Float64Array
    names: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.codes)


def published_patches() -> PatchList:
    """The 234 patches of Diaz-Barrancas et al. (2020, 2.1): ramps of each channel in steps of 5, 50
    random colours and systematic ones.

    The article does not list the systematic ones: here they are 24 greys, cyan, magenta, yellow and
    white. Each ramp begins with black, so that black is read three times.
    """
    ramp = np.arange(0, 256, 5)
    ramps = [np.outer(ramp, axis) for axis in np.eye(3, dtype=int)]
    greys = np.repeat(np.arange(10, 250, 10)[:, None], 3, axis=1)
    solids = 255 * np.array([[0, 1, 1], [1, 0, 1], [1, 1, 0], [1, 1, 1]])
    random = np.random.default_rng(_SEED).integers(0, 256, (50, 3))
    codes = np.concatenate([*ramps, greys, solids, random])
    names = [f"{channel} {level}" for channel in ("red", "green", "blue") for level in ramp]
    names += [f"grey {level}" for level in greys[:, 0]] + ["cyan", "magenta", "yellow", "white"]
    names += [f"random {number}" for number in range(1, 51)]
    return PatchList(frozen(codes / 255), tuple(names))


def read_patches(source: str | Path) -> PatchList:
    """A CSV with the columns R, G, B (0..1, or 0..255 if any is above 1) and perhaps a name; or ``published``.

    Raises
    ------
    DisplayError
        If the file is no such list, or a code is out of range.
    """
    if str(source) == PUBLISHED:
        return published_patches()
    path = Path(source)
    header, rows = _table(path, "give a CSV with the header R,G,B, or 'published'")
    _require(header, _CODES, path)
    codes = _columns(header, rows, _CODES, path)
    codes = codes / (255.0 if codes.max() > 1 else 1.0)
    for (number, _), code in zip(rows, codes, strict=True):
        if not ((code >= 0) & (code <= 1)).all():
            raise DisplayError(
                "device codes outside 0..1 (or 0..255)", where=f"{path}, line {number}", remedy="correct the row"
            )
    name = next((index for index, each in enumerate(header) if each.casefold() in _NAMES), None)
    return PatchList(frozen(codes), tuple("" if name is None else row[name] for _, row in rows))


def write_patches(patches: PatchList, path: str | Path) -> None:
    """The list as CSV ``R,G,B,name``, codes 0..1, for `read_patches`."""
    _write([*_CODES, "name"], ([*codes_text(code), name] for code, name in _each(patches)), path)


def codes_text(codes: Float64Array) -> list[str]:
    """Codes (3,) as they stand in every file: 0..1, nine digits."""
    return [f"{value:.9g}" for value in codes]


@dataclass(frozen=True)
class Paired:
    """Readings with the codes that were shown.

    Attributes
    ----------
    header, rows
        A table that `read_measurements` reads: R, G, B, the colour, further columns of the readings.
    matched_by
        ``index``, ``time`` or ``order``.
    warnings
        What a user should know.
    """

    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    matched_by: str
    warnings: tuple[str, ...] = ()


def pair(shown: str | Path, readings: str | Path) -> Paired:
    """Join the list that the player wrote with an instrument's readings.

    By the readings' column ``index`` if they have it (several readings of a patch are repeats), else
    by their column ``time`` (ISO 8601, this computer's zone unless it says another; or seconds since
    1970), else by order, one reading a patch. Patches that were left before they had settled do not
    count. Columns of the readings other than index and time, spectra for instance, are kept.

    Raises
    ------
    DisplayError
        If a reading belongs to no patch, or the numbers differ.
    """
    shown, readings = Path(shown), Path(readings)
    showings = _settled(shown)
    header, rows = _table(readings, "give a CSV of readings with X,Y,Z or x,y,Y")
    colour = next((each for each in _COLOURS if set(each) <= set(header)), None)
    if colour is None:
        raise DisplayError(
            f"the header is {','.join(header[:6])}", where=readings, remedy="give the columns X,Y,Z or x,y,Y"
        )
    _columns(header, rows, colour, readings)  # a cell that is no number is told with its line
    matched_by = next((each for each in ("index", "time") if each in header), "order")
    if matched_by == "order":
        found = _by_order(showings, len(rows), shown, readings)
    else:
        column = header.index(matched_by)
        find = _by_index if matched_by == "index" else _by_time
        found = [find(showings, row[column], f"{readings}, line {number}") for number, row in rows]
    others = [each for each in header if each not in (*colour, "index", "time", *_CODES, "name")]
    picked = [header.index(each) for each in (*colour, *others)]
    table = tuple(
        (*showing.codes, *(row[index] for index in picked)) for showing, (_, row) in zip(found, rows, strict=True)
    )
    missing = len({each.index for each in showings} - {each.index for each in found})
    warnings = (f"{missing} of the patches shown have no reading",) if missing else ()
    return Paired((*_CODES, *colour, *others), table, matched_by, warnings)


def write_paired(paired: Paired, path: str | Path) -> None:
    """The joined table as CSV, for `characterise`."""
    _write(paired.header, paired.rows, path)


@dataclass(frozen=True)
class _Shown:
    index: int
    codes: tuple[str, str, str]
    ready: float
    gone: float


def _settled(path: Path) -> list[_Shown]:
    """What the player showed long enough, in order."""
    header, rows = _table(path, "give the patches-shown.csv that the player wrote")
    _require(header, SHOWN_HEADER, path)
    _columns(header, rows, _CODES, path)
    at = {name: header.index(name) for name in SHOWN_HEADER}
    found = []
    for number, row in rows:
        where = f"{path}, line {number}"
        if row[at["ready"]]:
            codes = (row[at["R"]], row[at["G"]], row[at["B"]])
            times = (_seconds(row[at[name]], where) for name in ("ready", "gone"))
            found.append(_Shown(_index(row[at["index"]], where), codes, *times))
    if not found:
        raise DisplayError("no patch was shown long enough to be read", where=path, remedy="show the patches again")
    return found


def _by_order(showings: Sequence[_Shown], readings: int, shown: Path, path: Path) -> list[_Shown]:
    if len(showings) != readings:
        raise DisplayError(
            f"{readings} readings, but {len(showings)} patches were shown ({shown.name})",
            where=path,
            remedy="give the readings a column index or time",
        )
    return list(showings)


def _by_index(showings: Sequence[_Shown], cell: str, where: str) -> _Shown:
    index = _index(cell, where)
    found = next((each for each in reversed(showings) if each.index == index), None)
    if found is None:
        raise DisplayError(f"patch {index} was not shown", where=where, remedy="correct the column index")
    return found


def _by_time(showings: Sequence[_Shown], cell: str, where: str) -> _Shown:
    time = _seconds(cell, where)
    found = next((each for each in showings if each.ready <= time <= each.gone), None)
    if found is None:
        raise DisplayError(f"no patch stood settled at {cell}", where=where, remedy="do both clocks agree?")
    return found


def _index(cell: str, where: str) -> int:
    if not cell.isdecimal():
        raise DisplayError(f"'{cell}' is no patch number", where=where, remedy="correct the column index")
    return int(cell)


def _seconds(cell: str, where: str) -> float:
    """Seconds since 1970 of a number or an ISO 8601 time."""
    try:
        seconds = float(cell)
    except ValueError:
        try:
            seconds = datetime.datetime.fromisoformat(cell).timestamp()
        except (ValueError, OverflowError, OSError):
            seconds = math.nan
    if not math.isfinite(seconds):
        raise DisplayError(f"'{cell}' is no time", where=where, remedy="give ISO 8601 or seconds since 1970")
    return seconds


def _table(path: Path, remedy: str) -> tuple[list[str], Rows]:
    """Header and rows with their line numbers; all rows as long as the header."""
    text = read_text(path, DisplayError, remedy)
    return parse_table(text, path, remedy)


def _require(header: Sequence[str], names: Sequence[str], path: Path) -> None:
    missing = [each for each in names if each not in header]
    if missing:
        raise DisplayError(f"lacks the column {missing[0]}", where=path, remedy=f"the header is {','.join(names)}")


def _columns(header: list[str], rows: Rows, names: Sequence[str], path: Path) -> Float64Array:
    """Finite numbers (n, len(names)) of the named columns."""
    return number_columns(rows, [header.index(each) for each in names], path)


def _each(patches: PatchList) -> Iterable[tuple[Float64Array, str]]:
    return zip(patches.codes, patches.names, strict=True)


def _write(header: Sequence[str], rows: Iterable[Sequence[str]], path: str | Path) -> None:
    with atomic_path(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(rows)
