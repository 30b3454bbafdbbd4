from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from spectral_core.baking import bake
from spectral_core.display import load_profile, srgb, srgb_encode
from spectral_core.errors import OutputError, SceneError, TextureError
from spectral_core.imaging import oiio
from spectral_core.lights import Light
from spectral_core.textures import open_texture

NM = np.arange(380.0, 781.0, 20)


@pytest.fixture
def cube() -> np.ndarray:
    return np.random.default_rng(3).uniform(0.02, 0.95, (37, 23, len(NM))).astype(np.float32)


def write_exr(path: Path, cube: np.ndarray, names: list[str], tile: int = 0) -> None:
    spec = oiio().ImageSpec(cube.shape[1], cube.shape[0], cube.shape[2], "float")
    spec.channelnames = tuple(names)
    if tile:
        spec.tile_width = spec.tile_height = tile
    output = oiio().ImageOutput.create(str(path))
    assert output.open(str(path), spec), output.geterror()
    assert output.write_image(cube)
    output.close()


def as_formats(folder: Path, cube: np.ndarray) -> list[Path]:
    np.savez(folder / "plain.npz", reflectance=cube, wavelengths_nm=NM)
    np.savez_compressed(folder / "packed.npz", reflectance=cube, wavelengths_nm=NM)
    np.save(folder / "cube.npy", cube)
    np.save(folder / "fortran.npy", np.asfortranarray(cube))
    for name in ("cube", "fortran"):
        (folder / f"{name}.wavelengths.csv").write_text("# nm\n" + "\n".join(map(str, NM)))
    names = [f"T.{f'{nm:.6f}'.replace('.', ',')}nm" for nm in NM]
    write_exr(folder / "lines.exr", cube, names)
    write_exr(folder / "tiles.exr", cube, names, tile=16)
    write_exr(
        folder / "micrometres.exr",
        np.ascontiguousarray(cube[..., ::-1]),
        [f"T.{nm / 1000:.6f}um".replace(".", ",").replace("T,", "T.") for nm in NM[::-1]],
    )
    return [
        folder / name
        for name in ("plain.npz", "packed.npz", "cube.npy", "fortran.npy", "lines.exr", "tiles.exr", "micrometres.exr")
    ]


