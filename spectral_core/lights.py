"""Lights: spectral power distributions and lines, their colour and their quality.

A `Light` is a list of (wavelength, power) nodes: a table contributes its own samples, each times
the width it stands for; a spectral line contributes one exact node.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from spectral_core import standards, weights
from spectral_core.arrays import BoolArray, Float64Array, frozen
from spectral_core.chromaticities import XYZ_to_xy
from spectral_core.errors import LightError, SpectrumError
from spectral_core.files import is_file
from spectral_core.spectra import Spectra, read_spectra
from spectral_core.standards import DEFAULT_OBSERVER

# CIE 15:2018, 9.5: a correlated colour temperature means nothing further than this from the
# Planckian locus in CIE 1960 uv.
LARGEST_DUV = 0.05
# Tables coarser than CIE 15 recommends for lamps (5 nm); the sum at its own samples is then a
# poor integral of the colour-matching functions.
COARSEST_STEP_NM = 5.0
# Powers are relative; beyond these their products overflow, or lose their digits.
_POWER_RANGE = (1e-100, 1e100)
# A share and a light of a mixture: "0.5 A".
_PART = re.compile(r"\s*(?P<share>(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?)\s+(?P<name>\S.*)")
_INDEX_GRID_NM = np.arange(380.0, 781.0)


@dataclass(frozen=True)
class LightQuality:
    """Correlated colour temperature, Duv, CIE 224 Rf and CIE 13.3 Ra; None where undefined."""

    cct_K: float | None
    duv: float | None
    rf: float | None
    ra: float | None


@dataclass(frozen=True)
class Light:
    """A light source.

    Attributes
    ----------
    name
        What it is called in tables and scenes.
    wavelengths_nm, powers
        (nodes,), ascending; power is relative and already times the width of its sample.
    lines
        (nodes,), True where a node is a spectral line, so that plots and indices know.
    kind
        ``illuminant``, ``measured``, ``designed``, ``file`` or ``mixture``.
    warnings
        What a user should know of it.
    parts
        Of a mixture: its lights and their shares of the white's luminance.
    """

    name: str
    wavelengths_nm: Float64Array
    powers: Float64Array
    lines: BoolArray
    kind: str = "file"
    warnings: tuple[str, ...] = ()
    parts: tuple[tuple[Light, float], ...] = ()

    @classmethod
    def from_table(cls, name: str, wavelengths_nm: Float64Array, powers: Float64Array, kind: str = "file") -> Light:
        """A light from a table (n,), summed at its own samples.

        Raises
        ------
        LightError
            If a power is negative or not finite, or the light has no luminance.
        """
        wavelengths = np.asarray(wavelengths_nm, dtype=np.float64)
        table = np.asarray(powers, dtype=np.float64)
        _check_powers(name, wavelengths, table)
        widths = weights.quadrature_widths(wavelengths)
        return cls(
            name=name,
            wavelengths_nm=frozen(wavelengths),
            powers=frozen(table * widths),
            lines=np.zeros(len(wavelengths), dtype=bool),
            kind=kind,
            warnings=tuple(_table_warnings(wavelengths, table)),
        )

    @classmethod
    def from_lines(
        cls, name: str, wavelengths_nm: Sequence[float], powers: Sequence[float], kind: str = "designed"
    ) -> Light:
        """A light of spectral lines (n,), each one exact node."""
        order = np.argsort(wavelengths_nm)
        wavelengths = np.asarray(wavelengths_nm, dtype=np.float64)[order]
        table = np.asarray(powers, dtype=np.float64)[order]
        _check_powers(name, wavelengths, table)
        return cls(name, frozen(wavelengths), frozen(table), np.ones(len(wavelengths), dtype=bool), kind)

    @classmethod
    def builtin(cls, name: str) -> Light:
        """A built-in light by name, case and punctuation ignored (`builtin_names` lists them).

        Raises
        ------
        LightError
            If there is none of that name; the nearest names are suggested.
        """
        known = _names_by_key()
        if _key(name) not in known:
            near = difflib.get_close_matches(_key(name), list(known), n=3, cutoff=0.5)
            hint = f"did you mean {' or '.join(repr(known[each]) for each in near)}? " if near else ""
            raise LightError(
                f"no built-in light and no file called '{name}'",
                remedy=f"{hint}`spectral-booth lights` lists them".strip(),
            )
        return _builtin(known[_key(name)])

    @classmethod
    def load(cls, name_or_path: str | Path) -> Light:
        """A light from a built-in name, a file with one spectrum, or a mixture (see `mixture_parts`).

        Raises
        ------
        LightError, SpectrumError
            If it is neither, or the file cannot be used.
        """
        text = str(name_or_path)
        path = Path(text)
        parts = [] if is_file(path) else mixture_parts(text)
        if parts:
            return mixed_light([(cls.load(part), share) for part, share in parts])
        looks_like_file = path.suffix.lower() in (".csv", ".txt", ".tsv", ".spd") or "/" in text or "\\" in text
        if _key(text) in _names_by_key():
            return cls.builtin(text)
        if not looks_like_file and not is_file(path):
            return cls.builtin(text)
        return light_from_spectra(read_spectra(path, "power"), path)

    def same_spectrum(self, other: Light) -> bool:
        """Whether it has the same nodes, whatever its name."""
        return np.array_equal(self.wavelengths_nm, other.wavelengths_nm) and np.array_equal(self.powers, other.powers)

    def XYZ(self, observer: str = DEFAULT_OBSERVER) -> Float64Array:
        """XYZ (3,) with Y = 1."""
        return weights.light_XYZ(self.wavelengths_nm, self.powers, observer)

    def luminance(self) -> float:
        """The sum of its powers as the CIE 1931 observer weights them, in the unit of its powers."""
        return float(self.powers @ weights.colour_matching(self.wavelengths_nm)[:, 1])

    def xy(self, observer: str = DEFAULT_OBSERVER) -> Float64Array:
        """Chromaticity (2,)."""
        return XYZ_to_xy(self.XYZ(observer))

    def weighting_factors(
        self, bands_nm: Float64Array, observer: str = DEFAULT_OBSERVER, interpolation: str = "cubic"
    ) -> weights.WeightingFactors:
        """Weighting factors for reflectance at `bands_nm` (bands,), in any order and spacing."""
        return weights.weighting_factors(self.wavelengths_nm, self.powers, bands_nm, observer, interpolation)

    def quality(self) -> LightQuality:
        """CCT, Duv, Rf and Ra. CCT and both indices are None further than Duv 0.05 from the locus."""
        cct, duv = standards.cct_and_duv(self.xy())
        if not np.isfinite(cct) or not np.isfinite(duv) or abs(duv) > LARGEST_DUV:
            return LightQuality(None, float(duv) if np.isfinite(duv) else None, None, None)
        grid, powers = self._index_table()
        return LightQuality(cct, duv, standards.fidelity_index(grid, powers), standards.rendering_index(grid, powers))

    def _index_table(self) -> tuple[Float64Array, Float64Array]:
        """The table that Rf and Ra are computed from: the light's own where it is one of 1 or 5 nm
        from 380 to 780 nm, as CIE 224 asks; otherwise 1 nm, interpolated linearly and dark beyond
        its ends, each line shared between its two neighbours by distance.
        """
        nm = self.wavelengths_nm
        inside = (nm >= _INDEX_GRID_NM[0]) & (nm <= _INDEX_GRID_NM[-1])
        if not self.parts and not self.lines.any() and _is_standard_grid(nm[inside]):
            # Beyond 380 to 780 nm the table may be uneven: its density, not what its samples stand for.
            return nm[inside], (self.powers / weights.quadrature_widths(nm))[inside]
        return _INDEX_GRID_NM, self._every_nm()

    def _every_nm(self) -> Float64Array:
        """Powers at each nm from 380 to 780."""
        if self.parts:
            scaled = [light._every_nm() * (share / light.luminance()) for light, share in self.parts]
            return np.asarray(np.sum(scaled, axis=0))
        nm, table = self.wavelengths_nm, ~self.lines
        powers = np.zeros_like(_INDEX_GRID_NM)
        if table.sum() > 1:
            density = self.powers[table] / weights.quadrature_widths(nm[table])
            powers += np.interp(_INDEX_GRID_NM, nm[table], density, left=0.0, right=0.0)
        below = np.floor(nm[self.lines])
        fraction = nm[self.lines] - below
        for at, share in ((below, 1 - fraction), (below + 1, fraction)):
            inside = (at >= _INDEX_GRID_NM[0]) & (at <= _INDEX_GRID_NM[-1])
            np.add.at(powers, (at[inside] - _INDEX_GRID_NM[0]).astype(int), (self.powers[self.lines] * share)[inside])
        return powers


def light_from_spectra(spectra: Spectra, path: Path) -> Light:
    """The one light of a file: a table, or exact lines where the file says ``# kind: lines``."""
    if len(spectra.names) != 1:
        raise SpectrumError(
            f"{len(spectra.names)} spectra ({', '.join(spectra.names[:4])}...), a light has one",
            where=path,
            remedy="keep the wavelength column and one spectrum",
        )
    name = spectra.names[0] if spectra.named else path.stem
    try:
        if spectra.lines:
            return Light.from_lines(name, spectra.wavelengths_nm.tolist(), spectra.values[0].tolist(), kind="file")
        return Light.from_table(name, spectra.wavelengths_nm, spectra.values[0])
    except LightError as error:
        raise LightError(error.problem, where=path, remedy=error.remedy) from None


