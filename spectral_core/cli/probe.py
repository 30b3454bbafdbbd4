"""The command ``spectral-booth probe``: what the headset's runtime did to the codes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from spectral_core.cli.console import Document, emit, facts, naming, rounded, table
from spectral_core.cli.options import as_json, observer_option
from spectral_core.display import DisplayProfile, load_profile
from spectral_core.display.characterising.repeats import noise
from spectral_core.display.measuring.measurements import Measurements, read_measurements
from spectral_core.display.probing.correction import (
    correct,
    correction_document,
    unreachable_document,
    write_correction,
)
from spectral_core.display.probing.probe import Probe
from spectral_core.display.probing.probe import probe as infer
from spectral_core.display.probing.probe_patches import patches_text, probe_patches, write_patches
from spectral_core.errors import DisplayError

_PATH = click.Path(path_type=Path)
# White further from the profile's than this is worth a word.
_DIMMED = 0.05
_SHOWN = 8


@click.command()
@click.argument("readings", type=_PATH, required=False)
@click.option("--profile", metavar="PROFILE", help="the display's, characterised with codes set directly")
@click.option("--patches", is_flag=True, help="write the sequence of codes to measure instead (CSV)")
@click.option("-o", "--output", type=_PATH, help="write the correction as JSON, or the patches as CSV")
@observer_option
@as_json
def probe(
    readings: Path | None, profile: str | None, patches: bool, output: Path | None, observer: str, json: bool
) -> None:
    """Infer from READINGS of a short sequence what the headset's runtime did to the codes.

    READINGS is Argyll's .ti3 or CSV as for `characterise`, with the codes that the application sent.
    """
    if patches:
        if readings is not None or profile is not None:
            raise click.UsageError("--patches only writes what to measure; leave the readings and --profile out")
        _patches(output, json)
        return
    if readings is None:
        raise DisplayError("no readings", remedy="name a file, or ask for the sequence to measure with --patches")
    display = None if profile is None else load_profile(profile)
    measured = read_measurements(readings, observer)
    with naming(readings):
        found = infer(measured, None if display is None else display.model)
    document = probe_document(found, measured, display)
    if output is not None and document["correction"] is not None:
        write_correction({key: document[key] for key in ("runtime", "parameters", "correction", "unreachable")}, output)
        document["file"] = str(output)
    elif output is not None:
        document["warnings"].append("undecided: no correction was written")
    emit(document, json, lambda console: _show(console, document))


def probe_document(found: Probe, measured: Measurements, display: DisplayProfile | None) -> Document:
    """`probe`: what the runtime is, why, and its correction; none of an undecided one."""
    best = found.best
    made = correct(best.runtime, best.parameters) if found.decided else None
    scale = _luminance(found, measured, display)
    warnings = [*measured.warnings, *found.warnings]
    if scale is not None and abs(scale - 1) > _DIMMED:
        warnings.append(
            f"luminance is {scale:.2f} of the profile's: a brightness setting, or a tone map that lowers white; "
            "readings cannot tell which"
        )
    return {
        "runtime": found.name,
        "meaning": best.runtime.meaning if found.decided else "the readings do not tell",
        "parameters": {
            name: {"value": float(value), "sd": float(sd)}
            for name, value, sd in zip(best.runtime.parameters, best.parameters, best.deviations, strict=True)
            if found.decided
        },
        "margin": found.margin,
        "candidates": [fit.runtime.name for fit in ((best, *found.rivals) if not found.decided else (best,))],
        "noise": {"times_expected": found.noise, "repeats_dE00": noise(measured)},
        "luminance": scale,
        "evidence": [
            {
                "hypothesis": fit.runtime.name,
                "dE00": float(fit.dE00.mean()),
                "parameters": len(fit.parameters),
                "score": fit.score,
            }
            for fit in found.fits
        ],
        "correction": None if made is None else correction_document(made),
        "unreachable": None if made is None else unreachable_document(made),
        "warnings": warnings,
    }


def _luminance(found: Probe, measured: Measurements, display: DisplayProfile | None) -> float | None:
    """Luminance of the readings over the profile's, None where the two have no unit in common."""
    if display is None or display.white_Y == 1.0 or measured.unit != "cd/m2":
        return None
    return float(found.best.own[0] * measured.white_XYZ[1] / display.white_Y)


def _patches(output: Path | None, json: bool) -> None:
    if output is not None:
        write_patches(output)
    codes = (255 * probe_patches()).round().astype(int).tolist()
    document: Document = {"patches": codes, "file": None if output is None else str(output), "warnings": []}
    text = patches_text() if output is None else f"{len(codes)} patches in {output}"
    emit(document, json, lambda console: console.print(text.rstrip()))


def _show(console: Any, document: Document) -> None:
    rows = [
        [each["hypothesis"], *rounded([each["dE00"]], 2), each["parameters"], *rounded([each["score"]], 1)]
        for each in document["evidence"][:_SHOWN]
    ]
    left = len(document["evidence"]) - len(rows)
    title = f"the best hypotheses, {left} more left out" if left > 0 else "hypotheses"
    console.print(table(("hypothesis", "mean dE00", "parameters", "score"), rows, title))
    shown = {key: document[key] for key in ("runtime", "meaning", "margin")}
    shown |= {name: f"{each['value']:.4f} +- {each['sd']:.4f}" for name, each in document["parameters"].items()}
    if document["correction"]:
        shown["correction, error in 8-bit levels"] = document["correction"]["round_trip_levels"]
        shown["the same, sent in 8 bits"] = list((document["correction"]["sent_in_8_bits_levels"] or {}).values())
        shown |= {key.replace("_", " "): value for key, value in document["unreachable"].items()}
    console.print(facts(shown))


def add_probe_command(group: click.Group) -> None:
    """Add this module's command to the program."""
    group.add_command(probe)
