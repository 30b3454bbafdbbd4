"""Rendered pixels against theory: 8-bit differences per channel, dE00, and the error by stage."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from spectral_core import standards
from spectral_core.arrays import Float64Array
from spectral_core.display import srgb, srgb_encode
from spectral_core.display.profile import in_gamut
from spectral_core.lighting import WORKING_SPACE, Lighting


@dataclass(frozen=True)
class Spread:
    """Mean, standard deviation and maximum of absolute differences."""

    mean: float
    sd: float
    max: float


@dataclass(frozen=True)
class Percentiles:
    """Mean, 95th percentile and maximum."""

    mean: float
    p95: float
    max: float


@dataclass(frozen=True)
class PatchReading:
    """What a render shows of one surface, averaged over its pixels.

    Attributes
    ----------
    name, surface
        The object and its surface.
    rendered
        (3,) linear RGB in the render.
    irradiance
        Relative to that which gives the perfect diffuser its luminance.
    stored
        (3,) linear RGB at irradiance 1 that follows from what material and lamps hold, in their precision.
    exact
        (3,) linear RGB of theory at irradiance 1, float64, from the spectra.
    """

    name: str
    surface: str
    rendered: Float64Array
    irradiance: float
    stored: Float64Array
    exact: Float64Array


@dataclass(frozen=True)
class PatchDifference:
    """One surface at one level against theory.

    Attributes
    ----------
    name, surface
        The object and its surface.
    rendered_rgb_8bit, exact_rgb_8bit
        (3,) 255 times the encoded sRGB value, neither rounded nor clipped.
    dE00
        CIEDE2000 between the two, not clipped, relative to the white under the light.
    in_gamut
        Whether the exact colour needs no clipping.
    """

    name: str
    surface: str
    rendered_rgb_8bit: tuple[float, ...]
    exact_rgb_8bit: tuple[float, ...]
    dE00: float
    in_gamut: bool


@dataclass(frozen=True)
class LevelResult:
    """One light at one level against theory.

    Attributes
    ----------
    rgb8
        Per channel, in 8-bit sRGB levels before rounding, all patches clipped to 0..1 on both sides.
    rgb8_in_gamut
        The same over the patches whose exact colour needs no clipping.
    dE00
        CIEDE2000 against the exact colour, not clipped, relative to the white under the light.
    dE00_in_gamut
        The same over the patches in gamut.
    stages
        8-bit levels (mean and max over patches and channels) lost by each stage.
    patches, in_gamut
        How many were read, and how many of them need no clipping.
    readings
        Patch by patch, in the order of the scene.
    """

    rgb8: dict[str, Spread]
    rgb8_in_gamut: dict[str, Spread]
    dE00: Percentiles
    dE00_in_gamut: Percentiles
    stages: dict[str, Spread]
    patches: int
    in_gamut: int
    switch_seconds: float
    render_seconds: float
    readings: tuple[PatchDifference, ...] = ()


def compare(
    readings: list[PatchReading], lighting: Lighting, switch_seconds: float = 0.0, render_seconds: float = 0.0
) -> LevelResult:
    """Compare readings with theory for one lighting (any level; theory is always the exact colour)."""
    irradiance = np.array([reading.irradiance for reading in readings])[:, None]
    # The shape is said because a view of textures alone has no readings.
    rendered = np.array([reading.rendered for reading in readings]).reshape(-1, 3)
    exact = np.array([reading.exact for reading in readings]).reshape(-1, 3) * irradiance
    stored = np.array([reading.stored for reading in readings]).reshape(-1, 3) * irradiance
    inside = in_gamut(exact)
    difference = np.abs(_codes(rendered) - _codes(exact))
    dE00 = _dE00(rendered, exact, lighting)
    return LevelResult(
        rgb8=_per_channel(difference),
        rgb8_in_gamut=_per_channel(difference[inside]),
        dE00=percentiles(dE00),
        dE00_in_gamut=percentiles(dE00[inside]),
        stages={
            "8-bit rounding": spread(np.abs(_codes(exact) - np.round(_codes(exact)))),
            "material": spread(np.abs(_codes(stored) - _codes(exact))),
            "Eevee": spread(np.abs(_codes(rendered) - _codes(stored))),
        },
        patches=len(readings),
        in_gamut=int(inside.sum()),
        switch_seconds=switch_seconds,
        render_seconds=render_seconds,
        readings=_per_patch(readings, rendered, exact, dE00, inside),
    )


def percentiles(values: Float64Array) -> Percentiles:
    """Mean, 95th percentile and maximum of (n,); zeros for none."""
    if not len(values):
        return Percentiles(0.0, 0.0, 0.0)
    return Percentiles(float(values.mean()), float(np.percentile(values, 95)), float(values.max()))


def spread(values: Float64Array) -> Spread:
    """Mean, standard deviation and maximum of all values; zeros for none."""
    if not values.size:
        return Spread(0.0, 0.0, 0.0)
    return Spread(float(values.mean()), float(values.std()), float(values.max()))


@dataclass(frozen=True)
class TextureDifference:
    """One textured object against its texture's exact colours.

    Attributes
    ----------
    mean_colour
        Largest channel difference of the object's mean colour: what the texture's values, their
        storage and the lighting are off by.
    pixels
        Differences of single pixels: these add where within its pixel the renderer samples the
        texture, which theory takes at the pixel's centre.
    """

    mean_colour: float
    pixels: Spread


@dataclass(frozen=True)
class LightResult:
    """One light at all levels that were verified.

    Attributes
    ----------
    levels
        By level, 0 to 2.
    textures
        Per textured object at the highest level, in 8-bit levels.
    conditions
        What made this light numerically special, one sentence each.
    """

    name: str
    levels: dict[int, LevelResult]
    textures: dict[str, TextureDifference]
    conditions: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """The light's entry in the contract's JSON."""
        levels = {f"level{level}": asdict(result) for level, result in self.levels.items()}
        textures = {name: asdict(spread) for name, spread in self.textures.items()}
        return {"name": self.name, **levels, "textures": textures, "conditions": list(self.conditions)}


def texture_difference(rendered: Float64Array, exact: Float64Array) -> TextureDifference:
    """8-bit differences of an object's pixels (n, 3) of linear RGB, clipped to 0..1 on both sides."""
    means = [np.clip(each, 0.0, 1.0).mean(axis=0) for each in (rendered, exact)]
    mean_colour = float(np.abs(_codes(means[0]) - _codes(means[1])).max())
    return TextureDifference(mean_colour, spread(np.abs(_codes(rendered) - _codes(exact))))


