"""White and dark references: the quotient, its columns, what is saturated, what does not fit."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spectral_core.baking import level2_weights, project
from spectral_core.errors import SpectrumError, TextureError
from spectral_core.lights import Light
from spectral_core.textures import HyperspectralTexture, Reading, open_texture

NM = np.arange(400.0, 700.0, 50)
HEIGHT, WIDTH, BANDS = 20, 8, len(NM)


def save(path: Path, values: np.ndarray, kind: str = "counts", wavelengths: np.ndarray = NM) -> Path:
    np.savez(path, **{kind: values}, wavelengths_nm=wavelengths)
    return path


@pytest.fixture
def scene(tmp_path: Path) -> dict[str, Any]:
    """A line scanner: lamp and dark signal differ from column to column, and the references have noise."""
    random_ = np.random.default_rng(8)
    reflectance = random_.uniform(0.05, 0.9, (HEIGHT, WIDTH, BANDS))
    lamp = random_.uniform(2000, 30000, (WIDTH, BANDS))
    dark = random_.uniform(80, 120, (WIDTH, BANDS))
    white = np.round(lamp + dark + random_.normal(0, 20, (50, WIDTH, BANDS))).astype(np.uint16)
    darkness = np.round(dark + random_.normal(0, 2, (40, WIDTH, BANDS))).astype(np.uint16)
    counts = np.round(reflectance * lamp + dark).astype(np.uint16)
    return {
        "counts": save(tmp_path / "scene.npz", counts),
        "white": save(tmp_path / "white.npz", white),
        "dark": save(tmp_path / "dark.npz", darkness),
        "values": {"counts": counts, "white": white, "dark": darkness, "reflectance": reflectance},
        "folder": tmp_path,
    }


def quotient(counts: np.ndarray, white: np.ndarray, dark: np.ndarray | float) -> np.ndarray:
    return (counts - dark) / (white - dark)


def whole(texture: HyperspectralTexture) -> np.ndarray:
    return np.concatenate([tile.values for tile in texture.tiles()])


def test_columns_have_their_own_white_and_dark(scene: dict[str, Any]) -> None:
    texture = open_texture(scene["counts"], Reading(white=scene["white"], dark=scene["dark"]))
    values = scene["values"]
    assert (texture.kind, texture.gain.shape, texture.dark.shape) == ("reflectance", (WIDTH, BANDS), (WIDTH, BANDS))
    assert texture.warnings == ("reflectance is relative to the white reference, whose own is taken as 1",)
    assert texture.good.all()
    np.testing.assert_array_equal(texture.samples(3, 4), values["counts"][3:7])  # as stored
    exact = quotient(values["counts"].astype(float), values["white"].mean(axis=0), values["dark"].mean(axis=0))
    # float32: half a step of 2**-9 of counts up to 30000 less their dark signal, against 2000 counts at least,
    # and three roundings of a reflectance up to 0.9.
    np.testing.assert_allclose(whole(texture), exact, rtol=0, atol=2e-6)
    # The noise of 50 and 40 rows and of rounding, against 2000 counts: four standard deviations.
    np.testing.assert_allclose(whole(texture), values["reflectance"], rtol=0, atol=4 * 20 / 50**0.5 / 2000)


def test_the_engine_s_form_is_the_same_in_float64(scene: dict[str, Any]) -> None:
    texture = open_texture(scene["counts"], Reading(white=scene["white"], dark=scene["dark"]))
    values = scene["values"]
    exact = quotient(values["counts"].astype(float), values["white"].mean(axis=0), values["dark"].mean(axis=0))
    np.testing.assert_allclose((texture.samples(0, HEIGHT) - texture.dark) * texture.gain, exact, rtol=1e-12)


def test_references_of_another_width_are_averaged(scene: dict[str, Any]) -> None:
    values, folder = scene["values"], scene["folder"]
    white = save(folder / "narrow.npz", values["white"][:, :3])
    texture = open_texture(scene["counts"], Reading(white=white))
    assert (texture.gain.shape, texture.dark.shape) == ((BANDS,), (BANDS,))
    exact = values["counts"] / values["white"][:, :3].mean(axis=(0, 1))
    np.testing.assert_allclose(whole(texture), exact, rtol=3e-7)  # two roundings to float32
    both = open_texture(scene["counts"], Reading(white=white, dark=scene["dark"]))
    exact = quotient(
        values["counts"].astype(float), values["white"][:, :3].mean(axis=(0, 1)), values["dark"].mean(axis=0)
    )
    np.testing.assert_allclose(whole(both), exact, rtol=0, atol=2e-6)


def test_saturated_columns_take_the_band_s_mean(scene: dict[str, Any]) -> None:
    """In band 2 two of eight columns are saturated, in band 4 six are: that band is bad."""
    values, folder = scene["values"], scene["folder"]
    white = values["white"].copy()
    white[:, :2, 2] = 65535
    white[:, :6, 4] = 65535
    white[7, 7, 0] = 65535  # one row of fifty is two in a hundred: too many as well
    texture = open_texture(scene["counts"], Reading(white=save(folder / "s.npz", white), dark=scene["dark"]))
    np.testing.assert_array_equal(texture.good, [True, True, True, True, False, True])
    assert texture.warnings[1:] == (
        "1 of 6 bands left out (600 nm): a reference is saturated there, or the white not brighter than the dark",
        "3 columns of the white reference, over all bands, are replaced by their band's mean",
    )
    dark = values["dark"].mean(axis=0)
    span = white.mean(axis=0) - dark
    span[:2, 2] = span[2:, 2].mean()
    span[7, 0] = span[:7, 0].mean()
    exact = (values["counts"] - dark) / span
    exact[..., 4] = 0  # bad bands are black
    np.testing.assert_allclose(whole(texture), exact, rtol=0, atol=2e-6)


def test_a_few_saturated_pixels_do_no_harm(scene: dict[str, Any]) -> None:
    white = np.repeat(scene["values"]["white"], 4, axis=0)
    white[0, 0, 0] = 65535  # one of 200
    texture = open_texture(scene["counts"], Reading(white=save(scene["folder"] / "s.npz", white)))
    assert len(texture.warnings) == 1
    assert texture.gain[0, 0] == pytest.approx(1 / white[:, 0, 0].mean(), rel=1e-12)


def test_a_white_darker_than_the_dark_and_one_that_is_no_number(scene: dict[str, Any]) -> None:
    white = scene["values"]["white"].astype(float)
    white[:, :, 1] = 10  # below the dark signal in all columns
    white[3, 5, 3] = np.nan
    reading = Reading(white=save(scene["folder"] / "w.npz", white), dark=scene["dark"])
    texture = open_texture(scene["counts"], reading)
    np.testing.assert_array_equal(texture.good, [True, False, True, True, True, True])
    assert texture.warnings[2].startswith("1 columns of the white reference")
    assert np.isfinite(whole(texture)).all()
    narrow = open_texture(
        scene["counts"], Reading(white=save(scene["folder"] / "n.npz", white[:, 2:]), dark=scene["dark"])
    )
    np.testing.assert_array_equal(narrow.good, texture.good)
    assert narrow.warnings[-1] == "n: 1 columns, over all bands, are no part of its mean"
    # In all others the mean of its six columns; of five where one is no number.
    assert np.isfinite(whole(narrow)).all()


def test_no_usable_band_is_refused(scene: dict[str, Any]) -> None:
    full = save(scene["folder"] / "full.npz", np.full((4, WIDTH, BANDS), 65535, np.uint16))
    for reading in (Reading(white=full), Reading(white=scene["dark"], dark=scene["white"])):
        with pytest.raises(TextureError, match="no band has a white reference that is brighter"):
            open_texture(scene["counts"], reading)


def test_radiance_and_a_table_of_one_spectrum(tmp_path: Path) -> None:
    """Linear between the table's rows, which is said."""
    radiance = np.random.default_rng(9).uniform(0.1, 1, (5, 4, BANDS)).astype(np.float32)
    path = save(tmp_path / "lit.npz", radiance, "radiance")
    (tmp_path / "white.csv").write_text("nm,W\n400,1\n500,3\n700,1\n")
    texture = open_texture(path, Reading(white=tmp_path / "white.csv"))
    np.testing.assert_allclose(whole(texture), radiance / np.array([1, 2, 3, 2.5, 2, 1.5]), rtol=3e-7)
    assert texture.warnings[-1] == "white.csv: interpolated from its 3 wavelengths to the bands"
    table = "nm,W\n" + "".join(f"{nm},{2 * (band + 1)}\n" for band, nm in enumerate(NM))
    (tmp_path / "bands.csv").write_text(table)
    texture = open_texture(path, Reading(white=tmp_path / "bands.csv"))
    np.testing.assert_allclose(whole(texture), radiance / (2 * np.arange(1.0, 7)), rtol=3e-7)
    assert len(texture.warnings) == 1