def mixture_parts(text: str) -> list[tuple[str, float]]:
    """Names and shares of a mixture such as ``0.5 A + 0.3 D65 + 0.2 FL11``; empty if the text is none.

    Shares are of the white's luminance; they need not add up to 1, only their ratios count.
    """
    found = [_PART.fullmatch(part) for part in text.split(" + ")]
    if len(found) < 2 or not all(found):
        return []
    return [(each["name"].strip(), float(each["share"])) for each in found if each]


def mixture_name(parts: Sequence[tuple[str, float]]) -> str:
    """The text of a mixture, or the one light's name."""
    if len(parts) == 1:
        return parts[0][0]
    return " + ".join(f"{share:g} {name}" for name, share in parts)


def check_shares(shares: Sequence[float]) -> float:
    """The sum of a mixture's shares.

    Raises
    ------
    LightError
        If a share is negative or not finite, or all are 0.
    """
    total = sum(shares)
    if not (np.isfinite(total) and total > 0 and min(shares) >= 0):
        raise LightError(
            f"the shares {', '.join(f'{each:g}' for each in shares)} make no mixture", remedy="give numbers above 0"
        )
    return total


def mixed_light(parts: Sequence[tuple[Light, float]]) -> Light:
    """Several lights as one, each with its share of the white's luminance; only the ratios count.

    Raises
    ------
    LightError
        As `check_shares`.
    """
    total = check_shares([share for _, share in parts])
    nm = np.concatenate([light.wavelengths_nm for light, _ in parts])
    powers = np.concatenate([light.powers * (share / total / light.luminance()) for light, share in parts])
    order = np.argsort(nm, kind="stable")
    return Light(
        name=mixture_name([(light.name, share / total) for light, share in parts]),
        wavelengths_nm=frozen(nm[order]),
        powers=frozen(powers[order]),
        lines=np.concatenate([light.lines for light, _ in parts])[order],
        kind="mixture",
        warnings=tuple(dict.fromkeys(text for light, _ in parts for text in light.warnings)),
        parts=tuple((light, share / total) for light, share in parts),
    )


