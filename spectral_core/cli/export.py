"""``spectral-booth profile export``: a display profile for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from spectral_core.cli.console import Document, emit, facts
from spectral_core.cli.options import as_json
from spectral_core.display import load_profile
from spectral_core.display.export import (
    ReadBack,
    blender_config,
    export_cube,
    export_icc,
    export_ocio,
    read_back_cube,
    read_back_icc,
    read_back_ocio,
    read_back_ocio_xyz,
)
from spectral_core.errors import DisplayError

_PATH = click.Path(path_type=Path)


@click.command()
@click.argument("profile")
@click.option("--ocio", type=_PATH, metavar="DIR", help="OpenColorIO: Blender's config with the display added")
@click.option("--cube", type=_PATH, metavar="FILE", help="3-D table from sRGB's primaries to codes")
@click.option("--icc", type=_PATH, metavar="FILE", help="ICC v4 display profile")
@click.option("--base", type=_PATH, metavar="CONFIG", help="for --ocio: the config.ocio of the Blender in use")
@click.option("--cube-input", type=click.Choice(["srgb", "linear"]), default="srgb", show_default=True)
@as_json
def export(
    profile: str, ocio: Path | None, cube: Path | None, icc: Path | None, base: Path | None, cube_input: Any, json: bool
) -> None:
    """Write PROFILE (built-in or JSON) for other programs, and let one of them read it back.

    `max_code_error` is the largest difference between its codes and the profile's own, 0 to 1, over
    colours in gamut.
    """
    if sum(each is not None for each in (ocio, cube, icc)) != 1:
        raise DisplayError("give one of --ocio, --cube and --icc", remedy="one export at a time")
    if base is not None and ocio is None:
        raise DisplayError("--base belongs to --ocio", remedy="leave it out")
    display = load_profile(profile)
    if ocio is not None:
        made = export_ocio(display, ocio, base or blender_config())
        chosen = {"display": made.display, "view": made.view, "xyz_view": made.xyz_view}
        xyz = read_back_ocio_xyz(display, made)
        errors = {"xyz_max_code_error": xyz.max_code_error, "xyz_max_dE00": xyz.max_dE00}
        document = _document(made.files, read_back_ocio(display, made), xyz) | chosen | errors
    elif cube is not None:
        written = export_cube(display, cube, cube_input)
        document = _document((written,), read_back_cube(display, written, cube_input)) | {"input": cube_input}
    elif icc is not None:
        written = export_icc(display, icc)
        document = _document((written,), read_back_icc(display, written))
    emit(document, json, lambda console: console.print(facts(document)))


def _document(files: tuple[Path, ...], read: ReadBack, *others: ReadBack) -> Document:
    """The figures of `read`, and what of all of them could not be read back."""
    error = read.max_code_error
    return {
        "files": [str(path) for path in files],
        "max_code_error": error,
        "max_code_error_8bit": None if error is None else 255 * error,
        "max_dE00": read.max_dE00,
        "read_back_by": read.by,
        "colours": read.colours,
        "warnings": [
            f"not read back: {why}" for why in dict.fromkeys(each.why for each in (read, *others) if each.by is None)
        ],
    }