def test_bands_that_the_white_spoils_have_no_weight(scene: dict[str, Any]) -> None:
    """What `good` says, and that values of bad bands are finite, is all that whoever weights them needs."""
    white = scene["values"]["white"].copy()
    white[..., 0] = 0
    texture = open_texture(scene["counts"], Reading(white=save(scene["folder"] / "w.npz", white)))
    assert not texture.good[0]
    assert (whole(texture)[..., 0] == 0).all()


def test_columns_that_differ_in_darkness_alone(scene: dict[str, Any]) -> None:
    """White less dark is the same everywhere, so the gain is one row and the dark level is not."""
    dark = np.arange(WIDTH * BANDS, dtype=np.uint16).reshape(1, WIDTH, BANDS)
    save(scene["folder"] / "white.npz", dark + np.uint16(2000))
    save(scene["folder"] / "dark.npz", dark)
    texture = open_texture(scene["counts"], Reading(white=scene["white"], dark=scene["dark"]))
    assert (texture.gain.shape, texture.dark.shape) == ((BANDS,), (WIDTH, BANDS))
    weights = level2_weights(texture, [Light.builtin("A")])
    exact = (scene["values"]["counts"] - dark.astype(float)) / 2000 @ weights
    # float32 sums of a few values up to 15.
    assert np.abs(project(texture, weights) - exact).max() < 1e-5


