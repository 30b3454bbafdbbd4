"""Bounds of CIEDE2000 that cost less than CIEDE2000, so that most colours need not be compared.

With ``x = dC'/S_C``, ``y = dH'/S_H`` and ``l = dL'/S_L`` (Sharma, Wu & Dalal 2005, equations 2 to 22)

    dE00^2 = l^2 + x^2 + y^2 + R_T x y,    R_T = -sin(2 dtheta) R_C,    0 <= dtheta <= 30 degrees,

so that ``-rho <= R_T <= 0`` with ``rho = sin(60 deg) R_C``. And ``dC'^2 + dH'^2`` is the squared distance of the
two points ``(a', b)``, with ``a' = (1 + G) a`` and one G for both: the law of cosines. The rest follows from
``S_C = 1 + 0.045 C'`` and ``S_H = 1 + 0.015 C' T`` of the pair's mean chroma, with T between two constants, so
that ``S_H <= S_C``; from G falling with the mean chroma of L*a*b*; and from R_C and S_L rising with C' and
with the distance of the mean lightness from 50.
"""

from __future__ import annotations

import numpy as np

from spectral_core.arrays import Float64Array, IntArray

# Extremes of T over all hues, rounded outwards.
_T_LEAST, _T_MOST = 0.362, 1.5725
_SIN_60 = np.sin(np.radians(60.0))
_25_7 = 25.0**7
# For a mean hue so far from 275 degrees (as a cosine), the most that sin(2 dtheta) can be.
_FURTHER = (
    (np.cos(np.radians(30.0)), np.sin(np.radians(60.0 * np.exp(-((30 / 25) ** 2))))),
    (np.cos(np.radians(60.0)), np.sin(np.radians(60.0 * np.exp(-((60 / 25) ** 2))))),
)
# Two hues further than a quarter from 275 degrees have a mean that is; a little more, for rounding.
_AWAY = 91.0
_COS_275, _SIN_275 = np.cos(np.radians(275.0)), np.sin(np.radians(275.0))


class Boxes:
    """Boxes of L*a*b* that hold colours, or colours themselves: boxes of no size.

    Parameters
    ----------
    low, high
        Corners (n, 3).

    Attributes
    ----------
    least, most
        Chroma (n,).
    off_blue
        The least angle in degrees (n,) between 275 degrees and the hues of a box, whatever G is.
    side
        1 or -1 (n,) where all hues lie on one side of it, 0 where on both.
    """

    def __init__(self, low: Float64Array, high: Float64Array) -> None:
        self.low, self.high = low, high
        self.least = np.hypot(*np.maximum(np.maximum(low, -high), 0.0)[:, 1:].T)
        self.most = np.hypot(*np.maximum(-low, high)[:, 1:].T)
        a, b = np.stack([low[:, 1], high[:, 1]]), np.stack([low[:, 2], high[:, 2]])
        # The corners as they are and stretched as far as G can: the hues in between lie between theirs.
        angles = np.stack([_off_blue(stretch * a[i], b[j]) for stretch in (1.0, 1.5) for i in (0, 1) for j in (0, 1)])
        lowest, highest = angles.min(axis=0), angles.max(axis=0)
        # Where they span half a circle, the box may hold grey or lie across 95 degrees, where the angle turns over.
        around = (highest - lowest >= 180) | (self.least == 0)
        away = around & (np.abs(angles).min(axis=0) >= _AWAY) & (self.least > 0)
        self.side = np.where(around, 0, np.where(lowest > 0, 1, np.where(highest < 0, -1, 0)))
        self.off_blue = np.where(around, np.where(away, _AWAY, 0.0), np.maximum(np.maximum(lowest, -highest), 0.0))


