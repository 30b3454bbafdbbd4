"""Results as the JSON documents of the public contract."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from spectral_core.baking import BakeResult, PixelCounts
from spectral_core.verification import LightResult

Document = dict[str, Any]


def verify_document(
    lights: Sequence[LightResult], stages: dict[str, Any], left_out: Sequence[str], **facts: Any
) -> Document:
    """The JSON of `verify`: lights, stages over all of them, what was left out, and facts."""
    return {**facts, "lights": [each.to_json() for each in lights], "stages": stages, "left_out": list(left_out)}


def bake_document(result: BakeResult) -> Document:
    """The JSON of `bake` for one texture."""
    return {
        "outputs": [
            {
                "light": image.light,
                "level": image.level,
                "path": str(image.path),
                "clipped_fraction": image.clipped_fraction,
                "extended": image.extended,
                "kept": image.kept,
            }
            for image in result.images
        ],
        "seconds": result.seconds,
        "pixels": result.pixels,
        "bands": result.bands,
        "peak_memory_MB": result.peak_memory_MB,
        "bad_pixels": asdict(result.counts),
        "warnings": list(result.warnings),
    }


def bakes_document(results: Mapping[Path, BakeResult]) -> Document:
    """The JSON of `bake` for one texture or several, of which each output names its own."""
    parts = {file: bake_document(result) for file, result in results.items()}
    if len(parts) == 1:
        return next(iter(parts.values()))
    seconds = [part["seconds"] for part in parts.values()]
    memory = [part["peak_memory_MB"] for part in parts.values() if part["peak_memory_MB"] is not None]
    return {
        "outputs": [{"texture": str(file), **each} for file, part in parts.items() for each in part["outputs"]],
        "seconds": {key: sum(each[key] for each in seconds) for key in seconds[0]},
        "pixels": sum(part["pixels"] for part in parts.values()),
        "bands": max(part["bands"] for part in parts.values()),
        "peak_memory_MB": max(memory, default=None),
        "bad_pixels": {key: sum(part["bad_pixels"][key] for part in parts.values()) for key in asdict(PixelCounts())},
        "warnings": [f"{file}: {warning}" for file, part in parts.items() for warning in part["warnings"]],
    }
