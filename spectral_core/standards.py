"""The only door to colour-science: observers, CIE data, colour differences, light quality.

colour-science takes about a second to import, so it is imported on first use, never when this
module is.
"""

from __future__ import annotations

import sys
import warnings
from functools import cache
from types import ModuleType
from typing import Any
from unittest.mock import NonCallableMock

import numpy as np

from spectral_core.arrays import Float64Array, frozen
from spectral_core.errors import LightError, MissingExtraError, SpectrumError

OBSERVERS = {
    "cie1931-2": "CIE 1931 2 Degree Standard Observer",
    "cie1964-10": "CIE 1964 10 Degree Standard Observer",
    "cie2015-2": "CIE 2015 2 Degree Standard Observer",
    "cie2015-10": "CIE 2015 10 Degree Standard Observer",
}
DEFAULT_OBSERVER = "cie1931-2"
# Smits 1999, Mallett & Yuksel 2019, Otsu et al. 2018, Jakob & Hanika 2019, Meng et al. 2015.
RECOVERY_METHODS = {
    "smits": "Smits1999", "mallett": "Mallett2019", "otsu": "Otsu2018", "jakob": "Jakob2019", "meng": "Meng2015",
}  # fmt: skip
NEED_SCIPY = ("jakob", "meng")
# Colour spaces that displays are compared with, all with a D65 white, by colour-science's names.
GAMUTS = {"sRGB": "sRGB", "P3": "Display P3", "Rec.2020": "ITU-R BT.2020"}


@cache
def _colour() -> ModuleType:
    """Import colour-science quietly and leave no trace of packages that are missing.

    For a missing matplotlib or scipy colour-science puts mocks in ``sys.modules``, which any other
    code of the process (other Blender add-ons) would take for the real thing; they are taken out.
    """
    before = set(sys.modules)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import colour

    for name in set(sys.modules) - before:
        if isinstance(sys.modules[name], NonCallableMock):
            del sys.modules[name]
    return colour


def colour_science_version() -> str:
    """Version of the colour-science in use."""
    return str(_colour().__version__)


@cache
def observer_table(observer: str = DEFAULT_OBSERVER) -> tuple[Float64Array, Float64Array]:
    """Colour-matching functions at 1 nm: wavelengths (n,), values (n, 3).

    Raises
    ------
    SpectrumError
        If `observer` is none of `OBSERVERS`.
    """
    if observer not in OBSERVERS:
        raise SpectrumError(f"no observer '{observer}'", remedy=f"use one of {', '.join(OBSERVERS)}")
    cmfs = _colour().MSDS_CMFS[OBSERVERS[observer]]
    return frozen(cmfs.wavelengths), frozen(cmfs.values)


@cache
def illuminant_tables() -> dict[str, tuple[Float64Array, Float64Array]]:
    """CIE and ISO illuminants by name: wavelengths (n,) and relative power (n,)."""
    return _tables(_colour().SDS_ILLUMINANTS)


@cache
def light_source_tables() -> dict[str, tuple[Float64Array, Float64Array]]:
    """Measured light sources by name: wavelengths (n,) and relative power (n,)."""
    return _tables(_colour().SDS_LIGHT_SOURCES)


def published_chromaticities() -> dict[str, tuple[float, float]]:
    """Published CIE 1931 xy of the illuminants, as colour-science tabulates them (CIE 015:2018)."""
    table = _colour().CCS_ILLUMINANTS[OBSERVERS["cie1931-2"]]
    names = set(illuminant_tables())
    return {name: (float(xy[0]), float(xy[1])) for name, xy in table.items() if name in names}


@cache
def colorchecker(chart: str = "BabelColor Average") -> tuple[tuple[str, ...], Float64Array, Float64Array]:
    """Reflectances of a ColorChecker: names (24,), wavelengths (n,), values (24, n)."""
    sds = _colour().SDS_COLOURCHECKERS[chart]
    names = tuple(sds)
    wavelengths = sds[names[0]].wavelengths
    return names, frozen(wavelengths), frozen([sds[name].values for name in names])


