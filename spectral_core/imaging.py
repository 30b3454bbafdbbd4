"""Images on disk, through OpenImageIO."""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from spectral_core.arrays import Float32Array
from spectral_core.display.models import srgb_encode
from spectral_core.errors import OutputError
from spectral_core.files import atomic_path

ImageFormat = Literal["exr", "png8", "png16", "tiff"]
# Largest integer of a code, None for linear floats.
LEVELS: dict[str, int | None] = {"exr": None, "png8": 255, "png16": 65535, "tiff": 65535}
IMAGE_FORMATS: dict[str, tuple[str, str]] = {
    "exr": (".exr", "half"),
    "png8": (".png", "uint8"),
    "png16": (".png", "uint16"),
    "tiff": (".tif", "uint16"),
}


@cache
def oiio() -> ModuleType:
    """OpenImageIO; inside the bpy wheels it is bundled but not on the path."""
    try:
        import OpenImageIO
    except ImportError:
        bundled = _bundled_with_blender()
        if bundled is None:
            raise
        sys.path.append(str(bundled))
        import OpenImageIO
    return OpenImageIO


def _bundled_with_blender() -> Path | None:
    """Site-packages that a loaded bpy brings; the core never imports bpy itself."""
    bpy = sys.modules.get("bpy")
    if bpy is None:
        return None
    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    folder = Path(bpy.utils.resource_path("LOCAL")) / "python" / "lib" / version / "site-packages"
    return folder if (folder / "OpenImageIO").exists() else None


def error_text(source: Any) -> str:
    """The first line of the pending error of OpenImageIO or one of its inputs and outputs."""
    try:
        return next(iter(str(source.geterror()).splitlines()), "unknown")
    except UnicodeDecodeError:  # it quotes the damaged file
        return "unknown"


class ImageWriter:
    """Writes an RGB image from the top down, a few rows at a time.

    Only sRGB images say their colour space: other programs would decode a headset's codes otherwise.
    Messages name the file `target`, where `path` is a temporary one that will become it.
    """

    def __init__(
        self,
        path: Path,
        width: int,
        height: int,
        image_format: ImageFormat,
        is_srgb: bool = True,
        target: Path | None = None,
    ) -> None:
        self._path, self._target = path, target or path
        suffix, pixel_type = IMAGE_FORMATS[image_format]
        spec = oiio().ImageSpec(width, height, 3, pixel_type)
        if is_srgb:
            spec.attribute("oiio:ColorSpace", "Linear" if image_format == "exr" else "sRGB")
        spec.attribute("compression", "zip")
        self._row = 0
        # By the format and not by the name, which is a temporary one.
        self._output: Any = oiio().ImageOutput.create(suffix.lstrip("."))
        if self._output is None or not self._output.open(str(path), spec):
            raise self._failure("choose another folder")

    def write(self, rows: npt.NDArray[Any]) -> None:
        """Append rows (count, width, 3): integers as they are, or float32 that is rounded to them from 0..1."""
        count = len(rows)
        if not self._output.write_scanlines(self._row, self._row + count, 0, np.ascontiguousarray(rows)):
            raise self._failure("is the disk full?")
        self._row += count

    def close(self) -> None:
        """Finish the file."""
        if not self._output.close():
            raise self._failure("is the disk full?")

    def _failure(self, remedy: str) -> OutputError:
        said = error_text(self._output if self._output is not None else oiio())
        said = said.replace(str(self._path), str(self._target))
        return OutputError(f"cannot be written ({said})", where=self._target, remedy=remedy)


def write_png(path: Path, linear: Float32Array) -> None:
    """Write linear sRGB (height, width, 3) as an 8-bit sRGB PNG, clipped, as a screen shows it."""
    height, width, _ = linear.shape
    with atomic_path(path) as temporary:
        writer = ImageWriter(temporary, width, height, "png8", target=path)
        writer.write(np.asarray(srgb_encode(np.clip(linear, 0.0, 1.0)), dtype=np.float32))
        writer.close()
