"""Textures onto lights: time against reading the data once, against colour-science, and band by band.

``python benchmarks/projection.py [--side 1024] [--bands 101] [--rounds 9] [--json]``. All ratios are of medians of
rounds in one run, in which the ways take turns. *sum* adds the array up with one thread per processor, and
*fromfile* is NumPy's of the same file: the least that anything which reads the data once can take. *one by one* is
the published way: each light is a pass of its own over the band images.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
import time
import warnings
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from spectral_core.baking import bake_to_memory, level2_weights, project
from spectral_core.lights import Light
from spectral_core.textures import ArrayTexture, HyperspectralTexture, open_texture

LIGHTS = ("D65", "D50", "A", "FL11", "Philips TL-84", "LED-B3", "HP1", "two-peaks-d65")
FOUR = LIGHTS[:4]
AXES = {"bip": (0, 1, 2), "bil": (0, 2, 1), "bsq": (2, 0, 1)}
SCALE = 10_000


def rounds(ways: dict[str, Callable[[], object]], count: int) -> dict[str, np.ndarray]:
    """Milliseconds (count,) of each way, taken in turn after a first call that is not counted."""
    for way in ways.values():
        way()
    result = {name: np.empty(count) for name in ways}
    for index in range(count):
        for name, way in ways.items():
            started = time.perf_counter()
            way()
            result[name][index] = 1e3 * (time.perf_counter() - started)
    return result


def onto(texture: HyperspectralTexture, names: tuple[str, ...]) -> np.ndarray:
    """XYZ of all lights, as `project` gives it."""
    return project(texture, level2_weights(texture, [Light.builtin(name) for name in names]))


def added_up(cube: np.ndarray, pool: ThreadPoolExecutor) -> float:
    parts = np.array_split(cube.reshape(-1, cube.shape[-1]), os.cpu_count() or 1)
    return float(sum(pool.map(np.sum, parts)))


def colour_science(cube: np.ndarray, nm: np.ndarray, lights: tuple[str, ...]) -> list[np.ndarray]:
    """8-bit sRGB of a cube under each light, by colour-science."""
    import colour

    shape = colour.SpectralShape(nm[0], nm[-1], nm[1] - nm[0])
    cmfs = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    images = []
    for name in lights:
        sd = colour.SDS_ILLUMINANTS[name]
        XYZ = colour.msds_to_XYZ(cube, cmfs, sd, method="Integration", shape=shape) / 100
        images.append(np.round(255 * np.clip(colour.XYZ_to_sRGB(XYZ), 0, 1)).astype(np.uint8))
    return images


def one_by_one(bands: np.ndarray, weights: np.ndarray) -> list[np.ndarray]:
    """XYZ under each light from band images (bands, height, width), a pass per light."""
    results = []
    for light in range(weights.shape[1] // 3):
        XYZ = np.zeros((*bands.shape[1:], 3), dtype=np.float32)
        for image, weight in zip(bands, weights[:, 3 * light : 3 * light + 3].astype(np.float32), strict=True):
            XYZ += image[..., None] * weight
        results.append(XYZ)
    return results


def envi_file(folder: Path, interleave: str, cube: np.ndarray, nm: np.ndarray) -> Path:
    """A file of integers with its header."""
    path = folder / f"{interleave}.img"
    np.ascontiguousarray(cube.transpose(AXES[interleave])).tofile(path)
    height, width, bands = cube.shape
    path.with_suffix(".hdr").write_text(
        f"ENVI\nsamples = {width}\nlines = {height}\nbands = {bands}\nheader offset = 0\nfile type = ENVI Standard\n"
        f"data type = 12\ninterleave = {interleave}\nbyte order = 0\nwavelength units = Nanometers\n"
        f"reflectance scale factor = {SCALE}\nwavelength = {{{', '.join(f'{each:g}' for each in nm)}}}\n"
    )
    return path


def in_memory(cube: np.ndarray, nm: np.ndarray, count: int) -> dict[str, np.ndarray]:
    texture = ArrayTexture(cube, nm)
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return rounds(
            {
                "sum": lambda: added_up(cube, pool),
                "one light": lambda: onto(texture, LIGHTS[:1]),
                "four lights": lambda: onto(texture, FOUR),
                "eight lights": lambda: onto(texture, LIGHTS),
                "four lights, 8-bit sRGB": lambda: bake_to_memory(
                    texture, [Light.builtin(name) for name in FOUR], image_format="png8"
                ),
            },
            count,
        )


def against_others(cube: np.ndarray, nm: np.ndarray) -> dict[str, np.ndarray]:
    """Ways that take seconds: three rounds."""
    texture = ArrayTexture(cube, nm)
    bands = np.ascontiguousarray(cube.transpose(2, 0, 1))
    lights = [Light.builtin(name) for name in FOUR]
    weights = level2_weights(texture, lights)
    return rounds(
        {
            "ours, 8-bit sRGB": lambda: bake_to_memory(texture, lights, image_format="png8"),
            "colour-science, 8-bit sRGB": lambda: colour_science(cube, nm, FOUR),
            "ours, XYZ": lambda: onto(texture, FOUR),
            "one by one, XYZ": lambda: one_by_one(bands, weights),
        },
        3,
    )


def from_files(cube: np.ndarray, nm: np.ndarray, count: int) -> dict[str, np.ndarray]:
    with tempfile.TemporaryDirectory() as folder:
        counts = np.round(cube * SCALE).astype(np.uint16)
        paths = {name: envi_file(Path(folder), name, counts, nm) for name in AXES}
        del counts
        ways: dict[str, Callable[[], object]] = {}
        for name, path in paths.items():
            ways[f"fromfile {name}"] = lambda path=path: np.fromfile(path, dtype=np.uint16)
            ways[f"four lights {name}"] = lambda path=path: onto(open_texture(path), FOUR)
        return rounds(ways, count)


def accuracy(cube: np.ndarray, nm: np.ndarray) -> float:
    """Largest difference from float64, as a share of the white's Y."""
    weights = level2_weights(ArrayTexture(cube, nm), [Light.builtin(name) for name in LIGHTS])
    return float(np.abs(project(ArrayTexture(cube, nm), weights) - cube.astype(np.float64) @ weights).max())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--side", type=int, default=1024)
    parser.add_argument("--bands", type=int, default=101)
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    arguments = parser.parse_args()
    nm = np.linspace(380, 780, arguments.bands)
    cube = np.random.default_rng(0).random((arguments.side, arguments.side, arguments.bands), dtype=np.float32)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        memory, files = in_memory(cube, nm, arguments.rounds), from_files(cube, nm, arguments.rounds)
        others = against_others(cube, nm)
    error = accuracy(cube[: max(1, arguments.side // 8)], nm)
    rows = [
        ("four lights / sum", memory["four lights"], memory["sum"]),
        ("eight lights / one light", memory["eight lights"], memory["one light"]),
        *(
            (f"four lights / fromfile, {name}", files[f"four lights {name}"], files[f"fromfile {name}"])
            for name in AXES
        ),
        ("colour-science / ours, 8-bit sRGB", others["colour-science, 8-bit sRGB"], others["ours, 8-bit sRGB"]),
        ("one by one / ours, XYZ", others["one by one, XYZ"], others["ours, XYZ"]),
    ]
    ratios = {name: float(np.median(above) / np.median(below)) for name, above, below in rows}
    spread = {name: [float(each) for each in np.percentile(above / below, (25, 75))] for name, above, below in rows}
    if arguments.json:
        ms = {
            name: [float(e) for e in np.percentile(v, (50, 25, 75))]
            for name, v in {**memory, **files, **others}.items()
        }
        print(json.dumps({"ms": ms, "ratios": ratios, "quartiles": spread, "error": error, "numpy": np.__version__}))
        return
    print(
        f"{arguments.side} x {arguments.side} x {arguments.bands}, {os.cpu_count()} processors, NumPy {np.__version__}"
    )
    print(f"{'':<32} {'ms':>8} {'quartiles':>17}")
    for name, each in {**memory, **files, **others}.items():
        print(f"{name:<32} {np.median(each):8.1f} {np.percentile(each, 25):8.1f} {np.percentile(each, 75):8.1f}")
    print(f"\n{'ratio of medians':<36} {'':>8} {'quartiles':>13}")
    for name, ratio in ratios.items():
        print(f"{name:<36} {ratio:8.2f} {spread[name][0]:6.2f} {spread[name][1]:6.2f}")
    print(f"\nlargest difference from float64: {error:.1e} of the white's Y")


if __name__ == "__main__":
    main()