def _tables(sds: Any) -> dict[str, tuple[Float64Array, Float64Array]]:
    """Aliases of colour-science's lazy dictionaries are dropped: its own names are canonical."""
    return {name: (frozen(sds[name].wavelengths), frozen(sds[name].values)) for name in list(sds)}


def srgb_to_XYZ_matrix() -> Float64Array:
    """Linear sRGB (Rec.709 primaries, D65) to XYZ with white Y = 1: (3, 3), IEC 61966-2-1."""
    return rgb_to_XYZ_matrix("sRGB")


@cache
def rgb_to_XYZ_matrix(gamut: str) -> Float64Array:
    """Linear RGB of one of `GAMUTS` to XYZ with white Y = 1: (3, 3).

    Derived from the primaries rather than taken rounded, so that its inverse is exact.
    """
    space = _colour().RGB_COLOURSPACES[GAMUTS[gamut]]
    return frozen(_colour().normalised_primary_matrix(space.primaries, space.whitepoint))


def XYZ_to_Lab(XYZ: Float64Array, white_XYZ: Float64Array) -> Float64Array:
    """CIE 1976 L*a*b* (..., 3) of XYZ (..., 3) relative to the white's XYZ (3,).

    Raises
    ------
    LightError
        If the white has no power in one of its tristimulus values (Lab divides by them).
    """
    white = np.asarray(white_XYZ, dtype=np.float64)
    if not np.all(white > 0):
        raise LightError(f"Lab is undefined for the white XYZ {white.tolist()}", remedy="use a light with X, Y, Z > 0")
    # colour-science takes the white as xy; scaled by its Y the result is the same.
    xy = white[:2] / white.sum()
    return np.asarray(_colour().XYZ_to_Lab(np.asarray(XYZ, dtype=np.float64) / white[1], xy), dtype=np.float64)


def delta_E_2000(Lab_a: Float64Array, Lab_b: Float64Array) -> Float64Array:
    """CIEDE2000 colour difference (...,) of two arrays of L*a*b* (..., 3); ISO/CIE 11664-6."""
    return np.asarray(_colour().delta_E(Lab_a, Lab_b, method="CIE 2000"), dtype=np.float64)


def dE00(XYZ_a: Float64Array, XYZ_b: Float64Array, white_XYZ: Float64Array) -> Float64Array:
    """CIEDE2000 colour difference (...,) of two arrays of XYZ (..., 3) seen under a white XYZ (3,)."""
    return delta_E_2000(XYZ_to_Lab(XYZ_a, white_XYZ), XYZ_to_Lab(XYZ_b, white_XYZ))


def cct_and_duv(xy: Float64Array) -> tuple[float, float]:
    """Correlated colour temperature in kelvin and Duv of a CIE 1931 xy (2,), Ohno 2013."""
    colour = _colour()
    XYZ = np.array([xy[0] / xy[1], 1.0, (1 - xy[0] - xy[1]) / xy[1]])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        cct, duv = colour.temperature.XYZ_to_CCT_Ohno2013(XYZ)
    return float(cct), float(duv)


def planckian_or_daylight_xy(cct_K: float) -> Float64Array:
    """Xy of the reference of a CCT: Planckian below 5000 K, CIE daylight from there on.

    Raises
    ------
    LightError
        Outside 1000 to 25000 K, where CIE daylight ends.
    """
    colour = _colour()
    if not 1000 <= cct_K <= 25000:
        raise LightError(f"CCT {cct_K:g} K is outside 1000 to 25000 K", remedy="give --xy instead")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if cct_K < 5000:
            XYZ = np.asarray(colour.temperature.CCT_to_XYZ_Ohno2013([cct_K, 0.0]))
            return np.asarray(XYZ[:2] / XYZ.sum())
        return np.asarray(colour.temperature.CCT_to_xy_CIE_D(cct_K))


