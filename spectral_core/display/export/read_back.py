"""Exports read back by other software: how far its codes are from the profile's own."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from spectral_core import standards
from spectral_core.arrays import BoolArray, Float64Array
from spectral_core.display.export.cube import CubeInput, cube_input
from spectral_core.display.export.icc import D50, adaptation
from spectral_core.display.export.ocio import OcioExport
from spectral_core.display.models.corrected import drive_of_lightness
from spectral_core.display.profile import DisplayProfile
from spectral_core.imaging import error_text, oiio

_XYZ_D65 = "cie_xyz_d65_interchange"
# Greys and colours at random.
_GREYS, _MIXED = 256, 4000
# Levels of 8-bit Lab per unit.
_LAB_8BIT = np.array([2.55, 1.0, 1.0])


@dataclass(frozen=True)
class ReadBack:
    """What other software made of an export.

    Attributes
    ----------
    by
        The software, and in what precision it gives codes; None if there was none.
    max_code_error, max_dE00
        Largest difference of codes (0..1), and of the colours that the profile gives for them. Near
        black a code says little: there the first is far larger than it looks.
    colours
        How many in-gamut colours were asked for.
    why
        Why nothing was read back.
    """

    by: str | None
    max_code_error: float | None
    max_dE00: float | None
    colours: int
    why: str = ""


def probe_codes() -> Float64Array:
    """Codes (n, 3): greys, ramps of primaries and secondaries, and mixed colours at random."""
    corners = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [0, 1, 1], [1, 0, 1]])
    ramps = np.linspace(0.0, 1.0, 64)[:, None, None] * corners
    greys = np.repeat(np.linspace(0.0, 1.0, _GREYS)[:, None], 3, axis=1)
    mixed = np.random.default_rng(0).uniform(0.0, 1.0, (_MIXED, 3))
    return np.concatenate([greys, ramps.reshape(-1, 3), mixed])


def read_back_ocio(profile: DisplayProfile, export: OcioExport) -> ReadBack:
    """Ask OpenColorIO, inside OpenImageIO, for the codes that the display's view gives."""
    config = str(export.config)
    XYZ = profile.to_XYZ(probe_codes())

    def ask(image: Any) -> Any:
        linear = oiio().ImageBufAlgo.colorconvert(image, _XYZ_D65, "scene_linear", colorconfig=config)
        return linear if linear.has_error else _displayed(linear, export, export.view)

    return _by_openimageio(profile, XYZ, XYZ, ask)


def read_back_ocio_xyz(profile: DisplayProfile, export: OcioExport) -> ReadBack:
    """Ask OpenColorIO for the codes that the display's view of XYZ gives to pixels that are XYZ."""
    XYZ = profile.to_XYZ(probe_codes())
    return _by_openimageio(profile, XYZ, XYZ, lambda image: _displayed(image, export, export.xyz_view))


def _displayed(pixels: Any, export: OcioExport, view: str) -> Any:
    config = str(export.config)
    return oiio().ImageBufAlgo.ociodisplay(pixels, export.display, view, "scene_linear", colorconfig=config)


def read_back_cube(profile: DisplayProfile, path: Path, read_as: CubeInput) -> ReadBack:
    """Ask OpenColorIO, inside OpenImageIO, for the codes of colours that the table can be asked for."""
    XYZ = profile.to_XYZ(probe_codes())
    asked = cube_input(XYZ, read_as)
    inside = _between(asked)
    # OpenColorIO keeps a file that it has read once: a copy, in case the same name was read before.
    with tempfile.TemporaryDirectory() as folder:
        copy = shutil.copy(path, folder)
        return _by_openimageio(
            profile, XYZ[inside], asked[inside], lambda image: oiio().ImageBufAlgo.ociofiletransform(image, copy)
        )


def read_back_icc(profile: DisplayProfile, path: Path) -> ReadBack:
    """Ask LittleCMS, inside Pillow, which takes Lab and gives codes in 8 bits.

    The colours asked for are those that 8-bit Lab can say exactly, so that only the codes are rounded.
    """
    try:
        from PIL import Image, ImageCms, features
    except ImportError:
        return ReadBack(None, None, None, 0, "Pillow is missing: install the extra 'report'")
    white = profile.to_XYZ(np.ones(3))
    to_pcs = adaptation(white) / white[1]
    Lab = np.round(standards.XYZ_to_Lab(profile.to_XYZ(probe_codes()) @ to_pcs.T, D50) * _LAB_8BIT)
    XYZ = _XYZ_of_Lab(Lab / _LAB_8BIT) @ np.linalg.inv(to_pcs).T
    inside = (np.abs(Lab[:, 1:]) <= 127).all(axis=1) & _between(profile.to_codes(XYZ))
    image = Image.frombytes("LAB", (int(inside.sum()), 1), Lab[inside].astype(np.int16).astype(np.uint8).tobytes())
    # Its own faster tables would be an error that is not the profile's.
    transform = ImageCms.buildTransform(
        ImageCms.createProfile("LAB"), str(path), "LAB", "RGB", ImageCms.Intent.RELATIVE_COLORIMETRIC,
        ImageCms.Flags.NOOPTIMIZE,
    )  # fmt: skip
    got = np.asarray(ImageCms.applyTransform(image, transform), dtype=np.float64).reshape(-1, 3) / 255
    by = f"LittleCMS {features.version('littlecms2')} (codes of 8 bits, whose rounding is up to 0.002)"
    return _compared(profile, XYZ[inside], got, by)


def _XYZ_of_Lab(Lab: Float64Array) -> Float64Array:
    """XYZ (n, 3), white D50, of CIE Lab (n, 3)."""
    lightness, a, b = Lab.T / 100
    return D50 * drive_of_lightness(np.stack([lightness + 0.232 * a, lightness, lightness - 0.58 * b], axis=1))


def _between(values: Float64Array) -> BoolArray:
    return np.asarray(((values >= 0) & (values <= 1)).all(axis=-1))


def _by_openimageio(
    profile: DisplayProfile, XYZ: Float64Array, asked: Float64Array, ask: Callable[[Any], Any]
) -> ReadBack:
    """Codes that a function of an image gives for what is asked (n, 3)."""
    image = oiio().ImageBuf(oiio().ImageSpec(len(asked), 1, 3, oiio().FLOAT))
    image.set_pixels(oiio().ROI(), np.ascontiguousarray(asked[None], dtype=np.float32))
    answer = ask(image)
    if answer.has_error:
        return ReadBack(None, None, None, 0, f"OpenImageIO could not read it back ({error_text(answer)})")
    got = np.asarray(answer.get_pixels(oiio().FLOAT), dtype=np.float64).reshape(-1, 3)
    return _compared(profile, XYZ, got, f"OpenColorIO in OpenImageIO {oiio().VERSION_STRING} (32-bit floats)")


def _compared(profile: DisplayProfile, XYZ: Float64Array, got: Float64Array, by: str) -> ReadBack:
    if not len(XYZ):
        return ReadBack(None, None, None, 0, "no colour of the display can be asked for")
    white = profile.to_XYZ(np.ones(3))
    got, own = np.clip(got, 0.0, 1.0), np.clip(profile.to_codes(XYZ), 0.0, 1.0)
    shown, meant = (standards.XYZ_to_Lab(profile.to_XYZ(codes), white) for codes in (got, own))
    error, dE00 = np.abs(got - own).max(), standards.delta_E_2000(shown, meant).max()
    return ReadBack(by, float(error), float(dE00), len(XYZ))
