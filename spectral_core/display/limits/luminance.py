"""Absolute luminance: what of a scene's luminance a display can show, and what must be dimmed.

A scene's colours are XYZ relative to the perfect diffuser, which has Y = 1; a profile's are relative
to the display's own white. One number, the *scene white*, joins them: the luminance that the
scene's perfect diffuser is shown at, as a fraction of that of the display's white. It scales all
colours alike, so that chromaticities, and lightnesses relative to white, stay what they are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spectral_core.arrays import BoolArray, Float64Array, FloatArray
from spectral_core.chromaticities import XYZ_to_uv
from spectral_core.display.limits.gamut import map_to_gamut, peak_luminance, reach
from spectral_core.display.profile import GAMUT_TOLERANCE, DisplayProfile
from spectral_core.errors import DisplayError
from spectral_core.lights import Light

# Below this rods take part in vision (CIE 191:2010), and matches for cones need not hold.
MESOPIC_CD_M2 = 5.0
# A model's white further off than instruments are: of a display that is not additive.
_SAME_WHITE = 0.02


@dataclass(frozen=True)
class SceneColour:
    """A colour of a scene: a surface under a light, XYZ (3,) relative to the perfect diffuser."""

    name: str
    light: str
    XYZ: Float64Array


@dataclass(frozen=True)
class BeyondPeak:
    """A colour brighter than the display can show at its chromaticity: so many times too bright."""

    name: str
    light: str
    ratio: float


@dataclass(frozen=True)
class OutsideChromaticity:
    """A colour that no dimming mends: its xy, and how far in u'v' it moves when mapped to the gamut."""

    name: str
    light: str
    xy: tuple[float, float]
    delta_uv: float


@dataclass(frozen=True)
class BlackLimit:
    """What the display's black does to a scene.

    Attributes
    ----------
    scene_Y
        Lowest luminance that can be shown, relative to the perfect diffuser; 0 without a black.
    luminance_cd_m2
        The same on the display, None if its luminance is unknown.
    darkest, darkest_Y
        The scene's darkest colour.
    crushed
        Names of the colours that are darker, and are shown as black.
    tinted
        Names of those brighter than black whose chromaticity its light changes all the same.
    contrast_scene, contrast_shown
        Luminance of the scene's brightest over its darkest colour, wanted and shown.
    contrast_lost_stops
        Their ratio, in powers of two.
    """

    scene_Y: float
    luminance_cd_m2: float | None
    darkest: str
    darkest_Y: float
    crushed: tuple[str, ...]
    tinted: tuple[str, ...]
    contrast_scene: float
    contrast_shown: float
    contrast_lost_stops: float


@dataclass(frozen=True)
class LuminanceMapping:
    """How a scene's luminance meets a display's.

    Attributes
    ----------
    factor
        Scene white asked for: scene XYZ times this is the profile's XYZ (white Y = 1).
    largest_factor
        The largest at which every colour of an attainable chromaticity fits; None if there is none.
    white_largest_factor
        The same for the perfect diffuser alone, by light; None where its chromaticity is out of reach.
    booth_white_cd_m2
        Luminance of the booth's white, None if not given.
    headset_white_cd_m2, largest_white_cd_m2
        Luminance on the display of the scene's white at `factor` and at `largest_factor`; None if
        the display's is unknown.
    dimming_percent, dimming_stops
        From `factor` down to `largest_factor`; 0 where everything fits.
    beyond_peak
        Colours too bright at `factor`, worst first.
    outside_chromaticity
        Colours that the display cannot show at any luminance, worst first.
    black
        What the display's black does at `factor`.
    warnings
        What a user should know.
    """

    factor: float
    largest_factor: float | None
    white_largest_factor: dict[str, float | None]
    booth_white_cd_m2: float | None
    headset_white_cd_m2: float | None
    largest_white_cd_m2: float | None
    dimming_percent: float
    dimming_stops: float
    beyond_peak: tuple[BeyondPeak, ...]
    outside_chromaticity: tuple[OutsideChromaticity, ...]
    black: BlackLimit
    warnings: tuple[str, ...]


def scene_white(profile: DisplayProfile) -> float:
    """The fraction of its white's luminance that a profile shows a scene's white at.

    What the profile was given; else the largest at which the perfect diffuser under D65 fits, and
    at most 1, its measured white, whatever a model says of a display that is not additive.

    Raises
    ------
    DisplayError
        If the display cannot show D65's chromaticity, and nothing was given.
    """
    if profile.scene_white is not None:
        return profile.scene_white
    peak = float(peak_luminance(profile, Light.builtin("D65").XYZ()))
    if not peak > 0:
        raise DisplayError(f"'{profile.name}' cannot show D65", remedy="set the profile's scene white")
    return min(peak, 1.0)


def scene_to_display(profile: DisplayProfile, XYZ: FloatArray) -> Float64Array:
    """A scene's XYZ (..., 3), perfect diffuser Y = 1, as the profile's XYZ (white Y = 1)."""
    return np.asarray(np.asarray(XYZ) * scene_white(profile))


def map_luminance(
    profile: DisplayProfile,
    colours: tuple[SceneColour, ...],
    whites: dict[str, Float64Array],
    booth_white_cd_m2: float | None = None,
    fraction: float | None = None,
) -> LuminanceMapping:
    """How the colours of a scene, and its perfect diffuser under each light (`whites`, XYZ (3,) by
    name), fit into a display.

    With the luminance of the booth's white, they are asked for at the luminance that they have
    there; with a fraction, with the scene's white at that fraction of the display's; with neither,
    at `scene_white`.

    Raises
    ------
    DisplayError
        If both are given, or the booth's luminance for a display whose own is unknown.
    """
    factor = _factor(profile, booth_white_cd_m2, fraction)
    peak_cd_m2 = profile.white_luminance_cd_m2
    colours = (*(SceneColour("perfect diffuser", light, XYZ) for light, XYZ in whites.items()), *colours)
    XYZ = np.stack([each.XYZ for each in colours])
    if not (XYZ[:, 1] > 0).all():
        dark = colours[int(np.argmin(XYZ[:, 1]))]
        raise DisplayError(f"'{dark.name}' under {dark.light} has no luminance", remedy="leave it out")
    room = peak_luminance(profile, XYZ) / XYZ[:, 1]
    attainable = room > 0
    largest = float(room[attainable].min()) if attainable.any() else None
    # What exceeds the peak by rounding, or by how CIE D65's table differs from sRGB's white, fits.
    fits = largest is None or factor <= largest * (1 + GAMUT_TOLERANCE)
    share = 1.0 if largest is None or fits else largest / factor
    black = _black_limit(profile, colours, factor)
    beyond = [
        BeyondPeak(each.name, each.light, factor / limit)
        for each, limit in zip(colours, room.tolist(), strict=True)
        if 0 < limit * (1 + GAMUT_TOLERANCE) < factor
    ]
    return LuminanceMapping(
        factor=factor,
        largest_factor=largest,
        white_largest_factor={
            light: limit if limit > 0 else None for light, limit in zip(whites, room.tolist(), strict=False)
        },
        booth_white_cd_m2=booth_white_cd_m2,
        headset_white_cd_m2=None if peak_cd_m2 is None else factor * peak_cd_m2,
        largest_white_cd_m2=None if peak_cd_m2 is None or largest is None else largest * peak_cd_m2,
        dimming_percent=100 * (1 - share),
        dimming_stops=float(-np.log2(share)) + 0.0,
        beyond_peak=tuple(sorted(beyond, key=lambda each: -each.ratio)),
        outside_chromaticity=_outside(profile, colours, np.flatnonzero(~attainable).tolist(), factor),
        black=black,
        warnings=_warnings(profile, factor * share, black),
    )


def _factor(profile: DisplayProfile, booth_white_cd_m2: float | None, fraction: float | None) -> float:
    if booth_white_cd_m2 is not None and fraction is not None:
        raise DisplayError("the luminance of the booth's white and a fraction exclude each other", remedy="give one")
    if fraction is not None:
        return fraction
    if booth_white_cd_m2 is None:
        return scene_white(profile)
    if profile.white_luminance_cd_m2 is None:
        raise DisplayError(
            f"the absolute luminance of '{profile.name}' is unknown",
            remedy="give its profile a --white-luminance, or a --fraction of its white instead",
        )
    return booth_white_cd_m2 / profile.white_luminance_cd_m2


def _outside(
    profile: DisplayProfile, colours: tuple[SceneColour, ...], chosen: list[int], factor: float
) -> tuple[OutsideChromaticity, ...]:
    found = []
    for index in chosen:
        XYZ = colours[index].XYZ * factor
        codes, _ = map_to_gamut(profile, XYZ, "chromaticity")
        moved = float(np.hypot(*(XYZ_to_uv(profile.to_XYZ(codes)) - XYZ_to_uv(XYZ))))
        x, y = (XYZ[:2] / XYZ.sum()).tolist()
        found.append(OutsideChromaticity(colours[index].name, colours[index].light, (x, y), moved))
    return tuple(sorted(found, key=lambda each: -each.delta_uv))


def _black_limit(profile: DisplayProfile, colours: tuple[SceneColour, ...], factor: float) -> BlackLimit:
    black = float(profile.to_XYZ(np.zeros(3))[1])
    lowest = max(black, 0.0) / factor
    Y = np.array([each.XYZ[1] for each in colours])
    dark = np.less(Y, lowest)
    found = reach(profile.model, factor * np.stack([each.XYZ for each in colours]))
    darkest, brightest = colours[int(Y.argmin())], float(Y.max())
    wanted, shown = brightest / float(Y.min()), brightest / max(float(Y.min()), lowest)
    peak = profile.white_luminance_cd_m2
    return BlackLimit(
        scene_Y=lowest,
        luminance_cd_m2=None if peak is None else max(black, 0.0) * peak,
        darkest=f"{darkest.name} under {darkest.light}",
        darkest_Y=float(Y.min()),
        crushed=_named(colours, dark),
        tinted=_named(colours, found.attainable & ~found.inside & (found.scale >= 1) & ~dark),
        contrast_scene=wanted,
        contrast_shown=max(shown, 1.0),
        contrast_lost_stops=float(np.log2(wanted / max(shown, 1.0))),
    )


def _named(colours: tuple[SceneColour, ...], chosen: BoolArray) -> tuple[str, ...]:
    return tuple(f"{each.name} under {each.light}" for each, is_so in zip(colours, chosen, strict=True) if is_so)


def _warnings(profile: DisplayProfile, shown: float, black: BlackLimit) -> tuple[str, ...]:
    warnings = []
    if profile.white_luminance_cd_m2 is None:
        warnings.append(f"the absolute luminance of '{profile.name}' is unknown: only fractions of its white are told")
    elif shown * profile.white_luminance_cd_m2 < MESOPIC_CD_M2:
        warnings.append(
            f"the scene's white is shown at {shown * profile.white_luminance_cd_m2:.3g} cd/m2: below "
            f"{MESOPIC_CD_M2:g} cd/m2 rods take part (CIE 191), and colours matched for cones need not match"
        )
    white_Y = float(profile.to_XYZ(np.ones(3))[1])
    if abs(white_Y - 1) > _SAME_WHITE:
        warnings.append(
            f"the profile's model makes white {white_Y:.3f} times as bright as it was measured: what is said of "
            "bright colours is uncertain by as much"
        )
    if black.scene_Y == 0:
        warnings.append("the profile has no light in black: what a real black does to dark colours is not told")
    return tuple(warnings)


def eye_scene_whites(left: DisplayProfile, right: DisplayProfile) -> tuple[float, float]:
    """The scene white of each eye: of both, the same luminance in cd/m2 where both profiles know theirs.

    The brighter eye is dimmed to the other. Without luminances each eye keeps its own `scene_white`.
    """
    own = scene_white(left), scene_white(right)
    whites = left.white_luminance_cd_m2, right.white_luminance_cd_m2
    if whites[0] is None or whites[1] is None:
        return own
    shown = min(own[0] * whites[0], own[1] * whites[1])
    return shown / whites[0], shown / whites[1]
