"""Bad input gets exit code 2 and one helpful line, never a traceback."""

from __future__ import annotations

import io
import os
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

Run = Callable[..., tuple[int, str, str]]
Csv = Callable[..., Path]
SCENE = Path(__file__).parents[2] / "blend_scenes" / "colorchecker.toml"


def refused(result: tuple[int, str, str], *words: str) -> None:
    code, out, err = result
    assert code == 2
    assert out == ""
    assert err.startswith("error: ")
    assert err.count("\n") == 1
    for word in words:
        assert word in err


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ["no data"]),
        ("# nothing\n\n", ["no data"]),
        ("nm,power\n", ["header and no data"]),
        ("nm,power\n400,1\n410,bright\n", ["line 3", "'bright' is not a number"]),
        ("400,1\n410,nan\n", ["line 2", "'nan'", "finite"]),
        ("400,1\n410,inf\n", ["line 2", "finite"]),
        ("400,1\n410,\n", ["line 2", "empty cell"]),
        ("400,1\n410,-0.1\n420,1\n", ["410 nm", "negative"]),
        ("400,1\n410,1\n410,1\n420,1\n", ["line 3", "410 nm", "twice"]),
        ("400,1\n420,1\n410,1\n430,1\n", ["line 3", "410 nm", "out of order"]),
        ("4.0e-7,1\n5.0e-7,1\n6.0e-7,1\n", ["metres", "1e+09"]),
        ("0.4,1\n0.5,1\n0.6,1\n", ["micrometres"]),
        ("400,1\n410,1,2\n", ["line 2", "3 columns"]),
        ("400\n410\n", ["one column"]),
        ("400,0\n500,0\n", ["no luminance"]),
        ("nm,a,b\n400,1,1\n500,1,1\n", ["2 spectra"]),
        ("nm,a\n400,1\n", ["one wavelength"]),
        ("900,1\n1000,1\n", ["visible"]),
        ("a,b,c\n400,1\n500,1\n", ["header has 3 columns"]),
        ("400 nm,1\n500,1\n600,1\n", ["line 1", "'400 nm' is not a number"]),
        ("400,0;1,5\n500,0;1,5\n", ["line 1", "not a number", "decimal points"]),
        ("400,1e308\n500,1e308\n", ["largest power", "1e+308"]),
        ("400,1e-310\n500,1e-310\n", ["largest power", "scale"]),
        ("4_00,1\n5_00,1\n", ["line 1", "'4_00' is not a number"]),
        ("٤٠٠,1\n٥٠٠,1\n", ["not a number"]),
        ("nm," + "x" * 200_000 + "\n400,1\n500,1\n", ["line 1", "field limit"]),
        ("nm,p\n" + "".join(f"{400 + i / 100:.2f},1\n" for i in range(20_001)), ["20001 wavelengths", "average"]),
    ],
)
def test_unusable_lights(run: Run, csv: Csv, text: str, words: list[str]) -> None:
    path = csv(text)
    refused(run("light", path), path.name, *words)


def test_missing_and_binary_files(run: Run, tmp_path: Path) -> None:
    refused(run("light", tmp_path / "none.csv"), "none.csv", "no such file")
    refused(run("light", f"{tmp_path}/"), "is a folder")
    binary = tmp_path / "spd.csv"
    binary.write_bytes(b"\xff\xfe\x00\x81" * 40)
    refused(run("light", binary), "not a text file")
    refused(run("reflectance", tmp_path / "none.csv"), "no such file")
    refused(run("texture", "info", tmp_path / "none.npz"), "no such file")
    refused(run("build", tmp_path / "none.toml", "-o", tmp_path / "x.blend"), "no such file")


def test_names_that_no_file_can_have(run: Run, tmp_path: Path) -> None:
    name = "x" * 5000
    refused(run("light", name), "no built-in light")
    for command in (["light", f"{name}.csv"], ["reflectance", name], ["texture", "info", name],
                    ["light", "D65", "--profile", name], ["build", name, "-o", "x.blend"]):  # fmt: skip
        refused(run(*command), "no such file")