@cache
def builtin_names() -> tuple[str, ...]:
    """Names of the built-in lights: CIE and ISO illuminants, measured sources, designed lights."""
    return (*standards.illuminant_tables(), *standards.light_source_tables(), *_DESIGNED)


@cache
def _names_by_key() -> dict[str, str]:
    """Built-in names by what counts of a name, aliases included."""
    known = {_key(each): each for each in builtin_names()}
    return {**_ALIASES, **known}


@cache
def _builtin(name: str) -> Light:
    if name in _DESIGNED:
        from spectral_core import light_design

        return light_design.builtin_design(name)
    illuminants = standards.illuminant_tables()
    kind = "illuminant" if name in illuminants else "measured"
    wavelengths, powers = illuminants[name] if name in illuminants else standards.light_source_tables()[name]
    return Light.from_table(name, wavelengths, powers, kind)


_DESIGNED = ("two-peaks-d65", "d65-simulator")
_ALIASES = {
    "tl84": "Philips TL-84",
    "philipstl84": "Philips TL-84",
    "twopeaks": "two-peaks-d65",
    "simulator": "d65-simulator",
    "sodium": "LPS",
    "lowpressuresodium": "LPS",
    "highpressuresodium": "HPS",
}


def _is_standard_grid(nm: Float64Array) -> bool:
    return any(np.array_equal(nm, np.arange(_INDEX_GRID_NM[0], _INDEX_GRID_NM[-1] + 1, step)) for step in (1, 5))


