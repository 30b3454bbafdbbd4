"""The basis itself: two small matrices, and the errors they make.

A surface enters by its exact tristimulus values under all lights of the scene, so that surfaces and textures of
different bands share one basis: whatever two of them have in common, the lights have decided already.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from spectral_core.arrays import Float64Array, FloatArray, frozen
from spectral_core.basis.metric import differences
from spectral_core.errors import LightError, SpectrumError
from spectral_core.lights import Light
from spectral_core.standards import OBSERVERS

_FORMAT = "spectral-booth basis"
_VERSION = 1
# More lights than any scene has: their square is what a file makes us allocate.
_MOST_LIGHTS = 256


@dataclass(frozen=True)
class BasisError:
    """dE00 of one light: the mean, what 95 % do not exceed, and the largest."""

    light: str
    mean: float
    p95: float
    max: float


@dataclass(frozen=True, eq=False)
class SpectralBasis:
    """K coefficients of a surface, from its XYZ under the lights or from its bands, and back to its colours.

    Attributes
    ----------
    lights
        (L,), of distinct names.
    observer
        That all XYZ are of.
    analysis
        (3 L, K): coefficients are XYZ under all lights, one light after the other, times it.
    synthesis
        (L, 3, K): XYZ under a light is its matrix times the coefficients.
    errors
        (L,), predicted: of the samples it was fitted to and the perfect diffuser, not of other surfaces.
    """

    lights: tuple[Light, ...]
    observer: str
    analysis: Float64Array
    synthesis: Float64Array
    errors: tuple[BasisError, ...]

    def __post_init__(self) -> None:
        check_lights(self.lights, self.observer)
        count = len(self.lights)
        analysis, synthesis = frozen(self.analysis), frozen(self.synthesis)
        if analysis.ndim != 2 or analysis.shape[0] != 3 * count or synthesis.shape != (count, 3, analysis.shape[1]):
            raise SpectrumError(
                f"matrices of shape {analysis.shape} and {synthesis.shape} are no basis of {count} lights",
                remedy="analysis is (3 lights, K), synthesis (lights, 3, K)",
            )
        if not (np.isfinite(analysis).all() and np.isfinite(synthesis).all()):
            raise SpectrumError("the basis holds a value that is no finite number", remedy="fit it again")
        if tuple(each.light for each in self.errors) != self.light_names:
            raise SpectrumError("the errors are not those of the basis' lights", remedy="give one for each, in order")
        object.__setattr__(self, "analysis", analysis)
        object.__setattr__(self, "synthesis", synthesis)

    @property
    def K(self) -> int:
        """Number of coefficients."""
        return self.analysis.shape[1]

    @property
    def light_names(self) -> tuple[str, ...]:
        """(L,), in the order of the matrices."""
        return tuple(light.name for light in self.lights)

    @property
    def whites(self) -> Float64Array:
        """(L, 3), XYZ of the perfect diffuser under each light, Y = 1."""
        return np.stack([light.XYZ(self.observer) for light in self.lights])

    @property
    def largest_error(self) -> float:
        """The largest dE00 of all `errors`."""
        return max(each.max for each in self.errors)

    def coefficients(self, XYZ: FloatArray) -> Float64Array:
        """Coefficients (..., K) of XYZ (..., L, 3) under all lights."""
        values = np.asarray(XYZ, dtype=np.float64)
        if values.shape[-2:] != (len(self.lights), 3):
            raise SpectrumError(
                f"an array of shape {values.shape} has no XYZ under {len(self.lights)} lights",
                remedy=f"give shape (..., {len(self.lights)}, 3), the lights being {', '.join(self.light_names)}",
            )
        return np.asarray(values.reshape(*values.shape[:-2], -1) @ self.analysis)

    def XYZ(self, coefficients: FloatArray) -> Float64Array:
        """XYZ (..., L, 3) under all lights, perfect diffuser Y = 1, of coefficients (..., K)."""
        values = np.asarray(coefficients, dtype=np.float64)
        if values.shape[-1:] != (self.K,):
            raise SpectrumError(f"an array of shape {values.shape} holds no {self.K} coefficients")
        found = values @ self.synthesis.reshape(-1, self.K).T
        return np.asarray(found.reshape(*values.shape[:-1], len(self.lights), 3))

    def band_analysis(self, wavelengths_nm: Float64Array) -> Float64Array:
        """(bands, K): coefficients are reflectance at these bands, in any order and spacing, times it."""
        factors = [light.weighting_factors(wavelengths_nm, self.observer).matrix for light in self.lights]
        return np.asarray(np.concatenate(factors, axis=1) @ self.analysis)

    def synthesis_of(self, light_name: str) -> Float64Array:
        """(3, K): XYZ under one light is it times the coefficients.

        Raises
        ------
        LightError
            If the basis has no light of that name.
        """
        if light_name not in self.light_names:
            raise LightError(
                f"the basis has no light '{light_name}'", remedy=f"it has {', '.join(self.light_names)}; add it"
            )
        return np.asarray(self.synthesis[self.light_names.index(light_name)])

    def measure(self, XYZ: FloatArray, coefficients: FloatArray | None = None) -> tuple[BasisError, ...]:
        """dE00 of each light on samples (n, L, 3), by colour-science: of their own coefficients, or of these
        (n, K), as they are stored.
        """
        samples = checked_samples(XYZ, self.lights)
        stored = self.coefficients(samples) if coefficients is None else np.asarray(coefficients, dtype=np.float64)
        if stored.shape != (len(samples), self.K):
            raise SpectrumError(
                f"coefficients of shape {stored.shape} for {len(samples)} samples", remedy=f"give (n, {self.K})"
            )
        return errors_of(differences(self.XYZ(stored), samples, self.whites), self.light_names)

    def to_json(self) -> dict[str, Any]:
        """Plain numbers and texts that `from_json` makes the same basis of, bit for bit; lights as their nodes."""
        return {
            "format": _FORMAT,
            "version": _VERSION,
            "observer": self.observer,
            "lights": [
                {
                    "name": light.name,
                    "kind": light.kind,
                    "wavelengths_nm": light.wavelengths_nm.tolist(),
                    "powers": light.powers.tolist(),
                    "lines": np.flatnonzero(light.lines).tolist(),
                }
                for light in self.lights
            ],
            "analysis": self.analysis.tolist(),
            "synthesis": self.synthesis.tolist(),
            "errors": [asdict(each) for each in self.errors],
        }

    @classmethod
    def from_json(cls, document: Mapping[str, Any]) -> SpectralBasis:
        """The basis of a document made by `to_json`.

        Raises
        ------
        SpectrumError, LightError
            If it is none, or holds what is no number.
        """
        if document.get("format") != _FORMAT or document.get("version") != _VERSION:
            raise SpectrumError(
                "is no spectral basis of this version", remedy=f"it must say format '{_FORMAT}', version {_VERSION}"
            )
        try:
            lights = tuple(_light(each) for each in document["lights"])
            errors = tuple(
                BasisError(str(each["light"]), *(float(each[key]) for key in ("mean", "p95", "max")))
                for each in document["errors"]
            )
            analysis, synthesis = frozen(document["analysis"]), frozen(document["synthesis"])
            observer = str(document["observer"])
            if not np.isfinite([[each.mean, each.p95, each.max] for each in errors]).all():
                raise ValueError
        except KeyError as error:
            raise SpectrumError(f"the spectral basis lacks {error}", remedy="fit it again") from None
        except (TypeError, ValueError, OverflowError, IndexError):
            raise SpectrumError("the spectral basis holds something that is no number", remedy="fit it again") from None
        return cls(lights, observer, analysis, synthesis, errors)


def _light(document: Mapping[str, Any]) -> Light:
    wavelengths, powers = frozen(document["wavelengths_nm"]), frozen(document["powers"])
    if wavelengths.ndim != 1 or powers.shape != wavelengths.shape:
        raise ValueError
    if not (np.isfinite(wavelengths).all() and (np.diff(wavelengths) >= 0).all() and (powers >= 0).all()):
        raise ValueError
    lines = np.zeros(len(wavelengths), dtype=bool)
    lines[[int(index) for index in document["lines"]]] = True
    return Light(str(document["name"]), wavelengths, powers, lines, str(document["kind"]))


def errors_of(dE00: Float64Array, names: Sequence[str]) -> tuple[BasisError, ...]:
    """Errors of each light of dE00 (n, lights)."""
    return tuple(
        BasisError(name, float(each.mean()), float(np.percentile(each, 95)), float(each.max()))
        for name, each in zip(names, dE00.T, strict=True)
    )


def check_lights(lights: Sequence[Light], observer: str) -> None:
    """Refuse what no basis can be of.

    Raises
    ------
    LightError, SpectrumError
        If there is no light, two have one name, L*a*b* is undefined under one, or there is no such observer.
    """
    names = [light.name for light in lights]
    if not names:
        raise LightError("a spectral basis needs a light", remedy="give at least one")
    if len(names) > _MOST_LIGHTS:
        raise LightError(f"{len(names)} lights are too many for a spectral basis", remedy=f"give {_MOST_LIGHTS}")
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise LightError(f"two lights of the basis are called '{twice}'", remedy="give each its own name, once")
    if observer not in OBSERVERS:
        raise SpectrumError(f"no observer '{observer}'", remedy=f"use one of {', '.join(OBSERVERS)}")
    dark = next((light.name for light in lights if not (light.XYZ(observer) > 0).all()), None)
    if dark is not None:
        raise LightError(
            f"colour differences are undefined under '{dark}': its white has no X, Y or Z",
            remedy="use a light with X, Y, Z > 0",
        )


def checked_samples(XYZ: FloatArray, lights: Sequence[Light]) -> Float64Array:
    """Samples (n, L, 3) in float64.

    Raises
    ------
    SpectrumError
        If there is none, the shape is another, or a value is no finite number.
    """
    samples = np.asarray(XYZ, dtype=np.float64)
    if samples.ndim != 3 or samples.shape[1:] != (len(lights), 3):
        raise SpectrumError(
            f"samples of shape {samples.shape} have no XYZ under {len(lights)} lights",
            remedy=f"give (n, {len(lights)}, 3)",
        )
    if not len(samples):
        raise SpectrumError("too few samples for a spectral basis: none", remedy="give at least one surface")
    bad = ~np.isfinite(samples).all(axis=(1, 2))
    if bad.any():
        raise SpectrumError(
            f"sample {int(np.argmax(bad))} of {len(samples)} holds a value that is no finite number",
            remedy="leave it out, or correct its reflectance",
        )
    return samples
