"""How well a sequence of patches tells what a headset's runtime did to the codes.

Run: ``python benchmarks/runtime_probe.py [--runs 4] [--combined] [--json]``.

Every runtime acts on a simulated headset (gamma 2.35 2.30 2.25, black 0.02 cd/m2 of 130), which is read
with 1 % noise in luminance and 0.0015 in x and y. The program's sequence is set beside others of as
many patches: a grey ramp with primaries, a coarse cube, and random codes. Told: named rightly, or by
another name of the same effect. The smallest margin says how strong the weakest verdict is.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "core"))
import displays

from spectral_core.display.models import GammaMatrix
from spectral_core.display.probing.probe import probe
from spectral_core.display.probing.probe_patches import probe_patches
from spectral_core.display.probing.runtimes import Runtime, combined_runtimes, single_runtimes

WHITE_Y = displays.additive(np.ones((1, 3)))[0, 1]
PANEL = GammaMatrix(displays.GAMMA, displays.MATRIX / WHITE_Y, displays.BLACK / WHITE_Y)
TRUE_PARAMETERS = {
    "gamma": [1.2],
    "reinhard": [2.0],
    "filmic": [1.0],
    "gamut-matrix": [0.96, 0.07, 0.07, 0.05, 0.02, 0.03, 0.1, 0.8],
}


def sequences() -> dict[str, np.ndarray]:
    """Codes (24, 3) by name; all hold white and the primaries, which readings must have."""
    ends = np.concatenate([np.ones((1, 3)), np.eye(3)])
    greys = np.repeat(np.linspace(0, 1, 20, endpoint=False)[:, None], 3, axis=1)
    cube = np.stack(np.meshgrid([0.0, 0.5, 1.0], [0.0, 0.5, 1.0], [0.0, 0.5, 1.0]), axis=-1).reshape(-1, 3)
    order = np.random.default_rng(0).permutation(27)
    rest = np.array([code for code in cube[order] if not (code == ends).all(axis=1).any()])[:20]
    return {
        "probe --patches": np.asarray(probe_patches()),
        "grey ramp": np.concatenate([ends, greys]),
        "coarse cube": np.concatenate([ends, rest]),
        "random": np.concatenate([ends, np.random.default_rng(1).uniform(0, 1, (20, 3))]),
    }


def confusion(codes: np.ndarray, runtimes: list[Runtime], runs: int) -> tuple[dict[str, Counter[str]], float]:
    """What each runtime was called, and the smallest margin of a verdict."""
    found: dict[str, Counter[str]] = {}
    margins = []
    for runtime in runtimes:
        values = np.array([[value for stage in runtime.stages for value in TRUE_PARAMETERS.get(stage.name, [])]])
        found[runtime.name] = Counter()
        for seed in range(runs):
            measured = displays.measure(
                lambda sent, runtime=runtime, values=values: displays.additive(runtime.forward(sent, values)[0]),
                codes,
                seed,
            )
            result = probe(measured, PANEL)
            found[runtime.name][result.name] += 1
            margins.append(result.margin)
    return found, float(min(margins))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=4)
    parser.add_argument("--combined", action="store_true", help="combinations of two stages too")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    runtimes = single_runtimes(PANEL) + (combined_runtimes(PANEL) if options.combined else [])
    document = []
    for name, codes in sequences().items():
        found, margin = confusion(codes, runtimes, options.runs)
        right = sum(counts[truth] for truth, counts in found.items())
        undecided = sum(counts["undecided"] for counts in found.values())
        total = sum(sum(counts.values()) for counts in found.values())
        row = {"sequence": name, "patches": len(codes), "right": right, "undecided": undecided,
               "wrong": total - right - undecided, "runs": total, "smallest_margin": margin,
               "confusion": {truth: dict(counts) for truth, counts in found.items()}}  # fmt: skip
        document.append(row)
        if not options.json:
            print(f"{name:16s} {len(codes)} patches: {right} of {total} right, {undecided} undecided, "
                  f"{row['wrong']} wrong; smallest margin {margin:.1f}", flush=True)  # fmt: skip
            for truth, counts in found.items():
                if set(counts) != {truth}:
                    print(f"    {truth}: {dict(counts)}")
    if options.json:
        print(json.dumps({"sequences": document}))


if __name__ == "__main__":
    main()
