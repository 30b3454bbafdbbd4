"""Spectra for RGB textures: the command, its output, and images that are none."""

from __future__ import annotations

import io
import json
import random
import struct
import zipfile
import zlib
from pathlib import Path

import numpy as np
import pytest
from assign_samples import (
    D65,
    NM,
    Run,
    noise,
    smooth_library,
    srgb_icc,
    write_image,
    write_library,
)

from spectral_core.assigning import assign
from spectral_core.assigning.image import RgbImage
from spectral_core.errors import OutputError, SpectralBoothError, TextureError
from spectral_core.imaging import oiio


def test_the_command(run: Run, tmp_path: Path) -> None:
    image = write_image(tmp_path / "t.png", noise(12, 10))
    library = write_library(tmp_path / "l.csv", smooth_library(40))
    code, out, err = run(
        "assign", image, "--library", library, "--light", "FL11", "-o", tmp_path / "o.npz", "--judge", "A",
        "--judge", "D65", "--json",
    )  # fmt: skip
    assert code == 0, err
    document = json.loads(out)
    assert {"mean", "p95", "max"} == set(document["dE00"])
    assert 0 < document["reflectances_used"] <= document["library"] == 40
    assert (document["pixels"], document["colours"], document["bands"]) == (120, 120, 31)
    assert document["light"] == "FL11"
    assert document["profile"] == "sRGB"
    assert [each["light"] for each in document["held_out"]] == ["A", "D65"]
    assert document["held_out"][0]["rgb_texture"]["mean"] > 0
    assert "taken as sRGB" in err
    code, out, _ = run("texture", "pixel", tmp_path / "o.npz", 3, 4, "--light", "FL11", "--json")
    assert code == 0
    assert len(json.loads(out)["reflectance"]) == 31
    code, out, err = run("assign", image, "--library", "colorchecker", "--light", "D65", "-o", tmp_path / "p.exr",
                         "--mix", 4, "--exact", "--step", 10, "--judge", "A")  # fmt: skip
    assert code == 0, err
    assert "left out" in out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--light", "D65"], "no library"),
        (["--light", "D65", "--library", "none.csv"], "no such file"),
        (["--light", "moon", "--library", "colorchecker"], "moon"),
        (["--library", "colorchecker"], "--light"),
        (["--light", "D65", "--library", "colorchecker", "--mix", "24"], "mix fewer"),
        (["--light", "D65", "--recover", "smits", "--exact"], "neither mixed"),
        (["--light", "D65", "--recover", "smits", "--judge", "A"], "--library with --judge"),
        (["--light", "D65", "--library", "colorchecker", "--profile", "x.json"], "x.json"),
        (["--light", "D65", "--library", "colorchecker", "--icc", "x.icc"], "x.icc"),
        (["--light", "D65", "--library", "colorchecker", "--step", "nan"], "nan"),
        (["--light", "D65", "--recover", "smits", "--step", "5"], "--step is for a library"),
    ],
)
def test_bad_arguments(run: Run, tmp_path: Path, arguments: list[str], message: str) -> None:
    image = write_image(tmp_path / "t.png", noise(4, 4))
    code, out, err = run("assign", image, "-o", tmp_path / "o.npz", *arguments)
    assert code == 2
    assert out == ""
    assert err.count("\n") == 1
    assert message in err
    assert not (tmp_path / "o.npz").exists()


def test_output_that_cannot_be(tmp_path: Path) -> None:
    image, library = write_image(tmp_path / "t.png", noise(4, 4)), smooth_library(3)
    with pytest.raises(OutputError, match=r"'.tiff'"):
        assign(image, D65, tmp_path / "o.tiff", library)
    (tmp_path / "o.npz").mkdir()
    with pytest.raises(OutputError, match="folder"):
        assign(image, D65, tmp_path / "o.npz", library)


def test_a_stopped_run_leaves_what_was_there(tmp_path: Path) -> None:
    image, library = write_image(tmp_path / "t.png", noise(4, 4)), smooth_library(3)

    def stop(_: float, __: str) -> None:
        raise KeyboardInterrupt

    for suffix in (".npz", ".npy", ".exr"):
        (tmp_path / f"o{suffix}").write_text("old")
        with pytest.raises(KeyboardInterrupt):
            assign(image, D65, tmp_path / f"o{suffix}", library, progress=stop)
        assert (tmp_path / f"o{suffix}").read_text() == "old"
    assert sorted(each.name for each in tmp_path.iterdir()) == ["o.exr", "o.npy", "o.npz", "t.png"]


@pytest.mark.parametrize("kind", ["uint8", "uint16"])
@pytest.mark.parametrize("suffix", [".png", ".tif", ".bmp", ".tga"])
def test_codes_come_as_they_are_stored(tmp_path: Path, suffix: str, kind: str) -> None:
    if kind == "uint16" and suffix in (".bmp", ".tga"):
        pytest.skip("formats of 8 bits")
    codes = noise(37, 21, kind=kind)
    for name, options in {"lines": {}, "tiles": {"tile_width": 16, "tile_height": 16}}.items():
        spec = oiio().ImageSpec(21, 37, 3, kind)
        if options and suffix != ".tif":
            continue
        for key, value in options.items():
            setattr(spec, key, value)
        path = tmp_path / f"{name}{suffix}"
        output = oiio().ImageOutput.create(str(path))
        assert output.open(str(path), spec)
        assert output.write_image(codes)
        output.close()
        image = RgbImage(path)
        assert (image.width, image.height, image.bits) == (21, 37, 8 if kind == "uint8" else 16)
        found = np.concatenate([image.rows(first, min(5, 37 - first)) for first in range(0, 37, 5)])
        np.testing.assert_array_equal(found, codes)


