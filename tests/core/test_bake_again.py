"""Bakes that are stopped, killed or repeated: images are whole, kept where they would come out the same."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spectral_core.baking import PixelCounts, bake
from spectral_core.errors import OutputError
from spectral_core.files import atomic_path
from spectral_core.imaging import oiio
from spectral_core.lights import Light
from spectral_core.textures import Reading, open_texture

Run = Callable[..., tuple[int, str, str]]
NM = np.arange(400.0, 701.0, 10)
SHAPE = (300, 200)


def write_textures(folder: Path, count: int) -> list[Path]:
    paths = [folder / f"t{index}.npz" for index in range(count)]
    for index, path in enumerate(paths):
        cube = np.random.default_rng(index).random((*SHAPE, len(NM)), dtype=np.float32)
        np.savez(path, reflectance=cube, wavelengths_nm=NM)
    return paths


def pixels(folder: Path) -> dict[str, bytes]:
    """The pixels of all images, which must be whole: their headers hold the time."""
    found = {}
    for path in folder.glob("*.exr"):
        values = oiio().ImageBuf(str(path)).get_pixels(oiio().FLOAT)
        assert values.shape == (*SHAPE, 3), path
        found[path.name] = values.tobytes()
    return found


def times(folder: Path) -> dict[str, int]:
    return {path.name: path.stat().st_mtime_ns for path in folder.iterdir() if path.suffix == ".exr"}


@pytest.fixture
def baked(tmp_path: Path) -> Callable[..., list[bool]]:
    """Bake a texture again with some things changed; which of its images were kept."""
    (path,) = write_textures(tmp_path, 1)

    def again(lights: tuple[str, ...] = ("D65", "A"), **changed: Any) -> list[bool]:
        result = bake(open_texture(path), [Light.builtin(each) for each in lights], tmp_path / "out", **changed)
        return [image.kept for image in result.images]

    assert again() == [False, False]
    return again


def test_images_that_would_come_out_the_same_are_kept(baked: Callable[..., list[bool]], tmp_path: Path) -> None:
    before = times(tmp_path / "out")
    assert baked() == [True, True]
    assert baked(("A", "FL11", "D65")) == [True, False, True]
    after = times(tmp_path / "out")
    assert {name: after[name] for name in before} == before
    assert baked(again=True) == [False, False]


@pytest.mark.parametrize(
    "changed", [{"observer": "cie1964-10"}, {"bad_pixels": "refuse"}, {"profile": "htc-vive-2021"}]
)  # fmt: skip
def test_what_would_come_out_otherwise_is_made(baked: Callable[..., list[bool]], changed: dict[str, Any]) -> None:
    from spectral_core.display import load_profile

    if "profile" in changed:
        changed["profile"] = load_profile(changed["profile"])
    assert baked(**changed) == [False, False]
    assert baked(**changed) == [True, True]
    assert baked() == [False, False]


def test_changed_files_are_made_again(baked: Callable[..., list[bool]], tmp_path: Path) -> None:
    out = tmp_path / "out"
    (out / "t0_A.exr").write_bytes(b"somebody else's")
    assert baked() == [True, False]
    (out / "t0_D65.exr").unlink()
    assert baked() == [False, True]
    os.utime(tmp_path / "t0.npz", ns=(1, 1))
    assert baked() == [False, False]
    for damage in ("", "[]", "{", '{"format": "spectral-booth bake", "version": 1, "images": {"t0_A.exr": 3}}'):
        (out / "t0.bake.json").write_text(damage)
        assert baked() == [False, False]


def test_an_image_of_a_sequence_that_changed_in_its_place(tmp_path: Path) -> None:
    """A folder's time stays when one of its files is written to; a pattern has no time at all."""
    folder = tmp_path / "capture"
    folder.mkdir()
    for nm in (450, 550, 650):
        image = oiio().ImageOutput.create("x.png")
        assert image.open(str(folder / f"{nm}.png"), oiio().ImageSpec(4, 3, 1, "uint8"))
        image.write_image(np.full((3, 4, 1), nm // 4, np.uint8))
        image.close()
    for given in (folder, folder / "*.png"):

        def kept(given: Path = given) -> list[bool]:
            texture = open_texture(given, Reading(scale=255))
            return [image.kept for image in bake(texture, [Light.builtin("D65")], tmp_path / "out").images]

        assert kept() == [given != folder]  # the same images, whichever way they are named
        assert kept() == [True]
        (folder / "550.png").write_bytes((folder / "650.png").read_bytes())
        os.utime(folder / "550.png", ns=(1, len(given.name)))
        assert (kept(), kept()) == ([False], [True])


def test_another_array_of_the_same_file_is_another_texture(tmp_path: Path) -> None:
    cubes = np.random.default_rng(3).random((2, 3, 4, len(NM)))
    np.savez(tmp_path / "two.npz", radiance=cubes[0], counts=cubes[1], wavelengths_nm=NM)
    (tmp_path / "white.csv").write_text("nm,white\n" + "".join(f"{nm:g},1\n" for nm in NM))
    scipy_io = pytest.importorskip("scipy.io")
    scipy_io.savemat(tmp_path / "both.mat", {"a": cubes[0], "b": cubes[1], "wavelengths": NM})
    white = tmp_path / "white.csv"
    for name, readings in (
        ("two.npz", [Reading("radiance", white=white), Reading("counts", white=white)]),
        ("both.mat", [Reading("reflectance", variable="a"), Reading("reflectance", variable="b")]),
    ):
        for reading in readings:
            result = bake(open_texture(tmp_path / name, reading), [Light.builtin("A")], tmp_path / "out")
            assert [image.kept for image in result.images] == [False], reading


def test_what_was_wrong_is_said_of_kept_images_too(tmp_path: Path) -> None:
    """Infrared bands have no weight and are not looked at: negative values are a share of those used."""
    nm = np.arange(400.0, 1401.0, 10)
    values = np.full((2, 3, len(nm)), 0.5, np.float32)
    values[0, 0, 5], values[1, 1, :2] = np.nan, -0.1
    np.savez(tmp_path / "t.npz", reflectance=values, wavelengths_nm=nm)
    texture = open_texture(tmp_path / "t.npz")
    told = []
    for lights in (("D65",), ("D65",), ("D65", "A")):
        result = bake(texture, [Light.builtin(each) for each in lights], tmp_path / "out")
        assert result.counts == PixelCounts(repaired=1, negative=2)
        told.append(result.warnings)
    assert told[0] == told[1] == told[2]
    used = result.images[0].bands_used
    assert 44 <= used < 75  # the observer ends at 830 nm, and the spline's weights fade out beyond
    assert f"{2 / (6 * used):.2%} of the values are negative" in told[0][-1]


def test_a_stopped_bake_leaves_nothing_half_written(tmp_path: Path) -> None:
    (path,) = write_textures(tmp_path, 1)

    def stop(fraction: float, text: str) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        bake(open_texture(path), [Light.builtin("D65")], tmp_path / "out", progress=stop)
    assert list((tmp_path / "out").iterdir()) == []


def test_two_textures_of_one_name_are_refused(run: Run, tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        write_textures(tmp_path / name, 1)
    code, _, err = run("bake", tmp_path / "a/t0.npz", tmp_path / "b/t0.npz", "--light", "A", "-o", tmp_path / "out")
    assert code == 2
    assert "named like those of" in err


@pytest.mark.skipif(os.name != "posix", reason="limits of files are those of POSIX")
@pytest.mark.parametrize("image_format", ["exr", "tiff"])
def test_a_full_disk_is_told_of_by_the_image_s_own_name(tmp_path: Path, image_format: Any) -> None:
    import resource

    (path,) = write_textures(tmp_path, 1)
    texture, lights = open_texture(path), [Light.builtin("D65")]
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, before[1]))
    try:
        with pytest.raises(OutputError) as raised:
            bake(texture, lights, tmp_path / "out", image_format=image_format)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert ".part" not in str(raised.value)
    assert "t0_D65." in str(raised.value)
    assert list((tmp_path / "out").iterdir()) == []


def test_all_textures_are_looked_at_before_the_first_is_baked(run: Run, tmp_path: Path) -> None:
    (good,) = write_textures(tmp_path, 1)
    np.savez(tmp_path / "counts.npz", counts=np.ones((2, 3, len(NM)), np.uint16), wavelengths_nm=NM)
    code, _, err = run("bake", good, tmp_path / "counts.npz", "--light", "A", "-o", tmp_path / "out")
    assert (code, "'counts' holds counts of a camera" in err, (tmp_path / "out").exists()) == (2, True, False)


def test_leftovers_of_the_dead_are_removed_and_those_of_the_living_kept(tmp_path: Path) -> None:
    target = tmp_path / "a.exr"
    with atomic_path(target) as mine:
        mine.write_text("new")
        theirs = mine.name.replace(f"-{os.getpid()}.", "-{}.")
        dead = subprocess.run(
            [sys.executable, "-c", "import os; print(os.getpid())"], stdout=subprocess.PIPE, check=True
        )
        gone = tmp_path / theirs.format(int(dead.stdout))
        alive = tmp_path / theirs.format(os.getppid())
        other = tmp_path / theirs.format(int(dead.stdout)).replace(".a.", ".b.")
        for each in (gone, alive, other):
            each.write_text("half")
    with atomic_path(target) as mine:
        mine.write_text("newer")
    assert sorted(each.name for each in tmp_path.iterdir()) == sorted([target.name, alive.name, other.name])


@pytest.mark.skipif(sys.platform == "win32", reason="there is no SIGKILL on Windows")
def test_killed_at_ten_random_moments(tmp_path: Path) -> None:
    """Every image is whole at any time, and the last run completes the rest and cleans up."""
    textures, out, lights = write_textures(tmp_path, 4), tmp_path / "out", ("D65", "A", "FL11")
    options = [part for name in lights for part in ("--light", name)]
    command = [
        sys.executable, "-c", "import sys; from spectral_core.cli import main; sys.exit(main(sys.argv[1:]))",
        "bake", *map(str, textures), *options, "-o", str(out), "--format", "exr",
    ]  # fmt: skip
    first = subprocess.run([*command, "--again", "--json"], check=True, capture_output=True)
    baking = json.loads(first.stdout)["seconds"]["total"]
    wanted = pixels(out)
    assert len(wanted) == len(textures) * len(lights)
    _empty(out)
    moments = random.Random(4)
    killed = 0
    for _ in range(40):  # some are done before their moment comes
        before = set(out.iterdir())
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        while process.poll() is None and set(out.iterdir()) == before:
            time.sleep(0.002)  # it starts, which takes longer than baking
        try:
            process.wait(moments.uniform(0, 1) * baking)
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGKILL)
            killed += 1
            process.wait()
        found = pixels(out)
        assert all(wanted[name] == data for name, data in found.items())
        if killed == 10:
            break
        if len(found) == len(wanted):  # begin anew: what is complete cannot be hurt
            _empty(out)
    assert killed == 10
    final = subprocess.run([*command, "--json"], check=True, capture_output=True)
    assert pixels(out) == wanted
    assert b'"kept"' in final.stdout
    records = {f"t{index}.bake.json" for index in range(len(textures))}
    assert {path.name for path in out.iterdir()} == set(wanted) | records


def _empty(folder: Path) -> None:
    for path in folder.iterdir():
        path.unlink()
