"""Typed reading of TOML tables: every error names the key and what it may be."""

from __future__ import annotations

import difflib
import math
import reprlib
import sys
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from spectral_core.errors import SceneError
from spectral_core.files import read_text

_REQUIRED: Any = object()
Vector = tuple[float, float, float]


class TableReader:
    """Takes keys out of one TOML table; `finish` refuses what is left."""

    def __init__(self, table: Any, where: Path, key: str) -> None:
        if not isinstance(table, dict):
            raise SceneError(f"'{key}' is not a table", where=where, remedy=f"write [{key}]")
        self._table = dict(table)
        self._where = where
        self._key = key
        self._known: list[str] = []

    def error(self, key: str, problem: str, remedy: str) -> SceneError:
        """A SceneError about one key of this table."""
        return SceneError(f"'{self._path(key)}' {problem}", where=self._where, remedy=remedy)

    def has(self, key: str) -> bool:
        """Whether the key was written."""
        return key in self._table

    def take(self, key: str, default: Any = _REQUIRED) -> Any:
        """The raw value of a key."""
        self._known.append(key)
        if key in self._table:
            return self._table.pop(key)
        if default is _REQUIRED:
            raise self.error(key, "is missing", "add it")
        return default

    def text(self, key: str, default: Any = _REQUIRED, choices: Sequence[str] = ()) -> str:
        """A string, perhaps one of some."""
        value = self.take(key, default)
        if not isinstance(value, str) or (choices and value not in choices):
            allowed = f"one of {', '.join(choices)}" if choices else "a text in quotes"
            raise self.error(key, f"is {_shown(value)}", f"give {allowed}")
        return value

    def number(self, key: str, default: Any = _REQUIRED, low: float = -math.inf, high: float = math.inf) -> float:
        """A finite number from low to high."""
        return self._number(key, self.take(key, default), low, high)

    def integer(self, key: str, default: Any = _REQUIRED, low: int = 0, high: int = 1 << 20) -> int:
        """A whole number from low to high."""
        value = self.number(key, default, low, high)
        if value != int(value):
            raise self.error(key, f"is {_shown(value)}", "give a whole number")
        return int(value)

    def boolean(self, key: str, default: bool) -> bool:
        """True or false."""
        value = self.take(key, default)
        if not isinstance(value, bool):
            raise self.error(key, f"is {_shown(value)}", "give true or false")
        return value

    def vector(self, key: str, default: Any = _REQUIRED, low: float = -1e6, high: float = 1e6) -> Vector:
        """Three finite numbers."""
        value = self.take(key, default)
        if not isinstance(value, (list, tuple)) or len(value) != 3:
            raise self.error(key, f"is {_shown(value)}", "give three numbers in brackets")
        x, y, z = (self._number(key, each, low, high) for each in value)
        return x, y, z

    def texts(self, key: str, default: Any = _REQUIRED) -> tuple[str, ...]:
        """A list of different strings, at least one."""
        value = self.take(key, default)
        if not isinstance(value, (list, tuple)) or not value or not all(isinstance(each, str) for each in value):
            raise self.error(key, f"is {_shown(value)}", "give a list of texts in quotes")
        if len(set(value)) < len(value):
            raise self.error(key, "names one twice", "give each once")
        return tuple(value)

    def table(self, key: str, default: Any = _REQUIRED) -> TableReader:
        """A table within this one."""
        return TableReader(self.take(key, default), self._where, self._path(key))

    def tables(self, key: str, default: Any = _REQUIRED) -> list[TableReader]:
        """A list of tables, ``[[key]]``."""
        value = self.take(key, default)
        if not isinstance(value, (list, tuple)):
            raise self.error(key, "is not a list of tables", f"write [[{key}]] before each")
        return [TableReader(each, self._where, f"{self._path(key)}[{index}]") for index, each in enumerate(value)]

    def named_tables(self, key: str) -> dict[str, TableReader]:
        """Tables with names of the user's own, ``[key.NAME]``."""
        value = self.take(key, {})
        if not isinstance(value, dict):
            raise self.error(key, "is not a table", f"write [{key}.NAME]")
        return {name: TableReader(each, self._where, f"{self._path(key)}.{name}") for name, each in value.items()}

    def finish(self) -> None:
        """Refuse keys that nobody asked for."""
        for key in self._table:
            near = difflib.get_close_matches(key, self._known, n=1)
            hint = f"did you mean '{near[0]}'?" if near else f"it may hold {', '.join(self._known)}"
            raise self.error(key, "is no key of this table", hint)

    def _number(self, key: str, value: Any, low: float, high: float) -> float:
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) <= sys.float_info.max:
            raise self.error(key, f"is {_shown(value)}", "give a number")
        if not low <= value <= high:
            span = f"from {low:g} to {high:g}" if math.isfinite(high) else f"of at least {low:g}"
            raise self.error(key, f"is {_shown(value)}", f"give a number {span}")
        return float(value)

    def _path(self, key: str) -> str:
        return f"{self._key}.{key}" if self._key else key


def _shown(value: Any) -> str:
    """A value as a message can hold it: TOML allows lists and integers of any length."""
    if isinstance(value, int) and abs(value) > sys.float_info.max:
        return "an enormous number"
    return reprlib.repr(value)


def read_toml(path: Path) -> tuple[str, TableReader]:
    """The text of a TOML file and a reader of its top table.

    Raises
    ------
    SceneError
        If it is missing, no text, or no TOML (with the line).
    """
    text = read_text(path, SceneError, "name a scene's TOML file")
    return text, parse_toml(text, path)


def parse_toml(text: str, where: Path) -> TableReader:
    """A reader of the top table of a TOML text."""
    try:
        return TableReader(tomllib.loads(text), where, "")
    except (ValueError, RecursionError) as error:  # ValueError: also of numbers too long to read
        raise SceneError(f"is no valid TOML: {error}", where=where, remedy="correct that line") from None
