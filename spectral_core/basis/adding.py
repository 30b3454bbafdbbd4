"""A light that comes later: its colours from the coefficients that are stored already."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spectral_core.arrays import Float64Array, FloatArray, frozen
from spectral_core.baking import level2_weights, project
from spectral_core.baking.dead_bands import without_dead_bands
from spectral_core.basis.fitting import NORMS, reweighted, synthesis_step
from spectral_core.basis.metric import differences, local_metric
from spectral_core.basis.spectral_basis import BasisError, SpectralBasis, checked_samples, errors_of
from spectral_core.errors import SpectrumError
from spectral_core.lights import Light
from spectral_core.standards import DEFAULT_OBSERVER
from spectral_core.textures import HyperspectralTexture


@dataclass(frozen=True, eq=False)
class LightAdded:
    """Synthesis (3, K) of a light that the basis was not fitted to, and its dE00 on the samples and the white."""

    light: Light
    synthesis: Float64Array
    error: BasisError


def with_light(basis: SpectralBasis, light: Light, samples: FloatArray, XYZ_under_new: FloatArray) -> LightAdded:
    """The synthesis of another light with the smallest largest dE00 on samples, all coefficients as they are.

    Whoever finds its error too large encodes again, with a basis fitted to that light as well.

    Parameters
    ----------
    basis
        That surfaces and textures are encoded with.
    light
        The new one.
    samples
        (n, L, 3), XYZ under the basis' lights.
    XYZ_under_new
        (n, 3), the same surfaces under the new light.

    Raises
    ------
    SpectrumError
        If the two do not belong together, there is none, or one is no number.
    """
    known = checked_samples(samples, basis.lights)
    new = np.asarray(XYZ_under_new, dtype=np.float64)
    if new.shape != (len(known), 3):
        raise SpectrumError(
            f"XYZ of shape {new.shape} under the new light for {len(known)} samples", remedy=f"give ({len(known)}, 3)"
        )
    white = light.XYZ(basis.observer)
    targets = np.concatenate([checked_samples(new[:, None], [light]), white[None, None]])
    coefficients = basis.coefficients(np.concatenate([known, basis.whites[None]]))
    metric = local_metric(targets, white[None])
    weights = np.ones((len(targets), 1))
    best, smallest = np.empty(0), np.inf
    dE00 = np.empty(0)
    for norm in NORMS:
        synthesis = synthesis_step(coefficients, targets, metric * weights[:, :, None, None])
        shown = (coefficients @ synthesis[0].T)[:, None]
        found = differences(shown, targets, white[None])
        if found.max() < smallest:
            best, smallest, dE00 = synthesis[0], float(found.max()), found
        weights = reweighted(weights, found, float(norm))
    return LightAdded(light, frozen(best), errors_of(dE00, [light.name])[0])


def stored_error(
    added: LightAdded, texture: HyperspectralTexture, coefficients: FloatArray, observer: str = DEFAULT_OBSERVER
) -> float:
    """Largest dE00 under an added light of all pixels of a texture, from coefficients (height, width, K) as stored.

    Raises
    ------
    TextureError
        If the texture cannot be read any more.
    """
    texture = without_dead_bands(texture)
    weights = level2_weights(texture, [added.light], observer)
    exact = project(texture, weights, bad_pixels="repair").astype(np.float64).reshape(-1, 1, 3)
    stored = np.asarray(coefficients).reshape(len(exact), -1)
    shown = (stored @ added.synthesis.T)[:, None]
    return float(differences(shown, exact, added.light.XYZ(observer)[None]).max())


def extend(basis: SpectralBasis, added: LightAdded) -> SpectralBasis:
    """The basis with one more light, at the end: coefficients do not depend on it, so what is encoded stays valid.

    Raises
    ------
    LightError
        If the basis has a light of that name.
    """
    return SpectralBasis(
        (*basis.lights, added.light),
        basis.observer,
        np.concatenate([basis.analysis, np.zeros((3, basis.K))]),
        np.concatenate([basis.synthesis, added.synthesis[None]]),
        (*basis.errors, added.error),
    )
