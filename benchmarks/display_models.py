"""Display models against Argyll's ``colprof``, on the same folds of the same measurements.

Run: ``python benchmarks/display_models.py FILE.ti3 ... [--json]``; Argyll (Debian's ``argyll``) must be
installed. The mixed colours are split into five folds; every model, and every display profile type
of ``colprof``, is fitted to the rest and judged by dE00 on the fold. Argyll's profiles are asked
through its own ``xicclu``, absolute colorimetric.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
import tempfile
from dataclasses import asdict
from pathlib import Path

import numpy as np

from spectral_core.display.characterising.characterise import characterise, folds
from spectral_core.display.measuring.measurements import Measurements, read_measurements
from spectral_core.standards import XYZ_to_Lab, delta_E_2000
from spectral_core.verification import percentiles

# Display types of colprof: cLUT in Lab and XYZ, with matrix, shapers and matrix, gammas and matrix.
COLPROF_TYPES = {
    "l": "Lab cLUT",
    "x": "XYZ cLUT",
    "X": "XYZ cLUT + matrix",
    "s": "shaper + matrix",
    "g": "gamma + matrix",
}


def argyll_errors(measured: Measurements, kind: str, quality: str) -> np.ndarray:
    """dE00 of the held-out colours of all folds."""
    found = []
    for test in folds(measured):
        kept = np.ones(len(measured.codes), dtype=bool)
        kept[test] = False
        predicted = argyll_XYZ(measured.subset(kept), measured.codes[test], kind, quality)
        white = measured.white_XYZ
        found.append(delta_E_2000(XYZ_to_Lab(predicted, white), XYZ_to_Lab(measured.XYZ[test], white)))
    return np.concatenate(found)


def argyll_XYZ(fitted: Measurements, codes: np.ndarray, kind: str, quality: str) -> np.ndarray:
    """XYZ that a profile of `colprof`, made from `fitted`, gives for codes (n, 3)."""
    with tempfile.TemporaryDirectory() as folder:
        base = Path(folder) / "display"
        base.with_suffix(".ti3").write_text(_ti3(fitted), encoding="ascii")
        subprocess.run(
            ["colprof", "-v", f"-q{quality}", f"-a{kind}", "-D", "display", str(base)], check=True, capture_output=True
        )
        text = "\n".join(" ".join(f"{value:.8f}" for value in row) for row in codes) + "\n"
        profile = next(path for path in Path(folder).iterdir() if path.suffix in (".icc", ".icm"))
        output = subprocess.run(
            ["xicclu", "-ff", "-ia", "-px", str(profile)], input=text, text=True, check=True, capture_output=True
        ).stdout
    rows = [line.split("->")[-1].split("[")[0].split() for line in output.splitlines() if "->" in line]
    scale = fitted.white_XYZ[1]
    return np.array([[float(value) for value in row[:3]] for row in rows]) * scale


def _ti3(measured: Measurements) -> str:
    XYZ = measured.XYZ / measured.white_XYZ[1] * 100
    rows = np.concatenate([measured.codes * 100, XYZ], axis=1)
    lines = [f"{index + 1} " + " ".join(f"{value:.6f}" for value in row) for index, row in enumerate(rows)]
    return "\n".join(
        ["CTI3", "", 'DEVICE_CLASS "DISPLAY"', 'COLOR_REP "RGB_XYZ"', 'NORMALIZED_TO_Y_100 "YES"',
         'LUMINANCE_XYZ_CDM2 "95.0 100.0 108.0"', "", "NUMBER_OF_FIELDS 7", "BEGIN_DATA_FORMAT",
         "SAMPLE_ID RGB_R RGB_G RGB_B XYZ_X XYZ_Y XYZ_Z", "END_DATA_FORMAT", "",
         f"NUMBER_OF_SETS {len(rows)}", "BEGIN_DATA", *lines, "END_DATA", ""]
    )  # fmt: skip


def compare(path: Path, quality: str) -> dict[str, object]:
    """Ours and Argyll's on one file."""
    found = characterise(read_measurements(path))
    ours = {each.name: asdict(each.held_out) for each in found.models if each.held_out}
    argyll = {
        name: asdict(percentiles(argyll_errors(found.measured, kind, quality))) for kind, name in COLPROF_TYPES.items()
    }
    return {"file": path.name, "chosen": found.chosen.name, "ours": ours, "argyll": argyll}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument(
        "--quality", choices=("l", "m", "h", "u"), default="m", help="of colprof; h takes a minute a profile"
    )
    arguments = parser.parse_args()
    if shutil.which("colprof") is None:
        sys.exit("error: colprof is missing; install Argyll (on Debian: apt-get install argyll)")
    results = [compare(path, arguments.quality) for path in arguments.files]
    if arguments.json:
        print(json.dumps({"files": results}))
        return
    for result in results:
        print(f"\n{result['file']}: dE00 on held-out mixed colours, mean, 95 %, max")
        for source in ("ours", "argyll"):
            for name, figures in result[source].items():
                mark = "*" if name == result["chosen"] else ""
                print(
                    f"  {source:<7} {name + mark:<24} {figures['mean']:.3f} {figures['p95']:.3f} {figures['max']:.3f}"
                )


if __name__ == "__main__":
    main()
