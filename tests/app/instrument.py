"""What an instrument's script does beside the patch player: ``instrument.py FOLDER``.

It waits until a patch has settled, reads it (here: photographs the screen, ``IMAGES/INDEX.png``), and
touches ``patch-next``. It ends when the player does.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path


def read_all(folder: Path) -> None:
    """Every patch once."""
    done = 0
    while True:
        state = json.loads((folder / "patch-state.json").read_text(encoding="utf-8"))
        if state["state"] in ("done", "stopped"):
            return
        if state["state"] == "ready" and state["index"] > done:
            done = state["index"]
            subprocess.run(["import", "-window", "root", str(folder / f"{done:03}.png")], check=True)
            (folder / "patch-next").touch()
        time.sleep(0.05)


if __name__ == "__main__":
    read_all(Path(sys.argv[1]))
