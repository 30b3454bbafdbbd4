"""What is known of images that were baked before: which of them a bake can keep.

A record stands beside the images. It holds a key per image, a digest of everything that the image
comes from, and the image's size and time as they were when it was written. An image is kept if
its key is the one that it would get now and the file has not changed since. Images are renamed to
their place only when they are whole, and the record is written last: a bake that is killed leaves
whole images, and makes at worst one texture's anew.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

import spectral_core
from spectral_core.baking.pixels import PixelCounts
from spectral_core.display import DisplayProfile
from spectral_core.errors import SpectralBoothError, TextureError
from spectral_core.files import atomic_path, read_text
from spectral_core.lights import Light
from spectral_core.textures import HyperspectralTexture

_FORMAT, _VERSION = "spectral-booth bake", 1
# Colours at which a display's answer is compared: as fine as its curves and corrections are.
_PROBED = np.stack(np.meshgrid(*[np.linspace(-0.1, 1.2, 9)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)


@dataclass(frozen=True)
class BakedImage:
    """One image that was written.

    Attributes
    ----------
    light, level, path
        What it shows, and where.
    clipped_fraction
        Share of its pixels that are out of gamut.
    extended
        Share of the white that rests on extended ends of the bands.
    counts, bands_used
        What was wrong with the pixels when it was made, and in how many bands.
    kept
        True if it was there already and has been left as it was.
    """

    light: str
    level: int
    path: Path
    clipped_fraction: float
    extended: float
    counts: PixelCounts
    bands_used: int
    kept: bool = False


@dataclass(frozen=True)
class Origin:
    """Everything but the light that an image of a texture comes from."""

    texture: HyperspectralTexture
    profile: DisplayProfile
    reference: Light
    observer: str
    image_format: str
    bad_pixels: str

    def key(self, light: Light, level: int) -> str | None:
        """Digest of what an image comes from; None if the texture has no file that could be told again."""
        texture = self.texture
        if not texture.files:
            return None
        told: list[Any] = [
            spectral_core.__version__, level, self.observer, self.image_format, self.bad_pixels, texture.kind,
            texture.ignore_value, texture.height, texture.width, texture.part,
            *((str(file.resolve()), *_source_stamp(file)) for file in texture.files),
        ]  # fmt: skip
        arrays = [texture.gain, texture.dark, texture.good, texture.wavelengths_nm, self.profile.to_codes(_PROBED)]
        for each in (light, self.reference) if level == 1 else (light,):
            arrays += [each.wavelengths_nm, each.powers]
        digest = hashlib.sha256(repr(told).encode())
        for array in arrays:
            digest.update(repr(array.shape).encode())
            digest.update(np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()


def record_path(folder: Path, texture: str) -> Path:
    """Where the record of a texture's images is."""
    return folder / f"{texture}.bake.json"


def kept_images(record: Path, keys: Mapping[Path, str | None]) -> dict[Path, BakedImage]:
    """Images of a record that need not be made again, by path; a record that cannot be read keeps none."""
    try:
        document = json.loads(read_text(record, TextureError, "")) if record.is_file() else {}
        entries = (
            document["images"] if document.get("format") == _FORMAT and document.get("version") == _VERSION else {}
        )
        found = {path: _kept(path, entries[path.name], key) for path, key in keys.items() if path.name in entries}
    except (SpectralBoothError, OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return {}
    return {path: image for path, image in found.items() if image is not None}


def _kept(path: Path, entry: dict[str, Any], key: str | None) -> BakedImage | None:
    if key is None or entry["key"] != key or not path.is_file() or _stamp(path) != entry["stamp"]:
        return None
    return BakedImage(
        light=str(entry["light"]),
        level=int(entry["level"]),
        path=path,
        clipped_fraction=float(entry["clipped_fraction"]),
        extended=float(entry["extended"]),
        counts=PixelCounts(**{name: int(count) for name, count in entry["bad_pixels"].items()}),
        bands_used=int(entry["bands_used"]),
        kept=True,
    )


def write_record(record: Path, images: Sequence[BakedImage], keys: Mapping[Path, str | None]) -> None:
    """Say of each image what it comes from; images of other lights that the record knew stay in it."""
    try:
        entries = json.loads(read_text(record, TextureError, ""))["images"] if record.is_file() else {}
        entries = dict(entries)
    except (SpectralBoothError, OSError, ValueError, KeyError, TypeError, RecursionError):
        entries = {}
    for image in images:
        entries[image.path.name] = {
            "light": image.light,
            "level": image.level,
            "clipped_fraction": image.clipped_fraction,
            "extended": image.extended,
            "bad_pixels": asdict(image.counts),
            "bands_used": image.bands_used,
            "key": keys[image.path],
            "stamp": _stamp(image.path),
        }
    document = {"format": _FORMAT, "version": _VERSION, "images": entries}
    with atomic_path(record) as temporary:
        temporary.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


def _source_stamp(file: Path) -> list[int]:
    try:
        return _stamp(file)
    except OSError as error:
        raise TextureError(f"cannot be found any more ({error.strerror})", where=file, remedy="put it back") from None


def _stamp(path: Path) -> list[int]:
    status = path.stat()
    return [status.st_size, status.st_mtime_ns]


__all__ = ["BakedImage", "Origin", "kept_images", "record_path", "write_record"]
