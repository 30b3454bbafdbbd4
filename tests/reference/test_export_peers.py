"""Exports of measured displays: Blender's own config in OpenColorIO, and LittleCMS in full precision.

Argyll 2.3 (Debian) reads no ICC v4 profile, and so no profile of ours.
"""

from __future__ import annotations

import sysconfig
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spectral_core.display import DisplayProfile, builtin_profile_names, load_profile
from spectral_core.display.characterising.characterise import characterise
from spectral_core.display.export import export_icc, export_ocio, read_back_ocio, read_back_ocio_xyz
from spectral_core.display.export.icc import D50, adaptation
from spectral_core.display.export.read_back import probe_codes
from spectral_core.display.measuring.measurements import read_measurements
from spectral_core.standards import XYZ_to_Lab, delta_E_2000

MODELS = ("gamma-matrix-black", "gain-offset-gamma", "channel-lut", "grey-lut", "grey-lut-corrected")


@pytest.fixture(scope="module", params=[*builtin_profile_names(), *MODELS])
def profile(request: pytest.FixtureRequest, measured_data: Path) -> DisplayProfile:
    """The built-in ones, and models of a desktop display."""
    if request.param not in MODELS:
        return load_profile(request.param)
    measured = read_measurements(measured_data / "displays/UP2516D_2022-03-20_i1DisplayPro_175patch.ti3")
    return DisplayProfile(request.param, characterise(measured, request.param).chosen.model)


@pytest.fixture(scope="module")
def config() -> Path:
    """Of the bpy package where it is installed; looked up as a file, since the core's tests block bpy."""
    packages = Path(sysconfig.get_paths()["purelib"])
    found = next(packages.glob("bpy/*/datafiles/colormanagement/config.ocio"), None)
    if found is None:
        pytest.skip("no bpy package, and so no OpenColorIO config of Blender")
    return found


def test_blenders_own_config(profile: DisplayProfile, config: Path, tmp_path: Path) -> None:
    """Exact models within half a level of 8 bits; the resampled table where a channel is dark within 5 levels,
    which are 0.05 dE00."""
    exported = export_ocio(profile, tmp_path, config)
    for read in (read_back_ocio(profile, exported), read_back_ocio_xyz(profile, exported)):
        if read.by is None:
            pytest.skip(read.why)  # an OpenColorIO that is older than that of Blender
        assert read.max_code_error is not None
        assert read.max_dE00 is not None
        resampled = profile.name == "grey-lut-corrected"
        assert read.max_code_error < (0.02 if resampled else 0.5 / 255)
        assert read.max_dE00 < (0.05 if resampled else 0.003)


def test_littlecms_in_floats(profile: DisplayProfile, tmp_path: Path) -> None:
    """ICC's matrices and offsets come in steps of 1.5e-5, its tables in 16 bits: 0.06 dE00 backwards; forward
    0.15 at black, of which a step is a large share."""
    imagecodecs: Any = pytest.importorskip("imagecodecs")
    icc, XYZ_icc = export_icc(profile, tmp_path / "a.icc").read_bytes(), imagecodecs.cms_profile("xyz")

    def ask(values: np.ndarray, source: str, target: str) -> np.ndarray:
        profiles = {"rgb": icc, "xyz": XYZ_icc}
        found: np.ndarray = imagecodecs.cms_transform(
            values[:, None], profiles[source], profiles[target], colorspace=source, outcolorspace=target,
            outdtype="float64", intent=1,
        )  # fmt: skip
        return found[:, 0]

    codes = probe_codes()
    XYZ, white = profile.to_XYZ(codes), profile.to_XYZ(np.ones(3))
    to_pcs = adaptation(white) / white[1]
    pcs = XYZ @ to_pcs.T
    lit = codes.min(axis=1) > 0.1
    back = ask(pcs, "xyz", "rgb")
    assert np.abs(back - codes)[lit].max() < 5e-4
    shown = profile.to_XYZ(np.clip(back, 0, 1)) @ to_pcs.T
    assert delta_E_2000(XYZ_to_Lab(shown, D50), XYZ_to_Lab(pcs, D50)).max() < 0.06
    forward = ask(codes, "rgb", "xyz")
    assert np.abs(forward - pcs).max() < 2e-4
    assert delta_E_2000(XYZ_to_Lab(forward, D50), XYZ_to_Lab(pcs, D50)).max() < 0.15
