"""The core never needs Blender: its tests run with bpy blocked."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

sys.modules["bpy"] = None  # type: ignore[assignment]  # any import of it now fails

import displays  # noqa: E402

from spectral_core.display import DisplayProfile, builtin_profile_names, load_profile  # noqa: E402
from spectral_core.display.characterising.characterise import characterise  # noqa: E402


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    """Run the command line in this process: (exit code, stdout, stderr)."""
    from spectral_core.cli import main

    def call(*arguments: object) -> tuple[int, str, str]:
        code = main([str(each) for each in arguments])
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return call


@pytest.fixture
def csv(tmp_path: Path) -> Callable[[str], Path]:
    """Write a CSV and return its path."""

    def write(text: str, name: str = "table.csv") -> Path:
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return write


# Of the program's models, one of each kind of steps.
FITTED = ("gamma-matrix-black", "gain-offset-gamma", "channel-lut", "grey-lut-corrected")


@pytest.fixture(scope="session")
def fitted() -> dict[str, DisplayProfile]:
    """Models of a simulated OLED whose channels depend on each other, read with noise."""
    measured = displays.measure(displays.power_limited, displays.published_protocol(), seed=3)
    return {name: DisplayProfile(name, characterise(measured, name).chosen.model) for name in FITTED}


@pytest.fixture(params=[*builtin_profile_names(), *FITTED])
def profile(request: pytest.FixtureRequest, fitted: dict[str, DisplayProfile]) -> DisplayProfile:
    return fitted[request.param] if request.param in fitted else load_profile(request.param)
