"""Which patches to measure next, and how accurate a profile they promise: found by simulation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.display.characterising.characterise import (
    Characterisation,
    characterise,
    errors,
    held_out_errors,
    held_out_XYZ,
)
from spectral_core.display.characterising.simulated import SimulatedDisplay, assumed_display, simulated
from spectral_core.display.measuring.measurements import Measurements
from spectral_core.display.measuring.patch_sets import SMALLEST, extension, starting_set
from spectral_core.display.measuring.patches import published_patches
from spectral_core.display.models.fitting import MODEL_KINDS, ModelKind
from spectral_core.errors import DisplayError

# The last is the size of the published protocol.
SIZES = (20, 30, 45, 60, 90, 140, 234)
LARGEST = 500
_MORE = (30, 90)
# A set this little larger than the measured one is no advice.
_FEWEST_NEW = 8
_UNSEEN = 400
_DRAWS = 5
_TRIALS = 3
# Student's t of 4 degrees of freedom, 95 %, for one more draw: t sqrt(1 + 1 / draws).
_PREDICTION = 2.776 * np.sqrt(1 + 1 / _DRAWS)
_SEED = 7
Report = Callable[[float, str], None]


@dataclass(frozen=True)
class Prediction:
    """Mean dE00 on unseen colours that a set of patches promises.

    `spread`: 19 of 20 measurements of that set fall within mean +- spread. `kind` is ``new`` (a set of
    its own), ``published`` (the published protocol), ``measured`` or ``extended`` (with patches added).
    """

    patches: int
    kind: str
    mean: float
    spread: float
    codes: Float64Array


@dataclass(frozen=True)
class Advice:
    """Codes (n, 3) to measure, 8-bit exact and in the order to show them; why; every prediction."""

    codes: Float64Array
    predicted: tuple[Prediction, ...]
    chosen: Prediction
    why: str
    warnings: tuple[str, ...]


def advise(
    measured: Measurements | None = None,
    accuracy: float | None = None,
    patches: int | None = None,
    report: Report = lambda fraction, text: None,
) -> Advice:
    """The next patches to measure.

    Parameters
    ----------
    measured
        What is at hand; without it a headset like the published one is assumed.
    accuracy
        Mean dE00 on unseen colours to reach with as few patches as possible. Without it, as few as come
        within the spread of the best.
    patches
        So many instead: of a new set, or added to the measured ones.
    report
        Called with the fraction done and a word.

    Raises
    ------
    DisplayError
        If `patches` is too few for a set.
    """
    if measured is None and patches is not None and patches < SMALLEST:
        raise DisplayError(f"{patches} patches are no set", remedy=f"ask for at least {SMALLEST}")
    found = None if measured is None else characterise(measured)
    display = assumed_display() if found is None else simulated(found)
    unexplained = 0.0 if found is None else _unexplained(found, display)
    sets = _sets(None if found is None else found.measured.codes, patches, display)
    predicted = []
    for index, (kind, codes) in enumerate(sets):
        report(index / len(sets), f"{len(codes)} patches")
        predicted.append(_prediction(kind, codes, display, unexplained))
    predicted = _pooled(predicted)
    chosen, reached = _choose(predicted, accuracy, None if patches is None else len(sets[-1][1]))
    known = 0 if found is None else len(found.measured.codes)
    codes = chosen.codes[known:] if chosen.kind == "extended" else chosen.codes
    codes = codes[:0] if chosen.kind == "measured" else codes
    warnings = () if found is None else found.warnings
    if not reached:
        warnings += (f"no set on trial promises dE00 {accuracy:g}; readings of less noise would help",)
    why = f"{_basis(found, display, unexplained)}; {_reason(chosen, accuracy, patches, reached)}"
    return Advice(_shown_order(codes), tuple(predicted), chosen, why, warnings)


def _sets(known: Float64Array | None, patches: int | None, display: SimulatedDisplay) -> list[tuple[str, Float64Array]]:
    """Kinds and codes of the sets on trial, those that were asked for last."""
    measured = 0 if known is None else len(known)
    sizes = [size for size in SIZES if known is None or size < measured]
    sets = [("new", starting_set(size, display.XYZ)) for size in sizes]
    if known is None:
        sets.append(("published", published_patches().codes))
        return sets if patches is None else [*sets, ("new", starting_set(patches, display.XYZ))]
    if measured >= SMALLEST:
        sets.append(("measured", known))
    larger = [size - measured for size in SIZES if size >= measured + _FEWEST_NEW]
    for count in [*(larger if len(larger) >= len(_MORE) else _MORE), *([] if patches is None else [patches])]:
        sets.append(("extended", np.concatenate([known, extension(known, count, display.XYZ)])))
    return sets


def _prediction(name: str, codes: Float64Array, display: SimulatedDisplay, unexplained: float) -> Prediction:
    """Measure the set on the simulated display several times, fit, and ask for unseen colours."""
    rng = np.random.default_rng(_SEED)
    unseen = np.random.default_rng(_SEED + 1).uniform(0, 1, (_UNSEEN, 3))
    truth, white = display.XYZ(unseen), display.XYZ(np.ones((1, 3)))[0]
    kind = _kind(characterise(display.measure(codes, rng)).chosen.name)
    means = []
    for _ in range(_DRAWS):
        model = kind.fit(display.measure(codes, rng))
        means.append(errors(model, Measurements(unseen, truth), white).mean())
    mean = float(np.hypot(np.mean(means), unexplained))
    # What is unexplained may be chance, or go as patches are added: the spread reaches down to none of it.
    spread = float(_PREDICTION * np.std(means, ddof=1) + mean - np.mean(means))
    return Prediction(len(codes), name, mean, spread, codes)


def _pooled(predicted: list[Prediction]) -> list[Prediction]:
    """No spread smaller than the usual share of the mean: a few draws may agree by chance."""
    usual = float(np.median([each.spread / each.mean for each in predicted]))
    return [replace(each, spread=max(each.spread, usual * each.mean)) for each in predicted]


def _unexplained(found: Characterisation, display: SimulatedDisplay) -> float:
    """Held-out dE00 that the simulated display does not show: what the chosen model cannot follow.

    0 if it is no larger than the standard error of the held-out mean.
    """
    if found.chosen.held_out is None:
        return 0.0
    rng = np.random.default_rng(_SEED)
    kind = _kind(found.chosen.name)
    trials = [display.measure(found.measured.codes, rng) for _ in range(_TRIALS)]
    expected = float(np.mean([held_out_errors(each, held_out_XYZ(each, kind)).mean() for each in trials]))
    mean, uncertainty = found.chosen.held_out.mean, _standard_error(found.chosen.held_out_errors)
    return float(np.sqrt(mean**2 - expected**2)) if mean > expected + uncertainty else 0.0


def _kind(name: str) -> ModelKind:
    return next(kind for kind in MODEL_KINDS if kind.name == name)


def _standard_error(values: Float64Array) -> float:
    return float(values.std(ddof=1) / np.sqrt(len(values)))


def _choose(predicted: list[Prediction], accuracy: float | None, size: int | None) -> tuple[Prediction, bool]:
    """The prediction advised, and whether it reaches the accuracy. Sets of their own are no advice to
    those who have measured already.
    """
    if size is not None:
        return predicted[-1], accuracy is None or predicted[-1].mean <= accuracy
    extended = any(each.kind == "extended" for each in predicted)
    usable = [each for each in predicted if not (extended and each.kind == "new")]
    usable = sorted(usable, key=lambda each: (each.patches, each.mean))
    best = min(usable, key=lambda each: each.mean)
    limit = best.mean + best.spread if accuracy is None else accuracy
    return next(((each, True) for each in usable if each.mean <= limit), (best, False))


def _basis(found: Characterisation | None, display: SimulatedDisplay, unexplained: float) -> str:
    noise = f"noise {display.noise[0]:.2%} in luminance, {display.noise[1]:.4f} in x and y"
    if found is None:
        return f"nothing is measured: a headset like the HTC Vive is assumed, not additive by 13 %, {noise}"
    text = f"the measured display's {found.chosen.name} model was measured in simulation, {noise}"
    if found.chosen.held_out is None:
        return f"{text}, dimming as the channels' sum says; the rest of the display is a guess until mixes are measured"
    return f"{text}; dE00 {unexplained:.2f} of its held-out error is not explained by that, and is kept"


def _reason(chosen: Prediction, accuracy: float | None, patches: int | None, reached: bool) -> str:
    promise = f"dE00 {chosen.mean:.2f} +- {chosen.spread:.2f} on unseen colours"
    if chosen.kind == "measured":
        return f"what is measured is enough: {promise}"
    if patches is not None or not reached:
        return f"{chosen.patches} patches{'' if reached else ', the best here,'} promise {promise}"
    goal = "as good as the best within its spread" if accuracy is None else f"for dE00 {accuracy:g}"
    return f"{chosen.patches} patches in all are the fewest {goal}: {promise}"


def _shown_order(codes: Float64Array) -> Float64Array:
    """White first, the rest shuffled, so that drift does not pass for a ramp."""
    shuffled = np.random.default_rng(_SEED).permutation(codes)
    return np.asarray(shuffled[np.argsort(~(shuffled == 1).all(axis=1), kind="stable")])
