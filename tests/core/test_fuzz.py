"""Random damage to valid files: every command ends with 0 and strict JSON, or with 2 and one line.

Seeded, so that a failure repeats; the number of mutations is chosen to take a few seconds.
"""

from __future__ import annotations

import io
import json
import random
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from spectral_core.display import load_profile, write_profile
from spectral_core.errors import SpectralBoothError
from spectral_core.imaging import oiio
from spectral_core.scene import load_scene

Run = Callable[..., tuple[int, str, str]]
SCENES = Path(__file__).parents[2] / "blend_scenes"
NM = np.linspace(400, 700, 5)
# What tends to break readers of text: separators, non-numbers, extremes, markup, line breaks of Unicode.
TOKENS = (
    "nan", "inf", "-", "1e308", "1e-308", "1e400", "-1", ";", "\t", ",", "#", "\n", "\r", '"', "'", "0", "é", "\u2028",
    "[/b]", "[x]", "{", "# kind: lines\n", "  ", "1_0", "\x00", "400", "9" * 400, "null", "true", "\ufeff",
)  # fmt: skip


def mutate_text(text: str, random_: random.Random) -> str:
    for _ in range(random_.randint(1, 3)):
        at, kind = random_.randrange(len(text) + 1), random_.random()
        if kind < 0.6:
            drop = 0 if kind < 0.4 else random_.randint(1, 8)
            text = text[:at] + random_.choice(TOKENS) + text[at + drop :]
        elif kind < 0.8:
            text = text[:at] + text[at + random_.randint(1, 40) :]
        else:
            start = random_.randrange(len(text) + 1)
            text = text[:at] + text[start : start + random_.randint(1, 60)] + text[at:]
    return text


def mutate_bytes(data: bytes, random_: random.Random) -> bytes:
    """Mostly in the header, where it hurts."""
    result = bytearray(data)
    for _ in range(random_.randint(1, 4)):
        at, kind = random_.randrange(min(len(result), random_.choice((150, 600, 1 << 20)))), random_.random()
        if kind < 0.5:
            result[at] = random_.randrange(256)
        elif kind < 0.65:
            result[at : at + 4] = random_.choice((b"\xff\xff\xff\x7f", b"\0\0\0\0", b"\xff\xff\xff\xff", b"\0\0\0\x80"))
        elif kind < 0.8:
            del result[at : at + random_.randint(1, 20)]
        elif kind < 0.95:
            result[at:at] = random_.choice((b"9" * 30, b"(", b"'", b"1e308", random_.randbytes(8)))
        else:
            del result[at:]
        result = result or bytearray(b"x")
    return bytes(result)


def check(result: tuple[int, str, str], source: Path) -> None:
    code, out, err = result
    what = f"{source.read_bytes()[:2000]!r}\nended with {code}: {err}"
    if code == 0:
        json.loads(out, parse_constant=lambda name: pytest.fail(f"{name} in JSON from {what}"))
        assert all(line.startswith("warning: ") for line in err.splitlines()), what
        return
    assert code == 2, what
    assert out == "", what
    assert err.startswith("error: "), what
    assert err.count("\n") == 1, what
    assert len(err) < 1500, what


def spectra_csv() -> str:
    return "nm,r1,r2\n" + "".join(f"{nm},{0.1 + nm % 70 / 100:.3f},0.5\n" for nm in range(380, 781, 20))


@pytest.mark.parametrize("command", ["light", "reflectance"])
def test_tables_of_spectra(run: Run, tmp_path: Path, command: str) -> None:
    random_ = random.Random(1)
    path = tmp_path / "m.csv"
    whole = spectra_csv()
    lamp = "".join(line.rsplit(",", 1)[0] + "\n" for line in whole.splitlines())
    accepted = 0
    for _ in range(400):
        path.write_text(mutate_text(lamp if command == "light" else whole, random_), encoding="utf-8", newline="")
        result = run(command, path, "--json")
        check(result, path)
        accepted += result[0] == 0
    assert 10 < accepted < 390  # both ends are reached


def test_profiles(run: Run, tmp_path: Path) -> None:
    random_ = random.Random(2)
    path = tmp_path / "m.json"
    write_profile(load_profile("htc-vive-2020"), path)
    text = path.read_text(encoding="utf-8")
    for _ in range(300):
        path.write_text(mutate_text(text, random_), encoding="utf-8", newline="")
        check(run("light", "D65", "--profile", path, "--json"), path)


def test_scenes(tmp_path: Path) -> None:
    """Reading alone: building one needs Blender."""
    random_ = random.Random(3)
    path = tmp_path / "m.toml"
    text = (SCENES / "colorchecker.toml").read_text(encoding="utf-8")
    messages = []
    for _ in range(300):
        path.write_text(mutate_text(text, random_), encoding="utf-8", newline="")
        try:
            load_scene(path)
        except SpectralBoothError as error:
            messages.append(str(error))
    assert 100 < len(messages) < 300
    for message in messages:
        assert "\n" not in message
        assert len(message) < 1500


def exr_file(path: Path, cube: np.ndarray) -> bytes:
    spec = oiio().ImageSpec(cube.shape[1], cube.shape[0], cube.shape[2], "float")
    spec.channelnames = tuple(f"T.{nm:.0f},0nm" for nm in NM)
    output = oiio().ImageOutput.create(str(path))
    assert output.open(str(path), spec)
    assert output.write_image(cube)
    output.close()
    return path.read_bytes()


@pytest.mark.parametrize("kind", ["npy", "npz", "packed.npz", "exr"])
def test_textures(run: Run, tmp_path: Path, kind: str) -> None:
    random_ = random.Random(4)
    cube = np.random.default_rng(0).random((6, 5, 5)).astype(np.float32)
    stream = io.BytesIO()
    if kind == "npy":
        np.save(stream, cube)
    elif kind == "npz":
        np.savez(stream, reflectance=cube, wavelengths_nm=NM)
    elif kind == "packed.npz":
        np.savez_compressed(stream, reflectance=cube, wavelengths_nm=NM)
    whole = stream.getvalue() if kind != "exr" else exr_file(tmp_path / "whole.exr", cube)
    path = tmp_path / f"m.{kind}"
    (tmp_path / "m.wavelengths.csv").write_text("\n".join(map(str, NM)))
    with warnings.catch_warnings():
        # NumPy tells of headers that Python 2 might have written.
        warnings.filterwarnings("ignore", message="Reading `.npy` or `.npz` file required additional header parsing")
        for _ in range(150):
            path.write_bytes(mutate_bytes(whole, random_))
            check(run("texture", "info", path, "--json"), path)
            check(run("texture", "pixel", path, 4, 5, "--light", "D65", "--json"), path)
        check(run("bake", path, "--light", "D65", "-o", tmp_path / "out", "--json"), path)
