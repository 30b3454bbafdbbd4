"""Synthetic hyperspectral textures of fruit, computed from pigments.

No capture stands behind them: a few maps of pigment concentration, the pigments' absorption and
the theory of Kubelka and Munk give the reflectance of every pixel. The bands' positions are
published, those of orange and red carotenoids in solution and here moved to the red as tissue
does. Their widths and strengths, and all concentrations, are set by hand so that the spectra look
like measured food (floor of 2 to 6 % where pigments absorb, plateau of 55 to 75 % above, the red
edge of chlorophyll), and are no measurement.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from spectral_core.arrays import Float32Array, Float64Array, frozen
from spectral_core.errors import TextureError
from spectral_core.textures.base import HyperspectralTexture, Kind, Samples
from spectral_core.textures.synthetic.skin import directions, mottle, spots

HEIGHT, WIDTH = 256, 512
# Share of light that the rough cuticle sends back before it meets a pigment, without colour
# (Saunderson 1942, k1, less the specular part that a surface's gloss stands for). Measured fruit
# shows such a floor of 2 to 6 % where pigments absorb all else.
_CUTICLE = 0.02
WAVELENGTHS_NM = np.arange(380.0, 781.0, 5.0)

Maps = Mapping[str, Float32Array]


@dataclass(frozen=True)
class Pigment:
    """Absorption as a sum of Gaussians in wavelength, and where its bands are published.

    Attributes
    ----------
    bands
        (centre nm, standard deviation nm, relative strength).
    source
        Author and year.
    """

    bands: tuple[tuple[float, float, float], ...]
    source: str

    def absorption(self, wavelengths_nm: Float64Array) -> Float64Array:
        """(n,) with its largest value in the visible at 1: a concentration is then K/S at that peak."""
        grid = np.arange(380.0, 781.0)
        return np.asarray(self._sum(wavelengths_nm) / self._sum(grid).max())

    def _sum(self, wavelengths_nm: Float64Array) -> Float64Array:
        centre, width, strength = np.array(self.bands).T
        return np.asarray(np.exp(-(((wavelengths_nm[:, None] - centre) / width) ** 2) / 2) @ strength)


PIGMENTS: dict[str, Pigment] = {
    # In the living leaf the red band of chlorophyll a lies at 676 nm (662 in acetone).
    "chlorophyll a": Pigment(
        (
            (384, 22, 0.75),
            (413, 15, 0.80),
            (435, 12, 1.00),
            (585, 24, 0.10),
            (623, 17, 0.20),
            (676, 11.5, 0.72),
            (700, 14, 0.06),
        ),
        "Hoepffner & Sathyendranath 1991, Gaussian bands in vivo",
    ),
    "chlorophyll b": Pigment(
        ((464, 16, 1.00), (600, 22, 0.10), (655, 13, 0.38)),
        "Hoepffner & Sathyendranath 1991, Gaussian bands in vivo",
    ),
    # Lutein and its kin, yellow: three bands of one vibronic progression.
    "xanthophyll": Pigment(
        ((400, 22, 0.55), (422, 13, 0.75), (445, 12, 1.00), (474, 13.5, 0.90)),
        "Britton 1995, lutein in ethanol: 422, 445, 474 nm",
    ),
    # Orange. In the skin the bands lie some 10 nm further to the red than in solution and are broader.
    "beta-carotene": Pigment(
        ((405, 28, 0.60), (438, 18, 0.85), (463, 17, 1.00), (490, 20, 0.90)),
        "Britton 1995, in acetone: 429 (shoulder), 452, 478 nm; shifted",
    ),
    # Red. In the chromoplasts of a tomato lycopene is crystalline, which moves its bands to the red.
    "lycopene": Pigment(
        ((400, 35, 0.55), (458, 20, 0.75), (486, 18, 1.00), (520, 19, 1.00), (558, 17, 0.55)),
        "Britton 1995, in acetone: 448, 474, 505 nm; shifted by 12 to 15 nm, and a band of the crystal",
    ),
    # What is left without coloured pigments: phenolics, absorbing more and more to the blue, as wide as
    # Gaussians from the ultraviolet make it.
    "phenolics": Pigment(
        ((350, 60, 1.00), (420, 130, 0.25)),
        "tail of a band near 350 nm, as of apple flavonols (Merzlyak et al. 2005); width chosen",
    ),
    # Wood and cork: the same tail much wider.
    "browning": Pigment(((360, 110, 1.00), (500, 180, 0.35)), "shape chosen: monotonic, as of melanoidins"),
    # Loss everywhere: cell walls, shade in pores, and the far overtone of water.
    "flesh": Pigment(((580, 2000, 1.00), (760, 18, 0.35)), "water overtone at 760 nm, Curcio & Petty 1951"),
}


def scattering(wavelengths_nm: Float64Array) -> Float64Array:
    """Relative scattering of tissue (n,), 1 at 500 nm: a power law, Jacques 2013, equation 1.

    The exponent 0.4 is at the low end of what is reported: large cells and cell walls scatter
    almost alike at all wavelengths.
    """
    return np.asarray((wavelengths_nm / 500.0) ** -0.4)


def kubelka_munk(ratio: Float32Array) -> Float32Array:
    """Reflectance of an infinitely thick layer from K/S, any shape (Kubelka & Munk 1931).

    Written as 1 / (1 + a + sqrt(a^2 + 2 a)), the same as 1 + a - sqrt(a^2 + 2 a) without the
    difference of two large numbers. Scratch memory is reused: tiles are computed for every light.
    """
    result = ratio + 2
    result *= ratio
    np.sqrt(result, out=result)
    result += ratio
    result += 1
    return np.asarray(np.reciprocal(result, out=result), dtype=np.float32)


class PigmentTexture(HyperspectralTexture):
    """A fruit's skin, computed row by row: u round the axis, the stem's end on top."""

    format = "synthetic"
    kind: Kind = "reflectance"
    height, width = HEIGHT, WIDTH

    def __init__(self, name: str, concentrations: Callable[[Float32Array], Maps]) -> None:
        self.name = name
        self.wavelengths_nm = frozen(WAVELENGTHS_NM)
        self.warnings = ("synthetic: computed from pigments, not measured",)
        self._concentrations = concentrations

    @cached_property
    def _maps(self) -> tuple[Float32Array, Float32Array]:
        """Concentrations (height, width, pigments) and their K/S per unit (pigments, bands)."""
        maps = self._concentrations(directions(self.height, self.width))
        per_unit = [PIGMENTS[pigment].absorption(WAVELENGTHS_NM) / scattering(WAVELENGTHS_NM) for pigment in maps]
        amounts = np.stack([np.broadcast_to(each, (self.height, self.width)) for each in maps.values()], axis=-1)
        return np.maximum(amounts, 0).astype(np.float32), np.array(per_unit, dtype=np.float32)

    def samples(self, first: int, count: int) -> Samples:
        """`count` rows from `first` on: (count, width, bands), float32."""
        amounts, per_unit = self._maps
        inside = kubelka_munk(amounts[first : first + count] @ per_unit)
        return np.asarray(_CUTICLE + (1 - _CUTICLE) * inside, dtype=np.float32)


def pigment_texture(name: str) -> HyperspectralTexture:
    """The synthetic texture of a fruit, one of `PIGMENT_TEXTURES`.

    Raises
    ------
    TextureError
        If there is none of that name.
    """
    if name not in _FRUIT:
        raise TextureError(f"no pigment texture '{name}'", remedy=f"use one of {', '.join(PIGMENT_TEXTURES)}")
    return PigmentTexture(name, _FRUIT[name])


def _lemon(where: Float32Array) -> Maps:
    """Yellow; a breath of green left at the tips and in patches; oil glands a little deeper."""
    height, width = where.shape[:2]
    glands = spots(height, width, 900, 1.9, seed=21)
    patches = mottle(where, 1.7, 3, seed=22)
    tips = np.abs(where[..., 2]) ** 12
    button = _disc(where, 1, 5.0)
    return {
        "xanthophyll": (7.5 + 2.0 * patches + 2.5 * glands) * (1 - 0.6 * button),
        "beta-carotene": 0.6 + 0.5 * patches,
        "chlorophyll a": 0.05 + 0.06 * np.maximum(-patches, 0) + 0.22 * tips + 0.10 * button,
        "phenolics": 1.0 + 0.5 * glands + 1.5 * button,
        "browning": 0.9 * button + 0.10 * np.maximum(mottle(where, 6, 2, seed=24) - 0.35, 0),
        "flesh": 0.030 + 0.035 * glands + 0.015 * mottle(where, 9, 2, seed=23),
    }


def _tomato(where: Float32Array) -> Maps:
    """Red; a paler, yellower shoulder about the stem, and fine golden specks."""
    height, width = where.shape[:2]
    specks = spots(height, width, 700, 0.8, seed=31, spread=0.8)
    patches = mottle(where, 1.5, 3, seed=32)
    shoulder = np.clip((where[..., 2] - 0.86 + 0.10 * patches) / 0.14, 0, 1) ** 1.5
    scar = _disc(where, 1, 7.0)
    return {
        "lycopene": (26.0 + 8.0 * patches) * (1 - 0.6 * shoulder) * (1 - 0.30 * specks),
        "beta-carotene": 3.0 + 1.2 * shoulder + 0.5 * patches,
        "chlorophyll a": 0.03 + 0.22 * shoulder + 0.5 * scar,
        "chlorophyll b": 0.03 + 0.12 * shoulder + 0.3 * scar,
        "phenolics": 0.8 + np.zeros_like(patches),
        "flesh": 0.12 + 0.04 * mottle(where, 5, 2, seed=33) - 0.02 * specks,
    }


def _green_apple(where: Float32Array) -> Maps:
    """Green with pale lenticels, finer towards the calyx; yellower on the sunny side; russet at the stem."""
    height, width = where.shape[:2]
    lenticels = spots(height, width, 420, 1.1, seed=41, spread=0.6)
    patches = mottle(where, 1.4, 4, seed=42)
    sunny = np.clip(where @ np.array([0.75, -0.60, 0.28], dtype=np.float32), 0, 1) ** 2
    russet = np.clip((where[..., 2] - 0.94 + 0.05 * mottle(where, 7, 3, seed=43)) / 0.06, 0, 1)
    green = (1 + 0.35 * patches - 0.55 * sunny) * (1 - 0.6 * lenticels) * (1 - 0.4 * russet)
    return {
        "chlorophyll a": 1.75 * green,
        "chlorophyll b": 1.1 * green,
        "xanthophyll": (4.2 + 0.6 * sunny + 0.4 * patches) * (1 - 0.55 * lenticels),
        "phenolics": 0.8 + 0.6 * russet,
        "browning": 0.9 * russet,
        "flesh": 0.095 - 0.035 * lenticels + 0.02 * patches,
    }


def _orange(where: Float32Array) -> Maps:
    """Orange with a dense pattern of oil glands, a trace of green about the stem, and its button."""
    height, width = where.shape[:2]
    glands = spots(height, width, 1500, 1.6, seed=51)
    patches = mottle(where, 1.6, 3, seed=52)
    button = _disc(where, 1, 4.5)
    near_stem = np.clip((where[..., 2] - 0.86 + 0.06 * patches) / 0.14, 0, 1)
    return {
        "beta-carotene": (13.0 + 4.0 * patches + 6.0 * glands) * (1 - 0.8 * button),
        "lycopene": 1.1 + 0.3 * patches,
        "xanthophyll": 2.0 + np.zeros_like(patches),
        "chlorophyll a": 0.02 + 0.16 * near_stem + 0.25 * button,
        "phenolics": 0.8 + 0.4 * glands,
        "browning": 0.8 * button,
        "flesh": 0.035 + 0.035 * glands + 0.015 * mottle(where, 9, 2, seed=53),
    }


def _disc(where: Float32Array, pole: int, radius_deg: float) -> Float32Array:
    """1 within a radius of a pole, 0 beyond it, with a soft rim: the scar of the stalk."""
    angle = np.degrees(np.arccos(np.clip(pole * where[..., 2], -1, 1)))
    return np.asarray(np.clip((radius_deg - angle) / (0.3 * radius_deg) + 0.5, 0, 1), dtype=np.float32)


_FRUIT: dict[str, Callable[[Float32Array], Maps]] = {
    "lemon": _lemon,
    "tomato": _tomato,
    "green-apple": _green_apple,
    "orange": _orange,
}
PIGMENT_TEXTURES: tuple[str, ...] = tuple(_FRUIT)
