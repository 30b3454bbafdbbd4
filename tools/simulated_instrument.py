"""An instrument for trying the patch player without one: ``python tools/simulated_instrument.py FOLDER``.

It waits until a patch has settled, reads it, touches ``patch-next`` and ends when the player does, as a
real instrument's script would. What it reads is a simulated headset like the published HTC Vive, whose
white dims to 109 cd/m2 under its own load, with a noise of 1 % in luminance and 0.0015 in x and y. The
readings go to ``FOLDER/readings.csv``.
"""

from __future__ import annotations

import csv
import json
import sys
import time
from pathlib import Path

import numpy as np

from spectral_core.display.characterising.simulated import assumed_display

# Of white, if it did not dim.
WHITE_CD_M2 = 130.0


def read_all(folder: Path) -> None:
    """Every patch once."""
    display, noise = assumed_display(), np.random.default_rng(1)
    done = 0
    while not (folder / "patch-state.json").exists():
        time.sleep(0.1)
    with (folder / "readings.csv").open("w", 1, newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(["index", "X", "Y", "Z"])
        while (state := json.loads((folder / "patch-state.json").read_text(encoding="utf-8")))["state"] not in (
            "done",
            "stopped",
        ):
            if state["state"] == "ready" and state["index"] > done:
                done = state["index"]
                XYZ = WHITE_CD_M2 * display.measure(np.array([state["codes"]]), noise).XYZ[0]
                writer.writerow([done, *(f"{value:.6g}" for value in XYZ)])
                (folder / "patch-next").touch()
            time.sleep(0.02)


if __name__ == "__main__":
    read_all(Path(sys.argv[1]))
