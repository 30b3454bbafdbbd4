"""Numbers as a reader wants them: a fixed number of decimals, a true minus, a dash for none."""

from __future__ import annotations

import math

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
NONE = "–"


def fixed(value: float | None, decimals: int) -> str:
    """A number with `decimals` decimals; a dash for None and for what is not finite."""
    if value is None or not math.isfinite(value):
        return NONE
    # Rounding first keeps -0.0001 from being shown as a negative zero.
    return f"{round(value, decimals) + 0.0:.{decimals}f}".replace("-", "−")


def percent(fraction: float | None, decimals: int = 1, signed: bool = False) -> str:
    """A fraction as ``99.8 %``; ``+0.3 %`` if signed."""
    if fraction is None or not math.isfinite(fraction):
        return NONE
    text = fixed(100 * fraction, decimals)
    return f"{'+' if signed and fraction >= 0 else ''}{text} %"


def spread(mean: float, sd: float, decimals: int = 2) -> str:
    """Mean and standard deviation, ``3.33 ± 2.86``."""
    return f"{fixed(mean, decimals)} ± {fixed(sd, decimals)}"


def small(value: float, digits: int = 2) -> str:
    """A number that may be very small: powers of ten below 0.001, else `digits` significant digits."""
    if value == 0 or not math.isfinite(value):
        return "0" if value == 0 else NONE
    if abs(value) >= 1e-3:
        decimals = max(0, digits - 1 - math.floor(math.log10(abs(value))))
        return fixed(value, decimals)
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    return f"{mantissa} × 10{str(int(exponent)).translate(_SUPERSCRIPTS)}".replace("-", "−")


def count(number: int, noun: str) -> str:
    """``1 light``, ``2 lights``."""
    return f"{number} {noun}{'' if number == 1 else 's'}"
