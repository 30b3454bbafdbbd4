"""What a user says of a file that the file does not say itself, and what follows."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.errors import TextureError
from spectral_core.files import is_file, read_text
from spectral_core.textures.base import KINDS, Kind, checked_wavelengths

# More than any instrument counts to, and less than any reflectance is scaled down by.
SCALE_RANGE = (1e-12, 1e12)


@dataclass(frozen=True)
class Reading:
    """How to read a texture; everything is optional, and what a file says itself need not be said.

    Attributes
    ----------
    kind
        ``reflectance``, ``radiance`` or ``counts``.
    scale
        Stored value of reflectance 1: 10000 for reflectance times 10000. Says that it is reflectance.
    white, dark
        Captures of a white reference and of darkness, or a table of one spectrum (CSV), to divide by
        and to subtract. Relative to the white: its own reflectance is taken as 1.
    wavelengths
        ``first:last:step`` in nm, a list ``400,410,...`` or a file with one wavelength in nm a line.
    variable
        Name of the array in a MATLAB file.
    reduce
        Whether a polarised or bispectral (fluorescent) file is reduced to the part that a texture can
        show, its unpolarised intensity or its reflectance without fluorescence, instead of refused.
    """

    kind: Kind | None = None
    scale: float | None = None
    white: Path | None = None
    dark: Path | None = None
    wavelengths: str | None = None
    variable: str | None = None
    reduce: bool = False

    def __post_init__(self) -> None:
        if self.kind is not None and self.kind not in KINDS:
            raise TextureError(f"no kind of texture '{self.kind}'", remedy=f"use one of {', '.join(KINDS[:3])}")
        if self.scale is not None and not SCALE_RANGE[0] <= self.scale <= SCALE_RANGE[1]:
            raise TextureError(f"scale {self.scale:g} is impossible", remedy="give the stored value of reflectance 1")
        if self.scale is not None and self.kind not in (None, "reflectance"):
            raise TextureError(f"a scale is for reflectance, not for {self.kind}", remedy="give one of the two")
        if self.dark is not None and self.white is None:
            raise TextureError("a dark reference needs a white one", remedy="give --white as well")
        if self.white is not None and (self.scale is not None or self.kind == "reflectance"):
            raise TextureError(
                "a white reference is for radiance or counts, not for reflectance", remedy="leave it or the scale out"
            )

    def relative_to(self, folder: Path) -> Reading:
        """The same with its files relative to a folder."""
        wavelengths = self.wavelengths
        if wavelengths is not None and is_file(folder / wavelengths):
            wavelengths = str(folder / wavelengths)
        return replace(
            self,
            white=self.white and folder / self.white,
            dark=self.dark and folder / self.dark,
            wavelengths=wavelengths,
        )


def stated_kind(
    path: Path, reading: Reading, dtype: np.dtype[Any], kind: Kind | None = None, scale: float | None = None
) -> tuple[Kind, float]:
    """Kind and scale of a texture from what its user says and then from what the file says (`kind`, `scale`).

    Integers that nobody calls anything are counts; floating point that nobody calls anything is
    ``unstated``. Neither is guessed to be reflectance.

    Raises
    ------
    TextureError
        If integers are called reflectance without saying which integer is 1.
    """
    if reading.kind is not None or reading.scale is not None:
        kind = reading.kind or "reflectance"
    scale = reading.scale or scale
    if scale is not None and kind is None:
        kind = "reflectance"
    if kind is None:
        kind = "counts" if dtype.kind in "iu" else "unstated"
    if kind == "reflectance" and scale is None and dtype.kind in "iu":
        raise TextureError(
            f"holds integers ({dtype}) and does not say which one is reflectance 1",
            where=path,
            remedy="give --scale, for example 10000, 255 or 65535",
        )
    return kind, float(scale) if scale is not None and kind == "reflectance" else 1.0


def stated_wavelengths(reading: Reading, bands: int, path: Path) -> Float64Array | None:
    """The wavelengths (bands,) that the user gives, None if none are given.

    Raises
    ------
    TextureError
        If they cannot be read, or are not one per band.
    """
    text = reading.wavelengths
    if text is None:
        return None
    if ":" in text and not Path(text).exists():
        return checked_wavelengths(_even(text), bands, path)
    if "," in text and not Path(text).exists():
        return checked_wavelengths(_numbers(text.split(","), "--wavelengths"), bands, path)
    return checked_wavelengths(wavelengths_in_file(Path(text)), bands, Path(text))


def wavelengths_in_file(path: Path) -> Float64Array:
    """Wavelengths (n,) in nm, one a line; ``#`` starts a comment."""
    text = read_text(path, TextureError, "give one wavelength in nm a line")
    return _numbers([line for line in text.splitlines() if line.strip() and not line.startswith("#")], path)


def _even(text: str) -> Float64Array:
    try:
        first, last, step = (float(part) for part in text.split(":"))
    except ValueError:
        raise TextureError(f"'{text}' is no range of wavelengths", remedy="give first:last:step in nm") from None
    count = (last - first) / step if step else math.inf
    # As many as a file can have bands; a step that misses the last wavelength is a slip of the pen.
    if not 0 <= count < 1e6 or abs(count - round(count)) > 1e-6:
        raise TextureError(f"'{text}' does not lead from the first to the last", remedy="give first:last:step in nm")
    return np.linspace(first, last, round(count) + 1)


def _numbers(parts: list[str], where: str | Path) -> Float64Array:
    try:
        return np.array([float(part) for part in parts])
    except ValueError as error:
        raise TextureError(
            f"holds something that is no number ({str(error)[:80]})",
            where=where,
            remedy="give one wavelength in nm a line",
        ) from None
