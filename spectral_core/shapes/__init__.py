"""Geometry of the scene's shapes as arrays. Each stands on z = 0, centred on x = y = 0; metres."""

from __future__ import annotations

from collections.abc import Callable

from spectral_core.shapes.fruit import apple, calyx, lemon, orange, stem, tomato
from spectral_core.shapes.mesh import Mesh, Size, rotation_matrix
from spectral_core.shapes.revolution import capsule, sphere
from spectral_core.shapes.solids import box, cube, plane, prism, pyramid

__all__ = ["SHAPES", "Mesh", "Size", "build_mesh", "rotation_matrix"]

SHAPES: dict[str, Callable[[Size], Mesh]] = {
    "plane": plane,
    "box": box,
    "cube": cube,
    "prism": prism,
    "pyramid": pyramid,
    "sphere": sphere,
    "capsule": capsule,
    "lemon": lemon,
    "tomato": tomato,
    "apple": apple,
    "orange": orange,
    "stem": stem,
    "calyx": calyx,
}


def build_mesh(shape: str, size: Size) -> Mesh:
    """The mesh of a shape with bounding box `size` (x, y, z)."""
    return SHAPES[shape](size)
