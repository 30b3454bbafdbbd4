"""Coded lamps: what channels stand for, and that light per channel adds up to the exact colour."""

from __future__ import annotations

import re

import numpy as np
import pytest

from spectral_core.coded import CHANNELS, CodedLamps, coded_lamps
from spectral_core.display import srgb
from spectral_core.errors import LightError, SceneError
from spectral_core.lights import Light
from spectral_core.scene import bundled_scene, load_scene, parse_scene
from spectral_core.standards import srgb_to_XYZ_matrix
from spectral_core.surfaces import Surface, scene_surfaces

MIXTURE = "0.5 A + 0.3 D65 + 0.2 FL11"
# Sums of a few hundred float64 numbers.
ROUNDING = 1e-12


@pytest.fixture(scope="module")
def surfaces() -> dict[str, Surface]:
    return scene_surfaces(load_scene(bundled_scene("colorchecker")))


def _parts(text: str) -> tuple[tuple[Light, float], ...]:
    light = Light.load(text)
    return light.parts or ((light, 1.0),)


def _shown(coded: CodedLamps, lamps: list[tuple[str, float]], surface: Surface) -> np.ndarray:
    """XYZ where each lamp's irradiance is given: what a renderer adds up per channel, times the surface's XYZ."""
    carried = sum(coded.code(_parts(light)) * irradiance for light, irradiance in lamps)
    colours = coded.XYZ(surface, Light.load("D65"))
    return np.asarray(sum(each * XYZ for each, XYZ in zip(carried, colours, strict=True)))


@pytest.mark.parametrize("light", ["D65", "LPS", MIXTURE, "2 A + 2 LPS"])
def test_one_lamp_shows_the_exact_colour(surfaces: dict[str, Surface], light: str) -> None:
    coded = coded_lamps([_parts(light)], 2, 0.85)
    for surface in surfaces.values():
        exact = 0.85 * surface.XYZ(Light.load(light))
        np.testing.assert_allclose(_shown(coded, [(light, 1.0)], surface), exact, rtol=ROUNDING, atol=ROUNDING)


def test_lamps_of_different_lights_add_up_at_any_place(surfaces: dict[str, Surface]) -> None:
    lamps = [("A", 0.7), ("0.4 D65 + 0.6 LPS", 0.2), ("LPS", 0.05)]
    coded = coded_lamps([_parts(light) for light, _ in lamps], 2, 0.6)
    assert [each.name for each in coded.lights] == ["A", "D65", "LPS"]
    for surface in surfaces.values():
        exact = 0.6 * sum(share * surface.XYZ(Light.load(light)) for light, share in lamps)
        np.testing.assert_allclose(_shown(coded, lamps, surface), exact, rtol=ROUNDING, atol=ROUNDING)


def test_the_white_is_what_the_perfect_diffuser_shows(surfaces: dict[str, Surface]) -> None:
    white = surfaces["white"]
    for level in (0, 1, 2):
        coded = coded_lamps([_parts("0.5 A + 0.5 HP1")], level, 0.85)
        shown = np.array(coded.XYZ(white, Light.load("D65")))
        # A constant reflectance of 1 has the light's own colour; D65's is the white of Rec.709 to four decimals.
        np.testing.assert_allclose(coded.white_XYZ, shown, rtol=ROUNDING if level == 2 else 2e-4)
        assert (coded.white_XYZ[2] == 0).all()


def test_levels_0_and_1_are_products_of_rgb(surfaces: dict[str, Surface]) -> None:
    reference, lights = Light.load("D65"), ("A", "FL11")
    for surface in surfaces.values():
        rgb = surface.reference_rgb(reference)
        plain = coded_lamps([_parts("A"), _parts("FL11")], 0, 1.0).XYZ(surface, reference)
        tinted = coded_lamps([_parts("A"), _parts("FL11")], 1, 1.0).XYZ(surface, reference)
        assert len(plain) == len(tinted) == CHANNELS
        for channel, light in enumerate(lights):
            lamp = np.maximum(srgb().to_linear(Light.load(light).XYZ()), 0.0)
            np.testing.assert_allclose(plain[channel], srgb_to_XYZ_matrix() @ rgb, atol=ROUNDING)
            np.testing.assert_allclose(tinted[channel], srgb_to_XYZ_matrix() @ (rgb * lamp), atol=ROUNDING)


