"""What a basis does to 8-bit codes: dE00 hardly sees where sRGB's curve is steep, codes do."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.basis.spectral_basis import SpectralBasis
from spectral_core.display import srgb, srgb_encode


@dataclass(frozen=True)
class CodeTolerance:
    """Largest difference, in 8-bit levels of sRGB, where the perfect diffuser has a luminance (scene white = 1)."""

    levels: float
    luminance: float

    def holds(self, basis: SpectralBasis, samples: Float64Array) -> bool:
        """Whether a basis shows samples (n, L, 3) within it under all its lights."""
        return code_difference(basis, samples, self.luminance) <= self.levels


def code_difference(basis: SpectralBasis, samples: Float64Array, luminance: float) -> float:
    """Largest difference of samples (n, L, 3) in 8-bit levels of sRGB before rounding, clipped on both sides."""
    shown = basis.XYZ(basis.coefficients(samples))
    codes = [255 * srgb_encode(np.clip(srgb().to_linear(each) * luminance, 0, 1)) for each in (shown, samples)]
    return float(np.abs(codes[0] - codes[1]).max(initial=0.0))
