"""Fixtures that every tier shares."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def measured_data() -> Path:
    """The folder of measured data, which is no part of the project."""
    named = os.environ.get("SPECTRAL_BOOTH_DATA")
    folder = Path(named) if named else Path(__file__).parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("measured data is not here; set SPECTRAL_BOOTH_DATA to its folder")
    return folder
