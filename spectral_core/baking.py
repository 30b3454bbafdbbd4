"""Bake a hyperspectral texture under several lights: one pass, all lights at once.

Level 2 is the exact colour of each pixel under a light; level 1 is what an RGB pipeline would
show: the pixel's colour under the reference white times the lamp's colour, channel by channel.
"""

from __future__ import annotations

import contextlib
import re
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from spectral_core.arrays import Float32Array, Float64Array
from spectral_core.display import DisplayProfile, srgb
from spectral_core.display.profile import in_gamut
from spectral_core.errors import OutputError, TextureError
from spectral_core.files import atomic_path
from spectral_core.imaging import IMAGE_FORMATS, ImageFormat, ImageWriter
from spectral_core.lights import Light
from spectral_core.memory import anonymous_MB
from spectral_core.standards import DEFAULT_OBSERVER
from spectral_core.textures import HyperspectralTexture, Tile

# Beyond it EXR images of half floats would hold infinity.
_LARGEST_HALF = 65504.0

Progress = Callable[[float, str], None]


@dataclass(frozen=True)
class BakedImage:
    """One image that was written: share of pixels clipped, and where its wavelengths were extended."""

    light: str
    level: int
    path: Path
    clipped_fraction: float
    extended: float


@dataclass(frozen=True)
class BakeResult:
    """All images of one pass, and where the time went, in seconds."""

    images: tuple[BakedImage, ...]
    seconds: dict[str, float]
    pixels: int
    bands: int
    peak_memory_MB: float | None


def level2_weights(
    texture: HyperspectralTexture, lights: Sequence[Light], observer: str = DEFAULT_OBSERVER
) -> Float64Array:
    """Weighting factors of all lights side by side: (bands, 3 * lights)."""
    return np.concatenate(
        [light.weighting_factors(texture.wavelengths_nm, observer).matrix for light in lights], axis=1
    )


def project(texture: HyperspectralTexture, weights: Float64Array) -> Iterator[tuple[int, Float32Array]]:
    """(first row, values (rows, width, columns)) of ``texture @ weights`` (bands, columns), tile by tile.

    Weights are float64 and rounded once; sums run in float32, which costs at most about 1e-6 of
    the white's Y for hundred bands.

    Raises
    ------
    TextureError
        If a pixel is not a finite number: the message names its row.
    """
    factors = weights.astype(np.float32)
    for tile in texture.tiles():
        yield tile.first_row, project_tile(texture, tile, factors)


def project_tile(texture: HyperspectralTexture, tile: Tile, factors: Float32Array) -> Float32Array:
    """(rows, width, columns) of one tile times factors (bands, columns)."""
    rows, width, bands = tile.values.shape
    with np.errstate(invalid="ignore", over="ignore"):
        values = (tile.values.reshape(-1, bands) @ factors).reshape(rows, width, -1)
    if not np.isfinite(values).all():
        row = tile.first_row + int(np.argmax(~np.isfinite(values).all(axis=(1, 2))))
        raise TextureError(
            f"'{texture.name}' has a value that is no finite number in row {row}", remedy="repair the capture"
        )
    return np.asarray(values, dtype=np.float32)


