"""What a headset's runtime may do to codes between the application and the panel.

A runtime is a chain of at most two stages, in the order gamut, curve, range; the panel clips what
leaves 0..1. Linear light within a runtime means decoded by the sRGB curve, as graphics APIs do.

Stages work on codes (m, n, 3) and parameters (m, k): m sets of parameters at once.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from spectral_core.arrays import Float64Array, frozen
from spectral_core.display.models import DisplayModel, srgb_decode, srgb_encode
from spectral_core.standards import rgb_to_XYZ_matrix

# Video's studio range in 8 bits (ITU-R BT.601).
_LOW, _HIGH = 16 / 255, 235 / 255
# Start values: what follows descends to the nearest minimum.
_GAMMAS = (0.45, 0.6, 0.8, 1.0, 1.25, 1.7, 2.2)
_EXPOSURES = (0.1, 0.3, 0.7, 1.5, 3.0, 8.0)
_SPACES = {"p3": "P3", "rec2020": "Rec.2020"}
# Places of the free matrix's parameters: all but green from green, to which they are relative.
_MATRIX_NAMES = ("RR", "RG", "RB", "GR", "GB", "BR", "BG", "BB")

Forward = Callable[[Float64Array, Float64Array], Float64Array]


@dataclass(frozen=True)
class Stage:
    """One thing that a runtime does.

    Attributes
    ----------
    name, kind
        Its name; ``gamut``, ``curve`` or ``range``.
    meaning
        For people.
    forward
        Codes (m, n, 3) and parameters (m, k) to codes (m, n, 3), not clipped.
    parameters
        Names (k,).
    starts
        (s, k), parameters to start a fit from.
    bounds
        Least and largest value of every parameter.
    matrix
        For ``gamut``: parameters (m, k) to linear RGB matrices (m, 3, 3).
    """

    name: str
    kind: str
    meaning: str
    forward: Forward
    parameters: tuple[str, ...] = ()
    starts: Float64Array = field(default_factory=lambda: frozen(np.zeros((1, 0))))
    bounds: tuple[float, float] = (-np.inf, np.inf)
    matrix: Callable[[Float64Array], Float64Array] | None = None


@dataclass(frozen=True)
class Runtime:
    """A chain of stages; none is the runtime that leaves codes alone."""

    stages: tuple[Stage, ...] = ()

    @property
    def name(self) -> str:
        """Names of its stages, in order."""
        return " + ".join(stage.name for stage in self.stages) or "none"

    @property
    def meaning(self) -> str:
        """For people."""
        return ", then ".join(stage.meaning for stage in self.stages) or "codes reach the panel as they are"

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names (k,) of all parameters."""
        return tuple(name for stage in self.stages for name in stage.parameters)

    def starts(self) -> Float64Array:
        """(s, k) parameters to start a fit from: every combination of the stages' own."""
        combinations = itertools.product(*(stage.starts for stage in self.stages))
        return np.array([np.concatenate([np.zeros(0), *each]) for each in combinations])

    def bounds(self) -> tuple[Float64Array, Float64Array]:
        """Least and largest parameters (k,)."""
        pairs = [stage.bounds for stage in self.stages for _ in stage.parameters]
        low, high = np.array(pairs, dtype=np.float64).reshape(-1, 2).T
        return low, high

    def forward(self, codes: Float64Array, parameters: Float64Array) -> Float64Array:
        """Panel codes (m, n, 3), clipped to 0..1, of application codes (n, 3) or (m, n, 3)."""
        at = 0
        for stage in self.stages:
            codes = stage.forward(codes, parameters[:, at : at + len(stage.parameters)])
            at += len(stage.parameters)
        return np.broadcast_to(np.clip(codes, 0.0, 1.0), (len(parameters), *codes.shape[-2:]))


def _applied(curve: Callable[[Float64Array], Float64Array]) -> Forward:
    return lambda codes, _: curve(codes)


def _twice(curve: Callable[[Float64Array], Float64Array]) -> Forward:
    return lambda codes, _: curve(curve(codes))


def _gamma(codes: Float64Array, parameters: Float64Array) -> Float64Array:
    return np.asarray(np.maximum(codes, 0.0) ** parameters[:, None])


def _toned(tone: Forward, codes: Float64Array, parameters: Float64Array) -> Float64Array:
    """A tone map of linear light, scaled so that white stays white: what it dims is in the luminance."""
    linear, exposure = srgb_decode(np.maximum(codes, 0.0)), parameters[:, None]
    return srgb_encode(tone(linear, exposure) / tone(np.ones(1), exposure))


def _reinhard(linear: Float64Array, exposure: Float64Array) -> Float64Array:
    """A shoulder without a toe; Hable's curve (2010) differs from it by less than readings tell."""
    return np.asarray(exposure * linear / (1 + exposure * linear))


def _filmic(linear: Float64Array, exposure: Float64Array) -> Float64Array:
    """The usual fit to the ACES reference rendering (Narkowicz 2015): a toe and a shoulder."""
    x = exposure * linear
    return np.asarray(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14))


