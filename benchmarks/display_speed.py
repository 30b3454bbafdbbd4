"""Display models' time for a million pixels, against a plain product and power in the same run.

Run: ``python benchmarks/display_speed.py [FILE.ti3] [--json]``. Codes to XYZ and back, for every model that
the measurements support (a simulated display without a file); plain is ``codes**gamma @ matrix`` and back,
which is the least that any model does. Rounds are interleaved, so that a busy machine slows all
alike; reported are the median over the rounds and their quartiles, and the median ratio to plain.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from spectral_core.arrays import frozen
from spectral_core.display.characterising.simulated import assumed_display
from spectral_core.display.measuring.measurements import Measurements, read_measurements
from spectral_core.display.measuring.patches import published_patches
from spectral_core.display.models.fitting import MODEL_KINDS

PIXELS = 1_000_000


def plain(codes: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """The published model without black, checks or signs."""
    gamma = np.array([2.34, 2.30, 2.26])
    XYZ = (codes**gamma) @ matrix.T
    return np.maximum(XYZ @ np.linalg.inv(matrix).T, 0) ** (1 / gamma)


def simulated() -> Measurements:
    """The published protocol read from a headset with a power limit."""
    return assumed_display().measure(published_patches().codes, np.random.default_rng(0))


def rounds(functions: dict[str, Callable[[], object]], count: int) -> dict[str, np.ndarray]:
    """Seconds (count,) of each function, taken in turn after a first call that is not counted."""
    for function in functions.values():
        function()
    seconds = {name: np.empty(count) for name in functions}
    for index in range(count):
        for name, function in functions.items():
            started = time.perf_counter()
            function()
            seconds[name][index] = time.perf_counter() - started
    return seconds


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("file", nargs="?", type=Path)
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    arguments = parser.parse_args()
    measured: Measurements = read_measurements(arguments.file) if arguments.file else simulated()
    measured = replace(measured, XYZ=frozen(measured.XYZ / measured.white_XYZ[1]))
    models = {kind.name: kind.fit(measured) for kind in MODEL_KINDS if kind.supported_by(measured)}
    codes = np.random.default_rng(0).uniform(0, 1, (PIXELS, 3))
    matrix = np.array([[0.41, 0.36, 0.18], [0.21, 0.72, 0.07], [0.02, 0.12, 0.95]])
    functions: dict[str, Callable[[], object]] = {"plain": lambda: plain(codes, matrix)}
    for name, model in models.items():
        functions[name] = lambda model=model: model.inverse(model.forward(codes))
    seconds = rounds(functions, arguments.rounds)
    table = {
        name: {
            "ms": [float(1e3 * value) for value in np.percentile(each, (50, 25, 75))],
            "ratio": float(np.median(each / seconds["plain"])),
        }
        for name, each in seconds.items()
    }
    if arguments.json:
        print(json.dumps({"pixels": PIXELS, "models": table}))
        return
    print(f"{'a million pixels, codes to XYZ and back':<40} {'ms':>7} {'quartiles':>15} {'ratio':>6}")
    for name, row in table.items():
        print(f"{name:<40} {row['ms'][0]:7.0f} {row['ms'][1]:7.0f} {row['ms'][2]:7.0f} {row['ratio']:6.2f}")


if __name__ == "__main__":
    main()
