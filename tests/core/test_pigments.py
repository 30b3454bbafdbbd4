"""Synthetic fruit: physical reflectance, the colours of the fruit, and a map without seams."""

from __future__ import annotations

import numpy as np
import pytest

from spectral_core import standards
from spectral_core.arrays import Float32Array
from spectral_core.baking import level2_weights
from spectral_core.errors import TextureError
from spectral_core.lights import Light
from spectral_core.textures.synthetic.pigments import (
    PIGMENT_TEXTURES,
    PIGMENTS,
    WAVELENGTHS_NM,
    kubelka_munk,
    pigment_texture,
)
from spectral_core.textures.synthetic.skin import directions, spots

# L*, C*ab and hue angle under D65. Mean of the whole skin; ranges hold what is called by that
# name: yellow near 90 degrees, orange near 65, ripe tomato 25 to 45, green apple 105 to 125.
COLOUR_RANGES = {
    "lemon": ((70, 82), (55, 85), (85, 98)),
    "orange": ((58, 72), (60, 90), (58, 76)),
    "tomato": ((38, 52), (45, 70), (25, 45)),
    "green-apple": ((60, 76), (45, 70), (104, 125)),
}


@pytest.fixture(scope="module")
def skins() -> dict[str, Float32Array]:
    textures = [pigment_texture(name) for name in PIGMENT_TEXTURES]
    return {each.name: each.rows(0, each.height) for each in textures}


@pytest.mark.parametrize("name", PIGMENT_TEXTURES)
def test_says_what_it_is(name: str) -> None:
    texture = pigment_texture(name)
    assert (texture.format, texture.kind, texture.height, texture.width) == ("synthetic", "reflectance", 256, 512)
    assert any("synthetic" in warning for warning in texture.warnings)
    np.testing.assert_array_equal(texture.wavelengths_nm, np.arange(380, 781, 5))


def test_unknown_name_is_refused_with_the_known_ones() -> None:
    with pytest.raises(TextureError, match=r"'melon'.*lemon, tomato, green-apple, orange"):
        pigment_texture("melon")


@pytest.mark.parametrize("name", PIGMENT_TEXTURES)
def test_is_a_reflectance(name: str, skins: dict[str, Float32Array]) -> None:
    """Inside what measured fruit shows: never below 1 % (surface reflection), never above 85 %."""
    assert skins[name].dtype == np.float32
    assert skins[name].min() > 0.01
    assert skins[name].max() < 0.85


@pytest.mark.parametrize("name", PIGMENT_TEXTURES)
def test_has_the_colour_of_the_fruit(name: str, skins: dict[str, Float32Array]) -> None:
    light = Light.builtin("D65")
    weights = level2_weights(pigment_texture(name), [light])
    L, a, b = standards.XYZ_to_Lab(skins[name].mean(axis=(0, 1), dtype=np.float64) @ weights, light.XYZ())
    measured = (L, np.hypot(a, b), np.degrees(np.arctan2(b, a)) % 360)
    assert all(low <= value <= high for value, (low, high) in zip(measured, COLOUR_RANGES[name], strict=True)), measured


def test_spectra_have_the_marks_of_their_pigments(skins: dict[str, Float32Array]) -> None:
    at = {name: dict(zip(WAVELENGTHS_NM, skin.mean(axis=(0, 1)), strict=True)) for name, skin in skins.items()}
    apple = at["green-apple"]
    # Chlorophyll: a dip at 675 nm between the green and the red edge.
    assert apple[675] < 0.7 * apple[555]
    assert apple[675] < 0.6 * apple[720]
    # Half of the rise lies further to the red with the longer chain of double bonds: yellow, orange, red.
    edges = []
    for name in ("lemon", "orange", "tomato"):
        curve = np.array(list(at[name].values()))
        half = (curve.min() + curve[WAVELENGTHS_NM == 640][0]) / 2
        edges.append(WAVELENGTHS_NM[np.argmax((curve > half) & (WAVELENGTHS_NM > 480))])
    assert 490 <= edges[0] < 530 < edges[1] < 570 < edges[2] <= 605


@pytest.mark.parametrize("name", PIGMENT_TEXTURES)
def test_is_the_same_every_time_and_tile_by_tile(name: str, skins: dict[str, Float32Array]) -> None:
    texture = pigment_texture(name)
    tiled = np.concatenate([tile.values for tile in texture.tiles()])
    # A matrix product of few rows may sum in another order than one of many: float32 rounding.
    np.testing.assert_allclose(tiled, skins[name], atol=1e-6)
    np.testing.assert_allclose(texture.rows(100, 1), skins[name][100:101], atol=1e-6)


@pytest.mark.parametrize("name", PIGMENT_TEXTURES)
def test_varies_over_the_skin(name: str, skins: dict[str, Float32Array]) -> None:
    """By more than 1 % of reflectance: else one spectrum would do."""
    assert skins[name].std(axis=(0, 1)).max() > 0.01


@pytest.mark.parametrize("name", PIGMENT_TEXTURES)
def test_wraps_round_without_a_seam(name: str, skins: dict[str, Float32Array]) -> None:
    """The step from the last column to the first is like any other step between columns."""
    steps = np.abs(skins[name] - np.roll(skins[name], 1, axis=1)).mean(axis=(0, 2))
    assert steps[0] < 1.5 * np.percentile(steps, 95)


@pytest.mark.parametrize("name", PIGMENT_TEXTURES)
def test_closes_at_the_poles(name: str, skins: dict[str, Float32Array]) -> None:
    """The outermost rows run round a cap of 0.7 degrees: nearly one value."""
    for row in (0, -1):
        assert np.ptp(skins[name][row], axis=0).max() < 0.06


def test_kubelka_munk_solves_its_equation() -> None:
    """(1 - R)^2 / 2R = K/S, from hardly absorbing to nearly black, within float32."""
    ratio = np.geomspace(1e-3, 100, 200, dtype=np.float32)
    R = kubelka_munk(ratio.copy()).astype(np.float64)
    np.testing.assert_allclose((1 - R) ** 2 / (2 * R), ratio, rtol=2e-4)
    assert kubelka_munk(np.zeros(1, dtype=np.float32))[0] == 1


@pytest.mark.parametrize("name", PIGMENTS)
def test_pigment_absorption_is_normalised(name: str) -> None:
    """A concentration is K/S at the strongest wavelength."""
    absorption = PIGMENTS[name].absorption(np.arange(380.0, 781.0))
    assert absorption.max() == pytest.approx(1)
    assert absorption.min() >= 0


def test_spots_are_round_on_the_sphere_near_a_pole() -> None:
    """Their share of the sphere's area does not depend on the latitude they are drawn at."""
    drawn = spots(128, 256, 200, 3.0, seed=1, spread=0.0)
    z = directions(128, 256)[..., 2]
    area = np.sqrt(1 - z**2)
    cap, belt = np.abs(z) > 0.8, np.abs(z) < 0.2
    density = [(drawn * area)[part].sum() / area[part].sum() for part in (cap, belt)]
    # 40 spots in each: their number alone is uncertain by some 10 %.
    assert density[0] == pytest.approx(density[1], rel=0.2)
