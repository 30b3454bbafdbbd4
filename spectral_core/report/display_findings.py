"""What the display report says in words: why a model was chosen, and what was not measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spectral_core.display.characterising.characterise import (
    FOLDS,
    Characterisation,
    ModelResult,
    simplest_within_noise,
)
from spectral_core.display.measuring.measurements import Measurements
from spectral_core.display.models.fitting import MODEL_KINDS, ModelKind
from spectral_core.report.numerals import count, fixed


@dataclass(frozen=True)
class Missing:
    """Something that was not measured, what follows, and what to measure."""

    what: str
    consequence: str
    remedy: str


def why_chosen(found: Characterisation) -> str:
    """Why the chosen model was chosen, with the numbers that decided."""
    chosen = found.chosen
    if chosen.held_out is None:
        mixed = count(int(found.measured.mixed.sum()), "mixed colour")
        return f"{chosen.name} was not chosen by a test: {mixed} cannot decide."
    best = min(found.models, key=lambda each: float(each.held_out_errors.mean()))
    if chosen is not simplest_within_noise(found.models):
        return f"{chosen.name} was asked for. {best.name} has the smallest mean; {_apart(chosen, best)}."
    if chosen is not best:
        return (
            f"{best.name} has the smallest mean, but {chosen.name} is simpler and no worse than the standard error of "
            f"their paired differences: {_apart(chosen, best)}."
        )
    simpler = found.models[: found.models.index(chosen)]
    if not simpler:
        return f"{chosen.name} is the simplest model and has the smallest mean."
    rival = min(simpler, key=lambda each: float(each.held_out_errors.mean()))
    return f"{chosen.name} has the smallest mean. Of the simpler ones the best, {_apart(rival, chosen)}."


def _apart(worse: ModelResult, better: ModelResult) -> str:
    difference = worse.held_out_errors - better.held_out_errors
    error = difference.std() / np.sqrt(len(difference))
    return f"{worse.name} is worse by {fixed(difference.mean(), 3)} ± {fixed(error, 3)} dE00"


def what_is_missing(found: Characterisation, read: Measurements) -> list[Missing]:
    """What was not measured, the most important first."""
    candidates = [
        (
            found.chosen.held_out is None,
            f"enough mixed colours ({int(read.mixed.sum())})",
            "No model could be tested, so its error on colours is unknown; the model stated is a guess.",
            f"{FOLDS * 10} colours in which two or three channels differ",
        ),
        (
            any(r2 == 0.0 for _, r2 in found.gamma.values()),
            "ramps of the channels",
            "The tone curves are assumed: gamma 2.2 where no grey ramp tells.",
            "at least four levels of each channel and five greys",
        ),
        (
            read.at(0, 0, 0) is None,
            "black",
            "It is taken as 0: contrast is unknown and dark colours are predicted too dark.",
            "codes 0 0 0",
        ),
        (
            found.checks.noise_dE00 is None,
            "repeats",
            "The instrument's noise is unknown, so the errors cannot be set against it.",
            "white, black and some colours twice or more",
        ),
        (
            read.unit != "cd/m2",
            "absolute luminance",
            "The file is relative to white; contrast and colour do not need it.",
            "white in cd/m²",
        ),
    ]
    missing = [Missing(*words) for absent, *words in candidates if absent]
    tried = {each.name for each in found.models}
    missing += [_unsupported(kind, found.measured) for kind in MODEL_KINDS if kind.name not in tried]
    return missing


def _unsupported(kind: ModelKind, measured: Measurements) -> Missing:
    """A model that the data does not support: what it needs that is not there."""
    ramp = min(int(measured.channel(index).sum()) for index in range(3))
    have = {"level of each channel": ramp, "grey": int(measured.grey.sum()), "mixed colour": int(measured.mixed.sum())}
    need = dict(zip(have, (kind.ramp, kind.greys, kind.mixed), strict=True))
    short = [name for name in have if have[name] < need[name]]
    return Missing(
        f"patches for {kind.name}",
        "This model was not tried.",
        ", ".join(f"{_several(need[name], name)} (there are {have[name]})" for name in short),
    )


def _several(number: int, noun: str) -> str:
    return f"{number} {noun.replace('level ', 'levels ') if ' of ' in noun else noun + 's'}"
