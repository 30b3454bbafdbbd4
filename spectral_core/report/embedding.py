"""Pictures as data URIs, so that the report is one file."""

from __future__ import annotations

import base64
import io
from pathlib import Path
from typing import Any

import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.display import srgb_decode, srgb_encode
from spectral_core.errors import OutputError
from spectral_core.report.extras import extra

# Twice the width at which the page shows them would be wasted on flat patches.
LARGEST_WIDTH = 960
_SMALLER = (1.0, 0.75, 0.5, 0.35)
_JPEG_QUALITY = 90


def image_uri(path: Path, allowance_bytes: int) -> str:
    """A picture file as a data URI of at most about `allowance_bytes`.

    PNG where that fits, which keeps every pixel's code; otherwise JPEG at full chroma resolution,
    smaller where needed.

    Raises
    ------
    OutputError
        If the file is missing or no picture.
    """
    image_module = extra("PIL.Image")
    try:
        with image_module.open(path) as opened:
            image = opened.convert("RGB")
    except (OSError, ValueError) as error:
        raise OutputError(
            f"cannot be read as a picture ({type(error).__name__})", where=path, remedy="render it again"
        ) from None
    data, kind = b"", "png"
    for scale in _SMALLER:
        resized = _narrowed(image, int(min(image.width, LARGEST_WIDTH) * scale))
        data, kind = _encoded(resized, "PNG"), "png"
        if len(data) > allowance_bytes:
            data, kind = _encoded(resized, "JPEG", quality=_JPEG_QUALITY, subsampling=0), "jpeg"
        if len(data) <= allowance_bytes:
            break
    return data_uri(data, kind)


def data_uri(data: bytes, kind: str) -> str:
    """A data URI of an image of a MIME subtype."""
    return f"data:image/{kind};base64,{base64.b64encode(data).decode('ascii')}"


def _encoded(image: Any, file_format: str, **options: Any) -> bytes:
    buffer = io.BytesIO()
    image.save(buffer, file_format, **options)
    return buffer.getvalue()


def _narrowed(image: Any, width: int) -> Any:
    """The picture at a smaller width, averaged in linear light so that no colour shifts."""
    if width >= image.width:
        return image
    image_module = extra("PIL.Image")
    height = max(1, round(image.height * width / image.width))
    linear: Float64Array = srgb_decode(np.asarray(image, dtype=np.float64) / 255)
    size, average = (width, height), image_module.Resampling.BOX
    channels = [image_module.fromarray(linear[..., each].astype(np.float32)).resize(size, average) for each in range(3)]
    codes = srgb_encode(np.stack([np.asarray(each, dtype=np.float64) for each in channels], axis=-1))
    return image_module.fromarray(np.round(255 * np.clip(codes, 0, 1)).astype(np.uint8))