def test_texts_are_read_to_a_limit(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By what is read, not by what the file system says: a device has size 0 and no end."""
    monkeypatch.setattr("spectral_core.files._LARGEST_TEXT_MB", 1)
    large = tmp_path / "large.csv"
    large.write_bytes(b"1" * (1024 * 1024 + 1))
    for command in (["light", large], ["light", "D65", "--profile", large], ["build", large, "-o", tmp_path / "x"]):
        refused(run(*command), "larger than 1 MB")


def test_descending_tables_are_turned_round(run: Run, csv: Csv) -> None:
    """Spectrophotometers write them; there is nothing ambiguous in them."""
    up = run("light", csv("400,1\n500,2\n600,1\n", "up.csv"), "--json")
    down = run("light", csv("600,1\n500,2\n400,1\n", "up.csv"), "--json")
    assert up[0] == 0
    assert up[1] == down[1]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("400,40\n700,60\n", ["up to 60", "100"]),
        ("400,-3\n700,0.5\n", ["down to -3"]),
        ("400,x\n", ["line 1", "not a number"]),
    ],
)
def test_unusable_reflectances(run: Run, csv: Csv, text: str, words: list[str]) -> None:
    text = "nm,r\n" + text if text.startswith("400,x") else text
    refused(run("reflectance", csv(text)), *[word.replace("line 1", "line 2") for word in words])


def test_reflectances_beyond_one_are_kept_and_told(run: Run, csv: Csv) -> None:
    code, out, err = run("reflectance", csv("nm,r\n380,1.01\n780,-0.01\n"), "--json")
    assert code == 0
    assert "outside 0..1" in err
    assert out.startswith("{")


def test_unknown_names(run: Run) -> None:
    refused(run("light", "D66"), "D65")
    refused(run("light", "D65", "--profile", "vive"), "vive", "htc-vive-2021")
    refused(run("light", "D65", "--observer", "2deg"), "cie1931-2")
    refused(run("light"), "LIGHT")
    refused(run("paint"), "paint")
    for luminance in ("-1", "0", "nan", "inf", "1e308"):
        refused(run("light", "D65", "--luminance", luminance), "luminance")
    refused(run("verify", "none.blend", "--limit", "nan"), "limit", "not a number")


def test_impossible_designs(run: Run) -> None:
    refused(run("light-design", "--match", "D65", "--peak", "520"), "no second line")
    refused(run("light-design", "--leds", "6"), "--rf")
    refused(run("light-design"), "--peak or --leds")
    refused(run("light-design", "--leds", "6", "--rf", "99.9"), "out of reach")
    refused(run("light-design", "--peak", "456", "--xy", "0.3"), "chromaticity")
    refused(run("light-design", "--peak", "456", "--xy", "0.31,0.33", "--cct", "3000"), "CCT")
    refused(run("light-design", "--peak", "456", "--xy", "0.31,0.33", "--cct", "0"), "CCT")
    refused(run("light-design", "--peak", "456", "--match", "D65", "--cct", "3000"), "give one")


def test_textures_that_promise_too_much(run: Run, tmp_path: Path) -> None:
    cube = np.full((8, 8, 5), 0.5, dtype=np.float32)
    path = tmp_path / "cube.npy"
    np.save(path, cube)
    (tmp_path / "cube.wavelengths.csv").write_text("400\n450\n500\n550\n600\n")
    assert run("texture", "info", path)[0] == 0
    data = path.read_bytes()
    path.write_bytes(data[:-100])
    refused(run("texture", "info", path), "promises", "1,280")
    path.write_bytes(data.replace(b"(8, 8, 5)", b"(8, 9, 5)"))
    refused(run("texture", "info", path), "promises")
    path.write_bytes(data[:40])
    refused(run("texture", "info", path), "damaged")
    (tmp_path / "cube.wavelengths.csv").write_text("400\n450\n500\n")
    path.write_bytes(data)
    refused(run("texture", "info", path), "3 wavelengths for 5 bands")
    (tmp_path / "cube.wavelengths.csv").unlink()
    refused(run("texture", "info", path), "does not say its wavelengths")


def test_archives_that_are_no_textures(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "cube.npz"
    nm = np.linspace(400, 700, 5)
    cases = {
        "lacks the array 'wavelengths_nm'": {"reflectance": np.zeros((4, 4, 5), np.float32)},
        "shape (4, 4)": {"reflectance": np.zeros((4, 4), np.float32), "wavelengths_nm": nm},
        "uint16": {"reflectance": np.zeros((4, 4, 5), np.uint16), "wavelengths_nm": nm},
        "holds cube": {"cube": np.zeros((4, 4, 5), np.float32), "wavelengths_nm": nm},
        "twice": {"reflectance": np.zeros((4, 4, 5), np.float32), "wavelengths_nm": nm * 0 + 500},
    }
    for word, arrays in cases.items():
        np.savez(path, **arrays)  # type: ignore[arg-type]
        refused(run("texture", "info", path), word.split(" (")[0])
    np.savez(path, reflectance=np.full((4, 4, 5), np.nan, np.float32), wavelengths_nm=nm)
    refused(run("bake", path, "--light", "D65", "-o", tmp_path), "no pixel holds a number")
    refused(run("bake", path, "--light", "D65", "-o", tmp_path, "--bad-pixels", "refuse"), "no finite number in row 0")
    assert not list(tmp_path.glob("*.exr"))
    path.write_bytes(path.read_bytes()[:200])
    refused(run("texture", "info", path), "damaged archive")
    path.write_bytes(b"")
    refused(run("texture", "info", path), "is empty")
    path.write_bytes(b"\x76\x2f\x31\x01" + b"\0" * 100)
    refused(run("texture", "info", path), "OpenEXR")


def test_archives_that_promise_what_no_memory_holds(run: Run, tmp_path: Path) -> None:
    """Headers are read before anything is allocated; what the parser of headers raises is caught."""
    path = tmp_path / "cube.npz"
    good = io.BytesIO()
    np.save(good, np.zeros((4, 4, 3), np.float32))
    for member, word in (
        (b"{'descr': '<f8', 'fortran_order': False, 'shape': (100000000000,), }", "promises"),
        (b"{'descr': '|O', 'fortran_order': False, 'shape': (3,), }", "type object"),
        (b"{'descr': '<f8', 'fortran_order': False, 'shape': (3,", "damaged NumPy header"),
    ):
        header = b"\x93NUMPY\x01\x00" + len(member).to_bytes(2, "little") + member + bytes(24)
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("reflectance.npy", good.getvalue())
            archive.writestr("wavelengths_nm.npy", header)
        refused(run("texture", "info", path), word)


def test_damage_inside_a_compressed_archive(run: Run, tmp_path: Path) -> None:
    """zlib's own errors, in the header and in the pixels."""
    path = tmp_path / "cube.npz"
    cube = np.random.default_rng(1).random((40, 40, 5)).astype(np.float32)
    np.savez_compressed(path, reflectance=cube, wavelengths_nm=np.linspace(400, 700, 5))
    whole = path.read_bytes()
    for at in (48, 60, len(whole) // 2):
        path.write_bytes(whole[:at] + bytes(each ^ 0xFF for each in whole[at : at + 40]) + whole[at + 40 :])
        refused(run("texture", "pixel", path, "39", "39"), "damaged")


def test_values_beyond_float32_are_told_without_python_warnings(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "cube.npz"
    np.savez(path, reflectance=np.full((4, 4, 2), 1e300), wavelengths_nm=np.array([400.0, 500.0]))
    refused(run("texture", "pixel", path, "0", "0"), "no finite number")
    refused(run("bake", path, "--light", "D65", "-o", tmp_path), "no pixel holds a number")
    refused(run("bake", path, "--light", "D65", "-o", tmp_path, "--bad-pixels", "refuse"), "no finite number in row 0")


def test_counts_taken_for_reflectance(run: Run, tmp_path: Path) -> None:
    """Half floats end at 65504: infinities in an image help nobody."""
    path = tmp_path / "counts.npz"
    cube = np.full((4, 4, 2), 0.5, np.float32)
    cube[2, 1] = 3e38
    np.savez(path, reflectance=cube, wavelengths_nm=np.array([400.0, 500.0]))
    refused(run("bake", path, "--light", "D65", "-o", tmp_path), "times white", "white reference")
    assert not list(tmp_path.glob("*.exr"))


def test_pickles_are_never_loaded(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "cube.npz"
    np.savez(path, reflectance=np.array([[["x", None]]], dtype=object), wavelengths_nm=np.array([400.0, 500.0]))
    refused(run("texture", "info", path), "not real numbers")


def test_pixels_outside(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "cube.npz"
    np.savez(path, reflectance=np.zeros((4, 6, 2), np.float32), wavelengths_nm=np.array([400.0, 500.0]))
    refused(run("texture", "pixel", path, "6", "0"), "no pixel 6, 0", "6 x 4")


def scene_with(tmp_path: Path, old: str, new: str) -> Path:
    text = SCENE.read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / "scene.toml"
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("luminance = 0.85", "luminence = 0.85", ["white.luminence", "did you mean 'luminance'"]),
        ("luminance = 0.85", "luminance = -1", ["white.luminance", "-1"]),
        ("luminance = 0.85", 'luminance = "bright"', ["white.luminance", "number"]),
        ("width = 0.36", "width = nan", ["camera.width"]),
        ('type = "sun"', 'type = "moon"', ["lamps[0].type", "spot, sun"]),
        ('surface = "frame"', 'surface = "gold"', ["objects[0].surface", "gold"]),
        ('object = "white"', 'object = "spectralon"', ["white.object"]),
        ('"FL11"', '"FL99"', ["lights", "FL99"]),
        ("format = 1", "format = 2", ["format"]),
        ("format = 1", "", ["format", "missing"]),
        ("size = [0.30, 0.20, 0.004]", "size = [0.30, 0.20]", ["objects[0].size", "three numbers"]),
        ("reflectance = 0.03", "reflectance = 3", ["surfaces.frame.reflectance"]),
        ("reflectance = 0.03", "gloss = 0.1", ["surfaces.frame", "no source"]),
        ("[white]", "[white", ["TOML", "line"]),
        ('name = "sun"', 'name = "white"', ["'white' is used twice"]),
        ("[[lamps]]", "[lamps]", ["lamps", "[[lamps]]"]),
        ('shape = "plane"', 'shape = "teapot"', ["shape", "teapot"]),
        ("luminance = 0.85", "luminance = 0x" + "f" * 4000, ["white.luminance", "enormous"]),
        ("luminance = 0.85", "luminance = " + "9" * 5000, ["TOML", "digits"]),
        ("luminance = 0.85", "luminance = [" + "1, " * 9000 + "]", ["white.luminance", "[1, 1, 1"]),
    ],
)
def test_scenes_with_a_wrong_key(run: Run, tmp_path: Path, old: str, new: str, words: list[str]) -> None:
    path = scene_with(tmp_path, old, new)
    refused(run("build", path, "-o", tmp_path / "x.blend"), path.name, *words)
    assert not (tmp_path / "x.blend").exists()


def test_without_blender_one_line_says_how_to_get_it(run: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    monkeypatch.delenv("BLENDER", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    refused(run("build", SCENE, "-o", tmp_path / "x.blend"), "needs Blender", "pip install")
    monkeypatch.setenv("BLENDER", str(tmp_path / "no-blender"))
    refused(run("build", SCENE, "-o", tmp_path / "x.blend"), "no-blender", "names no program")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no such files")
def test_devices_and_links_are_not_replaced(run: Run, tmp_path: Path) -> None:
    """A file comes into place by renaming, which would make an ordinary file of a device."""
    pipe, real, link = tmp_path / "pipe", tmp_path / "real.csv", tmp_path / "link.csv"
    os.mkfifo(pipe)
    refused(run("patches", "new", "-o", pipe), "no ordinary file")
    refused(run("patches", "new", "-o", tmp_path / ("n" * 300)), "cannot be written")
    assert pipe.is_fifo()
    real.write_text("before")
    link.symlink_to(real)
    assert run("patches", "new", "-o", link)[0] == 0
    assert link.is_symlink()
    assert real.read_text().startswith("R,G,B")


def test_options_that_have_no_effect_are_refused(run: Run, csv: Csv, tmp_path: Path) -> None:
    path = csv("R,G,B,X,Y,Z\n1,1,1,95,100,109\n1,0,0,41,21,2\n0,1,0,36,72,12\n0,0,1,18,7,95\n")
    refused(run("characterise", path, "--eye", "left"), "-o")
    refused(run("characterise", path, "--advise", "--eye", "left"), "--advise")
    refused(run("probe", path, "--patches"), "--patches")
    refused(run("convert", "--to", "codes", "--keep", "--gamut", "chromaticity", path), "exclude")
    refused(run("profile", "export", "sRGB", "--icc", tmp_path / "x.icc", "--base", path), "--base")


def test_a_report_is_not_written_if_the_profile_cannot_be(run: Run, csv: Csv, tmp_path: Path) -> None:
    path = csv("R,G,B,X,Y,Z\n1,1,1,95,100,109\n1,0,0,41,21,2\n0,1,0,36,72,12\n0,0,1,18,7,95\n")
    report = tmp_path / "r.html"
    report.write_text("before")
    refused(run("characterise", path, "--report", report, "-o", tmp_path / "p.json", "--date", "today"), "ISO date")
    assert report.read_text() == "before"


def test_codes_beyond_the_range_are_counted(run: Run, csv: Csv) -> None:
    code, out, err = run("convert", "--to", "xyz", csv("R,G,B\n255,0,0\n1,1,1\n"))
    assert code == 0
    assert "1 of 2 codes are outside 0..1" in err
    assert len(out.splitlines()) == 3
