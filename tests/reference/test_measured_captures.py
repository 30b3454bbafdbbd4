"""ENVI captures of others: pixels against arithmetic on the files' own bytes, and what their headers hide."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from spectral_core.lights import Light
from spectral_core.textures import HyperspectralTexture, Reading, open_texture


@dataclass(frozen=True)
class Capture:
    """A file as its documentation has it, without its header."""

    header: str
    data: str
    dtype: str
    height: int
    width: int
    bands: int
    # Samples between neighbours along (height, width, bands).
    steps: tuple[int, int, int]
    kind: str
    scale: float

    def at(self, data: bytes, y: int, x: int, band: int) -> float:
        """A stored value, by arithmetic on the bytes."""
        index = sum(step * place for step, place in zip(self.steps, (y, x, band), strict=True))
        size = np.dtype(self.dtype).itemsize
        return int.from_bytes(data[index * size : (index + 1) * size], "little", signed=self.dtype == "i2")


CORN = Capture(
    "corn-kernel-hyperspectral.hdr", "corn-kernel-hyperspectral.raw", "u2", 31, 43, 580, (43 * 580, 1, 43), "counts", 1
)
JASPER = Capture(
    "jasperRidge2_R198.hdr", "jasperRidge2_R198.img", "i2", 100, 100, 198, (100 * 198, 1, 100), "reflectance", 10000
)
PIRM = Capture("pirm2018_sample.hdr", "pirm2018_sample.fla", "u2", 240, 480, 14, (480, 1, 240 * 480), "counts", 1)
CAPTURES = [CORN, JASPER, PIRM]


def opened(measured_data: Path, capture: Capture, name: str = "") -> HyperspectralTexture:
    path = measured_data / "hyperspectral" / (name or capture.header)
    if not path.is_file():
        pytest.skip(f"{path.name} is not among the measured data")
    return open_texture(path)


@pytest.mark.parametrize("capture", CAPTURES, ids=lambda capture: capture.data)
def test_pixels_are_those_of_the_bytes(measured_data: Path, capture: Capture) -> None:
    texture = opened(measured_data, capture)
    data = (measured_data / "hyperspectral" / capture.data).read_bytes()
    assert len(data) == capture.height * capture.width * capture.bands * 2
    assert (texture.height, texture.width, texture.bands) == (capture.height, capture.width, capture.bands)
    assert (texture.kind, texture.scale) == (capture.kind, capture.scale)
    stored = texture.samples(0, texture.height)
    assert stored.dtype == np.dtype(capture.dtype)
    random = np.random.default_rng(0)
    corners = [(y, x, b) for y in (0, -1) for x in (0, -1) for b in (0, -1)]
    inside = [tuple(random.integers(size) for size in stored.shape) for _ in range(500)]
    for y, x, band in [*corners, *inside]:
        y, x, band = (place % size for place, size in zip((y, x, band), stored.shape, strict=True))
        assert stored[y, x, band] == capture.at(data, y, x, band)
    # Every sample once: no order of axes but the right one gives these sums over two of them.
    flat = np.frombuffer(data, dtype=f"<{capture.dtype}").astype(np.int64)
    places = sum(
        (step * np.arange(size)).reshape([-1 if axis == own else 1 for own in range(3)])
        for axis, (step, size) in enumerate(zip(capture.steps, stored.shape, strict=True))
    )
    np.testing.assert_array_equal(stored, flat[places])
    np.testing.assert_array_equal(opened(measured_data, capture, capture.data).samples(0, texture.height), stored)


def test_the_corn_kernel_is_counts_that_need_a_white(measured_data: Path) -> None:
    texture = opened(measured_data, CORN)
    assert (texture.wavelengths_nm[0], texture.wavelengths_nm[-1]) == (366.551, 1048.421)
    assert (np.diff(texture.wavelengths_nm) > 0).all()
    assert texture.warnings == ("the header does not say the byte order; little end first is assumed",)
    scaled = open_texture(measured_data / "hyperspectral" / CORN.data, Reading(scale=4095))
    assert (scaled.kind, scaled.scale) == ("reflectance", 4095)
    # One rounding of float32 each for the scale and for the product.
    np.testing.assert_allclose(scaled.rows(7, 1), texture.samples(7, 1) / 4095, rtol=1.2e-7)


def test_jasper_ridge_has_overlapping_detectors_and_negative_values(measured_data: Path) -> None:
    """Reflectance of trees, water, soil and road from the air, as its makers corrected it."""
    texture = opened(measured_data, JASPER)
    nm = texture.wavelengths_nm
    assert (nm.min(), nm.max()) == (399.369995, 2457.23999)
    back = np.flatnonzero(np.diff(nm) < 0)
    assert nm[back].tolist() == [675.619995, 1269.060059]
    assert nm[back + 1].tolist() == [664.140015, 1254.319946]
    assert texture.warnings == (
        "the wavelengths turn back 2 times; every band counts at its own wavelength, whatever the order",
    )
    stored, values = texture.samples(0, 100), texture.rows(0, 100)
    assert (stored < 0).sum() == (values < 0).sum() > 0
    np.testing.assert_allclose(values, stored / 10000, rtol=1.2e-7)
    # The weights take the axis as it is: a white surface is the light's white to rounding.
    factors = Light.builtin("D65").weighting_factors(nm)
    np.testing.assert_allclose(np.ones(198) @ factors.matrix, factors.white_XYZ, rtol=1e-12)
    # Sorting the bands changes nothing but the order of the sum.
    order = np.argsort(nm)
    sorted_factors = Light.builtin("D65").weighting_factors(nm[order]).matrix
    pixel = texture.pixel(50, 50)
    np.testing.assert_allclose(pixel @ factors.matrix, pixel[order] @ sorted_factors, rtol=1e-12)


def test_the_scale_of_0_is_no_scale(measured_data: Path) -> None:
    texture = opened(measured_data, PIRM)
    assert (texture.wavelengths_nm[0], texture.wavelengths_nm[-1]) == (477.247, 617.508)
    assert texture.warnings == (
        "the header does not say the unit of its wavelengths; nanometres by their magnitude",
        "reflectance scale factor 0 is impossible; ignored",
    )
    assert np.isfinite(texture.rows(0, 240)).all()
