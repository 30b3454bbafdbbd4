"""Random damage to valid files: every command ends with 0 and strict JSON, or with 2 and one line.

Seeded, so that a failure repeats; the number of mutations is chosen to take a few seconds.
"""

from __future__ import annotations

import io
import json
import random
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from displays import additive, measure, published_protocol

from spectral_core.display import DisplayProfile, load_profile, write_profile
from spectral_core.display.models.fitting import MODEL_KINDS
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


def display_csv() -> str:
    """Twelve readings of a display, white and the primaries among them, in cd/m2."""
    codes = np.array([*np.eye(3), *np.eye(3) * 0.5, [1, 1, 1], [0, 0, 0], [0.5] * 3, [1, 1, 0], [0, 1, 1], [1, 0, 1]])
    readings = additive(codes)
    return "R,G,B,X,Y,Z\n" + "".join(
        ",".join(f"{value:.6g}" for value in (*code, *XYZ)) + "\n"
        for code, XYZ in zip(codes, readings, strict=True)
    )  # fmt: skip


def display_ti3() -> str:
    rows = [line.split(",") for line in display_csv().splitlines()[1:]]
    data = "".join(f"A{i} {' '.join([str(100 * float(c)) for c in row[:3]] + row[3:])}\n" for i, row in enumerate(rows))
    return (
        'CTI3\n\nCREATED "Sun Mar 20 02:15:01 2022"\nTARGET_INSTRUMENT "X"\nNORMALIZED_TO_Y_100 "NO"\n'
        "BEGIN_DATA_FORMAT\nSAMPLE_ID RGB_R RGB_G RGB_B XYZ_X XYZ_Y XYZ_Z\nEND_DATA_FORMAT\n"
        f"NUMBER_OF_SETS {len(rows)}\nBEGIN_DATA\n{data}END_DATA\n"
    )


def named_csv() -> str:
    return "Color,L,x,y\nRed,20,.64,.33\nGreen,70,.3,.6\nBlue,8,.15,.06\nWhite,98,.31,.33\nBlack,0.1,.3,.3\n"


def field_csv() -> str:
    points = [(x, y) for x in (-10, 0, 10) for y in (-10, 0, 10)]
    return "x_deg,y_deg,x,y,Y\n" + "".join(f"{x},{y},0.31,0.33,{100 - abs(x) - abs(y)}\n" for x, y in points)


def shown_csv() -> str:
    rows = "".join(f"{i / 3:.9g},0,0,{i},p{i},{10 * i},{10 * i + 1},{10 * i + 9}\n" for i in range(4))
    return f"R,G,B,index,name,shown,ready,gone\n{rows}"


@pytest.mark.parametrize(
    ("text", "command", "runs"),
    [
        (display_csv, ["characterise", "{}"], 120),
        (display_ti3, ["characterise", "{}"], 120),
        (named_csv, ["characterise", "{}"], 120),
        (display_csv, ["compare", "{}", "--profile", "htc-vive-2020"], 200),
        (display_csv, ["probe", "{}", "--profile", "sRGB"], 40),
        (field_csv, ["field", "{}"], 200),
        (shown_csv, ["patches", "pair", "{}", "{readings}", "-o", "{out}"], 200),
    ],
)  # fmt: skip
def test_readings_of_displays(run: Run, tmp_path: Path, text: Callable[[], str], command: list[str], runs: int) -> None:
    """An output that was there stays as it was when its command fails."""
    random_ = random.Random(5)
    path, out, readings = tmp_path / "m.csv", tmp_path / "out.csv", tmp_path / "readings.csv"
    readings.write_text("index,X,Y,Z\n1,1,1,1\n3,2,2,2\n")
    given = [each.format(path, out=out, readings=readings) for each in command]
    accepted = 0
    for _ in range(runs):
        path.write_text(mutate_text(text(), random_), encoding="utf-8", newline="")
        out.write_text("before")
        result = run(*given, "--json")
        check(result, path)
        assert result[0] == 0 or out.read_text() == "before"
        accepted += result[0] == 0
    assert accepted < runs  # what is wrong is seen
    assert accepted or command[0] == "probe"  # too few patches for it, whatever they read


@pytest.mark.parametrize("target", ["codes", "xyz"])
def test_colours_to_convert(run: Run, tmp_path: Path, target: str) -> None:
    random_ = random.Random(6)
    path = tmp_path / "m.csv"
    text = ("X,Y,Z\n" if target == "codes" else "R,G,B\n") + "0.2,0.3,0.4\n0,0,0\n1,0.9,0.8\n"
    for rule in ("clip", "chromaticity", "keep"):
        for _ in range(80):
            path.write_text(mutate_text(text, random_), encoding="utf-8", newline="")
            code, out, err = run("convert", "--profile", "htc-vive-2020", "--to", target, "--gamut", rule, path)
            what = f"{path.read_bytes()!r}: {err}"
            assert code in (0, 2), what
            assert err.count("\n") == 1 if code else "Warning" not in err, what
            cells = [float(cell) for line in out.splitlines()[1:] for cell in line.split(",")]
            assert np.isfinite(cells).all(), what


# What people and scripts put into a profile where a number, a list or a text should be.
WRONG = (
    None,
    True,
    "x",
    "1",
    [],
    {},
    -1,
    0,
    1e308,
    -1e308,
    1e-308,
    10**400,
    float("nan"),
    [1, 2],
    [[1]],
    [[0, 0, 0]] * 3,
)


def places(value: object, before: tuple[str | int, ...] = ()) -> list[tuple[str | int, ...]]:
    """Keys and the two ends of lists, all the way down."""
    if isinstance(value, dict):
        keys: list[str | int] = list(value)
    else:
        keys = sorted({0, len(value) - 1}) if isinstance(value, list) and value else []
    return [each for key in keys for each in ((*before, key), *places(value[key], (*before, key)))]  # type: ignore[index]


@pytest.mark.parametrize("model", ["gain-offset-gamma", "channel-lut", "grey-lut-corrected"])
def test_profiles_edited_by_hand(run: Run, tmp_path: Path, model: str) -> None:
    """Entries of a profile replaced by what they are not, and the profile then used."""
    path = tmp_path / "m.json"
    kind = next(each for each in MODEL_KINDS if each.name == model)
    whole = measure(additive, published_protocol())
    relative = replace(whole, XYZ=whole.XYZ / whole.white_XYZ[1])
    write_profile(DisplayProfile("m", kind.fit(relative), white_Y=100.0), path)
    good = path.read_text(encoding="utf-8")
    colours = tmp_path / "XYZ.csv"
    colours.write_text("X,Y,Z\n20,30,40\n0,0,0\n-5,1,1e12\n")
    cases = [(place, wrong) for place in places(json.loads(good)) for wrong in WRONG]
    used = 0
    for place, wrong in random.Random(7).sample(cases, 150):
        document = json.loads(good)
        holder = document
        for key in place[:-1]:
            holder = holder[key]
        holder[place[-1]] = wrong
        path.write_text(json.dumps(document), encoding="utf-8")
        shown = run("profile", "show", path, "--json")
        check(shown, path)
        if shown[0] == 0 and place[0] != "state":
            used += 1
            check(run("luminance", "--profile", path, "--json"), path)
            code, out, err = run("convert", "--profile", path, "--to", "codes", colours)
            assert (code, "nan" in out, "inf" in out, "Warning" in err) == (0, False, False, False), (place, wrong)
    assert used > 5
