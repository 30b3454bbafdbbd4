"""The text of an ENVI header: its keys and what stands behind them, whoever wrote it.

``key = value`` a line after a first line ``ENVI``; lists stand in braces, over as many lines as they
need, and end at the first closing one; ``;`` starts a comment. Case, blanks and underscores in keys
mean nothing. What is damaged or hostile costs no more than its own length.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.errors import TextureError
from spectral_core.files import read_bytes

# Names of twenty thousand spectra are a quarter of it.
_LARGEST_BYTES = 4 * 1024 * 1024
# Headers have a few dozen, and as many comments; what has more is no header.
_MOST_ENTRIES = 2000
# No number that means anything is longer; Python's own conversion takes long for millions of digits.
_LONGEST_NUMBER = 64
# Whole numbers beyond are not told apart in float64; no file is larger either.
_LARGEST_INTEGER = 2.0**53

_COMMENT = re.compile(r"^[ \t]*;.*$", re.MULTILINE)
_BLANK = re.compile(r"\s*")
_KEY_NOISE = re.compile(r"[\s_]+")


@dataclass(frozen=True)
class EnviText:
    """Keys and values of a header, as text.

    Attributes
    ----------
    path
        For messages.
    entries
        Value per key; keys in lower case without blanks, values without braces.
    warnings
        Keys that occur twice and lines that are no entries.
    """

    path: Path
    entries: Mapping[str, str]
    warnings: tuple[str, ...]

    def text(self, key: str) -> str:
        """Value of a key on one line, empty if there is none."""
        return " ".join(self.entries.get(_plain(key), "").split())

    def integer(self, key: str, default: int | None = None) -> int:
        """Whole number of a key; `default`, unless that is None, if there is none.

        Raises
        ------
        TextureError
            If it is missing or no whole number.
        """
        value = self.text(key)
        if not value:
            if default is None:
                raise TextureError(
                    f"lacks '{key}'", where=self.path, remedy="complete the header; is a brace before it not closed?"
                )
            return default
        number = self.number(key)
        if number is None or not abs(number) <= _LARGEST_INTEGER or number != int(number):
            raise TextureError(f"'{key} = {shown(value)}' is no whole number", where=self.path, remedy="correct it")
        return int(number)

    def number(self, key: str) -> float | None:
        """Number of a key, which may be infinite or none (NaN); None if there is none.

        Raises
        ------
        TextureError
            If it is something else.
        """
        value = self.text(key)
        if not value:
            return None
        try:
            return _number(value)
        except ValueError:
            raise TextureError(f"'{key} = {shown(value)}' is no number", where=self.path, remedy="correct it") from None

    def numbers(self, key: str, count: int, of: str) -> Float64Array | None:
        """Finite numbers (count,) of a list, separated by commas or blanks; None if there is none.

        Raises
        ------
        TextureError
            If it has another length or holds something else; `of` says what there are `count` of.
        """
        value = self.entries.get(_plain(key), "").strip()
        if not value:
            return None
        cells = _cells(value, count)
        if len(cells) != count:
            number = value.removesuffix(",").count(",") + 1 if "," in value else len(cells)
            raise TextureError(
                f"'{key}' has {number}{'' if ',' in value or number < count else ' or more'} values for {count} {of}",
                where=self.path,
                remedy=f"give one for each of the {of}",
            )
        values = np.array([_number_or_nan(cell) for cell in cells])
        wrong = np.flatnonzero(~np.isfinite(values))
        if len(wrong):
            raise TextureError(
                f"value {wrong[0] + 1} of '{key}', '{shown(cells[wrong[0]])}', is no finite number",
                where=self.path,
                remedy="correct it",
            )
        return values

    def words(self, key: str, most: int) -> tuple[str, ...]:
        """Texts of a list separated by commas; what follows the first `most` stays together."""
        value = self.text(key)
        return tuple(cell.strip() for cell in value.rstrip(", ").split(",", most)) if value else ()


def begins_header(data: bytes) -> bool:
    """Whether a file that begins with `data` (at least 16 bytes, if it has as many) is an ENVI header."""
    first = data[:16].removeprefix(b"\xef\xbb\xbf").replace(b"\r", b"\n").split(b"\n")[0]
    return first.rstrip().upper() == b"ENVI"


def read_text_of_header(path: Path) -> EnviText:
    """Read the text of a header: UTF-8, or Latin-1 if it is none.

    Raises
    ------
    TextureError
        If the file cannot be read or is no ENVI header.
    """
    return parse_text(read_bytes(path, TextureError, "give an ENVI header", _LARGEST_BYTES), path)


def parse_text(data: bytes, path: Path) -> EnviText:
    """The same of a header's bytes."""
    if not begins_header(data):
        raise TextureError("does not begin with a line 'ENVI'", where=path, remedy="give an ENVI header")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.removeprefix(b"\xef\xbb\xbf").decode("latin-1")
    text, comments = _COMMENT.subn("", text.replace("\r\n", "\n").replace("\r", "\n"), _MOST_ENTRIES)
    if comments == _MOST_ENTRIES:
        raise _too_long(path)
    return _parsed(text, path)


