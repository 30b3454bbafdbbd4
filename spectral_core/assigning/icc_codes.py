"""What an ICC profile says of device codes, by LittleCMS inside Pillow.

Pillow lets LittleCMS give 8 bits of each coordinate of L*a*b*, steps as large as colour differences that are
seen, but 16 bits of a grey. So L*, a* and b* are asked for one by one, each by a profile of a grey device
whose grey is that coordinate.
"""

from __future__ import annotations

import io
import struct
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.errors import DisplayError, MissingExtraError

_D50_FIXED = struct.pack(">3i", 0xF6D6, 0x10000, 0xD32D)
# 8-bit codes that a transform is asked for at once, as an image of so many lines.
_LINE = 4096
_CLASSES = {"scnr": "input", "mntr": "display", "spac": "colour space"}


class IccProfile:
    """An ICC profile of RGB codes.

    Parameters
    ----------
    data
        The profile.
    where
        Its file, or that of the image that holds it.

    Attributes
    ----------
    name
        As it calls itself, and its class.
    of_input
        Whether it is of a scanner or camera.

    Raises
    ------
    MissingExtraError
        Without Pillow.
    DisplayError
        If it is damaged, or no profile of RGB input, display or colour space.
    """

    def __init__(self, data: bytes, where: Path) -> None:
        cms = _cms()
        try:
            self._profile = cms.ImageCmsProfile(io.BytesIO(data))
            space, kind = self._profile.profile.xcolor_space.strip(), self._profile.profile.device_class
            name = str(self._profile.profile.profile_description or "without a name").strip()
        except (OSError, cms.PyCMSError, ValueError, AttributeError) as error:
            raise _refused(f"is no ICC profile ({error})", where) from None
        if space != "RGB" or kind not in _CLASSES:
            raise _refused(f"is an ICC profile of class '{kind}' for {space}", where)
        self.name = f"{' '.join(name.split())[:80]} ({_CLASSES[kind]})"
        self.of_input = kind == "scnr"
        try:
            self._transforms = [
                cms.buildTransform(self._profile, _grey_profile(axis), "RGB", "I;16",
                                   cms.Intent.ABSOLUTE_COLORIMETRIC, cms.Flags.NOOPTIMIZE)
                for axis in range(3)
            ]  # fmt: skip
        except cms.PyCMSError as error:
            raise _refused(f"is an ICC profile that LittleCMS cannot use ({error})", where) from None

    def Lab(self, codes: Float64Array) -> Float64Array:
        """L*a*b* (n, 3), D50, relative to the perfect diffuser, of codes (n, 3) from 0 to 1.

        ICC-absolute colorimetry: that is media-relative for displays and colour spaces, whose white
        stands for the diffuser, and scaled by the white of the medium for scanners and cameras.
        Codes of 8 bits are taken as they are; others linearly from their neighbours of 8 bits, which
        is within 1e-5 of XYZ for curves like gamma 2.2.
        """
        levels = np.clip(codes, 0.0, 1.0) * 255
        below = np.minimum(np.floor(levels + 1e-6), 255).astype(np.uint8)
        fraction = levels - below
        base = self._at(below)
        if (np.abs(fraction) < 1e-6).all():
            return base
        result = base.copy()
        for channel in range(3):
            above = below.copy()
            above[:, channel] = np.minimum(below[:, channel], 254) + 1
            result += fraction[:, channel, None] * (self._at(above) - base)
        return result

    def _at(self, levels: Any) -> Float64Array:
        from PIL import Image

        lines = max(1, -(-len(levels) // _LINE))
        padded = np.zeros((lines * _LINE, 3), dtype=np.uint8)
        padded[: len(levels)] = levels
        image = Image.frombytes("RGB", (_LINE, lines), padded.tobytes())
        grey = [
            np.frombuffer(_cms().applyTransform(image, each).tobytes(), dtype="<u2")[: len(levels)]
            for each in self._transforms
        ]
        # The encoding of lut16Type: ICC.1:2010-12, 10.8, table 42.
        return np.asarray(np.stack(grey, axis=1) * [100 / 65280, 1 / 256, 1 / 256] - [0.0, 128.0, 128.0])


def _refused(problem: str, where: Path) -> DisplayError:
    short = " ".join(problem.split())[:200]
    return DisplayError(short, where=where, remedy="give the ICC profile of an RGB scanner, camera or display")


def _cms() -> Any:
    try:
        from PIL import ImageCms
    except ImportError:
        raise MissingExtraError(
            "ICC profiles need Pillow", remedy="pip install 'spectral-booth[report]', or leave --icc out"
        ) from None
    return ImageCms


@cache
def _grey_profile(axis: int) -> Any:
    """An output profile of a device with one colorant, whose code is L*, a* or b* as lut16Type encodes it."""
    table = np.indices((2, 2, 2))[axis].ravel() * 65535
    identity = struct.pack(">9i", *(np.eye(3, dtype=int).ravel() * 0x10000).tolist())
    lut = b"mft2\0\0\0\0" + bytes([3, 1, 2, 0]) + identity + struct.pack(">2H", 2, 2)
    lut += struct.pack(">6H", *[0, 65535] * 3) + table.astype(">u2").tobytes() + struct.pack(">2H", 0, 65535)
    tags = {b"wtpt": b"XYZ \0\0\0\0" + _D50_FIXED, b"B2A0": lut}
    at, directory, body = 128 + 4 + 12 * len(tags), b"", b""
    for name, tag in tags.items():
        tag += b"\0" * (-len(tag) % 4)
        directory += struct.pack(">4s2I", name, at + len(body), len(tag))
        body += tag
    head = struct.pack(">I4sI4s4s4s12s4s", at + len(body), b"", 0x04300000, b"prtr", b"GRAY", b"Lab ", b"", b"acsp")
    head += bytes(28) + _D50_FIXED + bytes(48)
    return _cms().ImageCmsProfile(io.BytesIO(head + struct.pack(">I", len(tags)) + directory + body))