def test_alpha_and_grey_are_said(tmp_path: Path) -> None:
    codes = np.concatenate([noise(6, 6), np.full((6, 6, 1), 40, dtype=np.uint8)], axis=2)
    image = RgbImage(write_image(tmp_path / "a.png", codes, **{"oiio:UnassociatedAlpha": 1}))
    np.testing.assert_array_equal(image.rows(0, 6), codes[..., :3])  # not times alpha
    assert "alpha" in image.warnings[0]
    grey = RgbImage(write_image(tmp_path / "g.png", codes[..., :1]))
    np.testing.assert_array_equal(grey.rows(1, 2), np.repeat(codes[1:3, :, :1], 3, axis=2))
    assert "grey" in grey.warnings[0]
    turned = RgbImage(write_image(tmp_path / "t.tif", codes[..., :3], Orientation=6))
    assert "turned" in turned.warnings[0]


def test_images_that_are_none(tmp_path: Path) -> None:
    write_image(tmp_path / "float.tif", np.ones((3, 3, 3), dtype=np.float32))
    write_image(tmp_path / "many.tif", np.ones((3, 3, 5), dtype=np.uint8))
    write_image(tmp_path / "x.exr", np.ones((3, 3, 3), dtype=np.float32))
    (tmp_path / "text.png").write_text("no image")
    (tmp_path / "empty.png").write_bytes(b"")
    for name in ("float.tif", "many.tif", "x.exr", "text.png", "empty.png", "none.png", "."):
        with pytest.raises(TextureError, match=r"give|name"):
            RgbImage(tmp_path / name)


def test_a_header_that_promises_too_much(tmp_path: Path) -> None:
    data = bytearray(write_image(tmp_path / "t.png", noise(4, 4)).read_bytes())
    data[16:24] = struct.pack(">2I", 60_000, 60_000)
    data[29:33] = struct.pack(">I", zlib.crc32(data[12:29]))
    (tmp_path / "t.png").write_bytes(data)
    with pytest.raises(TextureError, match=r"promises 60000 x 60000|no image"):
        RgbImage(tmp_path / "t.png")


def test_damaged_inputs_are_refused_or_read(run: Run, tmp_path: Path) -> None:
    """Whatever the bytes of an image, a profile and a library: 0 and JSON, or 2 and one line. Seeded."""
    pytest.importorskip("PIL")
    random_ = random.Random(11)
    image = write_image(tmp_path / "t.png", noise(9, 9))
    tiff = write_image(tmp_path / "t.tif", noise(9, 9), compression="zip")
    profile = tmp_path / "p.icc"
    profile.write_bytes(srgb_icc())
    library = write_library(tmp_path / "l.csv", smooth_library(4))
    sources = [(image, "t.png"), (tiff, "t.tif"), (profile, "p.icc")]
    try:
        import scipy.io
    except ImportError:
        pass
    else:
        matlab = tmp_path / "l.mat"
        scipy.io.savemat(matlab, {"data": smooth_library(4).values.T, "wavelength": NM})
        sources.append((matlab, "l.mat"))
    for source, name in sources:
        good = source.read_bytes()
        for _ in range(40):
            damaged = bytearray(good)
            for _ in range(random_.randint(1, 4)):
                at = random_.randrange(min(len(damaged), random_.choice((64, 400, 4000))))
                damaged[at : at + random_.choice((0, 1, 1, 4))] = random_.choice(
                    (b"", b"\xff\xff\xff\xff", b"\0\0\0\0", b"\x7f\xff\xff\xff", random_.randbytes(3))
                )
            broken = tmp_path / f"broken{Path(name).suffix}"
            broken.write_bytes(bytes(damaged))
            arguments = {
                "t.png": [broken, "--library", library], "t.tif": [broken, "--library", library],
                "p.icc": [image, "--library", library, "--icc", broken], "l.mat": [image, "--library", broken],
            }[name]  # fmt: skip
            code, out, err = run("assign", *arguments, "--light", "D65", "-o", tmp_path / "o.npz", "--json")
            what = f"{name} {bytes(damaged[:80])!r}: {err}"
            assert code in (0, 2), what
            if code == 0:
                json.loads(out, parse_constant=lambda constant: pytest.fail(constant))
            else:
                assert out == "", what
                assert err.startswith("error: "), what
                assert err.count("\n") == 1, what
                assert len(err) < 1000, what


def test_a_written_archive_is_a_plain_one(tmp_path: Path) -> None:
    image, library = write_image(tmp_path / "t.png", noise(4, 5)), smooth_library(3)
    assign(image, D65, tmp_path / "o.npz", library)
    with zipfile.ZipFile(tmp_path / "o.npz") as archive:
        assert archive.testzip() is None
    with np.load(io.BytesIO((tmp_path / "o.npz").read_bytes()), allow_pickle=False) as loaded:
        assert loaded["reflectance"].shape == (4, 5, 31)
        assert loaded["reflectance"].dtype == np.float16


def test_every_error_is_one_of_ours(tmp_path: Path) -> None:
    with pytest.raises(SpectralBoothError, match="no such file"):
        assign(tmp_path / "none.png", D65, tmp_path / "o.npz", smooth_library(3))
