"""ENVI files for tests, written by plain numpy."""

from __future__ import annotations

from pathlib import Path

import numpy as np

TYPES = {
    1: np.uint8, 2: np.int16, 3: np.int32, 4: np.float32, 5: np.float64, 12: np.uint16, 13: np.uint32, 14: np.int64,
    15: np.uint64,
}  # fmt: skip
# Axes of a cube (height, width, bands) in the order of the file.
AXES = {"bsq": (2, 0, 1), "bil": (0, 2, 1), "bip": (0, 1, 2)}
NM = (400.0, 450.5, 500.0, 550.25, 600.0, 650.0, 700.0)


def cube_of(code: int, shape: tuple[int, int, int] = (5, 4, len(NM)), seed: int = 0) -> np.ndarray:
    """Values all over the range of a type."""
    random = np.random.default_rng(seed)
    kind = np.dtype(TYPES[code])
    if kind.kind == "f":
        return random.normal(0.5, 0.4, shape).astype(kind)
    limits = np.iinfo(kind)
    return random.integers(limits.min, limits.max, shape, dtype=kind, endpoint=True)


def listed(values: object) -> str:
    return "{" + ", ".join(map(str, values)) + "}"  # type: ignore[call-overload]


def header_lines(cube: np.ndarray, code: int, interleave: str = "bsq", order: int = 0, offset: int = 0) -> list[str]:
    return [
        "ENVI",
        "description = {\n  Made for a test.\n  [Thu]}",
        f"samples = {cube.shape[1]}",
        f"lines   = {cube.shape[0]}",
        f"bands   = {cube.shape[2]}",
        f"header offset = {offset}",
        "file type = ENVI Standard",
        f"data type = {code}",
        f"interleave = {interleave}",
        f"byte order = {order}",
        "wavelength units = Nanometers",
        f"wavelength = {listed(NM[: cube.shape[2]])}",
    ]


def write_data(path: Path, cube: np.ndarray, interleave: str = "bsq", order: int = 0, offset: int = 0) -> None:
    stored = np.ascontiguousarray(cube.transpose(AXES[interleave])).astype(cube.dtype.newbyteorder("<>"[order]))
    path.write_bytes(b"\xaa" * offset + stored.tobytes())


def write_envi(
    folder: Path, cube: np.ndarray, code: int, interleave: str = "bsq", order: int = 0, offset: int = 0, *more: str,
    data: str = "x.raw", header: str = "x.hdr",
) -> Path:  # fmt: skip
    """Write both files and return the header's path; `more` are further lines."""
    write_data(folder / data, cube, interleave, order, offset)
    text = "\n".join([*header_lines(cube, code, interleave, order, offset), *more, ""])
    (folder / header).write_text(text, encoding="utf-8")
    return folder / header


def write_library(folder: Path, values: np.ndarray, code: int, *more: str, data: str = "lib.sli") -> Path:
    """A spectral library (spectra, wavelengths) with its header ``lib.hdr``."""
    (folder / data).write_bytes(values.astype(values.dtype.newbyteorder("<")).tobytes())
    lines = [
        "ENVI",
        f"samples = {values.shape[1]}",
        f"lines = {values.shape[0]}",
        "bands = 1",
        "file type = ENVI Spectral Library",
        f"data type = {code}",
        "interleave = bsq",
        "byte order = 0",
        *more,
        "",
    ]
    (folder / "lib.hdr").write_text("\n".join(lines), encoding="utf-8")
    return folder / "lib.hdr"
