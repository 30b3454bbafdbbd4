"""The published figures, from the spectra alone (rendered pixels: the add-on's tests)."""

from __future__ import annotations

import csv
from importlib import resources

import numpy as np
import pytest

from spectral_core import standards
from spectral_core.display import srgb, srgb_encode
from spectral_core.lighting import make_lighting
from spectral_core.lights import Light
from spectral_core.scene import SurfaceSource
from spectral_core.surfaces import Surface, resolve_surface
from spectral_core.verification import PatchReading, compare

NAMES = standards.colorchecker()[0]
D65 = Light.builtin("D65")


@pytest.fixture(scope="module")
def patches(tmp_path_factory: pytest.TempPathFactory) -> list[Surface]:
    folder = tmp_path_factory.mktemp("none")
    return [resolve_surface(SurfaceSource(name, "colorchecker", name, "", 0.0, 0.0, 0.4), folder) for name in NAMES]


def test_hyperspectral_chart_under_d65(patches: list[Surface]) -> None:
    """Diaz-Barrancas et al. 2020, Table 2: their capture's RGB; 1 level per channel on average."""
    table = resources.files("spectral_core").joinpath("data/colorchecker_srgb_d65.csv").read_text()
    published = [[float(row[f"hyperspectral_{c}"]) for c in "RGB"] for row in csv.DictReader(table.splitlines())]
    ours = [np.clip(255 * srgb_encode(srgb().to_linear(patch.XYZ(D65))), 0, 255) for patch in patches]
    assert (np.abs(np.array(ours) - published).mean(axis=0) <= 1.0).all()


@pytest.mark.parametrize(
    ("light", "low", "high"),
    [
        ("D65", (2.6, 0.9, 1.5), (3.6, 1.9, 2.5)),
        ("D50", (2.6, 1.2, 4.1), (3.6, 2.2, 5.1)),
        ("two-peaks-d65", (25, 0, 0), (40, 99, 99)),
    ],
)
def test_level_1_differs_from_theory_as_published(
    patches: list[Surface], light: str, low: tuple[float, ...], high: tuple[float, ...]
) -> None:
    """Diaz-Barrancas et al. 2020, Table 4: D65 3.1 1.4 2.0, D50 3.1 1.7 4.6, two peaks 30 in red.

    Half a level either way: their figures come from rounded screen captures.
    """
    lighting = make_lighting(Light.builtin(light), 1, 0.85)
    readings = [
        PatchReading(p.name, p.name, lighting.material_rgb(p, D65) * lighting.lamp_rgb, 1.0,
                     lighting.material_rgb(p, D65), lighting.exact_rgb(p))
        for p in patches
    ]  # fmt: skip
    means = [compare(readings, lighting).rgb8[channel].mean for channel in "RGB"]
    assert all(a <= mean <= b for a, mean, b in zip(low, means, high, strict=True)), means


@pytest.mark.parametrize("light", ["D65", "A", "FL11", "HP1", "LPS", "two-peaks-d65"])
def test_lamp_times_material_is_exact_at_level_2(patches: list[Surface], light: str) -> None:
    """Also where the lamp has no blue and the light is folded into the materials."""
    lighting = make_lighting(Light.builtin(light), 2, 0.85)
    assert (lighting.lamp_rgb >= 0).all()
    for patch in patches:
        product = lighting.material_rgb(patch, D65) * lighting.lamp_rgb
        np.testing.assert_allclose(product, lighting.exact_rgb(patch), rtol=1e-12, atol=1e-15)


def test_only_lights_without_a_channel_are_folded() -> None:
    folded = {
        name
        for name in ("D65", "D50", "A", "FL11", "LED-B3", "HP1", "LPS")
        if make_lighting(Light.builtin(name), 2, 1).folded
    }
    assert folded == {"HP1", "LPS"}
    assert "lamps are neutral" in make_lighting(Light.builtin("LPS"), 2, 1).notes[0]
