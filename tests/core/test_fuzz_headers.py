"""Damaged headers by the thousand: one clear line, at once, and no memory that a file merely promises.

Seeded, so that a failure repeats. A format takes part with a `Target`: valid files, a way to damage
one, a way to read one, and how many of them take a few seconds.
"""

from __future__ import annotations

import contextlib
import random
import re
import time
import tracemalloc
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from envi_samples import NM, cube_of, header_lines, listed, write_data, write_library
from test_fuzz import exr_file, mutate_bytes, mutate_text

from spectral_core.errors import SpectralBoothError, TextureError
from spectral_core.spectra import read_spectra
from spectral_core.textures import open_texture
from spectral_core.textures.envi.header import parse_header

# More than any reader needs beside what the process holds already; a hostile header promises terabytes.
_MEMORY_BYTES = 512 * 1024 * 1024
# Ordinary ones take a millisecond or less.
_SLOWEST_S = 1.0
_LONGEST_MESSAGE = 600

# Address space in pages, on Linux.
COUNTED = Path("/proc/self/statm")

Damage = Callable[[bytes, random.Random], bytes]


@dataclass(frozen=True)
class Target:
    """A reader of headers.

    Attributes
    ----------
    make
        Valid files, after it has written to the folder what must lie beside them.
    damage
        Changes one of them.
    read
        Reads a file of these bytes in that folder, as far as a hostile one could do harm.
    accepted
        Share of damaged files that are still valid: neither none nor all, or damage misses its aim.
    """

    name: str
    count: int
    make: Callable[[Path], list[bytes]]
    damage: Damage
    read: Callable[[Path, bytes], object]
    accepted: tuple[float, float] = (0.02, 0.8)


# What stands where a number should: none, too many digits, ends of types, other scripts, what Python alone reads.
NUMBERS = (
    "", "0", "-0", "1", "-1", "2", "3.5", "nan", "-nan", "inf", "-inf", "Infinity", "1e308", "-1e308", "1e400",
    "1e-400", "5e-324", "1e-13", "1e13", "1e", "1,5", "+5", "1_0", "0x10", "one", "٣", "½", str(2**31 - 1), str(2**31),
    str(2**32), str(2**53 + 1), str(2**63), str(2**64), str(10**30), "9" * 400, "9" * 100_000, "0." + "0" * 5000 + "1",
    "{1}", "{", "}", "{}", "}{", "1 2", "1;2", "\x00", "\x1b[2J", "é", "\u2028", "1\x0b2", " " * 5000, "16777216",
    "16777217", "4000", "4001", "20000", "bsq", "bil", "BIP", "6", "9", "15", "255", "Index", "Unknown", "Micrometers",
    "GHz", "cm-1", "ENVI", "ENVI Standard", "ENVI Spectral Library",
)  # fmt: skip
KEYS = (
    "samples", "lines", "bands", "header offset", "file type", "data type", "interleave", "byte order", "wavelength",
    "wavelength units", "fwhm", "bbl", "reflectance scale factor", "data ignore value", "data gain values",
    "data offset values", "data reflectance gain values", "z plot titles", "data units", "spectra names",
    "file compression", "major frame offsets", "description", "", "{", "x" * 300,
)  # fmt: skip


def damage_envi(data: bytes, random_: random.Random) -> bytes:
    """One to three changes of what a header says, or of its bytes, or both."""
    lines = data.decode("utf-8", "replace").split("\n")
    kind = random_.random()
    if kind < 0.85:
        for _ in range(random_.choice((1, 1, 1, 2, 3))):
            _change(lines, random_)
    ends = random_.choice(("\n", "\n", "\n", "\r\n", "\r"))
    damaged = ends.join(lines).encode("utf-8", "surrogatepass")
    if kind > 0.7:
        damaged = mutate_bytes(damaged, random_)
    if 0.6 < kind < 0.7:
        damaged = mutate_text(ends.join(lines), random_).encode("utf-8", "surrogatepass")
    return damaged