def test_all_formats_hold_the_same_texture(tmp_path: Path, cube: np.ndarray, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("spectral_core.textures.base._TILE_BYTES", 5 * cube.shape[1] * cube.shape[2] * 4)
    for path in as_formats(tmp_path, cube):
        texture = open_texture(path)
        assert (texture.height, texture.width, texture.bands) == cube.shape
        order = np.argsort(texture.wavelengths_nm)
        np.testing.assert_allclose(texture.wavelengths_nm[order], NM, atol=1e-6)
        tiles = list(texture.tiles())
        assert len(tiles) > 1
        np.testing.assert_array_equal(np.concatenate([tile.values for tile in tiles])[..., order], cube)
        np.testing.assert_array_equal(texture.pixel(7, 30)[order], cube[30, 7])
        np.testing.assert_array_equal(texture.pixel(3, 2)[order], cube[2, 3])
        assert texture.step_nm == 20


def test_bake_is_the_float64_product(tmp_path: Path, cube: np.ndarray) -> None:
    """3e-6 of the white: float32 products and sums over the bands."""
    np.savez(tmp_path / "t.npz", reflectance=cube, wavelengths_nm=NM)
    lights = [Light.builtin(name) for name in ("D65", "A", "two-peaks-d65")]
    result = bake(open_texture(tmp_path / "t.npz"), lights, tmp_path / "out", image_format="tiff")
    for light, image in zip(lights, result.images, strict=True):
        exact = cube.astype(np.float64) @ light.weighting_factors(NM).matrix
        codes = np.clip(srgb_encode(srgb().to_linear(exact)), 0, 1)
        stored = oiio().ImageBuf(str(image.path)).get_pixels(oiio().FLOAT)
        # Half a 16-bit step of rounding on top of the product's own error.
        np.testing.assert_allclose(stored, codes, atol=0.5 / 65535 + 4e-5)
        outside = ((srgb().to_linear(exact) < -1e-4) | (srgb().to_linear(exact) > 1 + 1e-4)).any(axis=-1).mean()
        assert image.clipped_fraction == pytest.approx(outside, abs=2 / exact[..., 0].size)
    assert result.pixels == 37 * 23
    assert set(result.seconds) == {"read", "project", "write", "total"}


def test_level_1_is_the_reference_times_the_lamp(tmp_path: Path, cube: np.ndarray) -> None:
    np.savez(tmp_path / "t.npz", reflectance=cube, wavelengths_nm=NM)
    light = Light.builtin("A")
    result = bake(open_texture(tmp_path / "t.npz"), [light], tmp_path, levels=(1, 2))
    assert [image.level for image in result.images] == [1, 2]
    pixels = oiio().ImageBuf(str(result.images[0].path)).get_pixels(oiio().FLOAT)
    reference = srgb().to_linear(cube @ Light.builtin("D65").weighting_factors(NM).matrix)
    # Half floats keep 11 bits.
    np.testing.assert_allclose(pixels, reference * srgb().to_linear(light.XYZ()), rtol=2**-11, atol=1e-6)


def test_bake_in_a_display_s_codes(tmp_path: Path, cube: np.ndarray) -> None:
    np.savez(tmp_path / "t.npz", reflectance=cube * 0.5, wavelengths_nm=NM)
    profile = load_profile("htc-vive-2021")
    result = bake(open_texture(tmp_path / "t.npz"), [Light.builtin("D65")], tmp_path, profile, "png16")
    stored = oiio().ImageBuf(str(result.images[0].path)).get_pixels(oiio().FLOAT)
    codes = profile.to_codes(cube * 0.5 @ Light.builtin("D65").weighting_factors(NM).matrix)
    np.testing.assert_allclose(stored, np.clip(codes, 0, 1), atol=4e-5)


def test_radiance_and_equal_lights_are_refused(tmp_path: Path, cube: np.ndarray) -> None:
    np.savez(tmp_path / "lit.npz", radiance=cube, wavelengths_nm=NM)
    with pytest.raises(TextureError, match="already lit"):
        bake(open_texture(tmp_path / "lit.npz"), [Light.builtin("D65")], tmp_path)
    np.savez(tmp_path / "t.npz", reflectance=cube, wavelengths_nm=NM)
    with pytest.raises(OutputError, match="one file"):
        bake(open_texture(tmp_path / "t.npz"), [Light.builtin("D65")] * 2, tmp_path)


def test_a_failed_bake_leaves_what_was_there(tmp_path: Path, cube: np.ndarray) -> None:
    np.savez(tmp_path / "t.npz", reflectance=cube, wavelengths_nm=NM)
    (tmp_path / "t_D65.exr").write_text("old")
    cube[30, 4, 2] = np.nan
    np.savez(tmp_path / "t.npz", reflectance=cube, wavelengths_nm=NM)
    with pytest.raises(TextureError, match="row 30"):
        bake(open_texture(tmp_path / "t.npz"), [Light.builtin("D65")], tmp_path, bad_pixels="refuse")
    assert (tmp_path / "t_D65.exr").read_text() == "old"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["t.npz", "t_D65.exr"]


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (["R", "G", "B"], "no spectral channels"),
        (["T.400,0nm", "T.500,0nm", "S0.500,0nm"], "mixes"),
        (["S0.400,0nm", "S1.400,0nm", "S2.400,0nm"], "polarised"),
        (["T.400,0nm", "T.400,0nm.500,0nm", "T.500,0nm"], "bispectral"),
        (["T.0,0nm", "T.500,0nm", "T.600,0nm"], "no wavelength"),
        (["T.1E400nm", "T.500,0nm", "T.600,0nm"], "not nanometres"),
        (["T.50,0nm", "T.500,0nm", "T.600,0nm"], "not nanometres"),
        (["T.500,0nm", "T.500,00000001nm", "T.600,0nm"], "twice"),
    ],
)
def test_exr_files_that_cannot_be_shown(tmp_path: Path, names: list[str], message: str) -> None:
    write_exr(tmp_path / "x.exr", np.ones((4, 4, 3), np.float32), names)
    with pytest.raises(TextureError, match=message):
        open_texture(tmp_path / "x.exr")


def test_emission_is_radiance(tmp_path: Path) -> None:
    write_exr(tmp_path / "x.exr", np.ones((4, 4, 3), np.float32), ["S0.400,0nm", "S0.500,0nm", "S0.600,0THz"])
    texture = open_texture(tmp_path / "x.exr")
    assert texture.kind == "radiance"
    # 600 THz is 499.65 nm.
    np.testing.assert_allclose(sorted(texture.wavelengths_nm), [400, 299_792.458 / 600, 500], atol=1e-6)


def test_the_core_never_imports_bpy() -> None:
    assert sys.modules["bpy"] is None


def test_a_scene_says_how_its_textures_are_read(tmp_path: Path) -> None:
    """A capture of counts over a white, with names relative to the scene."""
    from spectral_core.scene import load_scene
    from spectral_core.surfaces import scene_surfaces

    rng = np.random.default_rng(1)
    counts = rng.integers(0, 1000, (4, 5, 3)).astype(np.float32)
    np.savez(tmp_path / "leaf.npz", reflectance=counts, wavelengths_nm=[450, 550, 650])
    text = (Path(__file__).parents[2] / "blend_scenes" / "colorchecker.toml").read_text(encoding="utf-8")
    path = tmp_path / "scene.toml"
    path.write_text(f'{text}\n[surfaces.leaf]\ntexture = "leaf.npz"\nscale = 1000\n', encoding="utf-8")
    surface = scene_surfaces(load_scene(path))["leaf"]
    assert surface.texture is not None
    np.testing.assert_allclose(surface.texture.rows(0, 4), counts / 1000, rtol=1e-6)
    path.write_text(f'{text}\n[surfaces.leaf]\ntexture = "leaf.npz"\ndark = "dark.npz"\n', encoding="utf-8")
    with pytest.raises(SceneError, match=r"surfaces\.leaf\.texture.*needs a white one"):
        load_scene(path)
    path.write_text(f'{text}\n[surfaces.leaf]\ntexture = "leaf.npz"\nreduce = 1\n', encoding="utf-8")
    with pytest.raises(SceneError, match="true or false"):
        load_scene(path)
