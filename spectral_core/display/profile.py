"""A display profile: a model with its name and provenance, kept as JSON."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from spectral_core.arrays import BoolArray, Float64Array, FloatArray
from spectral_core.display.measuring.state import HeadsetState
from spectral_core.display.models import DisplayModel, GammaMatrix, SRGBCurve
from spectral_core.display.models.corrected import CorrectedLut
from spectral_core.display.models.tone_models import GainOffsetGamma, LutMatrix
from spectral_core.errors import DisplayError
from spectral_core.files import atomic_path, is_file, read_text, why_no_file

_FORMAT = "spectral-booth display profile"
_VERSION = 1
# Models that a profile may hold, by their type in the file.
MODELS: dict[str, Any] = {
    "gamma-matrix": GammaMatrix,
    "gain-offset-gamma": GainOffsetGamma,
    "lut-matrix": LutMatrix,
    "corrected-lut": CorrectedLut,
}
# CIE D65's table differs from sRGB's rounded white point by 9e-5 in linear RGB: the display's own
# white is not out of its gamut.
GAMUT_TOLERANCE = 1e-4
UNITS = ("cd/m2", "relative")
# Brighter than any display: the sun's disc.
_LARGEST_LUMINANCE = 2e9
_LEAST_SCENE_WHITE = 1e-9
# In whatever unit: beyond these the products of a profile overflow.
_WHITE_Y = (1e-6, 1e12)


@dataclass(frozen=True)
class DisplayProfile:
    """A display that can be asked for codes.

    Attributes
    ----------
    name
        What it is called.
    model
        Device codes to XYZ (white Y = 1) and back.
    source
        Where its numbers are from.
    white_Y
        Luminance of white in the unit of the measurements; 1 if not measured.
    unit
        Of the measurements: ``cd/m2``, or ``relative`` (to a white of 100, or of 1).
    white_luminance_cd_m2
        Luminance of white, None if unknown; with the unit ``cd/m2`` it is `white_Y`.
    state
        What was measured, and in what state.
    scene_white
        Luminance that a scene's white is shown at, as a fraction of white's, above 0 and up to 1;
        None for the default (`spectral_core.display.limits.luminance.scene_white`).
    """

    name: str
    model: DisplayModel
    source: str = ""
    white_Y: float = 1.0
    unit: str = "relative"
    white_luminance_cd_m2: float | None = None
    state: HeadsetState = field(default_factory=HeadsetState)
    scene_white: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "white_Y", _number("white_Y", self.white_Y, *_WHITE_Y))
        if self.unit not in UNITS:
            raise DisplayError("'unit' is no unit of luminance", remedy=f"use {' or '.join(UNITS)}")
        luminance = self.white_Y if self.unit == "cd/m2" else self.white_luminance_cd_m2
        if luminance is not None:
            luminance = _number("white_luminance_cd_m2", luminance, _WHITE_Y[0], _LARGEST_LUMINANCE)
        if self.white_luminance_cd_m2 not in (None, luminance):
            raise DisplayError(
                f"white has {self.white_luminance_cd_m2} cd/m2, but {self.white_Y} in the measurements",
                remedy="correct one of them, or make the unit 'relative'",
            )
        object.__setattr__(self, "white_luminance_cd_m2", luminance)
        if self.scene_white is not None:
            object.__setattr__(self, "scene_white", _number("scene_white", self.scene_white, _LEAST_SCENE_WHITE, 1.0))

    def to_XYZ(self, codes: FloatArray) -> Float64Array:
        """XYZ (..., 3), white Y = 1, of device codes (..., 3) from 0 to 1."""
        return self.model.forward(codes)

    def to_codes(self, XYZ: FloatArray) -> Float64Array:
        """Device codes (..., 3) of XYZ (..., 3), not clipped; outside 0..1 is out of gamut."""
        return self.model.inverse(XYZ)

    def to_linear(self, XYZ: FloatArray) -> Float64Array:
        """Linear device RGB (..., 3) of XYZ (..., 3), not clipped."""
        return self.model.linear(XYZ)


def in_gamut(values: FloatArray) -> BoolArray:
    """True (...,) where all channels of (..., 3) lie in 0..1."""
    return np.asarray(((values >= -GAMUT_TOLERANCE) & (values <= 1 + GAMUT_TOLERANCE)).all(axis=-1))


def _number(name: str, value: Any, low: float, high: float) -> float:
    # NaN is in no range, and an integer too long for a float can still be compared.
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
        raise DisplayError(f"'{name}' is no number from {low:g} to {high:g}", remedy="correct it")
    return float(value)


def write_profile(profile: DisplayProfile, path: Path) -> None:
    """Write a profile as JSON that `read_profile` gives back bit for bit."""
    kind = next((name for name, model in MODELS.items() if isinstance(profile.model, model)), None)
    if kind is None:
        raise DisplayError(f"'{profile.name}' is built in", remedy="name it instead of writing it")
    model: Any = profile.model
    document = {
        "format": _FORMAT,
        "version": _VERSION,
        "name": profile.name,
        "source": profile.source,
        "white_Y": profile.white_Y,
        "unit": profile.unit,
        "white_luminance_cd_m2": profile.white_luminance_cd_m2,
        "scene_white": profile.scene_white,
        "state": profile.state.to_json(),
        "model": {"type": kind, **model.to_json()},
    }
    with atomic_path(path) as temporary:
        temporary.write_text(_json_text(document), encoding="utf-8")


def read_profile(path: Path) -> DisplayProfile:
    """Read a profile written by `write_profile`.

    Files that lack the unit, the state or the scene's white are older: nothing is known of these.

    Raises
    ------
    DisplayError
        If the file is missing, not JSON, or not such a profile.
    """
    document = _json(path)
    if document.get("format") != _FORMAT or document.get("version") != _VERSION:
        raise DisplayError(
            "is not a display profile of this version",
            where=path,
            remedy=f"it must say format '{_FORMAT}', version {_VERSION}",
        )
    model = document.get("model")
    kind = MODELS.get(str(model.get("type"))) if isinstance(model, dict) else None
    if kind is None or not isinstance(model, dict):
        raise DisplayError("has no model of a known type", where=path, remedy=f"known are {', '.join(MODELS)}")
    try:
        return DisplayProfile(
            str(document.get("name", path.stem)),
            kind.from_json(model),
            str(document.get("source", "")),
            document.get("white_Y", 1.0),
            document.get("unit", "relative"),
            document.get("white_luminance_cd_m2"),
            HeadsetState.from_json(document.get("state", {})),
            document.get("scene_white"),
        )
    except KeyError as error:
        raise DisplayError(f"the model lacks {error}", where=path, remedy="correct the profile") from None
    except (TypeError, ValueError, OverflowError):
        raise DisplayError(
            "the model holds something that is no number", where=path, remedy="correct the profile"
        ) from None
    except DisplayError as error:
        raise DisplayError(error.problem, where=path, remedy=error.remedy) from None


def _json_text(document: dict[str, Any]) -> str:
    """JSON with one line per list of numbers: a table of 13 x 13 x 13 colours stays legible."""
    text = json.dumps(document, indent=2)
    # No text of JSON holds a line's end: what begins with one is a list.
    return re.sub(r"\[\n([^\[\]{}\"]*)\]", lambda found: f"[{' '.join(found[1].split())}]", text) + "\n"


def _json(path: Path) -> dict[str, Any]:
    if not is_file(path):
        raise DisplayError(
            f"{why_no_file(path)}, and no built-in profile of that name",
            where=path,
            remedy="use sRGB, htc-vive-2021, htc-vive-2020 or a file",
        )
    text = read_text(path, DisplayError, "give a profile written by this program")
    try:
        document = json.loads(text)
    except (ValueError, RecursionError):  # ValueError: also of numbers too long to read
        raise DisplayError("is not JSON", where=path, remedy="give a profile written by this program") from None
    if not isinstance(document, dict):
        raise DisplayError("is not a display profile", where=path, remedy="give a profile written by this program")
    return document


__all__ = ["DisplayProfile", "SRGBCurve", "in_gamut", "read_profile", "write_profile"]
