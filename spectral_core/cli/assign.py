"""The command ``spectral-booth assign``: spectra for RGB textures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from spectral_core.assigning import Assignment, read_library
from spectral_core.assigning import assign as run
from spectral_core.cli.console import Document, emit, facts, progress_bar, rounded, table
from spectral_core.cli.options import FiniteRange, as_json, observer_option
from spectral_core.errors import SpectrumError
from spectral_core.lights import Light
from spectral_core.standards import RECOVERY_METHODS

_PATH = click.Path(path_type=Path)


@click.command()
@click.argument("texture", type=_PATH)
@click.option(
    "--library", "libraries", metavar="FILE", multiple=True, help="reflectances, or `colorchecker`; repeat for several"
)
@click.option(
    "--light", metavar="LIGHT", required=True, help="the scanner's lamp: what the codes' colours are seen under"
)
@click.option("-o", "--output", type=_PATH, required=True, help="hyperspectral texture: .npz, .npy or .exr")
@click.option(
    "--icc", type=_PATH, metavar="FILE", help="the scanner's ICC profile; that in the image if left out, else sRGB"
)
@click.option("--profile", metavar="PROFILE", help="a display profile instead")
@click.option("--mix", type=int, default=0, metavar="N", help="smooth mixtures of the N nearest reflectances")
@click.option("--exact", is_flag=True, help="then change each reflectance smoothly until its colour is the texel's")
@click.option("--recover", type=click.Choice(list(RECOVERY_METHODS)), help="reflectances from colour alone, no library")
@click.option(
    "--judge",
    "judges",
    metavar="LIGHT",
    multiple=True,
    help="how wrong colours are under this light; repeat for several",
)
@click.option(
    "--step", type=FiniteRange(0, 100, min_open=True), metavar="NM", help="bring the library to even wavelengths"
)
@click.option("--precision", type=click.Choice(["half", "float"]), default="half", show_default=True)
@observer_option
@as_json
def assign(
    texture: Path, libraries: Sequence[str], light: str, output: Path, icc: Path | None, profile: str | None, mix: int,
    exact: bool, recover: str | None, judges: Sequence[str], step: float | None, precision: str, observer: str,
    json: bool,
) -> None:  # fmt: skip
    """Give every texel of the RGB image TEXTURE a reflectance of the same colour under the scanner's lamp.

    It is the one of a library whose colour is nearest by CIEDE2000, a mixture of near ones, or one
    recovered from colour alone. --judge leaves each reflectance of the library out in turn and
    predicts its colour under another light.
    """
    if step is not None and not libraries:
        raise SpectrumError("--step is for a library", remedy="leave it out, or give --library")
    library = read_library(libraries, step) if libraries else None
    lamp, others = Light.load(light), [Light.load(each) for each in judges]
    with progress_bar(f"assigning {texture.name}") as progress:
        done = run(
            texture, lamp, output, library, mix=mix, exact=exact, recover=recover, icc=icc, profile=profile,
            judges=others, observer=observer, half=precision == "half", progress=progress,
        )  # fmt: skip
    document = assign_document(done)

    def show(console: Any) -> None:
        shown = {**document, "dE00": [f"{key} {value:.2f}" for key, value in document["dE00"].items()]}
        console.print(facts(shown, ("held_out", "most_used")))
        used = [[each["name"], f"{each['share']:.1%}"] for each in document["most_used"]]
        if used:
            console.print(table(("most used", "texels"), used))
        rows = [
            [each["light"], *rounded([each["mean"], each["p95"], each["max"]], 2),
             *rounded([each["rgb_texture"]["mean"]], 2)]
            for each in document["held_out"]
        ]  # fmt: skip
        if rows:
            title = "each of the library left out in turn: dE00"
            console.print(table(("under", "mean", "p95", "max", "RGB texture"), rows, title))

    emit(document, json, show)


def assign_document(done: Assignment) -> Document:
    """`assign`: differences over all texels; `held_out` over the library."""
    return {
        "file": str(done.path),
        "method": done.method,
        "light": done.light,
        "profile": done.profile,
        "dE00": asdict(done.dE00),
        "reflectances_used": done.reflectances_used,
        "library": done.library,
        "most_used": [{"name": name, "share": share} for name, share in done.most_used],
        "colours": done.colours,
        "pixels": done.pixels,
        "bands": done.bands,
        "out_of_gamut": done.out_of_gamut,
        "outside_0_1": done.outside_0_1,
        "held_out": [
            {
                "light": each.light,
                **asdict(each.dE00),
                "rgb_texture": asdict(each.rgb_texture),
                "left_out": each.colours,
            }
            for each in done.held_out
        ],
        "seconds": done.seconds,
        "warnings": list(done.warnings),
    }


def add_assign_command(group: click.Group) -> None:
    """Add this module's command to the program."""
    group.add_command(assign)