def _parsed(text: str, path: Path) -> EnviText:
    entries: dict[str, str] = {}
    repeated: list[str] = []
    stray = 0
    position = _end_of_blanks(text, len("ENVI"))
    for _ in range(_MOST_ENTRIES):
        if position == len(text):
            return EnviText(path, entries, _warnings(repeated, stray))
        written, value, end = _entry(text, position, path)
        position, key = _end_of_blanks(text, end), _plain(written)
        if not key:
            stray += 1
        elif entries.setdefault(key, value) != value:
            entries[key] = value
            repeated.append(written)
    raise _too_long(path)


def _too_long(path: Path) -> TextureError:
    return TextureError("is far too long for a header", where=path, remedy="give an ENVI header")


def shown(text: str) -> str:
    """Text of a file, fit for a message: its beginning, without characters that move cursors."""
    return "".join(each if each.isprintable() else "?" for each in text[:40])


def _warnings(repeated: list[str], stray: int) -> tuple[str, ...]:
    warnings = []
    if repeated:
        names = ", ".join(f"'{shown(key)}'" for key in dict.fromkeys(repeated[:4]))
        warnings.append(f"the header gives {names} more than once; the last one counts")
    if stray:
        warnings.append(f"the header has {stray} lines that are no 'key = value'; ignored")
    return tuple(warnings)


def _plain(key: str) -> str:
    return _KEY_NOISE.sub("", key.casefold())


def _end_of_blanks(text: str, position: int) -> int:
    match = _BLANK.match(text, position)
    return match.end() if match else position


def _entry(text: str, position: int, path: Path) -> tuple[str, str, int]:
    """Key, value and the end of the entry at `position`; an empty key for a line that is none."""
    end = text.find("\n", position)
    end = len(text) if end < 0 else end
    equals = text.find("=", position, end)
    if equals < 0:
        return "", "", end
    key = text[position:equals].strip()
    first = _end_of_blanks(text, equals + 1)
    if not text.startswith("{", first):
        return key, text[equals + 1 : end].split(";")[0].strip(), end
    close = text.find("}", first)
    if close < 0:
        raise TextureError(f"the brace of '{shown(key)}' is never closed", where=path, remedy="close it with '}'")
    return key, text[first + 1 : close], close + 1


def _cells(value: str, count: int) -> list[str]:
    """Cells of a list, not many more than `count` whatever its length; one comma at its end is none too many."""
    if "," not in value:
        return value.split(None, count)
    return [cell.strip() for cell in value.removesuffix(",").split(",", count)]


def _number(text: str) -> float:
    """What is written, and not what else Python would read as a number (``4_00``, other scripts' digits)."""
    if "_" in text or not text.isascii() or len(text) > _LONGEST_NUMBER:
        raise ValueError(text[:_LONGEST_NUMBER])
    return float(text)


def _number_or_nan(text: str) -> float:
    try:
        return _number(text)
    except ValueError:
        return math.nan
