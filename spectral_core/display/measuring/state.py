"""The state that a headset was measured in: without it, its profile cannot be repeated."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from datetime import datetime
from email.utils import parsedate
from typing import Any

from spectral_core.errors import DisplayError

EYES = ("left", "right", "both")
# A name or a note, not a document.
_LONGEST_TEXT = 1000
# Half a year; and further than any optics shows.
_LONGEST_WARM_UP = 262_800.0
_WIDEST_FIELD = 180.0


@dataclass(frozen=True)
class HeadsetState:
    """What was measured, and how it was set; None where nobody said.

    Attributes
    ----------
    model
        The headset's maker and model.
    eye
        ``left``, ``right`` or ``both``.
    brightness
        Its setting, in the headset's own words (``80 %``, ``night``).
    warm_up_minutes
        How long it had been on.
    date
        Day, perhaps time, of the measurement, ISO 8601.
    instrument
        What measured.
    field_deg
        Point of the field: degrees to the right and up from the centre.
    note
        Anything else.
    """

    model: str | None = None
    eye: str | None = None
    brightness: str | None = None
    warm_up_minutes: float | None = None
    date: str | None = None
    instrument: str | None = None
    field_deg: tuple[float, float] | None = None
    note: str | None = None

    def __post_init__(self) -> None:
        for name in ("model", "eye", "brightness", "date", "instrument", "note"):
            _check_text(name, getattr(self, name))
        if self.eye is not None and self.eye not in EYES:
            raise DisplayError(f"'{self.eye}' is no eye", remedy=f"use {', '.join(EYES)}")
        if self.warm_up_minutes is not None:
            minutes = _number("warm_up_minutes", self.warm_up_minutes, 0.0, _LONGEST_WARM_UP)
            object.__setattr__(self, "warm_up_minutes", minutes)
        if self.date is not None:
            _check_date(self.date)
        if self.field_deg is not None:
            object.__setattr__(self, "field_deg", _point(self.field_deg))

    def to_json(self) -> dict[str, object]:
        """What is known, as plain values."""
        known = {name: value for name, value in asdict(self).items() if value is not None}
        return {name: list(value) if isinstance(value, tuple) else value for name, value in known.items()}

    @classmethod
    def from_json(cls, document: object) -> HeadsetState:
        """From `to_json`.

        Raises
        ------
        DisplayError
            If a value has the wrong type, or a key is unknown.
        """
        if not isinstance(document, Mapping):
            raise DisplayError("'state' is no object", remedy="correct the profile")
        unknown = [str(key) for key in document if key not in cls.__dataclass_fields__]
        if unknown:
            raise DisplayError(
                f"'state' has an unknown key '{unknown[0][:40]}'",
                remedy=f"known are {', '.join(cls.__dataclass_fields__)}",
            )
        return cls(**document)


def iso_date(text: str) -> str | None:
    """ISO 8601 of a date as instruments write it (``Sun Mar 20 02:15:01 2022``); None if it is none."""
    try:
        return datetime.fromisoformat(text.strip()).isoformat()
    except ValueError:
        pass
    try:
        parts = parsedate(text)
        return datetime(*parts[:6]).isoformat() if parts else None
    except (ValueError, TypeError, IndexError, OverflowError):
        return None


def _check_text(name: str, value: Any) -> None:
    if value is not None and (not isinstance(value, str) or not value.strip() or len(value) > _LONGEST_TEXT):
        raise DisplayError(
            f"'{name}' is no text of 1 to {_LONGEST_TEXT} characters", remedy="correct it or leave it out"
        )


def _check_date(text: str) -> None:
    try:
        datetime.fromisoformat(text)
    except ValueError:
        raise DisplayError(
            f"'{text[:40]}' is no ISO date", remedy="write it as 2026-01-31 or 2026-01-31T14:30"
        ) from None


def _point(value: Any) -> tuple[float, float]:
    if not isinstance(value, (list, tuple)) or len(value) != 2:
        raise DisplayError("'field_deg' is not two numbers", remedy="give degrees to the right and up")
    x, y = (_number("field_deg", each, -_WIDEST_FIELD, _WIDEST_FIELD) for each in value)
    return x, y


def _number(name: str, value: Any, low: float, high: float) -> float:
    # NaN is in no range, and an integer too long for a float can still be compared.
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
        raise DisplayError(f"'{name}' is no number from {low:g} to {high:g}", remedy="correct it or leave it out")
    return float(value)
