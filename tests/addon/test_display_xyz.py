"""Pixels that are XYZ, through the exported config's view of XYZ: the codes that Blender makes of them."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
import pytest

import blender_addon
from blender_addon.bridge.display import config_path
from spectral_core import standards
from spectral_core.display import DisplayProfile, load_profile
from spectral_core.display.export import export_ocio
from spectral_core.lights import Light

Simulated = Callable[[str], DisplayProfile]
_SIZE = 32
# Eevee's film holds half floats, of 11 binary digits: the last is lost at most.
_FILM = 2.0**-10
# Rounding of a 16-bit PNG, in levels of 8 bits.
_PNG16 = 255 * 0.5 / 65535


@dataclass(frozen=True)
class Shown:
    """What Blender rendered of XYZ (n, 3): scene-linear pixels, and codes on the profile's display and on sRGB's."""

    linear: np.ndarray
    codes: np.ndarray
    plain: np.ndarray


def _surfaces() -> np.ndarray:
    """XYZ (n, 3) at white luminance 0.6 of the ColorChecker and of CIE 224's samples under D65, A and FL11."""
    reflectances = [standards.colorchecker()[1:], standards.fidelity_samples()]
    lights = [Light.builtin(name) for name in ("D65", "A", "FL11")]
    return 0.6 * np.concatenate(
        [values @ light.weighting_factors(nm).matrix for nm, values in reflectances for light in lights]
    )


def _asked(profile: DisplayProfile) -> np.ndarray:
    """XYZ (_SIZE², 3): surfaces, saturated colours of any display and brighter ones, and the profile's own gamut."""
    saturated = np.array([[3.0, 0.1, 8.0], [0.9, 0.2, 0.01], [0.05, 0.7, 0.1], [0.2, 0.05, 1.2], [8.0, 9.0, 3.0]])
    asked = np.concatenate([_surfaces(), saturated])
    codes = np.random.default_rng(0).uniform(0.0, 1.0, (_SIZE**2 - len(asked), 3))
    return np.concatenate([asked, np.maximum(profile.to_XYZ(codes), 0.0)])


def _render(profile: DisplayProfile, XYZ: np.ndarray, folder: Path) -> Shown:
    exported = export_ocio(profile, folder / "ocio", config_path())
    np.save(folder / "XYZ.npy", np.float32(XYZ).reshape(_SIZE, _SIZE, 3))
    script = Path(__file__).with_name("emitted_xyz.py")
    sources = os.pathsep.join([str(Path(blender_addon.__file__).parents[1]), os.environ.get("PYTHONPATH", "")])
    environment = {**os.environ, "OCIO": str(exported.config), "PYTHONPATH": sources}
    views = [f"{display}={exported.xyz_view}" for display in (exported.display, "sRGB")]
    done = subprocess.run(
        [sys.executable, str(script), str(folder), *views], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert (folder / "version").read_text() == bpy.app.version_string
    names = "linear", exported.display, "sRGB"
    return Shown(*(np.load(folder / f"{name}.npy").reshape(-1, 3).astype(np.float64) for name in names))


def _clipped(profile: DisplayProfile, XYZ: np.ndarray) -> np.ndarray:
    return np.clip(profile.to_codes(XYZ), 0.0, 1.0)


def _film_error(profile: DisplayProfile, XYZ: np.ndarray) -> np.ndarray:
    """How far codes (n, 3) may be off because the film holds X, Y and Z in half floats."""
    signs = np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3, indexing="ij"), axis=-1).reshape(-1, 1, 3)
    return np.abs(_clipped(profile, XYZ * (1 + _FILM * signs)) - _clipped(profile, XYZ)).max(axis=0)


@pytest.mark.parametrize(
    ("name", "darkest", "limit"),
    [
        # OpenColorIO's 32-bit floats give 0.01 of a level; 0.1 is asked for.
        ("htc-vive-2021", 0.0, 0.1),
        ("channel-lut", 0.0, 0.1),
        # Below its threshold (0.16) all codes are black, and which of them is sent says nothing.
        ("gain-offset-gamma", 0.2, 0.1),
        # Its 3-D table is sampled anew, which is coarse where a channel is dark.
        ("channel-lut-corrected", 0.1, 0.3),
    ],
)
def test_xyz_reaches_both_displays(
    name: str, darkest: float, limit: float, simulated_profile: Simulated, tmp_path: Path
) -> None:
    """Against codes of the pixels as the film holds them, and of XYZ as asked for, where half floats may add theirs.

    Those are some levels where a channel is dark and its drive a difference of large numbers.
    """
    profile = simulated_profile(name)
    XYZ = _asked(profile)
    shown = _render(profile, XYZ, tmp_path)
    # The software renderer cuts digits off: always darker. Others round.
    np.testing.assert_allclose(shown.linear, XYZ, rtol=1.001 * _FILM, atol=1e-6)
    for display, from_code, most, codes in (
        (profile, darkest, limit, shown.codes),
        (load_profile("sRGB"), 0.0, 0.1, shown.plain),
    ):
        most += _PNG16
        own, theory = _clipped(display, shown.linear), _clipped(display, XYZ)
        # Models that are no formula say nothing of codes outside 0..1.
        wanted = display.to_codes(XYZ)
        told = ((wanted >= from_code) & (wanted <= 1)).all(axis=1) | (from_code == 0)
        errors = 255 * np.abs(codes - own)[told]
        from_theory = 255 * np.abs(codes - theory)[told]
        beyond = from_theory - 255 * _film_error(display, XYZ)[told]
        print(
            f"{bpy.app.version_string} {name} on {display.name}: {int(told.sum())} colours, "
            f"display {errors.max():.4f}, with the film {from_theory.max():.3f} (mean {from_theory.mean():.3f}), "
            f"more than half floats do {beyond.max():.4f}"
        )
        assert errors.max() < most
        assert beyond.max() < most
        # What the guide says of real surfaces, from half floats alone.
        assert (255 * np.abs(codes - theory)[: len(_surfaces())]).max() < 0.2
    outside = (XYZ @ np.linalg.inv(standards.srgb_to_XYZ_matrix()).T).min(axis=1) < -0.01
    codes = profile.to_codes(XYZ)
    assert (outside & ((codes >= darkest) & (codes <= 1)).all(axis=1)).sum() > 50
