"""Libraries, images and colours for the tests of RGB textures' spectra."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spectral_core import standards
from spectral_core.assigning import Library
from spectral_core.imaging import oiio
from spectral_core.lights import Light
from spectral_core.textures import open_texture

Run = Callable[..., tuple[int, str, str]]
NM = np.arange(400.0, 701.0, 10)
D65, FL11 = Light.builtin("D65"), Light.builtin("FL11")
# A half float rounds by at most 1 part in 2048; averaged over the bands that is far less than this dE00.
HALF = 0.03
BLUE = np.array([0.0, 5.0, -40.0])


def smooth_library(count: int, seed: int = 0) -> Library:
    """Reflectances like measured ones: a level, steps and bands, smooth, within 0.02 to 0.95."""
    random_ = np.random.default_rng(seed)
    level, step, edge, width, band, centre = (
        random_.uniform(*limits, (count, 1))
        for limits in ((-2.5, 2), (-4, 4), (420, 680), (8, 40), (-2.5, 2.5), (420, 680))
    )
    curve = level + step / (1 + np.exp(-(NM - edge) / width)) + band * np.exp(-(((NM - centre) / 45) ** 2))
    values = 0.02 + 0.93 / (1 + np.exp(-curve))
    return Library(tuple(f"r{i}" for i in range(count)), NM, values)


def write_image(path: Path, codes: np.ndarray, **attributes: Any) -> Path:
    """Write codes (height, width, channels), uint8 or uint16."""
    spec = oiio().ImageSpec(
        codes.shape[1], codes.shape[0], codes.shape[2], str(codes.dtype).replace("float32", "float")
    )
    for name, value in attributes.items():
        spec.attribute(name, *value) if isinstance(value, tuple) else spec.attribute(name, value)
    output = oiio().ImageOutput.create(str(path))
    assert output.open(str(path), spec), output.geterror()
    assert output.write_image(np.ascontiguousarray(codes))
    output.close()
    return path


def write_library(path: Path, library: Library) -> Path:
    rows = [",".join(map(repr, [float(nm), *row.tolist()])) for nm, row in zip(NM, library.values.T, strict=True)]
    path.write_text("\n".join([",".join(["nm", *library.names]), *rows]) + "\n")
    return path


def noise(height: int, width: int, seed: int = 3, kind: str = "uint8") -> np.ndarray:
    return np.random.default_rng(seed).integers(0, np.iinfo(kind).max, (height, width, 3), kind, endpoint=True)


def all_rows(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Wavelengths, and values (height, width, bands) in float64."""
    texture: Any = open_texture(path)
    values = texture.rows(0, texture.height).astype(np.float64)
    if hasattr(texture, "close"):
        texture.close()
    assert texture.kind == "reflectance"
    return texture.wavelengths_nm, values


def Lab_at_random(count: int, chroma: float, seed: int) -> np.ndarray:
    random_ = np.random.default_rng(seed)
    return np.column_stack([random_.uniform(0, 100, count), random_.normal(0, chroma, (count, 2))])


def all_dE00(colours: np.ndarray, library: np.ndarray) -> np.ndarray:
    return standards.delta_E_2000(np.repeat(colours[:, None], len(library), axis=1), library[None])


def srgb_icc() -> bytes:
    cms = pytest.importorskip("PIL.ImageCms")
    return bytes(cms.ImageCmsProfile(cms.createProfile("sRGB")).tobytes())
