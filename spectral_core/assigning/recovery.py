"""Reflectances for RGB colours without a library: a method of colour-science on a lattice, interpolated.

The lattice is one of linear RGB, and reflectance is interpolated linearly in its tetrahedra. Colours are linear in
reflectance, so an interpolated reflectance has just the colour that is asked for if those of the
lattice's nodes have theirs. The methods are made for D65 and not for the scanner's lamp, and some leave small errors or
cut at 0 and 1: each node's reflectance is therefore changed as smoothly as possible until its colour under the lamp
is right.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from spectral_core import standards
from spectral_core.arrays import Float64Array, IntArray
from spectral_core.assigning.change import EDGE, with_colours
from spectral_core.assigning.choice import Choice
from spectral_core.assigning.codes import between
from spectral_core.errors import SpectrumError
from spectral_core.lights import Light
from spectral_core.standards import DEFAULT_OBSERVER
from spectral_core.weights import interpolation_operator

# Nodes a side. Smits' method is linear in each of the lattice's tetrahedra, Mallett's everywhere: the corners
# say it all. Measured reflectances under other lamps are predicted no better with more nodes than these (Otsu's
# clusters show, and worse), and Jakob's and Meng's methods take a quarter to a whole second a node.
_NODES = {"smits": 2, "mallett": 2, "otsu": 5, "jakob": 4, "meng": 4}
# Nodes stand closer in the dark: even steps of this power's inverse.
_POWER = 2.0
_STEP_NM = 5.0


class Recovered:
    """Each colour gets a reflectance that a method recovers from colour alone.

    Colours outside sRGB's gamut (seen relative to the lamp's white) are moved to its surface, and counted.

    Attributes
    ----------
    method, wavelengths_nm, table
        As of `SpectraOfColours`; the table is the lattice's nodes.
    warnings
        What a user should know of the nodes.

    Raises
    ------
    SpectrumError
        If there is no such method, or it fails.
    MissingExtraError
        If it needs scipy, which is not there.
    """

    def __init__(
        self, method: str, light: Light, observer: str = DEFAULT_OBSERVER,
        progress: Callable[[float, str], None] | None = None,
    ) -> None:  # fmt: skip
        if method not in _NODES:
            raise SpectrumError(f"no recovery method '{method}'", remedy=f"use one of {', '.join(_NODES)}")
        self.method = f"recovered by {standards.RECOVERY_METHODS[method]}"
        self._white = light.XYZ(observer)
        matrix = standards.srgb_to_XYZ_matrix()
        # Linear sRGB relative to the lamp's white.
        self._to_XYZ = between(matrix @ np.ones(3), self._white) @ matrix
        self._axis = np.linspace(0.0, 1.0, _NODES[method]) ** _POWER
        nodes = np.stack(np.meshgrid(*[self._axis] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
        spectra = []
        for index, RGB in enumerate(nodes):
            spectra.append(standards.recovered_reflectance(method, matrix @ RGB))
            if progress:
                progress((index + 1) / len(nodes), f"recovering {index + 1} of {len(nodes)} colours")
        own = spectra[0][0]
        self.wavelengths_nm = np.arange(np.ceil(own[0] / _STEP_NM), np.floor(own[-1] / _STEP_NM) + 1) * _STEP_NM
        table = np.array([values for _, values in spectra]) @ interpolation_operator(own, self.wavelengths_nm).T
        factors = light.weighting_factors(self.wavelengths_nm, observer).matrix
        self.table = with_colours(table, nodes @ self._to_XYZ.T, self.wavelengths_nm, factors)
        self._XYZ = self.table @ factors
        beyond = ((self.table < -EDGE) | (self.table > 1 + EDGE)).any(axis=1).sum()
        self.warnings = (
            (f"{beyond} of {len(nodes)} colours of the lattice have no reflectance within 0..1 under {light.name}",)
            if beyond else ()
        )  # fmt: skip

    def choose(self, XYZ: Float64Array, own: IntArray | None = None) -> Choice:
        """As `SpectraOfColours.choose`; no library, and so nothing to leave out."""
        RGB = np.linalg.solve(self._to_XYZ, XYZ.T).T
        inside = np.clip(RGB, 0.0, 1.0)
        rows, weights = self._tetrahedra(inside)
        outside = (np.abs(inside - RGB) > 1e-4).any(axis=1)
        found = Choice(rows, weights, np.zeros(len(XYZ)), np.asarray(outside))
        return replace(found, dE00=standards.dE00(XYZ, found.spectra(self._XYZ), self._white))

    def _tetrahedra(self, RGB: Float64Array) -> tuple[IntArray, Float64Array]:
        """The four nodes round each colour and their weights, both (n, 4): six tetrahedra share a cell's diagonal."""
        cell = np.clip(np.searchsorted(self._axis, RGB, side="right") - 1, 0, len(self._axis) - 2)
        fraction = (RGB - self._axis[cell]) / (self._axis[cell + 1] - self._axis[cell])
        order = np.argsort(-fraction, axis=1, kind="stable")
        falling = np.take_along_axis(fraction, order, axis=1)
        count = len(self._axis)
        steps = np.array([count * count, count, 1])
        rows = np.concatenate([(cell @ steps)[:, None], steps[order]], axis=1).cumsum(axis=1)
        ends = np.concatenate([np.ones((len(RGB), 1)), falling, np.zeros((len(RGB), 1))], axis=1)
        return rows, ends[:, :-1] - ends[:, 1:]
