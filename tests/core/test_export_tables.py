"""Profiles as .cube and ICC files."""

from __future__ import annotations

import hashlib
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from spectral_core import standards
from spectral_core.display import DisplayProfile, load_profile, srgb_decode
from spectral_core.display.export import export_cube, export_icc, read_back_cube, read_back_icc
from spectral_core.display.export.icc import adaptation


def read_cube(path: Path) -> np.ndarray:
    """Rows (n, 3) of a .cube file, by the format's own words."""
    lines = [line for line in path.read_text().splitlines() if line and line[0] not in "#LDT"]
    return np.array([[float(cell) for cell in line.split()] for line in lines])


@pytest.mark.parametrize("read_as", ["srgb", "linear"])
def test_cube_holds_the_codes(profile: DisplayProfile, tmp_path: Path, read_as: str) -> None:
    """At nodes to the file's seven decimals; between them linear input is far worse near black."""
    path = export_cube(profile, tmp_path / "a.cube", read_as)  # type: ignore[arg-type]
    rows = read_cube(path)
    assert len(rows) == 65**3
    for r, g, b in ((0, 0, 0), (64, 64, 64), (40, 20, 31), (3, 60, 12)):
        asked = np.array([r, g, b]) / 64
        XYZ = standards.srgb_to_XYZ_matrix() @ (srgb_decode(asked) if read_as == "srgb" else asked)
        np.testing.assert_allclose(rows[r + 65 * g + 65**2 * b], np.clip(profile.to_codes(XYZ), 0, 1), atol=6e-8)
    read = read_back_cube(profile, path, read_as)  # type: ignore[arg-type]
    assert read.max_code_error is not None, read.why
    assert read.max_code_error < (0.04 if read_as == "srgb" else 0.1)
    assert f"{'sRGB-encoded' if read_as == 'srgb' else 'linear'} RGB" in path.read_text()


def test_srgb_to_srgb_is_the_identity_cube(tmp_path: Path) -> None:
    profile = load_profile("sRGB")
    read = read_back_cube(profile, export_cube(profile, tmp_path / "a.cube"), "srgb")
    assert read.max_code_error == pytest.approx(0, abs=1e-6)


def icc_tags(data: bytes) -> dict[str, bytes]:
    count = struct.unpack(">I", data[128:132])[0]
    entries = [struct.unpack(">4sII", data[132 + 12 * i : 144 + 12 * i]) for i in range(count)]
    return {name.decode(): data[start : start + size] for name, start, size in entries}


def test_icc_header_and_tags(profile: DisplayProfile, tmp_path: Path) -> None:
    """ICC.1:2010-12: sizes, alignment, the profile's ID, and primaries that sum to D50."""
    data = export_icc(replace(profile, white_luminance_cd_m2=120.0), tmp_path / "a.icc").read_bytes()
    assert struct.unpack(">I", data[:4])[0] == len(data)
    assert data[8:24] == b"\x04\x30\0\0mntrRGB XYZ "
    assert data[36:40] == b"acsp"
    without = data[:44] + bytes(4) + data[48:64] + bytes(4) + data[68:84] + bytes(16) + data[100:]
    assert data[84:100] == hashlib.md5(without, usedforsecurity=False).digest()
    tags = icc_tags(data)
    assert all(struct.unpack(">I", data[136 + 12 * i : 140 + 12 * i])[0] % 4 == 0 for i in range(len(tags)))
    numbers = {
        name: np.frombuffer(tag[8:], ">i4") / 65536 for name, tag in tags.items() if tag[:4] in (b"XYZ ", b"sf32")
    }
    D50 = [0.9642, 1.0, 0.8249]
    np.testing.assert_allclose(numbers["rXYZ"] + numbers["gXYZ"] + numbers["bXYZ"], D50, atol=4e-5)
    np.testing.assert_allclose(numbers["wtpt"], D50, atol=1e-5)
    white = profile.to_XYZ(np.ones(3))
    np.testing.assert_allclose(numbers["lumi"], [0, 120 * white[1], 0], atol=1e-5)
    np.testing.assert_allclose(numbers["chad"].reshape(3, 3) @ white / white[1], D50, atol=4e-5)
    assert tags["A2B0"] == tags["A2B1"]
    assert "lumi" not in icc_tags(export_icc(profile, tmp_path / "b.icc").read_bytes())


def test_adaptation_is_bradford() -> None:
    """D65 to D50 as published (Lindbloom), whose D50 has Z = 0.8252 where ICC's has 0.8249."""
    published = [[1.0478, 0.0229, -0.0501], [0.0295, 0.9905, -0.0171], [-0.0092, 0.0150, 0.7521]]
    np.testing.assert_allclose(adaptation(np.array([0.95047, 1.0, 1.08883])), published, atol=3e-4)


def test_icc_read_by_littlecms(profile: DisplayProfile, tmp_path: Path) -> None:
    """LittleCMS rounds to 8 bits (0.002). Where a curve is steep at black, a matrix in ICC's numbers
    of 1.5e-5 adds up to 0.05 that no eye sees: dE00 is that of 8 bits."""
    pytest.importorskip("PIL.ImageCms")
    read = read_back_icc(profile, export_icc(profile, tmp_path / "a.icc"))
    assert read.by is not None
    assert read.by.startswith("LittleCMS")
    assert read.max_code_error is not None
    assert read.max_code_error < (0.0021 if profile.name == "sRGB" else 0.05)
    assert read.max_dE00 is not None
    assert read.max_dE00 < 1.6
    assert read.colours > 3000