def _key(name: str) -> str:
    return "".join(each for each in name.casefold() if each.isalnum() or each == ".")


def _check_powers(name: str, wavelengths: Float64Array, powers: Float64Array) -> None:
    bad = ~np.isfinite(powers)
    if bad.any():
        raise LightError(
            f"power of '{name}' at {wavelengths[bad][0]:g} nm is not a finite number", remedy="correct the value"
        )
    if (powers < 0).any():
        where = int(np.argmax(powers < 0))
        raise LightError(
            f"power of '{name}' at {wavelengths[where]:g} nm is negative ({powers[where]:g})",
            remedy="correct it, or set it to 0 if it is the instrument's noise",
        )
    largest = float(powers.max(initial=0.0))
    if largest > 0 and not _POWER_RANGE[0] <= largest <= _POWER_RANGE[1]:
        raise LightError(f"the largest power of '{name}' is {largest:g}", remedy="scale the powers to about 1")
    if not (powers * weights.colour_matching(wavelengths)[:, 1]).sum() > 0:
        raise LightError(f"'{name}' has no luminance", remedy="give a spectrum with power between 380 and 780 nm")


def _table_warnings(wavelengths: Float64Array, powers: Float64Array) -> list[str]:
    warnings = []
    step = float(np.diff(wavelengths).max()) if len(wavelengths) > 1 else np.inf
    if step > COARSEST_STEP_NM:
        warnings.append(f"sampled every {step:g} nm: CIE 15 asks for 5 nm or finer; lines between samples are not seen")
    # What the observer would see beyond the table if the end powers went on: an upper estimate
    # for smooth lamps, and nothing at all where they end in darkness.
    luminance = (powers * weights.quadrature_widths(wavelengths)) @ weights.colour_matching(wavelengths)
    for end, beyond in ((0, np.arange(360.0, wavelengths[0])), (-1, np.arange(wavelengths[-1] + 1.0, 831.0))):
        if not len(beyond):
            continue
        missing = powers[end] * weights.colour_matching(beyond).sum(axis=0)
        share = float(np.max(missing / np.maximum(luminance, luminance.max() * 1e-3)))
        if share > 1e-3:
            side = "below" if end == 0 else "above"
            warnings.append(
                f"ends at {wavelengths[end]:g} nm with power left: up to {share:.1%} of X, Y or Z {side} it is missing"
            )
    return warnings