def fidelity_index(wavelengths_nm: Float64Array, powers: Float64Array) -> float:
    """CIE 224:2017 colour fidelity index Rf of an evenly spaced SPD of at most 5 nm step.

    NaN-free: raises LightError where the index is undefined (no power in the visible range).
    """
    colour = _colour()
    sd = _distribution(wavelengths_nm, powers)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        value = float(colour.quality.colour_fidelity_index_CIE2017(sd))
    return _finite(value, "Rf")


@cache
def fidelity_samples() -> tuple[Float64Array, Float64Array]:
    """Wavelengths (401,) in nm and reflectances (99, 401) of CIE 224:2017's test colour samples 1 to 99."""
    colour = _colour()
    samples = colour.quality.cfi2017.load_TCS_CIE2017(colour.SpectralShape(380, 780, 1))
    return frozen(samples.wavelengths), frozen(samples.values.T)


def rendering_index(wavelengths_nm: Float64Array, powers: Float64Array) -> float:
    """CIE 13.3-1995 general colour rendering index Ra of an evenly spaced SPD."""
    colour = _colour()
    sd = _distribution(wavelengths_nm, powers)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        value = float(colour.colour_rendering_index(sd))
    return _finite(value, "Ra")


def _distribution(wavelengths_nm: Float64Array, powers: Float64Array) -> Any:
    return _colour().SpectralDistribution(
        dict(zip(np.asarray(wavelengths_nm).tolist(), np.asarray(powers).tolist(), strict=True))
    )


def _finite(value: float, name: str) -> float:
    if not np.isfinite(value):
        raise LightError(
            f"{name} is undefined for this spectrum", remedy="give a spectrum with power from 380 to 780 nm"
        )
    return value


def recovered_reflectance(method: str, XYZ: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Wavelengths (n,) and reflectance (n,) that a method of colour-science recovers for one XYZ (3,) under D65.

    For ``smits`` and ``mallett`` the XYZ must be of the sRGB gamut, white Y = 1.

    Raises
    ------
    MissingExtraError
        For ``jakob`` and ``meng`` without scipy.
    SpectrumError
        If the method does not come to an end for this colour.
    """
    colour = _colour()
    if method in NEED_SCIPY and not _has_scipy():
        raise MissingExtraError(
            f"the recovery method '{method}' needs scipy", remedy="pip install scipy, or use smits, mallett or otsu"
        )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if method in ("smits", "mallett"):
            # Relative to white both bases are 1 throughout: white is (1, 1, 1) for either's own lamp.
            function = getattr(colour.recovery, f"RGB_to_sd_{RECOVERY_METHODS[method]}")
            found = function(np.linalg.solve(srgb_to_XYZ_matrix(), XYZ))
        else:
            try:
                found = getattr(colour.recovery, f"XYZ_to_sd_{RECOVERY_METHODS[method]}")(
                    XYZ, **_recovery_tables(method)
                )
            except (RuntimeError, ValueError) as error:
                raise SpectrumError(
                    f"'{method}' recovers nothing for XYZ {XYZ} ({error})", remedy="use another method"
                ) from None
    return np.asarray(found.wavelengths, dtype=np.float64), np.asarray(found.values, dtype=np.float64)


@cache
def _recovery_tables(method: str) -> dict[str, Any]:
    """Observer and D65 on the method's own grid; colour-science would align them for every colour."""
    colour = _colour()
    shape = colour.recovery.SPECTRAL_SHAPE_OTSU2018 if method == "otsu" else colour.SpectralShape(360, 780, 10)
    cmfs = colour.MSDS_CMFS[OBSERVERS[DEFAULT_OBSERVER]].copy().align(shape)
    return {"cmfs": cmfs, "illuminant": colour.SDS_ILLUMINANTS["D65"].copy().align(shape)}


def _has_scipy() -> bool:
    try:
        import scipy.optimize
    except ImportError:
        return False
    return bool(scipy.optimize)