def _change(lines: list[str], random_: random.Random) -> None:
    at = random_.randrange(1, len(lines)) if len(lines) > 1 else 0
    kind = random_.random()
    key, equals, value = lines[at].partition("=")
    if kind < 0.35:
        lines[at] = f"{key}= {random_.choice(NUMBERS)}"
    elif kind < 0.55:
        cells = value.strip(" {}").split(",")
        cells[random_.randrange(len(cells))] = random_.choice(NUMBERS)
        lines[at] = f"{key}{equals} {{{','.join(cells)}}}"
    elif kind < 0.65:
        lines[at] = lines[at].replace(random_.choice("{}=,"), random_.choice(("", "{", "}", "\n")))
    elif kind < 0.75:
        lines.insert(at, f"{random_.choice(KEYS)} = {random_.choice(NUMBERS)}")
    elif kind < 0.85:
        values = [random_.choice(NUMBERS[:20]) for _ in range(len(NM))]
        lines.append(f"{random_.choice(KEYS)} = {{{random_.choice((', ', ' ', ',')).join(values)}}}")
    elif kind < 0.9:
        lines.append(f"{random_.choice(KEYS)} = {{{random_.choice(('1,', '1 ', ',', '{', ' ', 'x')) * 20_000}}}")
    elif kind < 0.93:
        lines[at:at] = [random_.choice(("", "x", "x = 1", "= 1", ";", "}", "a = {}"))] * random_.choice(
            (10, 1900, 5000)
        )
    else:
        del lines[at]


def envi_headers(folder: Path) -> list[bytes]:
    """Headers of one data file, small enough that each promise too many is seen."""
    cube = cube_of(12)
    write_data(folder / "m.raw", cube, "bil")
    extra = [
        f"bbl = {listed([1, 1, 0, 1, 1, 1, 1])}",
        f"data gain values = {listed(np.arange(1, 8) / 4)}",
        f"data offset values = {listed(range(7))}",
        "data ignore value = -9999",
        "z plot titles = {Wavelength, Radiance}",
    ]
    plain = header_lines(cube, 12, "bil")
    return ["\n".join([*plain, *more]).encode() for more in ([], extra, ["reflectance scale factor = 10000"])]


def library_headers(folder: Path) -> list[bytes]:
    values = np.random.default_rng(0).uniform(0, 1, (3, len(NM)))
    lines = ("wavelength units = nm", f"wavelength = {listed(NM)}", "spectra names = {a,b,c}", "bbl = {1,1,1,1,1,1,1}")
    header = write_library(folder, values, 5, *lines, data="lib.sli").read_bytes()
    (folder / "m.sli").write_bytes((folder / "lib.sli").read_bytes())
    return [header]


def npy_files(folder: Path) -> list[bytes]:
    np.save(folder / "m.npy", np.random.default_rng(0).random((6, 5, len(NM))).astype(np.float32))
    (folder / "m.wavelengths.csv").write_text("\n".join(map(str, NM)))
    return [(folder / "m.npy").read_bytes()]


def exr_files(folder: Path) -> list[bytes]:
    """With another date than the writer's, which would make every run differ."""
    data = exr_file(folder / "whole.exr", np.random.default_rng(0).random((6, 5, 5)).astype(np.float32))
    return [re.sub(rb"\d{4}:\d\d:\d\d \d\d:\d\d:\d\d", b"2000:01:01 00:00:00", data)]


def read_texture(name: str) -> Callable[[Path, bytes], object]:
    """Write the bytes under a name, open them as a texture and read its first and its last row."""

    def read(folder: Path, data: bytes) -> object:
        (folder / name).write_bytes(data)
        texture = open_texture(folder / name)
        for row in {0, texture.height - 1}:
            assert texture.rows(row, 1).shape == (1, texture.width, texture.bands)
        return texture.gain, texture.dark, texture.good, texture.rows_per_tile()

    return read


def read_library(folder: Path, data: bytes) -> object:
    (folder / "m.hdr").write_bytes(data)
    spectra = read_spectra(folder / "m.hdr", "reflectance")
    assert spectra.values.shape == (len(spectra.names), len(spectra.wavelengths_nm))
    return spectra


