"""What an ENVI header says of its spectral channels: wavelengths, which are good, and what values mean.

Channels are the bands of an image and the samples of a spectral library. Keys as in ENVI's own
documentation of its header files.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from spectral_core.arrays import BoolArray, Float64Array
from spectral_core.errors import TextureError
from spectral_core.textures.base import Kind
from spectral_core.textures.envi.header import EnviHeader
from spectral_core.textures.envi.text import shown
from spectral_core.textures.reading import SCALE_RANGE, Reading

# In air or vacuum, whatever the writer meant: they differ by 0.03 per cent.
_SPEED_OF_LIGHT_NM_GHZ = 299_792_458.0
_RANGE_NM = (100.0, 5000.0)

_Convert = Callable[[Float64Array], Float64Array]


def _times(factor: float) -> _Convert:
    return lambda values: values * factor


def _over(numerator: float) -> _Convert:
    return lambda values: numerator / values


_UNITS: tuple[tuple[tuple[str, ...], _Convert], ...] = (
    (("nanometer", "nanometre", "nm"), _times(1.0)),
    (("micrometer", "micrometre", "micron", "um", "µm", "μm"), _times(1e3)),
    (("angstrom", "ångström", "ångstrom", "å", "a"), _times(0.1)),
    (("millimeter", "millimetre", "mm"), _times(1e6)),
    (("centimeter", "centimetre", "cm"), _times(1e7)),
    (("meter", "metre", "m"), _times(1e9)),
    (("wavenumber", "wavenumber(cm-1)", "wavenumbers(cm-1)", "cm-1", "cm^-1", "1/cm"), _over(1e7)),
    (("thz", "terahertz"), _over(_SPEED_OF_LIGHT_NM_GHZ / 1e3)),
    (("ghz", "gigahertz"), _over(_SPEED_OF_LIGHT_NM_GHZ)),
    (("mhz", "megahertz"), _over(_SPEED_OF_LIGHT_NM_GHZ * 1e3)),
)
# "Reflectance (%)", "Reflectance * 10000".
_FACTOR = re.compile(r"%|percent|\*|[0-9]")
_CALIBRATION_KEYS = (
    "reflectance scale factor",
    "data reflectance gain values",
    "data reflectance offset values",
    "data gain values",
    "data offset values",
)


@dataclass(frozen=True)
class Calibration:
    """What stored values mean.

    Attributes
    ----------
    kind
        As far as the header says it.
    scale
        Stored value of reflectance 1; None if the header does not say it.
    gain, dark
        (channels,): value per stored unit and stored value of 0, without the scale; None if there are none.
    warnings
        What was used or ignored, and why.
    """

    kind: Kind | None = None
    scale: float | None = None
    gain: Float64Array | None = None
    dark: Float64Array | None = None
    warnings: tuple[str, ...] = ()


def channels(header: EnviHeader) -> tuple[int, str]:
    """Number of spectral channels, and what they are called."""
    return (header.samples, "samples") if header.is_library else (header.bands, "bands")


def wavelengths_nm(header: EnviHeader) -> tuple[Float64Array | None, list[str]]:
    """Wavelengths (channels,) in nm in the header's order, None if it has none, and warnings.

    Raises
    ------
    TextureError
        If their number or unit is wrong.
    """
    written = header.text.numbers("wavelength", *channels(header))
    if written is None:
        return None, []
    unit, warnings = header.text.text("wavelength units"), []
    if not unit:
        unit = _unit_by_magnitude(written)
        if unit:
            warnings.append(f"the header does not say the unit of its wavelengths; {unit} by their magnitude")
    convert = _conversion(unit)
    if convert is None:
        what = f"are in '{shown(unit)}'" if unit else "are without a unit"
        raise TextureError(
            f"the wavelengths {what}",
            where=header.path,
            remedy="give them with --wavelengths, or write 'wavelength units = Nanometers' or the like",
        )
    with np.errstate(all="ignore"):
        # Six decimals, as in spectral OpenEXR: what the conversion adds beyond them is noise.
        values = np.round(convert(written), 6)
    return values, warnings


def is_light(values_nm: Float64Array) -> BoolArray:
    """Which wavelengths are those of light that anything here is about."""
    return np.asarray((values_nm >= _RANGE_NM[0]) & (values_nm <= _RANGE_NM[1]))


def refuse_other_than_light(values_nm: Float64Array, header: EnviHeader) -> None:
    """Refuse wavelengths that are none, as with a wrong unit.

    Raises
    ------
    TextureError
        With their range.
    """
    if not is_light(values_nm).all():
        unit = header.text.text("wavelength units")
        raise TextureError(
            f"wavelengths from {values_nm.min():g} to {values_nm.max():g} nm"
            f"{f' (in the header: {shown(unit)})' if unit else ''} are not all between 100 and 5000 nm",
            where=header.path,
            remedy="correct 'wavelength units', or give the wavelengths with --wavelengths",
        )


def refuse_repeated(values_nm: Float64Array, used: BoolArray, header: EnviHeader) -> None:
    """Refuse wavelengths (channels,) that two of the channels in use, (channels,), share.

    Raises
    ------
    TextureError
        With the numbers of the first two such channels, counted from 1 as in ENVI.
    """
    order = np.argsort(values_nm, kind="stable")
    order = order[used[order]]
    same = np.flatnonzero(np.diff(values_nm[order]) == 0)
    if len(same):
        first, second = order[same[0]], order[same[0] + 1]
        more = f" and {len(same) - 1} more such pairs" if len(same) > 1 else ""
        raise TextureError(
            f"{channels(header)[1]} {first + 1} and {second + 1} (from 1){more} are both at {values_nm[first]:g} nm",
            where=header.path,
            remedy="correct the header, write the file without one of them, or give --wavelengths",
        )


def order_warning(values: Float64Array) -> list[str]:
    """Says so if wavelengths neither rise nor fall throughout, as where detectors overlap."""
    steps = np.diff(values)
    back = min(int((steps < 0).sum()), int((steps > 0).sum()))
    if not back:
        return []
    return [f"the wavelengths turn back {back} times; every band counts at its own wavelength, whatever the order"]


def good_channels(header: EnviHeader) -> BoolArray:
    """Which channels are good by the header's bad-band list: (channels,); all if it has none.

    Raises
    ------
    TextureError
        If the list has another length, holds anything but 0 and 1, or leaves nothing.
    """
    count, name = channels(header)
    listed = header.text.numbers("bbl", count, name)
    if listed is None:
        return np.ones(count, dtype=bool)
    if not np.isin(listed, (0, 1)).all():
        raise TextureError(
            "'bbl' holds other values than 0 and 1",
            where=header.path,
            remedy="give 1 for good bands and 0 for bad ones",
        )
    if not listed.any():
        raise TextureError("'bbl' calls all bands bad", where=header.path, remedy="correct or remove it")
    return np.asarray(listed == 1)


def ignore_value(header: EnviHeader) -> tuple[float | None, list[str]]:
    """Stored value that stands for no data, as the file's type holds it, and warnings."""
    value = header.text.number("data ignore value")
    if value is None or np.isnan(value):  # NaN is no number whether or not it is declared
        return None, []
    dtype = header.dtype.newbyteorder("=")
    if dtype.kind == "f":
        with np.errstate(over="ignore"):
            stored = float(dtype.type(value))
        if np.isfinite(stored) or not np.isfinite(value):
            return stored, []
    elif np.isfinite(value) and value == int(value) and np.iinfo(dtype).min <= value <= np.iinfo(dtype).max:
        return value, []
    return None, [f"data ignore value {value:g} is none that {dtype.name} can hold; ignored"]