def _remapped(matrix: Callable[[Float64Array], Float64Array], codes: Float64Array, p: Float64Array) -> Float64Array:
    linear = srgb_decode(codes) @ np.swapaxes(matrix(p), -1, -2)
    # The target space ends here: what it cannot hold is clipped before any curve sees it.
    return srgb_encode(np.clip(linear, 0.0, 1.0))


def free_matrix(parameters: Float64Array) -> Float64Array:
    """(m, 3, 3) of eight elements relative to green from green, the brightest channel of white 1."""
    m = len(parameters)
    matrix = np.concatenate([parameters[:, :4], np.ones((m, 1)), parameters[:, 4:]], axis=1).reshape(m, 3, 3)
    return np.asarray(matrix / matrix.sum(axis=2).max(axis=1)[:, None, None])


def _exposed(name: str, meaning: str, tone: Forward) -> Stage:
    starts = frozen(np.array(_EXPOSURES)[:, None])
    return Stage(name, "curve", meaning, partial(_toned, tone), ("exposure",), starts, (1e-2, 1e2))


_CURVES = (
    Stage("srgb-encode", "curve", "one sRGB encoding too many", _applied(srgb_encode)),
    Stage("srgb-encode-twice", "curve", "two sRGB encodings too many", _twice(srgb_encode)),
    Stage("srgb-decode", "curve", "one sRGB decoding too many", _applied(srgb_decode)),
    Stage("srgb-decode-twice", "curve", "two sRGB decodings too many", _twice(srgb_decode)),
    Stage("gamma", "curve", "a wrong gamma: panel code = code ^ gamma", _gamma, ("gamma",),
          frozen(np.array(_GAMMAS)[:, None]), (0.1, 10.0)),
    _exposed("reinhard", "a tone map with a shoulder, Reinhard's", _reinhard),
    _exposed("filmic", "a tone map with toe and shoulder, filmic (ACES)", _filmic),
)  # fmt: skip
_RANGES = (
    Stage("range-squeezed", "range", "0..255 squeezed into 16..235",
          _applied(lambda codes: _LOW + np.clip(codes, 0, 1) * (_HIGH - _LOW))),
    Stage("range-expanded", "range", "16..235 expanded to 0..255 and clipped",
          _applied(lambda codes: (codes - _LOW) / (_HIGH - _LOW))),
)  # fmt: skip


def _gamuts(panel: DisplayModel) -> tuple[Stage, ...]:
    """Matrices between RGB spaces that keep white, and the free one."""
    spaces = {name: rgb_to_XYZ_matrix(space) for name, space in _SPACES.items()} | {"native": _native(panel)}
    matrices = {}
    for name, space in spaces.items():
        to = np.linalg.solve(space, rgb_to_XYZ_matrix("sRGB"))
        matrices[f"rec709-to-{name}"] = to / to.sum(axis=1, keepdims=True)
        matrices[f"{name}-to-rec709"] = np.linalg.inv(matrices[f"rec709-to-{name}"])
    known = [_known_gamut(name, matrix) for name, matrix in matrices.items()]
    starts = [np.delete(each.ravel() / each[1, 1], 4) for each in (np.eye(3), *matrices.values())]
    free = Stage("gamut-matrix", "gamut", "a gamut remap by a matrix of its own", partial(_remapped, free_matrix),
                 _MATRIX_NAMES, frozen(starts), (-5.0, 5.0), free_matrix)  # fmt: skip
    return (*known, free)


def _known_gamut(name: str, matrix: Float64Array) -> Stage:
    def fixed(_: Float64Array) -> Float64Array:
        return matrix[None]

    meaning = f"a gamut remap, {name.replace('-to-', ' to ')}"
    return Stage(name, "gamut", meaning, partial(_remapped, fixed), matrix=fixed)


def _native(panel: DisplayModel) -> Float64Array:
    """(3, 3) linear panel RGB to XYZ, primaries scaled to the panel's white."""
    lit = panel.forward(np.concatenate([np.eye(3), np.ones((1, 3))])) - panel.forward(np.zeros(3))
    return np.asarray(lit[:3].T * np.linalg.solve(lit[:3].T, lit[3]))


def single_runtimes(panel: DisplayModel | None) -> list[Runtime]:
    """None, and every runtime of one stage; gamut remaps only where the panel is known."""
    stages = (*_CURVES, *_RANGES, *(_gamuts(panel) if panel is not None else ()))
    return [Runtime(), *(Runtime((stage,)) for stage in stages)]


def combined_runtimes(panel: DisplayModel | None) -> list[Runtime]:
    """Every runtime of two stages of different kinds."""
    kinds = [_gamuts(panel) if panel is not None else (), _CURVES, _RANGES]
    pairs = [pair for a, b in itertools.combinations(kinds, 2) for pair in itertools.product(a, b)]
    return [Runtime(pair) for pair in pairs]