TARGETS = [
    Target("envi parser", 15_000, envi_headers, damage_envi, lambda _, data: parse_header(data, Path("m.hdr"))),
    Target("envi image", 5000, envi_headers, damage_envi, read_texture("m.hdr")),
    Target("envi library", 2000, library_headers, damage_envi, read_library),
    Target("npy", 2000, npy_files, mutate_bytes, read_texture("m.npy")),
    Target("exr", 1000, exr_files, mutate_bytes, read_texture("m.exr")),
]


@contextlib.contextmanager
def memory_limited(beside: int) -> Iterator[None]:
    """Let this process take no more address space than it has and `beside`, where the system can do so."""
    if not COUNTED.is_file():
        yield
        return
    import resource

    pages = int(COUNTED.read_text().split()[0])
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + beside, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


@pytest.mark.skipif(not COUNTED.is_file(), reason="the system does not count the address space")
def test_the_limit_of_memory_holds() -> None:
    with memory_limited(_MEMORY_BYTES), pytest.raises(MemoryError):
        np.empty(2 * _MEMORY_BYTES, dtype=np.uint8)
    assert np.empty(2 * _MEMORY_BYTES, dtype=np.uint8).nbytes == 2 * _MEMORY_BYTES


def check_message(error: SpectralBoothError, folder: Path, data: bytes) -> None:
    message = str(error).replace(str(folder), "")
    what = f"{message!r} of {data[:1500]!r}"
    assert message.isprintable(), what
    assert 10 < len(message) < _LONGEST_MESSAGE, what
    assert error.remedy, what


def test_what_files_hold_moves_no_cursor() -> None:
    assert str(TextureError("has \x1b[2J\n\x00é\udcff", where="a\tb")) == "a b: has ?[2J ?é?"


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.name)
def test_damaged_headers(target: Target, tmp_path: Path) -> None:
    random_ = random.Random(target.name)
    whole = target.make(tmp_path)
    for data in whole:
        target.read(tmp_path, data)  # libraries are loaded before memory is counted
    accepted, slowest = 0, (0.0, b"")
    with memory_limited(_MEMORY_BYTES), warnings.catch_warnings():
        # NumPy tells of headers that Python 2 might have written.
        warnings.filterwarnings("ignore", message="Reading `.npy` or `.npz` file required additional header parsing")
        for _ in range(target.count):
            data = target.damage(random_.choice(whole), random_)
            started = time.process_time()
            try:
                target.read(tmp_path, data)
                accepted += 1
            except SpectralBoothError as error:
                check_message(error, tmp_path, data)
            except Exception as error:  # whatever it is, the file that did it must be seen
                pytest.fail(f"{type(error).__name__}: {str(error)[:300]} of {data[:3000]!r}")
            slowest = max(slowest, (time.process_time() - started, data[:1500]))
    assert slowest[0] < _SLOWEST_S, slowest
    low, high = target.accepted
    assert low * target.count < accepted < high * target.count


GIANT = 4 * 1024 * 1024 - 2000


@pytest.mark.parametrize(
    "more",
    [
        " " * GIANT,
        ";\n" * (GIANT // 2),
        "a = {" + "{" * GIANT + "}",
        "wavelength = {" + "1," * (GIANT // 2) + "}",
        "wavelength = {400, " + "9" * GIANT + ", 500, 550, 600, 650, 700}",
        "spectra names = {" + "a," * (GIANT // 2) + "}",
        "k" * GIANT + " = 1",
        "\n".join("k" * 2000 + f"{index} = 1" for index in range(1900)),
    ],
    ids=["blanks", "comments", "braces", "list", "number", "names", "key", "keys"],
)
def test_headers_as_large_as_any(tmp_path: Path, more: str) -> None:
    """Ten times their size in memory, for copies of the text; a quadratic reader would take hours."""
    data = envi_headers(tmp_path)[0] + b"\n" + more.encode()
    tracemalloc.start()
    started = time.process_time()
    with contextlib.suppress(SpectralBoothError):
        read_texture("m.hdr")(tmp_path, data)
    taken, (_, peak) = time.process_time() - started, tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert taken < 2 * _SLOWEST_S  # twice, for counting memory
    assert peak < 10 * len(data) + 20_000_000
