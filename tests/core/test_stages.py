from __future__ import annotations

import numpy as np
import pytest

from spectral_core.display import DisplayProfile
from spectral_core.display.models.corrected import CorrectedLut
from spectral_core.display.models.stages import SRGB, Interaction, Power, Tables, stages
from spectral_core.errors import DisplayError


def test_steps_are_the_model(profile: DisplayProfile) -> None:
    """Rounding near black is raised to 1 / gamma: codes where drive is above 1e-5 to 1e-9, all of them in XYZ."""
    steps = stages(profile.model)
    codes = np.random.default_rng(0).uniform(0, 1, (5000, 3))
    codes[:200] = np.linspace(0, 1, 200)[:, None]
    XYZ = profile.to_XYZ(codes)
    lit = profile.to_linear(XYZ).min(axis=1) > 1e-5
    np.testing.assert_allclose(steps.encode(XYZ[lit]), profile.to_codes(XYZ[lit]), atol=1e-9)
    np.testing.assert_allclose(profile.to_XYZ(steps.encode(XYZ)), XYZ, atol=1e-9)
    np.testing.assert_allclose(steps.decode(codes), XYZ, atol=1e-12)
    assert isinstance(steps.curve, SRGB if profile.name == "sRGB" else Power | Tables)
    assert (steps.interaction is not None) == isinstance(profile.model, CorrectedLut)


def test_steps_out_of_gamut_are_the_models(profile: DisplayProfile) -> None:
    XYZ = np.random.default_rng(1).uniform(0, 1.2, (500, 3))
    np.testing.assert_allclose(stages(profile.model).encode(XYZ), profile.to_codes(XYZ), atol=1e-9)


def test_an_unknown_model_is_refused() -> None:
    with pytest.raises(DisplayError, match="no steps"):
        stages(object())  # type: ignore[arg-type]


def test_a_sampled_interaction_meets_its_nodes(fitted: dict[str, DisplayProfile]) -> None:
    interaction = stages(fitted["grey-lut-corrected"].model).interaction
    assert isinstance(interaction, Interaction)
    low, high = interaction.span
    sampled = interaction.sampled(5)
    np.testing.assert_allclose(sampled[1, 2, 4], interaction.own(low + (high - low) * [0.25, 0.5, 1.0]), atol=1e-12)
    codes = np.random.default_rng(0).uniform(0, 1, (2000, 3))
    together = interaction.together(codes)
    assert (together >= low).all()
    assert (together <= high).all()
