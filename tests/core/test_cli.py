from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spectral_core.display import srgb
from spectral_core.lights import Light

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def document(run: Run) -> Callable[..., dict[str, Any]]:
    """The one JSON object of a command that succeeds."""

    def call(*arguments: object) -> dict[str, Any]:
        code, out, _ = run(*arguments, "--json")
        assert code == 0
        parsed: dict[str, Any] = json.loads(out)
        return parsed

    return call


def test_light(document: Callable[..., dict[str, Any]]) -> None:
    found = document("light", "D65", "--luminance", "85")
    assert set(found) >= {
        "name",
        "xy",
        "XYZ",
        "cct_K",
        "duv",
        "rf",
        "ra",
        "linear_rgb",
        "rgb_8bit",
        "in_gamut",
        "warnings",
    }
    np.testing.assert_allclose(found["rgb_8bit"], 237, atol=0.6)
    assert found["XYZ"][1] == pytest.approx(85)
    assert found["in_gamut"] is True
    assert document("light", "D65")["in_gamut"] is True
    assert document("light", "A", "--luminance", "85")["in_gamut"] is False
    vive = document("light", "D65", "--profile", "htc-vive-2021")
    assert vive["linear_rgb"][0] == pytest.approx(1.04, abs=0.005)  # just outside, as published


def test_lights(document: Callable[..., dict[str, Any]]) -> None:
    lights = {each["name"]: each for each in document("lights")["lights"]}
    assert {"D65", "Philips TL-84", "two-peaks-d65", "d65-simulator", "LPS"} <= set(lights)
    assert lights["LPS"]["kind"] == "measured"
    assert all(set(each) == {"name", "kind", "xy", "cct_K", "rf"} for each in lights.values())


def test_light_design(document: Callable[..., dict[str, Any]], tmp_path: Path) -> None:
    path = tmp_path / "two.csv"
    found = document("light-design", "--match", "D65", "--peak", "456", "-o", path)
    assert set(found) >= {"wavelengths_nm", "powers", "xy", "cct_K", "rf", "delta_xy"}
    assert found["delta_xy"] < 1e-6
    assert found["wavelengths_nm"][1] == pytest.approx(569, abs=0.05)
    np.testing.assert_allclose(document("light", path)["xy"], document("light", "D65")["xy"], atol=1e-9)
    leds = document("light-design", "--leds", "6", "--rf", "88", "--xy", "0.3107,0.3344", "--cct", "6568")
    assert leds["rf"] == pytest.approx(88, abs=1e-3)
    assert leds["cct_K"] == pytest.approx(6568, abs=30)


def test_reflectance(document: Callable[..., dict[str, Any]], tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    path.write_text("nm;white;grey\n380;1;0.2\n780;1;0.2\n")
    white, grey = document("reflectance", path, "--light", "A")["colours"]
    assert white["name"] == "white"
    np.testing.assert_allclose(white["Lab"], [100, 0, 0], atol=1e-9)
    np.testing.assert_allclose(np.array(grey["XYZ"]) / white["XYZ"], 0.2)
    assert len(document("reflectance", "colorchecker")["colours"]) == 24


def test_texture_and_bake(document: Callable[..., dict[str, Any]], tmp_path: Path) -> None:
    path = tmp_path / "t.npz"
    cube = np.random.default_rng(0).uniform(0, 1, (5, 7, 41)).astype(np.float32)
    np.savez(path, reflectance=cube, wavelengths_nm=np.arange(380.0, 781, 10))
    info = document("texture", "info", path)
    assert (info["width"], info["height"], info["bands"], info["step_nm"]) == (7, 5, 41, 10)
    pixel = document("texture", "pixel", path, 6, 4, "--light", "D65")
    np.testing.assert_array_equal(pixel["reflectance"], cube[4, 6])
    baked = document("bake", path, "--light", "D65", "--light", "A", "-o", tmp_path / "out", "--format", "png8")
    assert [each["light"] for each in baked["outputs"]] == ["D65", "A"]
    assert all(Path(each["path"]).is_file() for each in baked["outputs"])
    assert set(baked) >= {"outputs", "seconds", "pixels", "bands", "peak_memory_MB"}


def test_a_pixel_s_colour_leaves_bad_bands_out_as_a_bake_does(
    document: Callable[..., dict[str, Any]], run: Callable[..., tuple[int, str, str]], tmp_path: Path
) -> None:
    cube = np.full((3, 4, 31), 0.5, "<f4")
    cube[..., 12], cube[..., 20] = np.nan, 7.0
    (tmp_path / "t.raw").write_bytes(cube.tobytes())
    good = ",".join("0" if band in (12, 20) else "1" for band in range(31))
    (tmp_path / "t.hdr").write_text(
        "ENVI\nsamples = 4\nlines = 3\nbands = 31\ndata type = 4\ninterleave = bip\nbyte order = 0\n"
        f"wavelength units = nm\nwavelength = {{{','.join(map(str, range(400, 701, 10)))}}}\nbbl = {{{good}}}\n"
    )
    pixel = document("texture", "pixel", tmp_path / "t.hdr", 1, 1, "--light", "D65", "--kind", "reflectance")
    assert pixel["reflectance"][12] is None
    # A grey of 0.5 whatever the bad bands hold; float64.
    assert abs(pixel["XYZ"][1] - 0.5) < 1e-9
    code, _, err = run("texture", "pixel", tmp_path / "t.hdr", 1, 1, "--light", "D65", "--kind", "counts")
    assert (code, "holds counts of a camera; give a white reference" in err) == (2, True)


@pytest.mark.parametrize(
    "command", [["light", "D65"], ["lights"], ["reflectance", "colorchecker"], ["light-design", "--peak", "450"]]
)
def test_people_get_a_table(run: Run, command: list[str]) -> None:
    code, out, _ = run(*command)
    assert code == 0
    assert "│" in out
    assert max(map(len, out.splitlines())) <= 80


def test_names_are_text_and_no_markup(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    path.write_text("nm,[/x] :smile:\n380,1\n780,1\n")
    for command in ("light", "reflectance"):
        code, out, _ = run(command, path)
        assert code == 0
        assert "[/x] :smile:" in out


def test_help_and_version(run: Run) -> None:
    assert "Usage" in run("--help")[1]
    for command in ("light", "bake", "verify", "demo"):
        assert "--json" in run(command, "--help")[1]


def test_the_public_names_are_there_whatever_was_imported_before() -> None:
    import spectral_core as sb

    for name in sb.__all__:
        assert callable(getattr(sb, name))
    with pytest.raises(AttributeError, match="no attribute 'colour'"):
        sb.colour  # noqa: B018


def test_the_gamut_s_tolerance_is_in_linear_light(document: Callable[..., dict[str, Any]], tmp_path: Path) -> None:
    """Encoded, the same 1e-4 below zero would be 13 times that."""
    nm = np.arange(380.0, 781.0, 5)
    cyan = np.where((nm > 480) & (nm < 540), 0.9, 0.0)
    red = srgb().to_linear(np.stack([cyan, np.ones_like(nm)]) @ Light.builtin("D65").weighting_factors(nm).matrix)[:, 0]
    for wanted, inside in ((-5e-5, True), (-2e-4, False)):
        share = (wanted - red[0]) / (red[1] - red[0])
        path = tmp_path / "r.csv"
        values = cyan + share * (1 - cyan)
        path.write_text("nm,r\n" + "".join(f"{float(a)!r},{float(b)!r}\n" for a, b in zip(nm, values, strict=True)))
        (colour,) = document("reflectance", path)["colours"]
        assert colour["in_gamut"] is inside
