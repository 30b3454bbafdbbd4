"""The light booth: what it must hold, at true scale, nothing inside anything else."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from spectral_core.arrays import Float64Array
from spectral_core.scene import SceneDescription, SceneObject, load_scene
from spectral_core.shapes import build_mesh, rotation_matrix
from spectral_core.surfaces import scene_surfaces

BOOTH = Path(__file__).parents[2] / "blend_scenes" / "booth.toml"
WALLS = ("floor", "back", "left", "right", "top", "front", "table")
# A stalk stands in its fruit, and a stand touches what it holds.
PARTS = ("apple stem", "tomato calyx", "chart stand", "white stand")


@pytest.fixture(scope="module")
def booth() -> SceneDescription:
    return load_scene(BOOTH)


def _world(item: SceneObject) -> Float64Array:
    vertices = build_mesh(item.shape, item.size).vertices
    return vertices @ rotation_matrix(item.rotation_deg).T + np.asarray(item.location)


def test_has_twelve_leds_the_white_the_chart_fruit_and_solids(booth: SceneDescription) -> None:
    assert sum(lamp.name.startswith("LED") for lamp in booth.lamps) == len(booth.lamps) == 12
    names = {item.name for item in booth.objects}
    assert {"white", "lemon", "tomato", "apple", "orange"} <= names
    assert {"green cube", "yellow sphere", "red prism", "blue pyramid"} <= names
    assert sum(item.surface.startswith("colorchecker ") for item in booth.objects) == 24


def test_white_is_the_perfect_diffuser_in_all_but_a_thousandth(booth: SceneDescription) -> None:
    assert booth.white.object == "white"
    assert booth.surfaces["white"].constant == 0.999


def test_every_surface_resolves(booth: SceneDescription) -> None:
    surfaces = scene_surfaces(booth)
    assert {item.surface for item in booth.objects} <= set(surfaces)
    assert sum(not surface.uniform for surface in surfaces.values()) == 4


def test_all_objects_stand_inside_the_booth(booth: SceneDescription) -> None:
    """Inside 1.0 x 0.6 x 0.75 m and not in the floor (0.1 mm: rounding of the written locations)."""
    for item in booth.objects:
        if item.name not in WALLS:
            points = _world(item)
            assert (points.min(axis=0) > [-0.5, -0.3, -1e-4]).all(), item.name
            assert (points.max(axis=0) < [0.5, 0.3, 0.75]).all(), item.name


def test_objects_keep_their_distance(booth: SceneDescription) -> None:
    """Footprints, as boxes along x and y, never overlap."""
    standing = [
        item for item in booth.objects if item.name not in WALLS + PARTS and not item.surface.startswith("colorc")
    ]
    for one, other in combinations(standing, 2):
        a, b = _world(one)[:, :2], _world(other)[:, :2]
        apart = (a.min(axis=0) > b.max(axis=0)) | (b.min(axis=0) > a.max(axis=0))
        assert apart.any(), f"{one.name} and {other.name}"
