"""Results as the JSON documents of the public contract."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from spectral_core.baking import BakeResult
from spectral_core.verification import LightResult

Document = dict[str, Any]


def verify_document(
    lights: Sequence[LightResult], stages: dict[str, Any], left_out: Sequence[str], **facts: Any
) -> Document:
    """The JSON of `verify`: lights, stages over all of them, what was left out, and facts."""
    return {**facts, "lights": [each.to_json() for each in lights], "stages": stages, "left_out": list(left_out)}


def bake_document(result: BakeResult) -> Document:
    """The JSON of `bake`."""
    return {
        "outputs": [
            {
                "light": image.light,
                "level": image.level,
                "path": str(image.path),
                "clipped_fraction": image.clipped_fraction,
                "extended": image.extended,
            }
            for image in result.images
        ],
        "seconds": result.seconds,
        "pixels": result.pixels,
        "bands": result.bands,
        "peak_memory_MB": result.peak_memory_MB,
    }
