"""Bake a hyperspectral texture under several lights: one pass, all lights at once.

Level 2 is the exact colour of each pixel under a light; level 1 is what an RGB pipeline would
show: the pixel's colour under the reference white times the lamp's colour, channel by channel.
"""

from __future__ import annotations

import contextlib
import operator
import os
import re
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import reduce
from pathlib import Path

import numpy as np

from spectral_core.baking.dead_bands import without_dead_bands
from spectral_core.baking.pixels import BadPixels, PixelCounts, pixel_warnings
from spectral_core.baking.projection import grid_warnings, in_order
from spectral_core.baking.records import BakedImage, Origin, kept_images, record_path, write_record
from spectral_core.baking.strips import BakedStrip, Picture, Recipe, bake_rows, check_reflectance, recipe
from spectral_core.display import DisplayProfile, srgb
from spectral_core.errors import OutputError, TextureError
from spectral_core.files import atomic_path
from spectral_core.imaging import IMAGE_FORMATS, LEVELS, ImageFormat, ImageWriter
from spectral_core.lights import Light
from spectral_core.memory import anonymous_MB
from spectral_core.standards import DEFAULT_OBSERVER
from spectral_core.textures import HyperspectralTexture

Progress = Callable[[float, str], None]
Write = Callable[[BakedStrip], object]
Strips = Callable[[HyperspectralTexture, Recipe], Iterator[BakedStrip]]


@dataclass(frozen=True)
class BakeResult:
    """All images of one pass.

    Attributes
    ----------
    images
        In the order of levels and lights.
    seconds
        ``read``, ``project`` (encoding included) and ``write``: the work of all threads together;
        ``total`` by the clock. A mapped file is read while it is projected.
    pixels, bands
        Of the texture.
    peak_memory_MB
        Largest anonymous memory seen, None where the system does not tell.
    counts
        What was wrong with the pixels, also those of images that were kept.
    warnings
        What a user should know.
    """

    images: tuple[BakedImage, ...]
    seconds: dict[str, float]
    pixels: int
    bands: int
    peak_memory_MB: float | None
    counts: PixelCounts = field(default_factory=PixelCounts)
    warnings: tuple[str, ...] = ()


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
    bad_pixels: BadPixels = "repair",
    again: bool = False,
    strips: Strips | None = None,
) -> BakeResult:
    """Bake `texture` under `lights` into `folder`, one image per light and level.

    EXR images hold linear RGB of the profile, PNG and TIFF its device codes, both with the perfect
    diffuser at Y = 1. Out-of-gamut values are clipped in integer formats and counted in all.

    Images appear whole or not at all. A record beside them (``NAME.bake.json``) says how each was
    made: those that would come out the same are kept, so a bake that was stopped goes on where it was.

    Parameters
    ----------
    texture, lights, folder
        What is baked, under what, to where.
    profile
        sRGB if None.
    image_format
        A key of `spectral_core.imaging.IMAGE_FORMATS`.
    observer
        Standard observer.
    levels
        1, 2 or both.
    reference
        The light under which an RGB camera would have seen the texture, for level 1; D65 if None.
    progress
        Called with the fraction done and a text; what it raises stops the bake.
    bad_pixels
        ``repair`` or ``refuse`` (`spectral_core.baking.pixels`).
    again
        Make every image anew.
    strips
        Who computes the strips, in order; this process if None (`spectral_core.baking.cluster`).

    Raises
    ------
    TextureError
        If the texture is not reflectance or damaged.
    OutputError
        If an image cannot be written.
    """
    check_reflectance(texture)
    texture = without_dead_bands(texture)
    started, folder, profile = time.perf_counter(), Path(folder), profile or srgb()
    reference = reference or Light.builtin("D65")
    pictures = _pictures(texture.name, lights, levels, folder, image_format)
    origin = Origin(texture, profile, reference, observer, image_format, bad_pixels)
    keys = {path: origin.key(picture.light, picture.level) for path, picture in pictures.items()}
    record = record_path(folder, texture.name)
    images = {} if again else kept_images(record, keys)
    wanted = {path: picture for path, picture in pictures.items() if path not in images}
    tally = _Tally(texture, len(wanted), progress)
    if wanted:
        levels_of_code = LEVELS[image_format]
        plan = recipe(texture, list(wanted.values()), reference, profile, levels_of_code, observer, bad_pixels)
        with _writers(texture, list(wanted), image_format, profile is srgb()) as write:
            for strip in (strips or _here)(texture, plan):
                tally.add(strip, write)
            if tally.counts.lost == texture.width * texture.height:
                raise TextureError(f"no pixel holds a number in '{texture.name}'", remedy="repair the capture")
        shares = tally.outside / (texture.width * texture.height)
        for (path, picture), share in zip(wanted.items(), shares.tolist(), strict=True):
            factors = picture.light.weighting_factors(texture.wavelengths_nm[texture.good], observer)
            images[path] = BakedImage(
                picture.light.name, picture.level, path, share, factors.extended, tally.counts, plan.how.bands_used
            )
        write_record(record, [images[path] for path in wanted], keys)
    counts = reduce(operator.or_, (image.counts for image in images.values()), PixelCounts())
    bands_used = max((image.bands_used for image in images.values()), default=texture.bands)
    return BakeResult(
        images=tuple(images[path] for path in pictures),
        seconds={**tally.seconds, "total": time.perf_counter() - started},
        pixels=texture.width * texture.height,
        bands=texture.bands,
        peak_memory_MB=tally.memory_MB or None,
        counts=counts,
        warnings=(
            *texture.warnings,
            *grid_warnings(texture, lights, observer),
            *_of_fluorescence(texture, lights),
            *pixel_warnings(texture, counts, bands_used),
        ),
    )


