"""What measurements say of a display before any model: one verdict a check."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from spectral_core.arrays import Float64Array, frozen
from spectral_core.display.characterising.repeats import (
    clipping,
    drift,
    duplicates,
    instrument_noise,
    noise,
    reading_noise,
)
from spectral_core.display.characterising.verdicts import (
    ADDITIVE_PERCENT,
    Verdict,
    mixes_add_up,
    monotonic,
    saturation,
    untold,
)
from spectral_core.display.measuring.measurements import Measurements
from spectral_core.display.models import LEAST_LIGHT

# In percent of white: above it the contrast is below 100:1, which is stray light or a lifted black.
# Black of the published headset is 0.4 %.
_BLACK_PERCENT = 1.0
_SPECTRA_DE00 = 1.0


@dataclass(frozen=True)
class Checks:
    """What was found.

    Attributes
    ----------
    additivity_error, additivity_XYZ
        (R + G + B - 2 black) / white - 1: of Y, and (3,) of X, Y and Z.
    black_share
        Y of black over Y of white.
    noise_dE00
        Mean dE00 of repeated patches from their mean, None without repeats.
    warnings
        What a user should know: the file's warnings and the advice of the checks that failed.
    verdicts
        Every check.
    """

    additivity_error: float
    additivity_XYZ: Float64Array
    black_share: float
    noise_dE00: float | None
    warnings: tuple[str, ...]
    verdicts: tuple[Verdict, ...]


def check(measured: Measurements) -> Checks:
    """Check a set of measurements."""
    white, black = measured.white_XYZ, measured.black_XYZ
    primaries = [measured.at(*np.eye(3)[index]) for index in range(3)]
    total = np.sum([each for each in primaries if each is not None], axis=0) - 2 * black
    additivity = np.asarray(total / white - 1)
    black_share = float(black[1] / white[1])
    relative = replace(measured, XYZ=frozen(measured.XYZ / white[1]))
    noise_dE00, repeated = noise(relative), reading_noise(relative)
    verdicts = (
        _additivity(additivity),
        *mixes_add_up(relative, repeated),
        _black(measured, black_share),
        monotonic(relative, None if repeated is None else 100 * repeated[0]),
        saturation(relative),
        instrument_noise(relative),
        drift(relative),
        duplicates(relative),
        clipping(relative),
        *_spectra(measured),
    )
    warnings = list(measured.warnings)
    if measured.at(0, 0, 0) is None:
        warnings.append("black was not measured and is taken as 0")
    warnings += [each.advice for each in verdicts if each.passed is False]
    return Checks(float(additivity[1]), additivity, black_share, noise_dE00, tuple(warnings), verdicts)


def _additivity(error: Float64Array) -> Verdict:
    percent = float(100 * error[1])
    passed = abs(percent) <= ADDITIVE_PERCENT
    found = (
        f"red, green and blue sum to {abs(percent):.1f} % {'more' if percent > 0 else 'less'} than white's luminance"
    )
    advice = found if passed else f"not additive: {found}; greys need curves of their own, mixes a correction"
    return Verdict(
        "additivity of white", percent, "% of white", ADDITIVE_PERCENT, "twice what instruments reproduce",
        passed, advice, {"X_percent": float(100 * error[0]), "Z_percent": float(100 * error[2])},
    )  # fmt: skip


def _black(measured: Measurements, share: float) -> Verdict:
    name, unit = "black level", "% of white"
    if measured.at(0, 0, 0) is None:
        return untold(name, unit, "measure black (codes 0): without it black is taken as 0")
    percent = 100 * share
    passed = percent <= _BLACK_PERCENT
    found = (
        f"black is {percent:.2g} % of white, a contrast of {1 / share:.0f}:1"
        if share > LEAST_LIGHT
        else "black reads 0"
    )
    advice = found if passed else f"{found}: keep stray light out, and let nothing lift the codes"
    details = {"black_Y": float(measured.black_XYZ[1])}
    return Verdict(name, percent, unit, _BLACK_PERCENT, "a contrast of 100:1", passed, advice, details)


def _spectra(measured: Measurements) -> tuple[Verdict, ...]:
    """The spectra against the instrument's own XYZ, where a file has both."""
    found = measured.agreement
    if found is None:
        return ()
    passed = found.mean_dE00 <= _SPECTRA_DE00
    advice = f"the spectra's XYZ and the instrument's differ by dE00 {found.mean_dE00:.2f} on average"
    advice += f", {found.max_dE00:.2f} at most" + ("" if passed else ": one of the two is not of these patches")
    details = {"max_dE00": found.max_dE00, "max_percent": found.max_percent}
    return (
        Verdict(
            "spectra against XYZ", found.mean_dE00, "dE00, mean", _SPECTRA_DE00, "just seen side by side",
            passed, advice, details,
        ),
    )  # fmt: skip
