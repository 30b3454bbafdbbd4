"""Results as the JSON documents of the public contract, for the commands that need no Blender."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from spectral_core import light_design, standards, weights
from spectral_core.arrays import Float64Array
from spectral_core.baking.projection import grid_warnings, level2_weights
from spectral_core.baking.strips import check_reflectance
from spectral_core.display import DisplayProfile, srgb
from spectral_core.display.characterising.advice import Advice
from spectral_core.display.characterising.characterise import Characterisation
from spectral_core.display.measuring.measurements import Measurements
from spectral_core.display.profile import in_gamut
from spectral_core.errors import LightError, TextureError
from spectral_core.lights import Light, LightQuality, builtin_names
from spectral_core.report.documents import Document, bake_document, bakes_document
from spectral_core.spectra import Spectra
from spectral_core.textures import HyperspectralTexture

__all__ = [
    "advice_document",
    "bake_document",
    "bakes_document",
    "characterise_document",
    "design",
    "design_table",
    "light_document",
    "lights_document",
    "long_lists",
    "pixel_document",
    "reflectance_document",
    "target_chromaticity",
    "texture_document",
]

# Two statements of one chromaticity, xy and CCT, may differ by what four decimals of xy can say.
_CCT_AGREEMENT = 0.01
_LONGEST_SHOWN_LIST = 8


def light_document(light: Light, luminance: float, profile: DisplayProfile, observer: str) -> Document:
    """`light`: XYZ has Y = `luminance`; linear RGB is 1 at luminance 100."""
    XYZ = light.XYZ(observer) * luminance
    linear = profile.to_linear(XYZ / 100)
    return {
        "name": light.name,
        "xy": light.xy(observer).tolist(),
        "XYZ": XYZ.tolist(),
        **_quality(light.quality()),
        "linear_rgb": linear.tolist(),
        "rgb_8bit": (255 * profile.model.encode(linear)).tolist(),
        "in_gamut": bool(in_gamut(linear)),
        "warnings": list(light.warnings),
    }


def lights_document() -> Document:
    """`lights`: every built-in light."""
    entries = []
    for name in builtin_names():
        light = Light.builtin(name)
        quality = light.quality()
        entries.append(
            {"name": name, "kind": light.kind, "xy": light.xy().tolist(), "cct_K": quality.cct_K, "rf": quality.rf}
        )
    return {"lights": entries}


def target_chromaticity(match: str | None, xy: str | None, cct_K: float | None, observer: str) -> Float64Array:
    """The chromaticity (2,) that a design shall have, from a light, from ``x,y`` or from a CCT.

    Raises
    ------
    LightError
        If they contradict each other or cannot be read.
    """
    if match is not None and (xy is not None or cct_K is not None):
        raise LightError("--match, --xy and --cct all say the chromaticity", remedy="give one of them")
    if xy is not None:
        target = _parse_xy(xy)
        actual, _ = standards.cct_and_duv(target)
        if cct_K is not None and not abs(actual - cct_K) <= _CCT_AGREEMENT * abs(cct_K):
            raise LightError(f"xy {xy} has a CCT of {actual:.0f} K, not {cct_K:g} K", remedy="give one of the two")
        return target
    if cct_K is not None:
        return standards.planckian_or_daylight_xy(cct_K)
    return Light.load(match or "D65").xy(observer)


def design(
    target: Float64Array, peak: float | None, leds: int | None, rf: float | None, observer: str
) -> tuple[Light, Document]:
    """`light-design`: the light and its document."""
    if peak is not None:
        light = light_design.two_peak_metamer(target, peak, observer)
    else:
        light = light_design.led_mixture(target, float(rf or 0.0), int(leds or 0), observer)
    powers, _ = design_table(light)
    quality = light.quality()
    document = {
        "name": light.name,
        "wavelengths_nm": light.wavelengths_nm.tolist(),
        "powers": powers.tolist(),
        "xy": light.xy(observer).tolist(),
        **_quality(quality),
        "delta_xy": float(np.abs(light.xy(observer) - target).max()),
    }
    return light, document


def design_table(light: Light) -> tuple[Float64Array, bool]:
    """Powers (n,) to tabulate, and whether they are those of lines rather than of a curve."""
    is_lines = bool(light.lines.all())
    if is_lines:
        return light.powers, True
    return np.asarray(light.powers / weights.quadrature_widths(light.wavelengths_nm)), False


def reflectance_document(spectra: Spectra, light: Light, profile: DisplayProfile, observer: str) -> Document:
    """`reflectance`: colours of a library under a light, Lab relative to the light."""
    factors = light.weighting_factors(spectra.wavelengths_nm, observer)
    XYZ = spectra.values @ factors.matrix
    Lab = standards.XYZ_to_Lab(XYZ, factors.white_XYZ)
    linear = profile.to_linear(XYZ)
    codes = profile.model.encode(linear)
    colours = [
        {
            "name": name,
            "XYZ": XYZ[index].tolist(),
            "Lab": Lab[index].tolist(),
            "rgb_8bit": (255 * codes[index]).tolist(),
            "in_gamut": bool(in_gamut(linear[index])),
        }
        for index, name in enumerate(spectra.names)
    ]
    warnings = [*spectra.warnings, *light.warnings, *factors.warnings()]
    return {"light": light.name, "colours": colours, "warnings": warnings}


def check_names(textures: Mapping[Path, HyperspectralTexture]) -> None:
    """Refuse textures whose images would have the same names.

    Raises
    ------
    TextureError
        If two textures have one name.
    """
    first: dict[str, Path] = {}
    for path, texture in textures.items():
        other = first.setdefault(texture.name, path)
        if other != path:
            raise TextureError(
                f"its images would be named like those of {other}", where=path, remedy="bake it into another folder"
            )


def texture_document(texture: HyperspectralTexture) -> Document:
    """`texture info`."""
    return {
        "name": texture.name,
        "format": texture.format,
        "width": texture.width,
        "height": texture.height,
        "bands": texture.bands,
        "wavelengths_nm": [float(texture.wavelengths_nm[0]), float(texture.wavelengths_nm[-1])],
        "step_nm": texture.step_nm,
        "kind": texture.kind,
        "scale": texture.scale,
        "warnings": list(texture.warnings),
    }


def pixel_document(
    texture: HyperspectralTexture, path: Path, x: int, y: int, light: Light | None, observer: str
) -> Document:
    """`texture pixel`.

    Raises
    ------
    TextureError
        If the pixel is outside, or a colour is asked of something that is not reflectance.
    """
    if not (0 <= x < texture.width and 0 <= y < texture.height):
        size = f"{texture.width} x {texture.height}"
        raise TextureError(f"has no pixel {x}, {y}", where=path, remedy=f"it is {size}; x and y start at 0")
    spectrum = texture.pixel(x, y)
    document: Document = {
        "wavelengths_nm": texture.wavelengths_nm.tolist(),
        "reflectance": [float(value) if np.isfinite(value) else None for value in spectrum],
        "kind": texture.kind,
        "warnings": list(texture.warnings),
    }
    if not np.isfinite(spectrum[texture.good]).all():
        raise TextureError(
            f"pixel {x}, {y} holds a value that is no finite number", where=path, remedy="repair the capture"
        )
    if light is not None:
        check_reflectance(texture)
        # With bad bands left out, as a bake does.
        XYZ = np.nan_to_num(spectrum) @ level2_weights(texture, [light], observer)
        document["XYZ"] = XYZ.tolist()
        document["rgb_8bit"] = (255 * srgb().to_codes(XYZ)).tolist()
        document["warnings"] += grid_warnings(texture, [light], observer)
    return document


def characterise_document(found: Characterisation, original: Measurements) -> Document:
    """`characterise`: XYZ in the units of the file."""
    return {
        "model": found.chosen.name,
        "models": [
            {
                "name": each.name,
                "held_out": asdict(each.held_out) if each.held_out else None,
                "fit": asdict(each.fit),
                "nanoseconds_per_pixel": each.nanoseconds,
            }
            for each in found.models
        ],
        "gamma": {channel: {"value": value, "r2": r2} for channel, (value, r2) in found.gamma.items()},
        "additivity_error": found.checks.additivity_error,
        "additivity_XYZ": found.checks.additivity_XYZ.tolist(),
        "black_XYZ": original.black_XYZ.tolist(),
        "white_XYZ": original.white_XYZ.tolist(),
        "unit": original.unit,
        "patches": len(original.codes),
        "noise_dE00": found.checks.noise_dE00,
        "checks": [asdict(each) for each in found.checks.verdicts],
        "warnings": list(found.warnings),
    }


def advice_document(advice: Advice) -> Document:
    """`characterise --advise`: codes 0..1, each k/255."""
    return {
        "patches": advice.codes.tolist(),
        "predicted": [
            {
                "patches": each.patches,
                "set": each.kind,
                "dE00": {"mean": each.mean, "spread": each.spread},
                "chosen": each is advice.chosen,
            }
            for each in advice.predicted
        ],
        "why": advice.why,
        "warnings": list(advice.warnings),
    }


def long_lists(document: Document) -> list[str]:
    """Keys whose lists are too long to show to people."""
    return [key for key, value in document.items() if isinstance(value, list) and len(value) > _LONGEST_SHOWN_LIST]


def _quality(quality: LightQuality) -> dict[str, Any]:
    return {"cct_K": quality.cct_K, "duv": quality.duv, "rf": quality.rf, "ra": quality.ra}


def _parse_xy(text: str) -> Float64Array:
    try:
        x, y = (float(part) for part in text.split(","))
    except ValueError:
        raise LightError(f"'{text}' is no chromaticity", remedy="give --xy 0.3127,0.3290") from None
    if not (0 < x < 1 and 0 < y < 1 and x + y < 1):
        raise LightError(f"'{text}' is no chromaticity of a real light", remedy="give --xy 0.3127,0.3290")
    return np.array([x, y])