def calibration(header: EnviHeader, reading: Reading) -> Calibration:
    """What the header says of the meaning of its values, as far as its user does not say otherwise.

    In this order: the user's scale; a usable ``reflectance scale factor``; ``data reflectance gain
    values`` (and offsets); ``data gain values`` (and offsets), which do not say what they lead to;
    ``data units`` and ``z plot titles`` that name reflectance or radiance. What leads to reflectance
    is passed over for radiance, and all of it for counts.

    Raises
    ------
    TextureError
        If a list has another length, or a good channel a gain that is not positive or an offset beyond 1e12.
    """
    if reading.scale is not None or reading.kind == "counts":
        given = "scale" if reading.scale is not None else "kind 'counts'"
        keys = [key for key in _CALIBRATION_KEYS if header.text.text(key)]
        return Calibration(
            warnings=(f"the {given} that was given replaces the header's {', '.join(keys)}",) if keys else ()
        )
    lit = reading.kind == "radiance"
    scale, warnings = (None, []) if lit else reflectance_scale(header)
    if scale is not None:
        return Calibration("reflectance", scale, warnings=tuple(warnings))
    kind = _named_kind(header)
    for prefix in ("data",) if lit else ("data reflectance", "data"):
        gain, dark = _gain_and_dark(header, prefix)
        if gain is not None:
            warnings.append(f"values are calibrated by the header's '{prefix} gain values' and offsets")
            known: Kind | None = "reflectance" if prefix == "data reflectance" else kind
            return Calibration(known, None, gain, dark, tuple(warnings))
    if kind == "reflectance" and header.dtype.kind in "iu":
        warnings.append("the header calls its values reflectance and does not say which is 1; give --scale")
        return Calibration(warnings=tuple(warnings))
    if kind is not None and reading.kind is None:
        warnings.append(f"{kind} by what the header calls its values")
    return Calibration(kind, warnings=tuple(warnings))


