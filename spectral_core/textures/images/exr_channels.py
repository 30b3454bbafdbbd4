"""What the channels of a spectral OpenEXR are called, layout 1.0 (Fichet, Pacanowski, Wilkie 2021).

Reflective channels are called ``T.450,000000nm``, emissive ones ``S0.450,000000nm``; polarised files
have ``S1`` to ``S3`` as well, bispectral ones ``T.in.out``: the light that comes in at one wavelength
and goes out at another.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from spectral_core.errors import TextureError
from spectral_core.textures.base import Kind

_NUMBER = r"(\d*,?\d*(?:[Ee][+-]?\d+)?)"
_UNIT = r"(Y|Z|E|P|T|G|M|k|h|da|d|c|m|u|n|p)?(m|Hz)"
_CHANNEL = re.compile(rf"^(?:.*\.)?(S[0-3]|T)\.{_NUMBER}{_UNIT}$")
_BISPECTRAL = re.compile(rf"^(?:.*\.)?T\.{_NUMBER}{_UNIT}\.{_NUMBER}{_UNIT}$")
_PREFIX = {
    "Y": 1e24, "Z": 1e21, "E": 1e18, "P": 1e15, "T": 1e12, "G": 1e9, "M": 1e6, "k": 1e3, "h": 1e2, "da": 1e1,
    "": 1.0, "d": 1e-1, "c": 1e-2, "m": 1e-3, "u": 1e-6, "n": 1e-9, "p": 1e-12,
}  # fmt: skip
_SPEED_OF_LIGHT = 299_792_458.0


@dataclass(frozen=True, order=True)
class Band:
    """A spectral channel: wavelength in nm, part of the file, number in that part."""

    wavelength_nm: float
    part: int
    channel: int


@dataclass(frozen=True)
class SpectralChannels:
    """The channels of all parts of a file.

    Attributes
    ----------
    kind
        ``reflectance`` or ``radiance``.
    bands
        By wavelength.
    polarised, fluorescent
        (part, channel) of what no texture per lamp can show: Stokes S1 to S3, and ``T.in.out``.
    """

    kind: Kind
    bands: tuple[Band, ...]
    polarised: tuple[tuple[int, int], ...]
    fluorescent: tuple[tuple[int, int], ...]


def spectral_channels(parts: list[tuple[str, ...]], path: Path) -> SpectralChannels:
    """The spectral channels among the names of each part's channels.

    Raises
    ------
    TextureError
        If there are none, reflective and emissive ones are mixed, or a name holds no wavelength.
    """
    found: dict[str, list[Band]] = {}
    fluorescent = []
    for part, names in enumerate(parts):
        for channel, name in enumerate(names):
            if _BISPECTRAL.match(name):
                fluorescent.append((part, channel))
            elif match := _CHANNEL.match(name):
                found.setdefault(match[1], []).append(Band(_wavelength_nm(match, path), part, channel))
    if {"S0", "T"} <= found.keys():
        raise TextureError(
            "mixes reflective (T) and emissive (S0) channels", where=path, remedy="split the file in two"
        )
    bands = sorted(found.get("S0", []) + found.get("T", []))
    if not bands:
        raise _no_bands(parts, bool(found or fluorescent), path)
    polarised = [(band.part, band.channel) for stokes in ("S1", "S2", "S3") for band in found.get(stokes, [])]
    return SpectralChannels(
        "radiance" if "S0" in found else "reflectance", tuple(bands), tuple(polarised), tuple(fluorescent)
    )


def _wavelength_nm(match: re.Match[str], path: Path) -> float:
    _, number, prefix, unit = match.groups()
    try:
        value = float(number.replace(",", ".")) * _PREFIX[prefix or ""]
    except ValueError:
        value = 0.0
    if value <= 0:
        raise TextureError(
            f"channel '{match.string[:80]}' has no wavelength", where=path, remedy="name channels like T.450,000000nm"
        )
    return (_SPEED_OF_LIGHT / value if unit == "Hz" else value) * 1e9


def _no_bands(parts: list[tuple[str, ...]], others: bool, path: Path) -> TextureError:
    if others:
        return TextureError(
            "has polarised or fluorescent channels alone, and no intensity (S0) or reflectance (T)",
            where=path,
            remedy="write the file with them",
        )
    names = [name[:40] for part in parts for name in part]
    return TextureError(
        f"has no spectral channels, only {', '.join(names[:5])}",
        where=path,
        remedy="give channels like T.450,000000nm (Fichet et al. 2021)",
    )
