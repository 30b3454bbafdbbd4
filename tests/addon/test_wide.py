"""Colours that Rec.709 cannot hold, from coded lamps through an exported display's view of XYZ to its codes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np
import pytest

import blender_addon
from blender_addon.bridge.display import config_path
from spectral_core import standards
from spectral_core.cli import main
from spectral_core.display import load_profile, srgb
from spectral_core.display.export import export_ocio
from spectral_core.lights import Light
from spectral_core.spectra import write_spectra

Operators = bpy.ops.spectral_booth
_PROFILE = "htc-vive-2021"
# Scene white: at that level this display holds both colours.
_WHITE = 0.6
# Number 58 of the CIE 224 samples, a saturated green-blue.
_SAMPLE = 57
# Half a level of 8 bits: what is right and what is sent round to the same code or the next one.
_LIMIT = 0.5


@pytest.fixture
def wide(chart_toml: Path, tmp_path: Path) -> Path:
    """The chart and the CIE sample, lit by coded lamps, as a file whose surfaces emit XYZ."""
    nm, reflectances = standards.fidelity_samples()
    write_spectra(tmp_path / "sample.csv", nm, reflectances[_SAMPLE][None], ("sample",))
    text = chart_toml.read_text(encoding="utf-8").replace("luminance = 0.85", f"luminance = {_WHITE}")
    chart_toml.write_text(
        text
        + '[surfaces.sample]\nfile = "sample.csv"\n[[objects]]\nname = "sample"\nshape = "plane"\n'
        + 'location = [0.0, 0.125, 0.004]\nsize = [0.3, 0.02, 0.0]\nsurface = "sample"\n',
        encoding="utf-8",
    )
    assert Operators.build(filepath=str(chart_toml), calibrate=False) == {"FINISHED"}
    assert Operators.set_way(way="CODED", target="WIDE") == {"FINISHED"}
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "wide.blend"))
    return tmp_path / "wide.blend"


def _exact() -> dict[str, np.ndarray]:
    """XYZ by the objects' names, from spectra alone."""
    light, colours = Light.builtin("D65"), {}
    nm, reflectances = standards.fidelity_samples()
    colours["sample"] = reflectances[_SAMPLE] @ light.weighting_factors(nm).matrix
    names, nm, reflectances = standards.colorchecker()
    cyan = names.index("cyan")
    colours[f"chart {cyan + 1:02d}"] = reflectances[cyan] @ light.weighting_factors(nm).matrix
    return {name: _WHITE * XYZ for name, XYZ in colours.items()}


def test_colours_outside_rec709_reach_the_display(wide: Path, tmp_path: Path) -> None:
    profile, exact = load_profile(_PROFILE), _exact()
    exported = export_ocio(profile, tmp_path / "ocio", config_path())
    sources = os.pathsep.join([str(Path(blender_addon.__file__).parents[1]), os.environ.get("PYTHONPATH", "")])
    script, result = Path(__file__).with_name("shown_wide.py"), tmp_path / "result.json"
    done = subprocess.run(
        [sys.executable, str(script), str(wide), exported.display, str(result)],
        env={**os.environ, "OCIO": str(exported.config), "PYTHONPATH": sources},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    shown = json.loads(result.read_text(encoding="utf-8"))
    assert shown["blender"] == bpy.app.version_string
    for name, XYZ in exact.items():
        assert srgb().to_linear(XYZ).min() < -0.01  # Rec.709 does not hold it,
        codes = profile.to_codes(XYZ)
        assert (codes >= 0).all()  # and the display does
        assert (codes <= 1).all()
        difference = 255 * np.abs(np.array(shown["codes"][name]) - codes).max()
        # What would be sent had Rec.709 clipped it.
        clipped = profile.to_codes(np.maximum(srgb().to_linear(XYZ), 0) @ standards.srgb_to_XYZ_matrix().T)
        print(name, difference, 255 * np.abs(clipped - codes).max())
        assert difference <= _LIMIT
        assert 255 * np.abs(np.clip(clipped, 0, 1) - codes).max() > _LIMIT


def test_verify_uses_the_view_of_xyz_for_coded_lamps(wide: Path, capfd: pytest.CaptureFixture) -> None:
    capfd.readouterr()
    assert main(["verify", str(wide), "--light", "D65", "--profile", _PROFILE, "--json"]) == 0
    document = json.loads(capfd.readouterr().out)
    assert document["view"] == "Spectral XYZ"
    (light,) = document["lights"]
    print(light)
    assert light["lost"] == []
    assert (light["patches"], light["in_gamut"]) == (24, 24)
    assert light["codes8"]["max"] <= 0.1  # as of test_display_xyz
    assert light["theory8"]["max"] <= _LIMIT