def reflectance_scale(header: EnviHeader) -> tuple[float | None, list[str]]:
    """The header's ``reflectance scale factor`` if it can be one, else None, and warnings."""
    key = "reflectance scale factor"
    value = header.text.number(key)
    if value is None:
        return None, []
    if not SCALE_RANGE[0] <= value <= SCALE_RANGE[1]:
        return None, [f"{key} {value:g} is impossible; ignored"]
    if header.dtype.kind in "iu" and value <= 1:
        return None, [f"{key} {value:g} cannot be that of {header.dtype.name}; ignored"]
    return value, []


def _conversion(unit: str) -> _Convert | None:
    plain = unit.casefold().replace(" ", "")
    for names, convert in _UNITS:
        if plain in names or plain.removesuffix("s") in names:
            return convert
    return None


def _unit_by_magnitude(written: Float64Array) -> str:
    """Name of the unit where it is beyond doubt, else nothing: band numbers are none."""
    low, high = float(written.min()), float(written.max())
    if _RANGE_NM[0] <= low and high <= _RANGE_NM[1]:
        return "nanometres"
    whole = bool((written == np.round(written)).all())
    return "micrometres" if low >= 0.1 and high <= 5 and not whole else ""


def _gain_and_dark(header: EnviHeader, prefix: str) -> tuple[Float64Array | None, Float64Array]:
    """Gain, None if nothing but 1 and 0 is given, and dark: ``gain * stored + offset`` is one product."""
    count, name = channels(header)
    given = header.text.numbers(f"{prefix} gain values", count, name)
    offset = header.text.numbers(f"{prefix} offset values", count, name)
    gain = np.ones(count) if given is None else given
    offset = np.zeros(count) if offset is None else offset
    if (gain == 1).all() and not offset.any():
        return None, offset
    good = good_channels(header)
    _refuse_impossible("gain", gain, good & ~((gain >= SCALE_RANGE[0]) & (gain <= SCALE_RANGE[1])), header)
    _refuse_impossible("offset", offset, good & (np.abs(offset) > SCALE_RANGE[1]), header)
    gain = np.where(good, gain, 1.0)
    return gain, np.where(good, -offset, 0.0) / gain


def _refuse_impossible(what: str, values: Float64Array, wrong: BoolArray, header: EnviHeader) -> None:
    if wrong.any():
        first = int(np.argmax(wrong))
        raise TextureError(
            f"the {what} {values[first]:g} of {channels(header)[1][:-1]} {first + 1} (from 1) is impossible",
            where=header.path,
            remedy="correct it, or call the band bad in 'bbl'",
        )


def _named_kind(header: EnviHeader) -> Kind | None:
    """What a key made for it calls the values, if it calls them one thing and without a factor."""
    said = " ".join(header.text.text(key).casefold() for key in ("data units", "z plot titles"))
    kinds: tuple[Kind, ...] = ("reflectance", "radiance")
    named = [kind for kind in kinds if kind in said]
    if len(named) != 1 or (named[0] == "reflectance" and _FACTOR.search(said)):
        return None
    return named[0]
