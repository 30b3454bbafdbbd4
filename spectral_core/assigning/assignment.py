"""Give every texel of an RGB texture a reflectance whose colour under the scanner's lamp is the texel's.

After Diaz-Barrancas et al. 2021 (Electronics 10:2852, section 3.2), with colour differences by CIEDE2000.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from spectral_core.arrays import Float32Array, IntArray
from spectral_core.assigning.change import EDGE, Exact
from spectral_core.assigning.choice import Choice, SpectraOfColours
from spectral_core.assigning.codes import CodeColours, code_colours
from spectral_core.assigning.image import RgbImage
from spectral_core.assigning.judging import HeldOut, Spread, held_out
from spectral_core.assigning.known import KnownColours
from spectral_core.assigning.library import Library
from spectral_core.assigning.matching import Mixed, Nearest
from spectral_core.assigning.recovery import Recovered
from spectral_core.assigning.tally import Tally
from spectral_core.errors import SpectrumError
from spectral_core.lights import Light
from spectral_core.standards import DEFAULT_OBSERVER
from spectral_core.textures.writing import TextureWriter, texture_writer, writable_suffix

Progress = Callable[[float, str], None]

# Texels whose colours are looked for together, and spectra that are written together, in bytes.
_TEXELS = 1 << 20
_WRITTEN_BYTES = 1 << 25
# A difference that is seen at once.
_SEEN = 3.0


@dataclass(frozen=True)
class Assignment:
    """A texture that has got spectra.

    Attributes
    ----------
    path
        The hyperspectral texture.
    method
        How reflectances were chosen.
    light
        The scanner's lamp.
    profile
        What said the colours of codes.
    dE00
        Between the texels' colours and those of their reflectances under that lamp, over all texels.
    reflectances_used
        How many of the library, None without one.
    library
        How many there are, None without one.
    most_used
        (name, share of all texels) of the most used ones.
    colours
        Different codes; None if there were too many to count.
    pixels, bands
        Of the texture.
    out_of_gamut
        Texels whose colour the method is not made for, moved to the nearest that it is.
    outside_0_1
        Texels whose reflectance goes below 0 or above 1 somewhere.
    held_out
        How wrong reflectances are under other lights.
    warnings
        What a user should know.
    seconds
        From the first texel to the last.
    """

    path: Path
    method: str
    light: str
    profile: str
    dE00: Spread
    reflectances_used: int | None
    library: int | None
    most_used: tuple[tuple[str, float], ...]
    colours: int | None
    pixels: int
    bands: int
    out_of_gamut: int
    outside_0_1: int
    held_out: tuple[HeldOut, ...]
    warnings: tuple[str, ...]
    seconds: float


def spectra_source(
    light: Light,
    library: Library | None = None,
    mix: int = 0,
    exact: bool = False,
    recover: str | None = None,
    observer: str = DEFAULT_OBSERVER,
    progress: Progress | None = None,
) -> SpectraOfColours:
    """A way of giving spectra to colours under a light.

    Parameters
    ----------
    light
        The scanner's lamp.
    library
        Reflectances; needed unless `recover` is given.
    mix
        How many of the nearest are mixed; 0 takes the nearest alone.
    exact
        Whether a library's reflectance is changed smoothly until its colour is right.
    recover
        A key of `spectral_core.standards.RECOVERY_METHODS`: reflectances from colour alone.
    observer
        A key of `spectral_core.standards.OBSERVERS`.
    progress
        Told of a recovery's progress.

    Raises
    ------
    SpectrumError, MissingExtraError
        If these do not go together, or are not to be had.
    """
    if recover is not None:
        if mix or exact:
            raise SpectrumError(
                "recovered reflectances are neither mixed nor changed", remedy="leave --mix and --exact out"
            )
        return Recovered(recover, light, observer, progress)
    if library is None:
        raise SpectrumError("no library of reflectances", remedy="give --library, or --recover")
    source: SpectraOfColours = Mixed(library, light, mix, observer) if mix else Nearest(library, light, observer)
    return Exact(source, light, observer) if exact else source


def assign(
    texture: str | Path,
    light: Light,
    output: str | Path,
    library: Library | None = None,
    *,
    mix: int = 0,
    exact: bool = False,
    recover: str | None = None,
    icc: str | Path | None = None,
    profile: str | None = None,
    judges: Sequence[Light] = (),
    observer: str = DEFAULT_OBSERVER,
    half: bool = True,
    progress: Progress | None = None,
) -> Assignment:
    """Write the hyperspectral texture `output` of an RGB texture scanned under `light`.

    Parameters
    ----------
    texture
        RGB image of 8 or 16 bits.
    light
        The light that the profile's colours are seen under: the scanner's lamp.
    output
        ``.npz``, ``.npy`` or ``.exr``.
    library, mix, exact, recover
        As of `spectra_source`.
    icc, profile
        What the codes mean: an ICC file, or a display profile by name or file. Without either the image's
        own ICC profile, else sRGB.
    judges
        Lights to predict the library's own colours under, each reflectance left out in turn.
    observer
        A key of `spectral_core.standards.OBSERVERS`.
    half
        Half floats instead of floats.
    progress
        Told the share that is done.

    Raises
    ------
    SpectralBoothError
        If an input cannot be used or the output not be written.
    """
    writable_suffix(output)
    image = RgbImage(texture)
    means = code_colours(image, light.XYZ(observer), None if icc is None else Path(icc), profile)
    if judges and library is None:
        raise SpectrumError("nothing to judge the spectra by", remedy="give --library with --judge")
    source = spectra_source(light, library, mix, exact, recover, observer, progress)
    judged = held_out(source, library, light, judges, observer) if library is not None else ()
    started = time.perf_counter()
    size = image.height, image.width, source.wavelengths_nm
    with texture_writer(output, *size, half) as writer:
        tally = _run(image, means, source, writer, half, progress)
    own = library if recover is None else None
    return Assignment(
        path=Path(output),
        method=source.method,
        light=light.name,
        profile=means.profile,
        dE00=tally.spread(),
        reflectances_used=None if own is None else int((tally.used[: len(own.names)] > 0).sum()),
        library=None if own is None else len(own.names),
        most_used=() if own is None else tally.most_used(own.names),
        colours=tally.colours,
        pixels=tally.pixels,
        bands=len(source.wavelengths_nm),
        out_of_gamut=tally.out_of_gamut,
        outside_0_1=tally.outside_0_1,
        held_out=judged,
        warnings=(*_warnings(image, means, light, library, source, observer), *_verdicts(judged, tally)),
        seconds=time.perf_counter() - started,
    )


def _run(
    image: RgbImage, means: CodeColours, source: SpectraOfColours, writer: TextureWriter, half: bool,
    progress: Progress | None,
) -> Tally:  # fmt: skip
    known = KnownColours(lambda codes: source.choose(means.XYZ(codes)), image.bits)
    tally = Tally(len(source.table))
    table = source.table.astype(np.float32)
    step = max(1, _TEXELS // image.width)
    for first in range(0, image.height, step):
        rows = image.rows(first, min(step, image.height - first))
        which, count, choice = known.choices(rows.reshape(-1, 3))
        tally.add(choice, count)
        tally.outside_0_1 += _write(writer, table, choice, which.reshape(len(rows), -1), half)
        if progress:
            progress((first + len(rows)) / image.height, f"assigning {image.path.name}")
    tally.colours = None if known.forgotten else known.found
    return tally


def _write(writer: TextureWriter, table: Float32Array, choice: Choice, which: IntArray, half: bool) -> int:
    """Write rows of texels; how many have a reflectance outside 0..1."""
    step = max(1, _WRITTEN_BYTES // (4 * which.shape[1] * table.shape[1]))
    outside = 0
    for first in range(0, len(which), step):
        part = which[first : first + step]
        colours, texels = np.unique(part, return_inverse=True)
        spectra = choice.part(colours).spectra(table)
        beyond = (spectra.min(axis=1) < -EDGE) | (spectra.max(axis=1) > 1 + EDGE)
        outside += int(beyond[texels.ravel()].sum()) if beyond.any() else 0
        spectra = spectra.astype(np.float16) if half else spectra
        writer.write(spectra[texels.reshape(part.shape)])
    return outside


def _warnings(
    image: RgbImage, means: CodeColours, light: Light, library: Library | None, source: SpectraOfColours, observer: str
) -> list[str]:
    warnings = [*image.warnings, *means.warnings, *light.warnings, *getattr(source, "warnings", ())]
    return [
        *warnings,
        *(library.warnings if library else ()),
        *(library.unmeasured(light, observer) if library else ()),
    ]


def _verdicts(judged: Sequence[HeldOut], tally: Tally) -> list[str]:
    """What the numbers say of the result."""
    spread = tally.spread()
    warnings = [
        f"{each.light}: these spectra predict colours worse than a plain RGB texture would "
        f"(dE00 {each.dE00.mean:.2f} against {each.rgb_texture.mean:.2f}); mix more, or add --exact"
        for each in judged
        if each.dE00.mean > each.rgb_texture.mean
    ]
    if spread.p95 > _SEEN:
        warnings.append(
            f"a twentieth of the texels is off by more than dE00 {spread.p95:.1f} under the scanner's own lamp"
        )
    if tally.outside_0_1:
        warnings.append(f"{tally.outside_0_1} of {tally.pixels} texels have a reflectance below 0 or above 1 somewhere")
    if tally.out_of_gamut:
        warnings.append(
            f"{tally.out_of_gamut} of {tally.pixels} texels lie outside of sRGB's gamut and were moved to it"
        )
    return warnings
