"""References that are not this project's own code: published tables, measured data, other libraries."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spectral_core import standards

# Before a test imports colour-science itself: a missing scipy must not be a mock to these tests.
standards.colour_science_version()

MatFile = Callable[[str], Mapping[str, Any]]


@pytest.fixture(scope="session")
def mat_file(measured_data: Path) -> MatFile:
    """Read a MATLAB file of the measured data by its path in the folder."""
    scipy_io = pytest.importorskip("scipy.io")

    def read(name: str) -> Mapping[str, Any]:
        path = measured_data / name
        if not path.is_file():
            pytest.skip(f"{name} is not among the measured data")
        found: Mapping[str, Any] = scipy_io.loadmat(path, squeeze_me=True)
        return found

    return read


@pytest.fixture(scope="session")
def houser(mat_file: MatFile) -> tuple[np.ndarray, np.ndarray]:
    """Wavelengths (81,) and powers (401, 81) of Houser's light sources."""
    found = mat_file("lights/spd_houser.mat")
    first, step, count = found["S_houser"].astype(float)
    return first + step * np.arange(count), found["spd_houser"].T