def test_sodium_has_no_negative_lamps() -> None:
    coded = coded_lamps([_parts("LPS")], 1, 1.0)
    assert (coded.lamp_rgb >= 0).all()
    assert srgb().to_linear(Light.load("LPS").XYZ()).min() < 0
    # Its XYZ is held as it is.
    np.testing.assert_allclose(coded_lamps([_parts("LPS")], 2, 1.0).white_XYZ[0], Light.load("LPS").XYZ(), rtol=1e-15)


def test_only_ratios_of_shares_count_and_a_light_may_come_twice() -> None:
    coded = coded_lamps([_parts("2 A + 6 D65"), _parts("1 D65 + 3 D65")], 2, 0.85)
    assert [each.name for each in coded.lights] == ["A", "D65"]
    np.testing.assert_allclose(coded.code(_parts("2 A + 6 D65")), [0.85 * 0.25, 0.85 * 0.75, 0.0], rtol=ROUNDING)
    np.testing.assert_allclose(coded.code(_parts("1 D65 + 3 D65")), [0.0, 0.85, 0.0], rtol=ROUNDING)


def test_more_than_three_spectra_are_refused() -> None:
    lamps = [_parts(MIXTURE), _parts("A"), _parts("0.5 D65 + 0.5 LPS")]
    with pytest.raises(LightError, match=r"^4 spectra \(A, D65, FL11, LPS\), and coded lamps carry 3; "):
        coded_lamps(lamps, 2, 0.85)
    assert len(coded_lamps(lamps[:2], 2, 0.85).lights) == 3


def test_different_lights_of_one_name_are_refused() -> None:
    lamps = [[(Light.from_lines("lamp", [peak], [1.0]), 1.0)] for peak in (500.0, 600.0)]
    with pytest.raises(LightError, match="two different lights are called 'lamp'; rename one of them"):
        coded_lamps(lamps, 2, 1.0)
    assert len(coded_lamps([lamps[0], lamps[0]], 2, 1.0).lights) == 1


def _chart(change: str, to: str) -> str:
    text = bundled_scene("colorchecker").read_text(encoding="utf-8")
    assert text.count(change) == 1
    return text.replace(change, to)


def test_a_lamp_may_have_a_light_of_its_own() -> None:
    folder = bundled_scene("colorchecker").parent
    sun = 'type = "sun"\n'
    assert parse_scene(_chart(sun, sun), folder).lamps[0].light == ""
    for light in ("LPS", MIXTURE):
        (lamp,) = parse_scene(_chart(sun, f'{sun}light = "{light}"\n'), folder).lamps
        assert lamp.light == light
    for bad, words in (("nope", "no built-in light"), ("0 A + 0 D65", "make no mixture"), ("", "light")):
        with pytest.raises(SceneError, match=rf"'lamps\[0\]\.light' [^\n]*{re.escape(words)}[^\n]*$"):
            parse_scene(_chart(sun, f'{sun}light = "{bad}"\n'), folder)


def test_a_scene_may_offer_mixtures() -> None:
    folder = bundled_scene("colorchecker").parent
    scene = parse_scene(_chart('"D65", "D50", "A",', f'"{MIXTURE}", "D65", "D50", "A",'), folder)
    assert (scene.light, scene.lights[0]) == (MIXTURE, MIXTURE)


ADOPTED = """
format = 1
adopted = true
name = "mine"
lights = ["D65"]
[white]
[camera]
location = [0, -1, 0]
target = [0, 0, 0]
[surfaces.leaf]
reflectance = 0.2
"""


def test_an_adopted_scene_tells_of_surfaces_only() -> None:
    scene = parse_scene(ADOPTED, bundled_scene("colorchecker").parent)
    assert scene.adopted
    assert (scene.lamps, scene.objects, scene.white.object) == ((), (), "")
    assert list(scene.surfaces) == ["leaf"]
    with pytest.raises(SceneError, match=r"'(lamps|objects)' is missing"):
        parse_scene(ADOPTED.replace("adopted = true", "adopted = false"), bundled_scene("colorchecker").parent)
    with pytest.raises(SceneError, match="'adopted' is 1"):
        parse_scene(ADOPTED.replace("adopted = true", "adopted = 1"), bundled_scene("colorchecker").parent)


def test_an_adopted_scene_may_still_have_lamps_of_its_own() -> None:
    text = bundled_scene("colorchecker").read_text(encoding="utf-8").replace("format = 1", "format = 1\nadopted = true")
    scene = parse_scene(text, bundled_scene("colorchecker").parent)
    assert (len(scene.lamps), scene.white.object) == (1, "white")