def box_bounds(boxes: Boxes, box: IntArray, colours: Boxes, colour: IntArray) -> tuple[Float64Array, Float64Array]:
    """Squares of lower and upper bounds (pairs,) of dE00 between all colours of a box and a colour.

    Parameters
    ----------
    boxes, box
        The boxes, and which of them each pair means (pairs,).
    colours, colour
        The colours, and which of them each pair means (pairs,).
    """
    low, high, Lab = boxes.low[box], boxes.high[box], colours.low[colour]
    least = (boxes.least[box] + colours.least[colour]) / 2
    most = (boxes.most[box] + colours.least[colour]) / 2
    below, above = low - Lab, Lab - high
    apart = np.maximum(np.maximum(below, above), 0.0)
    furthest = np.maximum(-below, -above)
    stretch, most_stretch = 1 + _G(most), 1 + _G(least)
    most_primed = most_stretch * most
    rho = _R_C(most_primed) * _sine_of_boxes(boxes, box, colours, colour)
    middle = (low[:, 0] + Lab[:, 0]) / 2 - 50, (high[:, 0] + Lab[:, 0]) / 2 - 50
    off_most = np.maximum(-middle[0], middle[1])
    off_least = np.maximum(np.maximum(middle[0], -middle[1]), 0.0)
    lower = (apart[:, 0] / _S_L(off_most)) ** 2
    # The distance is partly one of chroma, which counts less than one of hue: as much as can be.
    square = (stretch * apart[:, 1]) ** 2 + apart[:, 2] ** 2
    of_chroma = np.maximum(colours.least[colour] - boxes.least[box], boxes.most[box] - colours.least[colour])
    of_chroma += (most_stretch - 1) * np.maximum(boxes.most[box], colours.least[colour])
    of_chroma = np.minimum(of_chroma**2, square)
    lower += (1 - rho / 2) * (
        of_chroma / (1 + 0.045 * most_primed) ** 2 + (square - of_chroma) / (1 + 0.015 * _T_MOST * most_primed) ** 2
    )
    upper = (furthest[:, 0] / _S_L(off_least)) ** 2
    upper += (
        (1 + rho / 2)
        * ((most_stretch * furthest[:, 1]) ** 2 + furthest[:, 2] ** 2)
        / (1 + 0.015 * _T_LEAST * least) ** 2
    )
    return lower, upper


def _off_blue(a: Float64Array, b: Float64Array) -> Float64Array:
    """Angle in degrees (n,) from 275 degrees, -180 to 180."""
    return np.asarray(np.degrees(np.arctan2(b * _COS_275 - a * _SIN_275, a * _COS_275 + b * _SIN_275)))


def _sine_of_boxes(boxes: Boxes, box: IntArray, colours: Boxes, colour: IntArray) -> Float64Array:
    """The most that sin(2 dtheta) can be: the mean hue lies between both hues, on the shorter way round."""
    off = np.minimum(boxes.off_blue[box], colours.off_blue[colour])
    between = (boxes.side[box] * colours.side[colour] <= 0) & (off < _AWAY)
    off[between] = 0.0
    return np.asarray(np.sin(np.radians(60.0 * np.exp(-((off / 25.0) ** 2)))))


def pair_lower_bound(first: Float64Array, second: Float64Array) -> Float64Array:
    """Square of a lower bound (n,) of dE00 between L*a*b* (3, n) and L*a*b* (3, n), without trigonometry.

    The mean hue, where R_T needs it, is the direction of the bisector of the two ``(a', b)``.
    """
    (L_1, a_1, b_1), (L_2, a_2, b_2) = first, second
    stretch = 1 + _G((np.sqrt(a_1**2 + b_1**2) + np.sqrt(a_2**2 + b_2**2)) / 2)
    a_1, a_2 = stretch * a_1, stretch * a_2
    chroma_1, chroma_2 = np.sqrt(a_1**2 + b_1**2), np.sqrt(a_2**2 + b_2**2)
    mean, difference = (chroma_1 + chroma_2) / 2, np.abs(chroma_1 - chroma_2)
    x = difference / (1 + 0.045 * mean)
    y = np.sqrt(np.maximum((a_1 - a_2) ** 2 + (b_1 - b_2) ** 2 - difference**2, 0.0))
    y /= 1 + 0.015 * _T_MOST * mean
    rho = _R_C(mean) * _sine(a_1 * chroma_2 + a_2 * chroma_1, b_1 * chroma_2 + b_2 * chroma_1)
    # y may be larger than this bound of it: the quadratic form is least at rho x / 2.
    y = np.maximum(y, rho * x / 2)
    return np.asarray(((L_1 - L_2) / _S_L((L_1 + L_2) / 2 - 50)) ** 2 + x**2 + y**2 - rho * x * y)


def _sine(a: Float64Array, b: Float64Array) -> Float64Array:
    """The most that sin(2 dtheta) can be for mean hues in the direction (a, b)."""
    along, length = a * _COS_275 + b * _SIN_275, np.sqrt(a**2 + b**2)
    bound = np.full_like(a, _SIN_60)
    for cosine, sine in _FURTHER:
        # Of opposite hues the bisector is rounding: no bound but the largest.
        bound[(along < cosine * length) & (length > 1e-6)] = sine
    return bound


def _G(chroma: Float64Array) -> Float64Array:
    seventh = chroma**7
    return np.asarray(0.5 * (1 - np.sqrt(seventh / (seventh + _25_7))))


def _R_C(chroma: Float64Array) -> Float64Array:
    seventh = chroma**7
    return np.asarray(2 * np.sqrt(seventh / (seventh + _25_7)))


def _S_L(off: Float64Array) -> Float64Array:
    """S_L of a mean lightness so far from 50."""
    return np.asarray(1 + 0.015 * off**2 / np.sqrt(20 + off**2))
