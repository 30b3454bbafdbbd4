"""Spectra for RGB textures: how much faster the search is than brute force, and what a whole texture takes.

Run: ``python benchmarks/assigning.py`` (add ``--json`` for one JSON object, ``--quick`` for a small texture).

The texture is like a photograph: soft gradients between random colours, stripes, and noise, so that it has some
hundred thousand colours. The library is of smooth random reflectances. Brute force compares a
sample of the colours with the whole library by the same function; both are measured in one run, so that their
ratio says something on any machine.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from pathlib import Path

import numpy as np

from spectral_core import standards
from spectral_core.assigning import Library, assign
from spectral_core.assigning import nearest as search
from spectral_core.assigning.codes import between
from spectral_core.display import srgb
from spectral_core.imaging import ImageWriter
from spectral_core.lights import Light
from spectral_core.memory import anonymous_MB

NM = np.arange(380.0, 781.0, 5)
SAMPLE = 200


def library(count: int) -> Library:
    """Sigmoids of a level, a step and a band."""
    random_ = np.random.default_rng(0)
    limits = ((-2.5, 2), (-4, 4), (420, 680), (8, 40), (-2.5, 2.5), (420, 680))
    level, step, edge, width, band, centre = (random_.uniform(*each, (count, 1)) for each in limits)
    curve = level + step / (1 + np.exp(-(NM - edge) / width)) + band * np.exp(-(((NM - centre) / 45) ** 2))
    return Library(tuple(f"r{i}" for i in range(count)), NM, 0.02 + 0.93 / (1 + np.exp(-curve)))


def photograph(size: int) -> np.ndarray:
    """Codes (size, size, 3), uint8."""
    random_ = np.random.default_rng(1)
    y, x = np.mgrid[:size, :size] / size
    image, total = np.zeros((size, size, 3)), np.zeros((size, size, 1))
    for colour in random_.uniform(0, 255, (12, 3)):
        at = random_.uniform(0, 1, 2)
        weight = np.exp(-((x - at[0]) ** 2 + (y - at[1]) ** 2) * 20)[..., None]
        image += weight * colour
        total += weight
    stripes = 0.8 + 0.2 * np.sin(40 * x + 30 * np.sin(9 * y))
    image = image / total * stripes[..., None] + random_.normal(0, 2.5, (size, size, 3))
    return np.clip(np.round(image), 0, 255).astype(np.uint8)


def search_against_brute_force(codes: np.ndarray, reflectances: Library, light: Light) -> dict[str, float]:
    """Microseconds a colour, and how many comparisons by CIEDE2000 each takes."""
    colours = np.unique(codes.reshape(-1, 3), axis=0)
    XYZ = srgb().to_XYZ(colours / 255) @ between(srgb().to_XYZ(np.ones(3)), light.XYZ()).T
    Lab, members = standards.XYZ_to_Lab(XYZ, light.XYZ()), reflectances.Lab(light)
    sample = np.random.default_rng(2).choice(len(Lab), SAMPLE, replace=False)
    started = time.perf_counter()
    brute = np.array(
        [standards.delta_E_2000(np.broadcast_to(each, members.shape), members).min() for each in Lab[sample]]
    )
    brute_seconds = (time.perf_counter() - started) / SAMPLE * len(Lab)
    started = time.perf_counter()
    found = search.nearest(Lab, members)
    seconds = time.perf_counter() - started
    return {
        "colours": len(Lab),
        "brute_force_s": brute_seconds,
        "search_s": seconds,
        "ratio": brute_seconds / seconds,
        "largest_difference": float(np.abs(found.dE00[sample, 0] - brute).max()),
    }


def whole_textures(codes: np.ndarray, reflectances: Library, light: Light, folder: Path) -> list[dict[str, object]]:
    """Seconds and memory from the image to the hyperspectral file."""
    image = folder / "photograph.png"
    writer = ImageWriter(image, codes.shape[1], codes.shape[0], "png8")
    writer.write((codes / 255).astype(np.float32))
    writer.close()
    rows = []
    for name, suffix, how in (
        ("nearest", "npz", {}),
        ("nearest", "exr", {}),
        ("nearest, exact", "npz", {"exact": True}),
        ("mixture of 8", "npz", {"mix": 8}),
        ("otsu", "npz", {"recover": "otsu"}),
    ):
        before, most = anonymous_MB() or 0.0, [0.0]

        def watch(_: float, __: str, most: list[float] = most) -> None:
            most[0] = max(most[0], anonymous_MB() or 0.0)

        done = assign(image, light, folder / f"out.{suffix}", reflectances, progress=watch, **how)  # type: ignore[arg-type]
        size = (folder / f"out.{suffix}").stat().st_size / 1e6
        # Else the next one waits until the system has brought this one to the disk.
        (folder / f"out.{suffix}").unlink()
        rows.append(
            {"method": name, "format": suffix, "seconds": done.seconds, "file_MB": size, "memory_MB": most[0] - before,
             "dE00_mean": done.dE00.mean}
        )  # fmt: skip
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--quick", action="store_true", help="256 x 256 texels and 1000 reflectances")
    arguments = parser.parse_args()
    standards.colour_science_version()  # its import is not what is measured
    size, count = (256, 1000) if arguments.quick else (2048, 10_000)
    codes, reflectances, light = photograph(size), library(count), Light.builtin("D65")
    found = search_against_brute_force(codes, reflectances, light)
    with tempfile.TemporaryDirectory() as folder:
        rows = whole_textures(codes, reflectances, light, Path(folder))
    if arguments.json:
        print(json.dumps({"size": size, "reflectances": count, "search": found, "textures": rows}))
        return
    print(f"{size} x {size} texels, {found['colours']} colours, {count} reflectances, {len(NM)} bands")
    print(
        f"search {found['search_s']:.2f} s, brute force {found['brute_force_s']:.0f} s: {found['ratio']:.0f} times, "
        f"largest difference {found['largest_difference']:.1e}"
    )
    for row in rows:
        print(
            f"{row['method']:<16} .{row['format']}  {row['seconds']:6.1f} s  {row['file_MB']:6.0f} MB file  "
            f"{row['memory_MB']:5.0f} MB memory  dE00 {row['dE00_mean']:.2f}"
        )


if __name__ == "__main__":
    main()
