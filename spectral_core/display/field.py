"""How uniform a headset's field is: readings at several points, and a smooth map through them.

Angles are degrees to the right and up from the centre of the field; luminance is relative to the
reading there. The map is a polynomial in both angles, of the degree that predicts points it was not
fitted to best (the simplest within the standard error of the best).
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from spectral_core.arrays import Float64Array, IntArray, frozen
from spectral_core.display.chromaticities import uv
from spectral_core.display.tables import number_columns, parse_table
from spectral_core.errors import DisplayError
from spectral_core.files import read_text
from spectral_core.standards import XYZ_to_Lab, delta_E_2000

_HEADERS = (["Y"], ["x", "y", "Y"], ["R", "G", "B", "X", "Y", "Z"])
_WIDEST_FIELD = 180.0
# The centre is where a reading was meant to be at 0, 0, give or take the aiming.
_CENTRE_DEG, _FARTHEST_CENTRE_DEG = 0.5, 2.5
_DEGREES = range(5)
# Of squared relative luminance: what is smaller is no difference between maps.
_ROUNDING = 1e-12
_NAMES = {(1, 1, 1): "white", (1, 0, 0): "red", (0, 1, 0): "green", (0, 0, 1): "blue", (0, 0, 0): "black"}


@dataclass(frozen=True)
class FieldReadings:
    """One patch over the field: points (n, 2) in degrees, luminance (n,), XYZ (n, 3) or None."""

    name: str
    points_deg: Float64Array
    Y: Float64Array
    XYZ: Float64Array | None


@dataclass(frozen=True)
class Span:
    """Smallest, mean and largest over the readings."""

    min: float
    mean: float
    max: float


@dataclass(frozen=True)
class FieldMap:
    """A polynomial in degrees over the field.

    Attributes
    ----------
    degree
        Total degree of its terms.
    coefficients
        (terms,), of x^i y^j with i + j from 0 to the degree, i falling, in angles over `scale_deg`.
    scale_deg
        What angles are divided by.
    fit_rms, held_out_rms
        Relative luminance: of the fit, and of each point from a fit to the others.
    """

    degree: int
    coefficients: Float64Array
    scale_deg: float
    fit_rms: float
    held_out_rms: float

    def at(self, points_deg: Float64Array) -> Float64Array:
        """Relative luminance (n,) at points (n, 2)."""
        return np.asarray(_terms(points_deg / self.scale_deg, self.degree) @ self.coefficients)


@dataclass(frozen=True)
class PatchReport:
    """One patch over the field, against its reading at the centre.

    Attributes
    ----------
    name, points_deg, centre_deg, centre_Y
        The patch; where it was read (n, 2); where and what its centre is (the mean of repeats).
    relative
        (n,) luminance over the centre's, and `luminance` its span.
    fall_off_percent_per_degree
        Of the line through the centre that fits the readings best, over the angle from there.
    tilt_percent_per_degree
        Slope to the right and up of the plane that fits best; None where points lie on one line.
    dE00, dE00_chromatic
        CIEDE2000 from the centre, relative to white there; and with luminances made equal. None
        without XYZ.
    delta_uv
        Distance in u'v' from the centre.
    map
        The smooth map of relative luminance, None with too few points.
    """

    name: str
    points_deg: Float64Array
    centre_deg: tuple[float, float]
    centre_Y: float
    relative: Float64Array
    luminance: Span
    fall_off_percent_per_degree: float
    tilt_percent_per_degree: tuple[float, float] | None
    dE00: Span | None
    dE00_chromatic: Span | None
    delta_uv: Span | None
    map: FieldMap | None

    def to_json(self) -> dict[str, object]:
        """Plain values."""
        document = asdict(self)
        fitted = document["map"]
        if fitted is not None:
            fitted["coefficients"] = fitted["coefficients"].tolist()
        return {**document, "points_deg": self.points_deg.tolist(), "relative": self.relative.tolist()}


@dataclass(frozen=True)
class FieldReport:
    """Patches, white first, and what a user should know."""

    patches: tuple[PatchReport, ...]
    warnings: tuple[str, ...]


def read_field(path: Path) -> tuple[FieldReadings, ...]:
    """Readings over the field, one entry a patch, white first.

    CSV with ``x_deg,y_deg`` and ``Y`` or ``x,y,Y`` (of white), or ``R,G,B,X,Y,Z`` (codes 0..1 or 0..255).

    Raises
    ------
    DisplayError
        If the file is no such table, a reading cannot be, or white was not read.
    """
    text = read_text(path, DisplayError, "give a CSV of readings over the field")
    header, rows = parse_table(text, path, "give a header and one row a point")
    if header[:2] != ["x_deg", "y_deg"] or header[2:] not in _HEADERS:
        raise DisplayError(
            f"the header is {','.join(header)[:80]}",
            where=path,
            remedy="give x_deg,y_deg, then Y, or x,y,Y, or R,G,B,X,Y,Z",
        )
    table = number_columns(rows, list(range(len(header))), path)
    if np.abs(table[:, :2]).max() > _WIDEST_FIELD:
        raise DisplayError(f"angles beyond {_WIDEST_FIELD:g} degrees", where=path, remedy="give degrees")
    return _patches(header[2:], table, path)


def _patches(columns: list[str], table: Float64Array, path: Path) -> tuple[FieldReadings, ...]:
    points, values = table[:, :2], table[:, 2:]
    codes = np.ones((len(table), 3))
    if columns == ["Y"]:
        XYZ, Y = None, values[:, 0]
    elif columns == ["x", "y", "Y"]:
        x, y, Y = values.T
        if not (y > 0).all():
            raise DisplayError("a chromaticity y is not above 0", where=path, remedy="correct the reading")
        XYZ = np.stack([x / y * Y, Y, (1 - x - y) / y * Y], axis=1)
    else:
        codes = values[:, :3] / (255.0 if values[:, :3].max() > 1 else 1.0)
        XYZ, Y = values[:, 3:], values[:, 4]
    if not (Y > 0).all() or (XYZ is not None and not (XYZ.sum(axis=1) > 0).all()):
        raise DisplayError("a luminance is not above 0", where=path, remedy="correct or leave out the reading")
    keys, group = np.unique(codes.round(4), axis=0, return_inverse=True)
    found = [
        FieldReadings(
            _name(key), frozen(points[chosen]), frozen(Y[chosen]), None if XYZ is None else frozen(XYZ[chosen])
        )
        for index, key in enumerate(keys)
        for chosen in (group.ravel() == index,)
    ]
    found.sort(key=lambda each: each.name != "white")
    if found[0].name != "white":
        raise DisplayError("white (R = G = B = 1) was not read", where=path, remedy="read white at every point")
    if found[0].XYZ is not None and not (found[0].XYZ > 0).all():
        raise DisplayError("white has an X, Y or Z that is not above 0", where=path, remedy="read it again")
    return tuple(found)


def _name(code: Float64Array) -> str:
    known = _NAMES.get(tuple(code.tolist()))
    return known or "/".join(f"{value:.3g}" for value in code)


def field_report(patches: tuple[FieldReadings, ...]) -> FieldReport:
    """Non-uniformity of each patch, white first.

    Raises
    ------
    DisplayError
        If a patch was not read near the centre, or at no other point.
    """
    warnings: list[str] = []
    white = patches[0]
    white_XYZ = None if white.XYZ is None else white.XYZ[_centre(white)].mean(axis=0)
    reports = tuple(_patch_report(each, white_XYZ) for each in patches)
    for each in reports:
        away = float(np.hypot(*each.centre_deg))
        if away > _CENTRE_DEG:
            warnings.append(
                f"{each.name}: nothing was read at the centre; all is relative to {away:.2g} degrees from it"
            )
        if each.map is None:
            warnings.append(f"{each.name}: too few points, or all on one line: no map is fitted")
    return FieldReport(reports, tuple(warnings))


def _centre(patch: FieldReadings) -> IntArray:
    """Indices of the readings at the point nearest to the centre."""
    away = np.hypot(*patch.points_deg.T)
    if away.min() > _FARTHEST_CENTRE_DEG:
        raise DisplayError(
            f"{patch.name} was read no nearer to the centre than {away.min():.3g} degrees",
            remedy="read the centre (0, 0) too",
        )
    if len(np.unique(patch.points_deg, axis=0)) < 2:
        raise DisplayError(f"{patch.name} was read at one point only", remedy="read others too")
    return np.flatnonzero((patch.points_deg == patch.points_deg[away.argmin()]).all(axis=1))


def _patch_report(patch: FieldReadings, white_XYZ: Float64Array | None) -> PatchReport:
    centre = _centre(patch)
    at = patch.points_deg[centre[0]]
    centre_Y = float(patch.Y[centre].mean())
    relative = patch.Y / centre_Y
    away = np.hypot(*(patch.points_deg - at).T)
    dE00 = chromatic = delta_uv = None
    if patch.XYZ is not None and white_XYZ is not None:
        middle = patch.XYZ[centre].mean(axis=0)
        Lab = XYZ_to_Lab(middle, white_XYZ)
        dE00 = _span(delta_E_2000(XYZ_to_Lab(patch.XYZ, white_XYZ), Lab))
        chromatic = _span(delta_E_2000(XYZ_to_Lab(patch.XYZ / relative[:, None], white_XYZ), Lab))
        delta_uv = _span(np.hypot(*(uv(patch.XYZ) - uv(middle)).T))
    fitted = fit_map(patch.points_deg, relative)
    return PatchReport(
        name=patch.name,
        points_deg=patch.points_deg,
        centre_deg=(float(at[0]), float(at[1])),
        centre_Y=centre_Y,
        relative=frozen(relative),
        luminance=_span(relative),
        fall_off_percent_per_degree=float(100 * (away @ (1 - relative)) / (away @ away)),
        tilt_percent_per_degree=_tilt(patch.points_deg, relative),
        dE00=dE00,
        dE00_chromatic=chromatic,
        delta_uv=delta_uv,
        map=fitted,
    )


def fit_map(points_deg: Float64Array, relative: Float64Array) -> FieldMap | None:
    """The polynomial of the simplest degree within noise of the best held-out error.

    Repeats of a point are held out together. None where fewer than two points are left to judge
    even a plane, or they lie on one line.
    """
    places, group = np.unique(points_deg, axis=0, return_inverse=True)
    group = group.ravel()
    scale = max(float(np.abs(points_deg).max()), 1e-6)
    scaled = points_deg / scale
    if len(places) < 5 or not _solvable(scaled, 1):
        return None
    trials = []
    for degree in _DEGREES:
        terms = _terms(scaled, degree)
        kept = [group != index for index in range(len(places))]
        # Two points more than terms: one to hold out, one to tell a fit from a copy.
        if len(places) < terms.shape[1] + 2 or not all(_solvable(scaled[each], degree) for each in kept):
            break
        error = np.empty(len(places))
        for index, each in enumerate(kept):
            missed = terms[~each] @ _solve(terms[each], relative[each]) - relative[~each]
            error[index] = (missed**2).mean()
        trials.append(error)
    best = min(trials, key=lambda each: float(each.mean()))
    degree = next(
        index
        for index, each in enumerate(trials)
        if (each - best).mean() <= max((each - best).std() / np.sqrt(len(places)), _ROUNDING)
    )
    terms = _terms(scaled, degree)
    coefficients = _solve(terms, relative)
    fit_rms = float(np.sqrt(((terms @ coefficients - relative) ** 2).mean()))
    return FieldMap(degree, frozen(coefficients), scale, fit_rms, float(np.sqrt(trials[degree].mean())))


def _tilt(points_deg: Float64Array, relative: Float64Array) -> tuple[float, float] | None:
    scale = max(float(np.abs(points_deg).max()), 1e-6)
    if not _solvable(points_deg / scale, 1):
        return None
    _, right, up = (100 * _solve(_terms(points_deg / scale, 1), relative) / scale).tolist()
    return right, up


def _terms(points: Float64Array, degree: int) -> Float64Array:
    """(n, terms): x^i y^j with i + j from 0 to the degree, i falling."""
    x, y = points.T
    return np.stack([x ** (total - j) * y**j for total in range(degree + 1) for j in range(total + 1)], axis=1)


def _solvable(points: Float64Array, degree: int) -> bool:
    terms = _terms(points, degree)
    return len(terms) >= terms.shape[1] and bool(np.linalg.cond(terms) < 1e6)


def _solve(terms: Float64Array, values: Float64Array) -> Float64Array:
    return np.asarray(np.linalg.lstsq(terms, values, rcond=None)[0])


def _span(values: Float64Array) -> Span:
    return Span(float(values.min()), float(values.mean()), float(values.max()))
