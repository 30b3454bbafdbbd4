"""A basis and all textures of a scene encoded with it, so that a tolerance holds for every pixel as it is stored."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from itertools import count

import numpy as np

from spectral_core.arrays import FloatArray
from spectral_core.basis.codes import CodeTolerance
from spectral_core.basis.encoding import PackedTexture, encoding_steps
from spectral_core.basis.fitting import choose_basis, fit_basis
from spectral_core.basis.samples import texture_samples
from spectral_core.basis.spectral_basis import SpectralBasis, check_lights
from spectral_core.errors import SpectrumError
from spectral_core.lights import Light
from spectral_core.standards import DEFAULT_OBSERVER
from spectral_core.steps import finished
from spectral_core.textures import HyperspectralTexture

# What the first basis may use of the tolerance: pixels that were not looked at need the rest, and so do half floats,
# with about this dE00.
_FIRST_SHARE = 0.9
_HALF_FLOATS = 0.03
# Pixels of each texture to begin with: the more, the fewer rounds over all pixels, which take longest by far.
_PIXELS = 500
# Rounds in which the worst pixels join the samples; after them a coefficient is added in each.
_ROUNDS = 4


@dataclass(frozen=True, eq=False)
class Packed:
    """A basis, the textures encoded with it, in their order, and the samples (n, L, 3) it was fitted to in the end."""

    basis: SpectralBasis
    textures: tuple[PackedTexture, ...]
    samples: FloatArray


def choose_for_textures(
    textures: Sequence[HyperspectralTexture],
    lights: Sequence[Light],
    tolerance_dE00: float,
    others: FloatArray | None = None,
    half: bool = True,
    observer: str = DEFAULT_OBSERVER,
    progress: Callable[[float, str], None] | None = None,
    codes: CodeTolerance | None = None,
) -> Packed:
    """The basis with the fewest coefficients that was found whose every pixel, as stored, is within a tolerance.

    Parameters
    ----------
    textures
        Reflectance.
    lights
        (L,).
    tolerance_dE00
        Largest dE00 under any light.
    others
        (n, L, 3), XYZ of uniform surfaces that are to be within it as well.
    half
        Whether coefficients are half floats.
    observer
        That all XYZ are of.
    progress
        Told of the fraction that is done of the present round.
    codes
        What samples shall hold as well: coefficients are added until they do.

    Raises
    ------
    SpectrumError, LightError, TextureError
        If the input cannot be used, or half floats round more than the tolerance.
    """
    steps = packing_steps(textures, lights, tolerance_dE00, others, half, observer, codes)
    return finished(steps, progress and (lambda step: progress(*step)))


def packing_steps(
    textures: Sequence[HyperspectralTexture],
    lights: Sequence[Light],
    tolerance_dE00: float,
    others: FloatArray | None = None,
    half: bool = True,
    observer: str = DEFAULT_OBSERVER,
    codes: CodeTolerance | None = None,
) -> Generator[tuple[float, str], None, Packed]:
    """The same a step at a time: yields the fraction of this round that is done, and what is being done."""
    check_lights(lights, observer)
    parts = [texture_samples(texture, lights, observer, _PIXELS) for texture in textures]
    samples = np.concatenate([*parts, np.zeros((0, len(lights), 3)) if others is None else others])
    smallest = 3
    target = max(tolerance_dE00 / 2, _FIRST_SHARE * tolerance_dE00 - (_HALF_FLOATS if half else 0.0))
    for attempt in count(1):
        yield 0.0, "fitting a spectral basis"
        basis = choose_basis(samples, lights, target, observer, smallest)
        while codes is not None and 3 * len(lights) > basis.K and not codes.holds(basis, samples):
            basis = fit_basis(samples, lights, basis.K + 1, observer)
        packed = yield from _encoding_all(textures, basis, half)
        largest = max((each.largest_error for each in packed), default=0.0)
        if largest <= tolerance_dE00:
            return Packed(basis, tuple(packed), samples)
        worst = np.concatenate([each.worst for each in packed if each.largest_error > tolerance_dE00])
        unrounded = max(each.max for each in basis.measure(worst))
        if 3 * len(lights) == basis.K or unrounded < largest / 2:
            raise SpectrumError(
                f"{'half' if half else 'single'} floats alone cost dE00 {largest:.2g}, above the tolerance of "
                f"{tolerance_dE00:g}",
                remedy=f"allow dE00 {1.2 * largest:.2g}" + (", or use single floats" if half else ""),
            )
        samples = np.concatenate([samples, worst])
        # Pixels nobody looked at are worse than samples by about this much again.
        target *= max(0.5, min(0.9, tolerance_dE00 / largest))
        smallest = basis.K if attempt < _ROUNDS else basis.K + 1
    raise AssertionError("K = 3 L ends it")


def _encoding_all(
    textures: Sequence[HyperspectralTexture], basis: SpectralBasis, half: bool
) -> Generator[tuple[float, str], None, list[PackedTexture]]:
    """All textures, a step at a time."""
    packed = []
    for index, texture in enumerate(textures):
        steps = encoding_steps(texture, basis, half)
        while True:
            try:
                fraction = next(steps)
            except StopIteration as end:
                packed.append(end.value)
                break
            yield (index + fraction) / len(textures), f"encoding {texture.name}"
    return packed
