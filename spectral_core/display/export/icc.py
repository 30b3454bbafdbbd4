"""An ICC v4.3 display profile (ICC.1:2010-12).

PCS XYZ is relative to the display's white, taken to D50 by Bradford (`chad`); `lumi` keeps its
luminance. The lutAToB and lutBToA tags hold the whole model: black by the matrix's offset,
formulas as parametric curves, tables in 16 bits, the interaction of channels as a CLUT. The
matrix and tone curve tags, for software that reads no others, leave out black and interaction.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.display.export.names import export_name
from spectral_core.display.models.corrected import drive_of_lightness
from spectral_core.display.models.lattice import lattice
from spectral_core.display.models.stages import SHAPER, SRGB, Interaction, Power, Stages, Tables, stages
from spectral_core.display.profile import DisplayProfile
from spectral_core.files import atomic_path

D50 = np.array([0.9642, 1.0, 0.8249])
# ICC.1:2010-12, annex E.
BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
# A PCS XYZ of 1 is 0x8000 of 0xFFFF.
_PCS_ONE = 32768 / 65535
_CURVE_NODES = 4096
# Where a curve starts steeply: even nodes in lightness.
_STEEP_NODES = 16384
_TABLE_NODES = 65
# So far beyond 0 and 1 the CLUT holds what no code gives, that cells across the gamut's surface are right.
_HEADROOM = 0.1
# Below this lightness (of 1) CIE lightness is a line.
_TOE_LIGHTNESS = 0.08

_Affine = tuple[Float64Array, Float64Array]


def export_icc(profile: DisplayProfile, path: Path) -> Path:
    """Write the profile as ICC; `lumi` is left out where the luminance of white is not known."""
    steps = stages(profile.model)
    white = steps.decode(np.ones(3))
    to_pcs = adaptation(white) / white[1]
    primaries = to_pcs @ np.linalg.inv(steps.matrix)
    primaries *= np.linalg.solve(primaries, D50)
    device_to_pcs, pcs_to_device = _lut_tags(steps, to_pcs)
    tags = {
        "desc": _text(export_name(profile)),
        "cprt": _text("No copyright, use freely"),
        "wtpt": _XYZ(D50),
        "chad": b"sf32\0\0\0\0" + _fixed(adaptation(white)),
        **{f"{name}XYZ": _XYZ(primaries[:, i]) for i, name in enumerate("rgb")},
        **{f"{name}TRC": curve for name, curve in zip("rgb", _tone_curves(steps), strict=True)},
        **{f"A2B{intent}": device_to_pcs for intent in range(2)},
        **{f"B2A{intent}": pcs_to_device for intent in range(2)},
    }
    if profile.white_luminance_cd_m2 is not None:
        tags["lumi"] = _XYZ(np.array([0.0, profile.white_luminance_cd_m2 * white[1], 0.0]))
    with atomic_path(path) as temporary:
        temporary.write_bytes(_file(tags))
    return path


def adaptation(white: Float64Array) -> Float64Array:
    """Bradford's (3, 3) from a white XYZ to D50, both at Y = 1."""
    scale = (BRADFORD @ D50) / (BRADFORD @ (white / white[1]))
    return np.asarray(np.linalg.inv(BRADFORD) @ (scale[:, None] * BRADFORD))


def _lut_tags(steps: Stages, to_pcs: Float64Array) -> tuple[bytes, bytes]:
    """Device codes to PCS, and back."""
    to_drive = (steps.matrix @ np.linalg.inv(to_pcs) / _PCS_ONE, steps.offset)
    if steps.interaction is not None:
        return _interaction_tags(steps, steps.interaction, to_drive)
    forward = _lut("mAB ", _inverse(to_drive), _tone_curves(steps))
    if not isinstance(steps.curve, Tables):
        return forward, _lut("mBA ", to_drive, _code_curves(steps.curve))
    # Even steps in drive are too coarse near black: a power first, then the table, after a CLUT that does nothing.
    curves = [_sampled(each) for each in steps.curve.sampled(_CURVE_NODES).T]
    return forward, _lut("mBA ", to_drive, [_parametric(0, SHAPER)] * 3, lattice(2), curves)


def _interaction_tags(steps: Stages, interaction: Interaction, to_drive: _Affine) -> tuple[bytes, bytes]:
    """Device codes to PCS, and back; drive and lightness are scaled so that what occurs spans 0..1."""
    low, high = interaction.span
    darkest, brightest = drive_of_lightness(low), drive_of_lightness(high)
    matrix = (to_drive[0] / (brightest - darkest)[:, None], (to_drive[1] - darkest) / (brightest - darkest))
    together = (interaction.together(lattice(len(interaction.table.nodes))) - low) / (high - low)
    own = (interaction.sampled(_TABLE_NODES) + _HEADROOM) / (1 + 2 * _HEADROOM)
    forward, backward = zip(*(_lightness_curves(*each) for each in zip(low, high, strict=True)), strict=True)
    lightness_of_codes = steps.curve.drive(_even(0.0, 1.0, _CURVE_NODES))
    codes_of_lightness = steps.curve.codes(_even(-_HEADROOM, 1 + _HEADROOM, _STEEP_NODES))
    return (
        _lut("mAB ", _inverse(matrix), list(backward), together, [_sampled(each) for each in lightness_of_codes.T]),
        _lut("mBA ", matrix, list(forward), own, [_sampled(each) for each in codes_of_lightness.T]),
    )


