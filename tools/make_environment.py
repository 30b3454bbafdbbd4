"""Make a virtual environment with some packages, and mark it ready when all of them are in.

``python tools/make_environment.py FOLDER REQUIREMENT ...``; a half-made environment is made anew.
A requirement that starts with ``.`` is this project, installed in place.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import venv
from pathlib import Path

WANTED = (3, 11)


def main(folder: Path, requirements: list[str]) -> None:
    """Make the environment and install into it."""
    if sys.version_info[:2] != WANTED:
        sys.exit(
            f"error: Python {'.'.join(map(str, WANTED))} is needed for Blender's module, this is "
            f"{sys.version_info[0]}.{sys.version_info[1]}; set PYTHON=/path/to/python3.11"
        )
    ready = folder / "ready"
    ready.unlink(missing_ok=True)
    python = folder / ("Scripts" if sys.platform == "win32" else "bin") / "python"
    if not python.exists():
        shutil.rmtree(folder, ignore_errors=True)
        print(f"making {folder}", flush=True)
        venv.create(folder, with_pip=True)
    arguments = [part for each in requirements for part in (["-e", each] if each.startswith(".") else [each])]
    subprocess.run([python, "-m", "pip", "install", "-q", "--disable-pip-version-check", *arguments], check=True)
    ready.touch()


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
