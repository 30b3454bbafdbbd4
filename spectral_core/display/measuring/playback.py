"""Which patch is shown and since when: the part of the patch player that needs no screen.

Its clock is given from outside, in seconds since 1970. Two files tell others what happens:
``patch-state.json`` what is shown now, and ``patches-shown.csv`` all that was shown.
"""

from __future__ import annotations

import csv
import datetime
import json
import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from spectral_core.display.measuring.patches import SHOWN_HEADER, PatchList, codes_text
from spectral_core.errors import DisplayError
from spectral_core.files import atomic_path

STATE_FILE, SHOWN_FILE, TRIGGER_FILE = "patch-state.json", "patches-shown.csv", "patch-next"
ADVANCES = ("KEY", "TIMER", "FILE")


@dataclass(frozen=True)
class Pace:
    """When the next patch comes.

    Attributes
    ----------
    advance
        ``KEY`` only by key, ``TIMER`` after `seconds`, ``FILE`` when the trigger is touched.
    seconds
        How long a settled patch stays, with ``TIMER``.
    settle
        Seconds after which a patch counts as settled and may be read.
    warm_up
        Seconds more before the first patch counts as settled.
    """

    advance: str = "KEY"
    seconds: float = 3.0
    settle: float = 0.5
    warm_up: float = 0.0

    def __post_init__(self) -> None:
        if self.advance not in ADVANCES:
            raise DisplayError(f"'{self.advance}' is no way to advance", remedy=f"use {', '.join(ADVANCES)}")
        for name in ("seconds", "settle", "warm_up"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0):
                raise DisplayError(f"{name} is {value}", remedy="give seconds from 0 up")


@dataclass(frozen=True)
class Showing:
    """One patch on the display.

    Attributes
    ----------
    patch
        Its number, from 0.
    wait
        Seconds from `shown` until it counts as settled.
    shown, gone
        When it was first drawn, and when it was left; None before that.
    """

    patch: int
    wait: float
    shown: float | None = None
    gone: float | None = None

    @property
    def ready(self) -> float:
        """From when on it may be read; infinite before it was drawn."""
        return math.inf if self.shown is None else self.shown + self.wait


class Playback:
    """Steps through a list of patches."""

    def __init__(self, patches: PatchList, pace: Pace) -> None:
        self.patches, self.pace = patches, pace
        self.ended = ""
        self.showings = [Showing(0, pace.warm_up + pace.settle)]

    @property
    def patch(self) -> int:
        """Number of the patch that is shown, from 0."""
        return self.showings[-1].patch

    def state(self, now: float) -> str:
        """``drawing``, ``settling``, ``ready``, or at the end ``done`` or ``stopped``."""
        if self.ended:
            return self.ended
        if self.showings[-1].shown is None:
            return "drawing"
        return "ready" if now >= self.showings[-1].ready else "settling"

    def drawn(self, now: float) -> None:
        """The patch stands on the display: from now on it settles."""
        if self.showings[-1].shown is None:
            self.showings[-1] = replace(self.showings[-1], shown=now)

    def tick(self, now: float, touched: bool = False) -> None:
        """Go on if it is time. A touch before a patch has settled counts for nothing."""
        if self.state(now) != "ready":
            return
        over = now >= self.showings[-1].ready + self.pace.seconds
        if (self.pace.advance == "TIMER" and over) or (self.pace.advance == "FILE" and touched):
            self.step(1, now)

    def step(self, by: int, now: float) -> None:
        """Show the next patch (1) or the one before (-1); after the last all is done."""
        patch = max(self.patch + by, 0)
        self._leave(now)
        if patch == len(self.patches):
            self.ended = "done"
        else:
            self.showings.append(Showing(patch, self.pace.settle))

    def stop(self, now: float) -> None:
        """End before the last patch."""
        if not self.ended:
            self._leave(now)
            self.ended = "stopped"

    def document(self, now: float) -> dict[str, Any]:
        """What ``patch-state.json`` says; `index` runs from 1, times are seconds since 1970.

        `shown` and `ready` are null until the patch was drawn.
        """
        showing = self.showings[-1]
        codes = self.patches.codes[showing.patch]
        return {
            "format": 1,
            "state": self.state(now),
            "index": showing.patch + 1,
            "count": len(self.patches),
            "name": self.patches.names[showing.patch],
            "codes": codes.tolist(),
            "rgb_8bit": (255 * codes).tolist(),
            "shown": showing.shown,
            "ready": None if showing.shown is None else showing.ready,
        }

    def _leave(self, now: float) -> None:
        self.showings[-1] = replace(self.showings[-1], gone=now)


def write_state(document: dict[str, Any], folder: Path) -> None:
    """``patch-state.json``, whole at any moment."""
    with atomic_path(folder / STATE_FILE) as temporary:
        temporary.write_text(json.dumps(document), encoding="utf-8")


def write_shown(playback: Playback, folder: Path) -> Path:
    """``patches-shown.csv``: a row for every patch that was shown and left.

    `ready` is empty where the patch was left before it had settled. Times are UTC.
    """
    path = folder / SHOWN_FILE
    with atomic_path(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(SHOWN_HEADER)
        for each in playback.showings:
            if each.shown is not None and each.gone is not None:
                ready = _iso(each.ready) if each.gone >= each.ready else ""
                codes, name = playback.patches.codes[each.patch], playback.patches.names[each.patch]
                writer.writerow([*codes_text(codes), each.patch + 1, name, _iso(each.shown), ready, _iso(each.gone)])
    return path


class Trigger:
    """A file that an instrument's script touches when it has read a patch."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._seen = self._stamp()

    def touched(self) -> bool:
        """Whether it was made or touched since the last call."""
        before, self._seen = self._seen, self._stamp()
        return self._seen is not None and self._seen != before

    def _stamp(self) -> int | None:
        try:
            return self._path.stat().st_mtime_ns
        except OSError:
            return None


def _iso(seconds: float) -> str:
    return datetime.datetime.fromtimestamp(seconds, datetime.UTC).isoformat(timespec="milliseconds")
