"""A display profile: a model with its name and provenance, kept as JSON."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from spectral_core.arrays import BoolArray, Float64Array, FloatArray
from spectral_core.display.corrected import CorrectedLut
from spectral_core.display.models import DisplayModel, GammaMatrix, SRGBCurve
from spectral_core.display.tone_models import GainOffsetGamma, LutMatrix
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
        Luminance of white in the units it was measured in (cd/m2 or relative); 1 if not measured.
    """

    name: str
    model: DisplayModel
    source: str = ""
    white_Y: float = 1.0

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
        "model": {"type": kind, **model.to_json()},
    }
    with atomic_path(path) as temporary:
        temporary.write_text(_json_text(document), encoding="utf-8")


def read_profile(path: Path) -> DisplayProfile:
    """Read a profile written by `write_profile`.

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
    model, white_Y = document.get("model"), document.get("white_Y", 1.0)
    kind = MODELS.get(str(model.get("type"))) if isinstance(model, dict) else None
    if kind is None or not isinstance(model, dict):
        raise DisplayError("has no model of a known type", where=path, remedy=f"known are {', '.join(MODELS)}")
    if isinstance(white_Y, bool) or not isinstance(white_Y, (int, float)) or not 0 < white_Y < np.inf:
        raise DisplayError("'white_Y' is no luminance", where=path, remedy="correct the profile")
    try:
        made = kind.from_json(model)
    except KeyError as error:
        raise DisplayError(f"the model lacks {error}", where=path, remedy="correct the profile") from None
    except (TypeError, ValueError, OverflowError):
        raise DisplayError(
            "the model holds something that is no number", where=path, remedy="correct the profile"
        ) from None
    except DisplayError as error:
        raise DisplayError(error.problem, where=path, remedy=error.remedy) from None
    return DisplayProfile(str(document.get("name", path.stem)), made, str(document.get("source", "")), float(white_Y))


def _json_text(document: dict[str, Any]) -> str:
    """JSON with one line per list of numbers: a table of 17 x 17 x 17 colours stays legible."""
    text = json.dumps(document, indent=2)
    return re.sub(r"\[([^\[\]{}]*)\]", lambda found: f"[{' '.join(found[1].split())}]", text) + "\n"


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
