"""Shapes: closed, turned outward, of the size asked for, with UVs a texture can live on."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise

import numpy as np
import pytest

from spectral_core.arrays import Float64Array
from spectral_core.shapes import SHAPES, Mesh, build_mesh

SIZE = (0.9, 0.6, 0.45)
SOLIDS = tuple(name for name in SHAPES if name != "plane")
GLOBES = ("sphere", "lemon", "tomato", "apple", "orange")


def _edges(face: tuple[int, ...]) -> list[tuple[int, int]]:
    return list(pairwise([*face, face[0]]))


def _triangles(mesh: Mesh) -> Float64Array:
    """(n, 3, 3) fan of every face."""
    fans = [(face[0], face[i], face[i + 1]) for face in mesh.faces for i in range(1, len(face) - 1)]
    return mesh.vertices[np.array(fans)]


def _volume(mesh: Mesh) -> float:
    a, b, c = _triangles(mesh).transpose(1, 0, 2)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


@pytest.mark.parametrize("shape", SHAPES)
def test_fills_its_bounding_box_and_stands_on_the_floor(shape: str) -> None:
    mesh = build_mesh(shape, SIZE)
    height = 0.0 if shape == "plane" else SIZE[2]
    # Rounding of float64 only.
    np.testing.assert_allclose(mesh.vertices.min(axis=0), [-SIZE[0] / 2, -SIZE[1] / 2, 0], atol=1e-12)
    np.testing.assert_allclose(mesh.vertices.max(axis=0), [SIZE[0] / 2, SIZE[1] / 2, height], atol=1e-12)


@pytest.mark.parametrize("shape", SOLIDS)
def test_is_closed_with_faces_wound_alike(shape: str) -> None:
    """In a closed, consistently wound mesh each edge is walked once in either direction."""
    walked = Counter(edge for face in build_mesh(shape, SIZE).faces for edge in _edges(face))
    assert set(walked.values()) == {1}
    assert all((b, a) in walked for a, b in walked)


@pytest.mark.parametrize("shape", SOLIDS)
def test_is_turned_outward(shape: str) -> None:
    """The signed volume of a closed mesh is positive exactly if its faces look outward."""
    volume = _volume(build_mesh(shape, SIZE))
    assert 0 < volume <= np.prod(SIZE) * (1 + 1e-12)


@pytest.mark.parametrize(
    ("shape", "share"),
    # Share of the bounding box; the sphere's 64 x 96 faces lose 0.2 % of pi / 6.
    [("box", 1.0), ("prism", 0.5), ("pyramid", 1 / 3), ("sphere", np.pi / 6)],
)
def test_volume_is_that_of_the_solid(shape: str, share: float) -> None:
    assert _volume(build_mesh(shape, SIZE)) / np.prod(SIZE) == pytest.approx(share, rel=3e-3)


@pytest.mark.parametrize("shape", SHAPES)
def test_has_one_uv_inside_the_image_per_corner(shape: str) -> None:
    mesh = build_mesh(shape, SIZE)
    assert mesh.uvs.shape == (sum(len(face) for face in mesh.faces), 2)
    assert mesh.uvs.min() >= 0
    assert mesh.uvs.max() <= 1


@pytest.mark.parametrize("shape", SHAPES)
def test_faces_have_no_repeated_corner_and_no_stray_vertex(shape: str) -> None:
    mesh = build_mesh(shape, SIZE)
    assert all(len(set(face)) == len(face) >= 3 for face in mesh.faces)
    assert {index for face in mesh.faces for index in face} == set(range(len(mesh.vertices)))


@pytest.mark.parametrize("shape", GLOBES)
def test_globe_has_no_seam_in_its_vertices_nor_a_face_across_the_map(shape: str) -> None:
    """No two vertices coincide (normals run on across the seam), and no face spans more than one
    segment in u (a face that ran back across the map would show the whole texture squeezed)."""
    mesh = build_mesh(shape, SIZE)
    assert mesh.smooth
    assert len(np.unique(mesh.vertices.round(9), axis=0)) == len(mesh.vertices)
    first = 0
    for face in mesh.faces:
        u = mesh.uvs[first : first + len(face), 0]
        assert np.ptp(u) <= 1 / 96 + 1e-12
        first += len(face)


@pytest.mark.parametrize("shape", GLOBES)
def test_poles_stay_inside_the_image(shape: str) -> None:
    """Half a pixel of 256 rows, so that a repeating image never blends its top and bottom rows."""
    v = build_mesh(shape, SIZE).uvs[:, 1]
    assert v.min() == pytest.approx(0.5 / 256)
    assert v.max() == pytest.approx(1 - 0.5 / 256)


def test_upper_pole_of_the_map_is_the_stem() -> None:
    """v = 1 is up on a standing fruit and at +x on the lying lemon: textures rely on it."""
    for shape, axis in (("apple", 2), ("lemon", 0)):
        mesh = build_mesh(shape, SIZE)
        corners = np.concatenate([np.array(face) for face in mesh.faces])
        upper = mesh.vertices[corners[mesh.uvs[:, 1] > 0.9], axis].mean()
        lower = mesh.vertices[corners[mesh.uvs[:, 1] < 0.1], axis].mean()
        assert upper > lower


def test_apple_and_tomato_have_a_dimple_for_the_stem() -> None:
    for shape in ("apple", "tomato"):
        top = build_mesh(shape, SIZE).vertices[-1]
        assert 0.5 * SIZE[2] < top[2] < 0.95 * SIZE[2]
        assert np.hypot(top[0], top[1]) < 0.1 * SIZE[1]
