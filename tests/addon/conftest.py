"""The add-on on the bpy wheel: a fresh, empty file for every test."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
import pytest

import blender_addon
from spectral_core.arrays import frozen
from spectral_core.display import DisplayProfile

sys.path.append(str(Path(__file__).parents[1] / "core"))
import displays

FAILED = Path("out") / "failed"


@pytest.fixture(scope="session", autouse=True)
def registered() -> Iterator[None]:
    """The add-on, for the whole session."""
    blender_addon.register()
    yield
    blender_addon.unregister()


@pytest.fixture(autouse=True)
def empty_file(request: pytest.FixtureRequest) -> Iterator[None]:
    """An empty file; what a failed test leaves in it is saved to look at."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    failed = request.session.testsfailed
    yield
    if request.session.testsfailed > failed:
        FAILED.mkdir(parents=True, exist_ok=True)
        name = re.sub(r"\W+", "_", request.node.name)
        bpy.ops.wm.save_as_mainfile(filepath=str((FAILED / f"{name}.blend").resolve()), copy=True)


def _shrunk(text: str) -> str:
    """A scene description with a tiny render: the renderer runs in software."""
    for key, value in (("width", 160), ("height", 120), ("samples", 1)):
        text, count = re.subn(rf"^{key} = \d+$", f"{key} = {value}", text, flags=re.MULTILINE)
        assert count == 1, key
    return text


@pytest.fixture(scope="session")
def shrunk() -> Callable[[str], str]:
    """Makes the render of a scene description tiny."""
    return _shrunk


@pytest.fixture
def chart_toml(tmp_path: Path) -> Path:
    """The ColorChecker with a tiny render."""
    from spectral_core.scene import bundled_scene

    path = tmp_path / "chart.toml"
    path.write_text(_shrunk(bundled_scene("colorchecker").read_text(encoding="utf-8")), encoding="utf-8")
    return path


@pytest.fixture
def chart(chart_toml: Path) -> bpy.types.Scene:
    """The ColorChecker, built but not calibrated: one sun of unit irradiance needs none."""
    assert bpy.ops.spectral_booth.build(filepath=str(chart_toml), calibrate=False) == {"FINISHED"}
    return bpy.context.scene


@pytest.fixture
def textured_toml(chart_toml: Path, tmp_path: Path) -> Path:
    """The ColorChecker's scene with a panel before it that shows a small hyperspectral texture.

    Its reflectance is linear along both sides, which bilinear filtering keeps exactly, and turns
    from red on the left to blue on the right.
    """
    x = np.linspace(0.0, 1.0, 16)[None, :, None]
    y = np.linspace(0.0, 1.0, 8)[:, None, None]
    long = np.linspace(0.0, 1.0, 36)
    np.savez(
        tmp_path / "panel.npz",
        reflectance=(0.1 + 0.4 * y + 0.4 * (x * (1 - long) + (1 - x) * long)).astype(np.float32),
        wavelengths_nm=np.linspace(380.0, 730.0, 36),
    )
    path = tmp_path / "textured.toml"
    path.write_text(
        chart_toml.read_text(encoding="utf-8")
        + '[surfaces.panel]\ntexture = "panel.npz"\n'
        + '[[objects]]\nname = "panel"\nshape = "plane"\nlocation = [0.0, 0.02, 0.01]\n'
        + 'size = [0.28, 0.18, 0.0]\nsurface = "panel"\n',
        encoding="utf-8",
    )
    return path


@pytest.fixture
def textured(textured_toml: Path) -> bpy.types.Scene:
    """The scene with the texture, not calibrated."""
    assert bpy.ops.spectral_booth.build(filepath=str(textured_toml), calibrate=False) == {"FINISHED"}
    return bpy.context.scene


@pytest.fixture(scope="session")
def simulated_profile() -> Callable[[str], DisplayProfile]:
    """A profile of a kind of model, fitted to a simulated headset; any other name is a built-in one."""
    from spectral_core.display import load_profile
    from spectral_core.display.models.fitting import MODEL_KINDS

    def profile(name: str) -> DisplayProfile:
        kinds = {kind.name: kind for kind in MODEL_KINDS}
        if name not in kinds:
            return load_profile(name)
        measured = displays.measure(displays.power_limited, displays.published_protocol(), seed=1)
        measured = replace(measured, XYZ=frozen(measured.XYZ / measured.white_XYZ[1]))
        return DisplayProfile(name, kinds[name].fit(measured))

    return profile
