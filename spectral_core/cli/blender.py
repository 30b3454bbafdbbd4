"""Commands of ``spectral-booth`` that need Blender: build, render, verify, demo."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

import click

from spectral_core.blender_process import run_verb
from spectral_core.cli.console import Document, emit, facts, progress_bar, rounded, table
from spectral_core.cli.options import FiniteRange, as_json
from spectral_core.demo import run_demo
from spectral_core.display import load_profile
from spectral_core.display.export import export_ocio
from spectral_core.errors import DisplayError, SceneError
from spectral_core.report.html import ReportInput, SceneRun, find_renders, write_report
from spectral_core.scene import load_scene

_PATH = click.Path(path_type=Path)
# Half an 8-bit level: below it, what is rendered and what is right round to the same or the next code.
_LIMIT = 0.5


@click.command()
@click.argument("scene", type=_PATH)
@click.option("-o", "--output", type=_PATH, required=True, help="the .blend to write")
@click.option("--live", type=FiniteRange(0.001), metavar="DE00", help="encode surfaces in a basis of this largest dE00")
@click.option("--half", is_flag=True, help="with --live: images of half floats")
@click.option("--lamps", type=click.Choice(["coloured", "coded"]), default="coloured", show_default=True)
@as_json
def build(scene: Path, output: Path, live: float | None, half: bool, lamps: str, json: bool) -> None:
    """Build the .blend of a SCENE (TOML) and calibrate its white.

    With --live a change of light touches no material or image. Coded lamps mix up to three lights exactly.
    """
    load_scene(scene)  # a wrong key is told at once, before Blender starts
    if half and live is None:
        raise SceneError("--half goes with --live only", remedy="add --live 0.1")
    arguments = ["build", str(scene), "-o", str(output), "--lamps", lamps]
    arguments += ["--live", str(live)] if live is not None else []
    arguments += ["--half"] if half else []
    with progress_bar(f"building {scene.name}") as progress:
        document = run_verb(arguments, progress)
    basis = document["basis"]
    told = "none" if basis is None else f"{basis['K']} numbers a colour, dE00 at most {basis['largest_dE00']:.2g}"
    emit(document, json, lambda console: console.print(facts({**document, "basis": told})))


@click.command()
@click.argument("file", type=_PATH)
@click.option("--light", metavar="LIGHT", help="the scene's own if left out")
@click.option("--level", type=click.Choice(["0", "1", "2"]), help="the scene's own if left out")
@click.option("--stereo", is_flag=True, help="both eyes side by side")
@click.option("-o", "--output", type=_PATH, required=True, help="the PNG to write")
@as_json
def render(file: Path, light: str | None, level: str | None, stereo: bool, output: Path, json: bool) -> None:
    """Render a built FILE (.blend) under a light to PNG."""
    arguments = ["render", str(file), "-o", str(output)]
    arguments += ["--light", light] if light else []
    arguments += ["--level", level] if level else []
    arguments += ["--stereo"] if stereo else []
    with progress_bar(f"rendering {file.name}") as progress:
        document = run_verb(arguments, progress)
    emit(document, json, lambda console: console.print(facts(document)))


@click.command()
@click.argument("file", type=_PATH)
@click.option("--light", "lights", metavar="LIGHT", multiple=True, help="repeat for several; all if left out")
@click.option(
    "--level", "levels", type=click.Choice(["0", "1", "2"]), multiple=True, help="repeat for several; all if left out"
)
@click.option("--images", type=_PATH, help="keep the renders in this folder")
@click.option("--report", type=_PATH, help="write an HTML report there")
@click.option(
    "--limit",
    type=FiniteRange(0),
    default=_LIMIT,
    show_default=True,
    help="largest 8-bit difference allowed at level 2",
)
@click.option(
    "--profile", metavar="PROFILE", help="render through this display instead, and compare its codes with the profile's"
)
@as_json
def verify(
    file: Path, lights: Sequence[str], levels: Sequence[str], images: Path | None, report: Path | None, limit: float,
    profile: str | None, json: bool,
) -> int:  # fmt: skip
    """Render a built FILE (.blend) and compare its pixels with theory.

    Ends with 1 if level 2 differs by more than --limit over the patches in gamut. With --profile the
    display is exported to OpenColorIO, Blender renders level 2 through it, and the codes that come
    out are compared with the profile's own. A scene of coded lamps goes through the export's view of XYZ.
    """
    if profile is not None:
        if levels or images or report:
            raise DisplayError("--profile goes with --light and --limit only", remedy="leave the other options out")
        return _verify_display(file, lights, profile, limit, json)
    arguments = ["verify", str(file)]
    arguments += [part for light in lights for part in ("--light", light)]
    arguments += [part for level in levels for part in ("--level", level)]
    with tempfile.TemporaryDirectory() as temporary, progress_bar(f"verifying {file.name}") as progress:
        folder = images or Path(temporary)
        arguments += ["--images", str(folder)] if images or report else []
        document = run_verb(arguments, progress)
        failed = [each["name"] for each in document["lights"] if _largest(each) > limit]
        document = {**document, "limit": limit, "failed": failed}
        if report:
            write_report(report, ReportInput(chart=SceneRun(document, find_renders(folder, document), file.parent)))
    emit(document, json, lambda console: console.print(table(_COLUMNS, verify_rows(document), _title(document))))
    return 1 if failed else 0


@click.command()
@click.option("-o", "--output", type=_PATH, default=Path("out/demo"), show_default=True, help="folder for everything")
@as_json
def demo(output: Path, json: bool) -> None:
    """Build the booth and the chart, render them under six lights, verify, and report."""
    with progress_bar("demo") as progress:
        document = run_demo(output, progress)
    emit(document, json, lambda console: console.print(facts(document)))


def _verify_display(file: Path, lights: Sequence[str], profile: str, limit: float, json: bool) -> int:
    display = load_profile(profile)
    with tempfile.TemporaryDirectory() as folder, progress_bar(f"verifying {file.name}") as progress:
        exported = export_ocio(display, Path(folder) / "ocio", Path(run_verb(["config"])["config"]))
        arguments = ["verify", str(file), "--profile", profile]
        arguments += ["--display", exported.display, "--view", exported.view, "--xyz-view", exported.xyz_view]
        arguments += [part for light in lights for part in ("--light", light)]
        document = run_verb(arguments, progress, exported.config)
    failed = [each["name"] for each in document["lights"] if each["codes8"]["max"] > limit]
    document = {**document, "limit": limit, "failed": failed}
    rows = [
        [
            each["name"],
            f"{each['in_gamut']} of {each['patches']}",
            *rounded([each[key][figure] for key in _SHOWN for figure in ("mean", "max")], 3),
            ", ".join(each["lost"]) or "none",
        ]
        for each in document["lights"]
    ]
    title = f"{document['scene']} through {document['display']}, Blender {document['blender']}: 8-bit levels"
    emit(document, json, lambda console: console.print(table(_SHOWN_COLUMNS, rows, title)))
    return 1 if failed else 0


_SHOWN = ("codes8", "codes8_clipped", "theory8")
_SHOWN_COLUMNS = ("light", "in gamut", "display", "max", "clipped", "max", "and Eevee", "max", "not in Rec.709")


def add_blender_commands(group: click.Group) -> None:
    """Add this module's commands to the program."""
    for command in (build, render, verify, demo):
        group.add_command(command)