def test_a_texture_s_own_scale_is_kept(tmp_path: Path) -> None:
    """Radiance of a polarised intensity, whose file is told to be counts: gain and dark of both are one."""

    class Scaled(HyperspectralTexture):
        name, format, kind, height, width = "scaled", "test", "radiance", 3, 2
        wavelengths_nm = NM

        def samples(self, first: int, count: int) -> np.ndarray:
            return np.arange(3 * 2 * BANDS, dtype=np.uint16).reshape(3, 2, BANDS)[first : first + count] + 100

        @property
        def gain(self) -> np.ndarray:
            return np.linspace(0.5, 2, BANDS)

        @property
        def dark(self) -> np.ndarray:
            return np.full(BANDS, 7.0)

    from spectral_core.textures.references import calibrated

    texture = Scaled()
    before = (texture.samples(0, 3) - 7.0) * np.linspace(0.5, 2, BANDS)
    white = save(tmp_path / "w.npz", np.full((2, 2, BANDS), 500.0), "radiance")
    dark = save(tmp_path / "d.npz", np.full((2, 2, BANDS), 3.0), "radiance")
    result = calibrated(texture, Reading(white=white, dark=dark), open_texture)
    assert result.gain.shape == (BANDS,)  # equal columns are one
    np.testing.assert_allclose(result.rows(0, 3), (before - 3) / 497, rtol=1e-6)


@pytest.mark.parametrize(
    ("white", "message"),
    [
        ({"values": np.ones((3, 3, 5), np.uint16), "wavelengths": NM[:5]}, r"its 5 bands from 400 to 600 nm are not"),
        ({"values": np.ones((3, 3, 6), np.uint16), "wavelengths": NM + 1}, r"its 6 bands from 401 to 651 nm are not"),
        ({"values": np.ones((3, 3, 6)), "kind": "radiance"}, "holds radiance, 'scene' holds counts"),
    ],
)
def test_references_that_do_not_fit(scene: dict[str, Any], white: dict[str, Any], message: str) -> None:
    path = save(scene["folder"] / "w.npz", **white)
    with pytest.raises(TextureError, match=message):
        open_texture(scene["counts"], Reading(white=path))


@pytest.mark.parametrize(
    ("table", "error", "message"),
    [
        ("nm,a,b\n400,1,1\n650,1,1\n", TextureError, "holds 2 spectra"),
        ("400,1\n600,1\n", TextureError, "covers 400 to 600 nm, the texture 400 to 650 nm"),
        ("400,1\n500,1\n700,1\n", TextureError, "no table of the bands' own counts"),
        ("400,x\n", SpectrumError, "not a number"),
    ],
)
def test_tables_that_do_not_fit(scene: dict[str, Any], table: str, error: type[Exception], message: str) -> None:
    path = scene["folder"] / "w.csv"
    path.write_text(table)
    with pytest.raises(error, match=message):
        open_texture(scene["counts"], Reading(white=path))


def test_reflectance_is_not_divided_again(scene: dict[str, Any]) -> None:
    path = save(scene["folder"] / "r.npz", np.ones((2, 2, BANDS)), "reflectance")
    with pytest.raises(TextureError, match="holds reflectance already"):
        open_texture(path, Reading(white=scene["white"]))
    with pytest.raises(TextureError, match="no such file"):
        open_texture(scene["counts"], Reading(white=scene["folder"] / "none.npz"))


def test_what_is_to_know_of_a_reference_is_said(scene: dict[str, Any]) -> None:
    path = scene["folder"] / "w.npz"
    np.savez(path, counts=scene["values"]["white"], radiance=np.ones((1, 1, 1)), wavelengths_nm=NM)
    texture = open_texture(scene["counts"], Reading(white=path, kind="counts"))
    assert texture.warnings[-1] == "w: counts is used; it holds radiance as well"
