"""Bake a file of 16 GB: anonymous memory, sampled every 10 ms, above what it was after the imports.

``python benchmarks/bake_memory.py [--gigabytes 16] [--interleave bil] [--format exr] [--json]``. The file is made with
``truncate``, an ENVI image of unsigned 16-bit integers, and takes no room; the images do, and are thrown away.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
import threading
import time
from pathlib import Path

from spectral_core.baking import bake
from spectral_core.lights import Light
from spectral_core.memory import anonymous_MB
from spectral_core.textures import open_texture

BANDS, WIDTH = 101, 8192
LIGHTS = ("D65", "D50", "A", "FL11")
_EVERY_SECONDS = 0.01


def sparse_file(folder: Path, gigabytes: float, interleave: str) -> Path:
    """An ENVI image that is all zeros."""
    lines = max(1, round(gigabytes * 1e9 / (2 * WIDTH * BANDS)))
    path = folder / "large.img"
    path.touch()
    os.truncate(path, 2 * WIDTH * BANDS * lines)
    wavelengths = ", ".join(str(380 + 4 * band) for band in range(BANDS))
    path.with_suffix(".hdr").write_text(
        f"ENVI\nsamples = {WIDTH}\nlines = {lines}\nbands = {BANDS}\nheader offset = 0\nfile type = ENVI Standard\n"
        f"data type = 12\ninterleave = {interleave}\nbyte order = 0\nwavelength units = Nanometers\n"
        f"reflectance scale factor = 10000\nwavelength = {{{wavelengths}}}\n"
    )
    return path


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--gigabytes", type=float, default=16.0)
    parser.add_argument("--interleave", choices=("bip", "bil", "bsq"), default="bil")
    parser.add_argument("--format", choices=("exr", "png8", "png16", "tiff"), default="exr")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    arguments = parser.parse_args()
    lights = [Light.builtin(name) for name in LIGHTS]
    samples: list[float] = []
    done = threading.Event()

    def sample() -> None:
        while not done.wait(_EVERY_SECONDS):
            samples.append(anonymous_MB() or 0.0)

    with tempfile.TemporaryDirectory() as folder:
        path = sparse_file(Path(folder), arguments.gigabytes, arguments.interleave)
        # What is imported late is imported now: a bake of a few rows.
        bake(open_texture(sparse_file(Path(folder), 0.01, arguments.interleave)), lights, Path(folder) / "first")
        path = sparse_file(Path(folder), arguments.gigabytes, arguments.interleave)
        before = anonymous_MB() or 0.0
        watcher = threading.Thread(target=sample)
        watcher.start()
        started = time.perf_counter()
        result = bake(open_texture(path), lights, Path(folder) / "out", image_format=arguments.format)
        seconds = time.perf_counter() - started
        done.set()
        watcher.join()
        size = path.stat().st_size
    document = {
        "file_GB": size / 1e9, "pixels": result.pixels, "seconds": seconds, "MB_above_imports": max(samples) - before,
        "samples": len(samples), **{f"{name}_seconds": value for name, value in result.seconds.items()},
    }  # fmt: skip
    if arguments.json:
        print(json.dumps(document))
        return
    print(f"{size / 1e9:.1f} GB, {arguments.interleave}, {len(LIGHTS)} lights to {arguments.format}: {seconds:.0f} s")
    print(f"anonymous memory: {document['MB_above_imports']:.0f} MB above {before:.0f} MB ({len(samples)} samples)")


if __name__ == "__main__":
    main()