def _title(document: Document) -> str:
    basis = document.get("basis")
    surfaces = "baked surfaces" if basis is None else f"{basis['K']} numbers a colour"
    how = f"{document.get('lamps', 'coloured')} lamps, {surfaces}"
    return f"{document['scene']}, {how}, Blender {document['blender']}: 8-bit differences and dE00 from theory"


_COLUMNS = ("light", "level", "R", "G", "B", "max", "dE00", "max", "s")


def verify_rows(document: Document) -> list[list[object]]:
    """One row per light and level for the terminal: mean 8-bit differences per channel over all
    patches, clipped, and the largest; mean and largest dE00; seconds of switching and rendering.
    """
    rows: list[list[object]] = []
    for light in document["lights"]:
        for level in ("level0", "level1", "level2"):
            if level not in light:
                continue
            result = light[level]
            rgb = [result["rgb8"][channel] for channel in "RGB"]
            levels = [*(each["mean"] for each in rgb), max(each["max"] for each in rgb)]
            dE00 = [result["dE00"]["mean"], result["dE00"]["max"]]
            seconds = result["switch_seconds"] + result["render_seconds"]
            rows.append([light["name"], level[-1], *rounded(levels, 2), *rounded(dE00, 2), *rounded([seconds])])
    return rows


def _largest(light: Document) -> float:
    """The largest 8-bit difference of a light at level 2 in gamut, 0 if level 2 was not asked for."""
    result = light.get("level2")
    return max(each["max"] for each in result["rgb8_in_gamut"].values()) if result else 0.0