class _Tally:
    """What the strips of a bake add up to."""

    def __init__(self, texture: HyperspectralTexture, pictures: int, progress: Progress | None) -> None:
        self._texture, self._progress, self._rows = texture, progress, 0
        self.outside = np.zeros(pictures, dtype=np.int64)
        self.counts = PixelCounts()
        self.seconds = {"read": 0.0, "project": 0.0, "write": 0.0}
        self.memory_MB = anonymous_MB() or 0.0

    def add(self, strip: BakedStrip, write: Write) -> None:
        """Write a strip and count it."""
        mark = time.perf_counter()
        write(strip)
        self.seconds["write"] += time.perf_counter() - mark
        self.seconds["read"] += strip.read_seconds
        self.seconds["project"] += strip.project_seconds
        self.outside += strip.outside
        self.counts += strip.counts
        self.memory_MB = max(self.memory_MB, anonymous_MB() or 0.0)
        self._rows += len(strip.pixels[0])
        if self._progress:
            self._progress(self._rows / self._texture.height, f"baking {self._texture.name}")


def file_name(name: str) -> str:
    """A light's name as part of a file name."""
    return re.sub(r"[^A-Za-z0-9.+-]+", "-", name).strip("-")


def _pictures(
    name: str, lights: Sequence[Light], levels: Sequence[int], folder: Path, image_format: str
) -> dict[Path, Picture]:
    suffix, _ = IMAGE_FORMATS[image_format]
    pictures = {
        folder / f"{name}_{file_name(light.name)}{'' if level == 2 else '_level1'}{suffix}": Picture(light, level)
        for level in levels
        for light in lights
    }
    if len(pictures) < len(levels) * len(lights):
        raise OutputError("two lights would be written to one file", where=folder, remedy="give each light once")
    return pictures


def _of_fluorescence(texture: HyperspectralTexture, lights: Sequence[Light]) -> list[str]:
    if not texture.fluorescent:
        return []
    names = ", ".join(light.name for light in lights)
    return [f"'{texture.name}' was measured as fluorescent: what {names} would excite in it is left out"]


def _here(texture: HyperspectralTexture, plan: Recipe) -> Iterator[BakedStrip]:
    """All strips, computed by this process."""
    return in_order(texture, plan.how, lambda rows, product: bake_rows(texture, plan, rows, product))


@contextmanager
def _writers(
    texture: HyperspectralTexture, paths: Sequence[Path], image_format: ImageFormat, is_srgb: bool
) -> Iterator[Write]:
    """A function that appends a strip to all images; they get their names when the block ends well.

    Images are written at the same time: most of the work is their compression.
    """
    with ExitStack() as stack:
        temporaries = [stack.enter_context(atomic_path(path, keep_suffix=False)) for path in paths]
        pool = stack.enter_context(ThreadPoolExecutor(os.cpu_count()))
        writers = [
            ImageWriter(temporary, texture.width, texture.height, image_format, is_srgb, target)
            for temporary, target in zip(temporaries, paths, strict=True)
        ]
        try:
            yield lambda strip: list(pool.map(ImageWriter.write, writers, strip.pixels))
        except BaseException:
            for writer in writers:
                with contextlib.suppress(OutputError):  # the first error is the one to report
                    writer.close()
            raise
        for writer in writers:
            writer.close()