def _lightness_curves(low: float, high: float) -> tuple[bytes, bytes]:
    """CIE lightness of drive and its inverse, where 0..1 of lightness means `low` to `high`, and of drive likewise."""
    darkest, brightest, toe = drive_of_lightness(np.array([low, high, _TOE_LIGHTNESS]))
    span, drives, slope = high - low, brightest - darkest, _TOE_LIGHTNESS / toe
    root = 1.16 / span
    lightness = _parametric(4, 1 / 3, root**3 * drives, root**3 * darkest, slope * drives / span,
                            (toe - darkest) / drives, -(0.16 + low) / span, (slope * darkest - low) / span)  # fmt: skip
    cube = 1 / (1.16 * np.cbrt(drives))
    drive = _parametric(4, 3.0, cube * span, cube * (low + 0.16), span / slope / drives,
                        (_TOE_LIGHTNESS - low) / span, -darkest / drives, (low / slope - darkest) / drives)  # fmt: skip
    return lightness, drive


def _tone_curves(steps: Stages) -> list[bytes]:
    """Code to drive, red, green, blue; of channels that interact, each by itself."""
    curve = steps.curve
    if isinstance(curve, SRGB):
        return [_parametric(3, 2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045)] * 3
    if isinstance(curve, Power):
        return [
            _parametric(1, gamma, 1 / (1 - threshold), -threshold / (1 - threshold))
            for gamma, threshold in zip(curve.gamma, curve.threshold, strict=True)
        ]
    drive = curve.drive(_even(0.0, 1.0, _CURVE_NODES))
    return [_sampled(each) for each in (drive if steps.interaction is None else drive_of_lightness(drive)).T]


def _code_curves(curve: Power | SRGB) -> list[bytes]:
    """Drive to code, red, green, blue."""
    if isinstance(curve, SRGB):
        return [_parametric(4, 1 / 2.4, 1.055**2.4, 0.0, 12.92, 0.0031308, -0.055, 0.0)] * 3
    return [
        _parametric(4, 1 / gamma, (1 - threshold) ** gamma, 0.0, 0.0, 0.0, threshold, threshold)
        for gamma, threshold in zip(curve.gamma, curve.threshold, strict=True)
    ]


def _even(first: float, last: float, count: int) -> Float64Array:
    """(count, 3), the same steps in each channel."""
    return np.repeat(np.linspace(first, last, count)[:, None], 3, axis=1)


def _inverse(affine: _Affine) -> _Affine:
    matrix = np.linalg.inv(affine[0])
    return matrix, -matrix @ affine[1]


def _lut(
    kind: str, affine: _Affine, m_curves: list[bytes], table: Float64Array | None = None,
    a_curves: Sequence[bytes] = (),
) -> bytes:  # fmt: skip
    """A lutAToBType or lutBToAType: B curves that do nothing, matrix, M curves, and a CLUT with A curves or none."""
    matrix = _fixed(np.concatenate([affine[0].ravel(), affine[1]]))
    parts = [b"".join([_parametric(0, 1.0)] * 3), matrix, b"".join(m_curves)]
    if table is not None:
        grid = bytes([len(table)] * 3 + [0] * 13 + [2, 0, 0, 0])
        parts += [_padded(grid + _sixteen_bits(table)), b"".join(a_curves)]
    offsets = [32]
    for part in parts[:-1]:
        offsets.append(offsets[-1] + len(part))
    offsets += [0] * (5 - len(offsets))
    return struct.pack(">4sIBBH5I", kind.encode(), 0, 3, 3, 0, *offsets) + b"".join(parts)


def _parametric(kind: int, *values: float) -> bytes:
    """A parametricCurveType; gamma, a, b, c, d, e, f."""
    return struct.pack(">4sIHH", b"para", 0, kind, 0) + _fixed(np.array(values))


def _sampled(values: Float64Array) -> bytes:
    """A curveType of even steps."""
    return _padded(struct.pack(">4sII", b"curv", 0, len(values)) + _sixteen_bits(values))


def _sixteen_bits(values: Float64Array) -> bytes:
    return bytes(np.round(np.clip(values, 0.0, 1.0) * 65535).astype(">u2").tobytes())


def _fixed(values: Float64Array) -> bytes:
    """s15Fixed16Number."""
    return bytes(np.round(np.asarray(values) * 65536).astype(">i4").tobytes())


def _XYZ(values: Float64Array) -> bytes:
    return b"XYZ \0\0\0\0" + _fixed(values)


def _text(text: str) -> bytes:
    """A multiLocalizedUnicodeType in American English, the language that every reader falls back to."""
    encoded = text.encode("utf-16-be")
    return _padded(struct.pack(">4sIII4sII", b"mluc", 0, 1, 12, b"enUS", len(encoded), 28) + encoded)


def _padded(data: bytes) -> bytes:
    return data + b"\0" * (-len(data) % 4)


def _file(tags: dict[str, bytes]) -> bytes:
    """Header, tag table and tags; tags of the same content share it."""
    at, table, body = 128 + 4 + 12 * len(tags), b"", b""
    places: dict[bytes, int] = {}
    for name, data in tags.items():
        if data not in places:
            places[data] = at + len(body)
            body += data
        table += struct.pack(">4sII", name.encode(), places[data], len(data))
    now = datetime.now(UTC)
    date = (now.year, now.month, now.day, now.hour, now.minute, now.second)
    # Size, version 4.3, class, spaces, date, signature; rendering intent 1, media-relative colorimetric.
    head = struct.pack(">I4sI4s4s4s6H4s", at + len(body), b"", 0x04300000, b"mntr", b"RGB ", b"XYZ ", *date, b"acsp")
    rest = _fixed(D50) + bytes(48)
    content = struct.pack(">I", len(tags)) + table + body
    # The profile's ID is taken without flags, intent and itself.
    without = head + bytes(28) + rest + content
    identity = hashlib.md5(without, usedforsecurity=False).digest()
    return head + bytes(24) + struct.pack(">I", 1) + _fixed(D50) + bytes(4) + identity + bytes(28) + content
