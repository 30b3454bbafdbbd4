"""The built zip in a real Blender, installed as users do it; ``application.sh`` says which Blender that is."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from real_blender import APPLICATION, PROJECT, WORK, Application, assert_clean


@pytest.fixture(scope="session")
def application() -> Application:
    """Run Blender with a clean user folder: `application("blender", "--version")`."""
    shutil.rmtree(WORK, ignore_errors=True)
    WORK.mkdir(parents=True)
    environment = {**os.environ, "BLENDER_USER_RESOURCES": str(WORK / "user")}

    def call(*arguments: object) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            ["bash", str(APPLICATION), *map(str, arguments)],
            cwd=PROJECT,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
            timeout=900,
        )

    return call


@pytest.fixture(scope="session")
def archive() -> Path:
    """The zip of these sources."""
    command = [sys.executable, "tools/build_extension.py", "-o", str(WORK)]
    done = subprocess.run(command, cwd=PROJECT, capture_output=True, text=True, check=True)
    return Path(done.stdout.splitlines()[-1])


@pytest.fixture(scope="session")
def installed(application: Application, archive: Path) -> Path:
    done = application(
        "blender", "--command", "extension", "install-file", "--repo", "user_default", "--enable", archive
    )
    assert_clean(done)
    return archive
