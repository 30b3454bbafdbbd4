"""The commands about hyperspectral textures: `texture` and `bake`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from typing import Any

import click

from spectral_core import documents
from spectral_core.baking import BakeResult, bake
from spectral_core.baking.strips import check_reflectance
from spectral_core.cli.console import Report, cell, emit, facts, progress_bar, table
from spectral_core.cli.options import as_json, observer_option, profile_option
from spectral_core.display import load_profile
from spectral_core.imaging import IMAGE_FORMATS
from spectral_core.lights import Light
from spectral_core.textures import Reading, open_texture
from spectral_core.textures.base import KINDS

_READING = (
    click.option("--kind", type=click.Choice(KINDS[:3]), help="what the values are, if the file does not say"),
    click.option("--scale", type=float, help="stored value of reflectance 1, if the file does not say"),
    click.option("--white", type=click.Path(path_type=Path), help="capture of a white reference, or a CSV spectrum"),
    click.option("--dark", type=click.Path(path_type=Path), help="capture in darkness, with --white"),
    click.option("--wavelengths", metavar="NM", help="first:last:step, a list, or a file: one wavelength in nm a line"),
    click.option("--variable", metavar="NAME", help="the array in a MATLAB file"),
    click.option("--reduce", is_flag=True, help="drop polarisation or fluorescence that a texture cannot show"),
)


def reading_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options of a `Reading`, which the command gets as `reading`."""

    @wraps(command)
    def with_reading(
        *arguments: Any, kind: Any, scale: float | None, white: Path | None, dark: Path | None,
        wavelengths: str | None, variable: str | None, reduce: bool, **others: Any,
    ) -> Any:  # fmt: skip
        reading = Reading(kind, scale, white, dark, wavelengths, variable, reduce)
        return command(*arguments, reading=reading, **others)

    for option in reversed(_READING):
        with_reading = option(with_reading)
    return with_reading


def add_texture_commands(cli: click.Group) -> None:
    """Add `texture info`, `texture pixel` and `bake`."""
    cli.add_command(texture)
    cli.add_command(bake_command)


@click.group()
def texture() -> None:
    """Look into hyperspectral textures."""


@texture.command("info")
@click.argument("file", type=click.Path(path_type=Path))
@reading_options
@as_json
def texture_info(file: Path, reading: Reading, json: bool) -> None:
    """What FILE holds.

    FILE is ENVI, spectral OpenEXR, multi-band TIFF, .npy, .npz or MATLAB, or a folder or a pattern
    of one image per wavelength.
    """
    document = documents.texture_document(open_texture(file, reading))
    emit(document, json, lambda console: console.print(facts(document)))


@texture.command("pixel")
@click.argument("file", type=click.Path(path_type=Path))
@click.argument("x", type=int)
@click.argument("y", type=int)
@click.option("--light", metavar="LIGHT", help="also its colour under this light")
@reading_options
@observer_option
@as_json
def texture_pixel(
    file: Path, x: int, y: int, light: str | None, reading: Reading, observer: str, json: bool
) -> None:  # fmt: skip
    """The spectrum at column X (to the right) and row Y (down), both from 0."""
    opened = open_texture(file, reading)
    document = documents.pixel_document(opened, file, x, y, Light.load(light) if light else None, observer)
    rows = list(zip((cell(nm) for nm in document["wavelengths_nm"]), document["reflectance"], strict=True))

    def show(console: Any) -> None:
        console.print(table(("nm", "value"), rows))
        if light:
            console.print(facts({key: document[key] for key in ("XYZ", "rgb_8bit")}))

    emit(document, json, show)


@click.command("bake")
@click.argument("files", metavar="FILE...", type=click.Path(path_type=Path), nargs=-1, required=True)
@click.option("--light", "lights", metavar="LIGHT", multiple=True, required=True, help="repeat for several")
@click.option("-o", "--output", type=click.Path(path_type=Path), required=True, help="folder for the images")
@profile_option
@click.option("--format", "image_format", type=click.Choice(sorted(IMAGE_FORMATS)), default="exr", show_default=True)
@click.option("--level", "levels", type=click.Choice(["1", "2"]), multiple=True, default=("2",), show_default=True)
@reading_options
@click.option(
    "--bad-pixels", type=click.Choice(["repair", "refuse"]), default="repair", show_default=True,
    help="what to do with values that are no numbers",
)  # fmt: skip
@click.option("--again", is_flag=True, help="also make images that would come out as they are")
@click.option("--cluster", metavar="ADDRESS", help="compute on the Dask cluster whose scheduler is there")
@observer_option
@as_json
def bake_command(
    files: Sequence[Path], lights: Sequence[str], output: Path, profile: str, image_format: Any,
    levels: Sequence[str], reading: Reading, bad_pixels: Any, again: bool, cluster: str | None, observer: str,
    json: bool,
) -> None:  # fmt: skip
    """Bake textures under lights: one image for each light, all in one pass over each FILE.

    A bake that was stopped goes on where it was: whole images are kept if they would come out the same.
    """
    chosen, display = [Light.load(each) for each in lights], load_profile(profile)
    opened = {file: open_texture(file, reading) for file in files}
    documents.check_names(opened)
    for each in opened.values():  # before the first one, which may take long, is baked
        check_reflectance(each)
    results: dict[Path, BakeResult] = {}
    with progress_bar("baking") as progress, _workers(cluster, reading) as strips:
        for index, (file, each) in enumerate(opened.items()):
            results[file] = bake(
                each, chosen, output, display, image_format, observer, [int(level) for level in dict.fromkeys(levels)],
                progress=_part(progress, index, len(opened)), bad_pixels=bad_pixels, again=again, strips=strips(file),
            )  # fmt: skip
    document = documents.bakes_document(results)
    rows = [
        [each["path"], each["light"], each["level"], each["clipped_fraction"], "kept" if each["kept"] else "made"]
        for each in document["outputs"]
    ]
    emit(
        document, json, lambda console: console.print(table(("file", "light", "level", "share clipped", "state"), rows))
    )


def _part(progress: Report, index: int, count: int) -> Report:
    """Progress of one of several textures."""
    return lambda fraction, text: progress((index + fraction) / count, text)


@contextmanager
def _workers(address: str | None, reading: Reading) -> Iterator[Callable[[Path], Any]]:
    """Who computes the strips of a file: None for this process."""
    if address is None:
        yield lambda file: None
        return
    from spectral_core.baking.cluster import Cluster, connected

    with connected(address) as client:
        yield lambda file: Cluster(client, file.absolute(), reading.relative_to(Path.cwd()))