def conditions(lighting: Lighting, clipped: dict[str, int], extended: dict[str, float]) -> tuple[str, ...]:
    """The numerical conditions a lighting met: lines, folding, negative channels, extended ends."""
    found = list(lighting.notes) + list(lighting.light.warnings)
    if lighting.light.lines.any():
        lines = ", ".join(f"{each:.2f}" for each in lighting.light.wavelengths_nm[lighting.light.lines])
        found.append(f"spectral lines at {lines} nm, summed at their exact wavelengths")
    negative = [name for name, count in clipped.items() if count]
    if negative:
        found.append(f"outside {WORKING_SPACE}, negative channels shown as 0: {', '.join(negative)}")
    worst = max(extended.values(), default=0.0)
    if worst > 0:
        found.append(f"ends of reflectances repeated beyond their bands: {worst:.3%} of the white's X, Y or Z at most")
    return tuple(found)


def worst_stages(lights: list[LightResult], level: int = 2) -> dict[str, Any]:
    """Per stage, the mean over the lights and the largest maximum at a level."""
    results = [light.levels[level] for light in lights if level in light.levels]
    names = results[0].stages if results else {}
    return {
        name: {
            "mean": float(np.mean([each.stages[name].mean for each in results])),
            "max": max(each.stages[name].max for each in results),
        }
        for name in names
    }


def _codes(linear: Float64Array) -> Float64Array:
    """8-bit sRGB levels before rounding, clipped as a screen does."""
    return np.asarray(255 * srgb_encode(np.clip(linear, 0.0, 1.0)))


def _dE00(rendered: Float64Array, exact: Float64Array, lighting: Lighting) -> Float64Array:
    white = lighting.light.XYZ() * lighting.luminance
    matrix = np.linalg.inv(srgb().to_linear(np.eye(3)).T)
    return standards.dE00(rendered @ matrix.T, exact @ matrix.T, white)


def _per_patch(
    readings: list[PatchReading],
    rendered: Float64Array,
    exact: Float64Array,
    dE00: Float64Array,
    inside: npt.NDArray[np.bool_],
) -> tuple[PatchDifference, ...]:
    return tuple(
        PatchDifference(
            reading.name,
            reading.surface,
            tuple((255 * srgb_encode(rendered[index])).tolist()),
            tuple((255 * srgb_encode(exact[index])).tolist()),
            float(dE00[index]),
            bool(inside[index]),
        )
        for index, reading in enumerate(readings)
    )


def _per_channel(difference: Float64Array) -> dict[str, Spread]:
    return {channel: spread(difference[:, index]) for index, channel in enumerate("RGB")}