def bake(
    texture: HyperspectralTexture,
    lights: Sequence[Light],
    folder: str | Path,
    profile: DisplayProfile | None = None,
    image_format: ImageFormat = "exr",
    observer: str = DEFAULT_OBSERVER,
    levels: Sequence[int] = (2,),
    reference: Light | None = None,
    progress: Progress | None = None,
) -> BakeResult:
    """Bake `texture` under `lights` into `folder`, one image per light and level.

    EXR images hold linear RGB of the profile, PNG and TIFF its device codes, both with the perfect
    diffuser at Y = 1. Out-of-gamut values are clipped in integer formats and counted in all.

    `reference` is the light under which an RGB camera would have seen the texture, for level 1;
    D65 if None.

    Raises
    ------
    TextureError
        If the texture is not reflectance or damaged.
    OutputError
        If an image cannot be written.
    """
    if texture.kind != "reflectance":
        raise TextureError(
            f"'{texture.name}' holds {texture.kind}, which is already lit",
            remedy="divide it by the radiance of a white reference",
        )
    profile = profile or srgb()
    reference = reference or Light.builtin("D65")
    weights = level2_weights(texture, [*lights, reference] if 1 in levels else lights, observer)
    jobs = [(level, index) for level in levels for index in range(len(lights))]
    paths = _image_paths(texture.name, lights, jobs, Path(folder), image_format)
    factors = weights.astype(np.float32)
    lamp_colours = np.array([profile.to_linear(light.XYZ(observer)) for light in lights], dtype=np.float32)
    memory = [anonymous_MB() or 0.0]
    seconds = {"read": 0.0, "project": 0.0, "write": 0.0, "total": 0.0}
    started = time.perf_counter()
    clipped = np.zeros(len(jobs), dtype=np.int64)
    with ExitStack() as stack:
        temporaries = [stack.enter_context(atomic_path(path)) for path in paths]
        size, is_srgb = (texture.width, texture.height), profile is srgb()
        writers = [ImageWriter(temporary, *size, image_format, is_srgb) for temporary in temporaries]
        try:
            for tile in _timed(texture.tiles(), seconds):
                mark = time.perf_counter()
                XYZ = project_tile(texture, tile, factors)
                linear = _linear(texture, tile, XYZ, profile)
                seconds["project"] += time.perf_counter() - mark
                mark = time.perf_counter()
                for number, (level, index) in enumerate(jobs):
                    pixels = linear[:, :, index] if level == 2 else linear[:, :, -1] * lamp_colours[index]
                    clipped[number] += _outside(pixels)
                    writers[number].write(_encode(pixels, profile, image_format))
                seconds["write"] += time.perf_counter() - mark
                memory.append(anonymous_MB() or 0.0)
                if progress:
                    progress((tile.first_row + len(XYZ)) / texture.height, f"baking {texture.name}")
        except BaseException:
            for writer in writers:
                with contextlib.suppress(OutputError):  # the first error is the one to report
                    writer.close()
            raise
        for writer in writers:
            writer.close()
    seconds["total"] = time.perf_counter() - started
    pixels_total = texture.width * texture.height
    extended = [light.weighting_factors(texture.wavelengths_nm, observer).extended for light in lights]
    images = tuple(
        BakedImage(lights[index].name, level, path, float(count / pixels_total), extended[index])
        for (level, index), path, count in zip(jobs, paths, clipped, strict=True)
    )
    return BakeResult(images, seconds, pixels_total, texture.bands, max(memory) or None)


def _linear(texture: HyperspectralTexture, tile: Tile, XYZ: Float32Array, profile: DisplayProfile) -> Float32Array:
    """Linear RGB (rows, width, lights, 3) of XYZ (rows, width, 3 * lights), within what half floats hold."""
    linear = profile.to_linear(XYZ.reshape(*XYZ.shape[:2], -1, 3))
    largest = max(float(linear.max()), -float(linear.min()))
    if largest > _LARGEST_HALF:
        raise TextureError(
            f"'{texture.name}' has values up to {largest:.3g} times white in the rows from {tile.first_row}",
            remedy="divide counts by the white reference",
        )
    return np.asarray(linear, dtype=np.float32)


def _timed(tiles: Iterator[Tile], seconds: dict[str, float]) -> Iterator[Tile]:
    """The tiles, with the time that reading them takes."""
    while True:
        mark = time.perf_counter()
        tile = next(tiles, None)
        seconds["read"] += time.perf_counter() - mark
        if tile is None:
            return
        yield tile


def _image_paths(
    name: str, lights: Sequence[Light], jobs: Sequence[tuple[int, int]], folder: Path, image_format: str
) -> list[Path]:
    suffix, _ = IMAGE_FORMATS[image_format]
    paths = [
        folder / f"{name}_{file_name(lights[index].name)}{'' if level == 2 else '_level1'}{suffix}"
        for level, index in jobs
    ]
    if len(set(paths)) < len(paths):
        raise OutputError("two lights would be written to one file", where=folder, remedy="give each light once")
    return paths


def file_name(name: str) -> str:
    """A light's name as part of a file name."""
    return re.sub(r"[^A-Za-z0-9.+-]+", "-", name).strip("-")


def _outside(linear: Float32Array) -> int:
    """How many pixels are out of gamut."""
    return int((~in_gamut(linear)).sum())


def _encode(linear: Float32Array, profile: DisplayProfile, image_format: str) -> Float32Array:
    if image_format == "exr":
        return linear
    return np.asarray(np.clip(profile.model.encode(linear), 0.0, 1.0), dtype=np.float32)
