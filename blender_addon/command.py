"""Commands inside Blender: ``blender -b FILE --command spectral_booth VERB ...``.

With the bpy module instead of an application: ``python -m blender_addon.command VERB ...``.
The core is imported when a verb runs, because this module is imported when the add-on is registered.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NoReturn

import bpy

NAME = "spectral_booth"
PROGRESS = "spectral-booth progress"

Result = dict[str, Any]


def main(argv: Sequence[str] | None = None) -> int:
    """Run one verb; 0 done, 2 bad input with one line on stderr."""
    from spectral_core.errors import SpectralBoothError

    try:
        arguments = _parser().parse_args(sys.argv[1:] if argv is None else list(argv))
    except SystemExit as stopped:  # argparse's way to end; inside Blender only a return value counts
        return int(stopped.code or 0)
    try:
        result = arguments.run(arguments)
        _print(result, arguments.result)
    except SpectralBoothError as error:
        print(f"error: {error}", file=sys.stderr, flush=True)
        return 2
    return 0


def build(arguments: argparse.Namespace) -> Result:
    """Build a scene from TOML in an empty file, calibrate its white, save it."""
    from spectral_core.scene import load_scene
    from spectral_core.steps import finished

    from .bridge import build as building
    from .bridge import encoded, lighting, ways
    from .bridge import verify as verifying

    started = time.perf_counter()
    description = load_scene(arguments.scene)
    output = _blend_path(arguments.output)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    scene.name = description.name
    progress(0.1, "building")
    built = building.build_scene(scene, description)
    progress(0.4, "calibrating the white")
    calibrated = lighting.calibrate_white(scene)
    if arguments.live is not None:
        progress(0.6, "encoding the surfaces")
        steps = encoded.encoding_steps(scene, encoded.lights_of(scene), arguments.live, arguments.half)
        ways.show_encoded(scene, finished(steps))
    if arguments.lamps == "coded":
        ways.set_way(scene, "CODED")
    _save(output)
    return {
        "file": str(output),
        "objects": built.objects,
        "materials": built.materials,
        "lights": built.lights,
        "white_luminance": calibrated.after,
        **verifying.shown_document(scene),
        "seconds": time.perf_counter() - started,
    }


def render(arguments: argparse.Namespace) -> Result:
    """Render a .blend under a light at a level to PNG."""
    from .bridge import ways
    from .bridge.render import render_png

    scene = _open(arguments.file)
    applied = ways.light(scene, arguments.light or scene.spectral_booth.light, _level(arguments, scene))
    progress(0.1, f"rendering {applied.lighting.light.name}")
    seconds = render_png(scene, arguments.output, arguments.stereo)
    return {
        "file": str(arguments.output),
        "light": applied.lighting.light.name,
        "level": applied.lighting.level,
        "seconds": seconds,
        "notes": list(applied.lighting.notes),
    }


def verify(arguments: argparse.Namespace) -> Result:
    """Verify a .blend under its lights, from rendered pixels."""
    from .bridge import state
    from .bridge import verify as verifying

    scene = _open(arguments.file)
    lights = arguments.light or list(state.description(scene).lights)
    started = time.perf_counter()
    if arguments.profile:
        return _verify_display(arguments, scene, lights)
    results = verifying.verify(scene, lights, tuple(arguments.level or (0, 1, 2)), arguments.images, progress)
    return verifying.document(scene, results, time.perf_counter() - started)


def _verify_display(arguments: argparse.Namespace, scene: bpy.types.Scene, lights: list[str]) -> Result:
    """Verify the codes that a display of the running OpenColorIO config gets, see `config`."""
    from spectral_core.display import load_profile

    from .bridge.display import Display, verify_display

    profile = load_profile(arguments.profile)
    display = Display(arguments.display or profile.name, arguments.view, arguments.xyz_view)
    results = verify_display(scene, lights, profile, display, progress)
    return {
        "scene": scene.spectral_booth.description.name.removesuffix(".toml"),
        "blender": bpy.app.version_string,
        "profile": profile.name,
        "display": display.name,
        "view": display.xyz_view if scene.spectral_booth.way == "CODED" else display.view,
        "lights": [each.to_json() for each in results],
    }


def config(arguments: argparse.Namespace) -> Result:
    """Tell where Blender's own OpenColorIO config is."""
    from .bridge.display import config_path

    return {"config": str(config_path()), "blender": bpy.app.version_string}


def bake_texture(arguments: argparse.Namespace) -> Result:
    """Bake a hyperspectral texture under lights, as `spectral-booth bake` does."""
    from spectral_core.baking import bake
    from spectral_core.display import load_profile
    from spectral_core.lights import Light
    from spectral_core.report.documents import bake_document
    from spectral_core.textures import Reading, open_texture

    reading = Reading(
        arguments.kind, arguments.scale, arguments.white, arguments.dark, arguments.wavelengths, arguments.variable,
        arguments.reduce,
    )  # fmt: skip
    texture = open_texture(arguments.file, reading)
    profile = load_profile(arguments.profile)
    result = bake(
        texture,
        [Light.load(each) for each in arguments.light],
        arguments.output,
        profile=profile,
        image_format=arguments.format,
        levels=tuple(arguments.level or (2,)),
        progress=progress,
        bad_pixels=arguments.bad_pixels,
        again=arguments.again,
    )
    return bake_document(result)


def progress(fraction: float, what: str) -> None:
    """One line per step on stderr; the command-line program turns them into a bar."""
    print(f"{PROGRESS} {fraction:.3f} {what}", file=sys.stderr, flush=True)


def register() -> None:
    """Offer the verbs as ``--command spectral_booth``; absent from the bpy module."""
    global _handle
    if hasattr(bpy.utils, "register_cli_command"):
        _handle = bpy.utils.register_cli_command(NAME, _blender_command)


def unregister() -> None:
    """Take them back."""
    global _handle
    if _handle is not None:
        bpy.utils.unregister_cli_command(_handle)
        _handle = None


_handle: object | None = None


def _blender_command(argv: list[str]) -> int:
    return main(argv)


class _Parser(argparse.ArgumentParser):
    """One line for a wrong argument, as for all bad input."""

    def error(self, message: str) -> NoReturn:
        print(f"error: {message}; see {self.prog} --help", file=sys.stderr, flush=True)
        raise SystemExit(2)


def _print(result: Result, path: Path | None) -> None:
    from spectral_core.files import atomic_path

    if path is None:
        print(json.dumps(result, indent=2), flush=True)
        return
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(result), encoding="utf-8")


def _parser() -> argparse.ArgumentParser:
    from spectral_core.display.export import XYZ_VIEW
    from spectral_core.imaging import IMAGE_FORMATS
    from spectral_core.textures.base import KINDS

    parser = _Parser(prog=NAME, description="Spectral Booth inside Blender")
    verbs = parser.add_subparsers(required=True, metavar="VERB")

    def verb(name: str, run: Callable[[argparse.Namespace], Result]) -> argparse.ArgumentParser:
        made = verbs.add_parser(name, help=(run.__doc__ or "").splitlines()[0])
        made.set_defaults(run=run)
        made.add_argument("--result", type=Path, help="write the JSON there instead of standard output")
        return made

    command = verb("build", build)
    command.add_argument("scene", type=Path)
    command.add_argument("-o", "--output", type=Path, required=True)
    command.add_argument("--live", type=float, help="encode surfaces in a basis of this largest dE00")
    command.add_argument("--half", action="store_true", help="images of half floats")
    command.add_argument("--lamps", choices=("coloured", "coded"), default="coloured")
    command = verb("render", render)
    command.add_argument("file", type=Path, nargs="?", help="a .blend; the open file if left out")
    command.add_argument("--light", help="name or file; the scene's own if left out")
    command.add_argument("--level", type=int, choices=(0, 1, 2))
    command.add_argument("--stereo", action="store_true", help="both eyes side by side")
    command.add_argument("-o", "--output", type=Path, required=True)
    command = verb("verify", verify)
    command.add_argument("file", type=Path, nargs="?", help="a .blend; the open file if left out")
    command.add_argument("--light", action="append", help="repeat for several; all of the scene's if left out")
    command.add_argument("--level", type=int, choices=(0, 1, 2), action="append")
    command.add_argument("--images", type=Path, help="keep the renders in this folder")
    command.add_argument("--profile", help="compare the codes of the profile's display instead, see --display")
    command.add_argument("--display", help="its name in the OpenColorIO config that Blender was started with")
    command.add_argument("--view", default="Standard")
    command.add_argument("--xyz-view", default=XYZ_VIEW, help="its view for scenes of coded lamps")
    verb("config", config)
    command = verb("bake", bake_texture)
    command.add_argument("file", type=Path)
    command.add_argument("--light", action="append", required=True)
    command.add_argument("-o", "--output", type=Path, required=True)
    command.add_argument("--profile", default="sRGB")
    command.add_argument("--format", choices=sorted(IMAGE_FORMATS), default="exr")
    command.add_argument("--level", type=int, choices=(1, 2), action="append")
    command.add_argument("--kind", choices=KINDS[:3], help="what the values are, if the file does not say")
    command.add_argument("--scale", type=float, help="stored value of reflectance 1, if the file does not say")
    command.add_argument("--white", type=Path, help="capture of a white reference")
    command.add_argument("--dark", type=Path, help="capture in darkness, with --white")
    command.add_argument("--wavelengths", help="first:last:step in nm, a list, or a file")
    command.add_argument("--variable", help="the array in a MATLAB file")
    command.add_argument("--reduce", action="store_true", help="drop polarisation or fluorescence")
    command.add_argument("--bad-pixels", choices=("repair", "refuse"), default="repair")
    command.add_argument("--again", action="store_true", help="also make images that would come out as they are")
    return parser


def _level(arguments: argparse.Namespace, scene: bpy.types.Scene) -> int:
    return int(scene.spectral_booth.level) if arguments.level is None else int(arguments.level)


def _open(path: Path | None) -> bpy.types.Scene:
    """The managed scene of a .blend, or of the file that is open."""
    from spectral_core.errors import BlenderError

    from .bridge import state

    if path is not None:
        if not path.is_file():
            raise BlenderError("no such file", where=path, remedy="build one with `spectral-booth build`")
        try:
            bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False)
        except RuntimeError as error:
            raise BlenderError(
                f"Blender cannot open it ({str(error).splitlines()[0]})", where=path, remedy="is it a .blend?"
            ) from None
    managed = [scene for scene in bpy.data.scenes if state.is_managed(scene)]
    if not managed:
        raise BlenderError("holds no spectral scene", where=path, remedy="build one with `spectral-booth build`")
    scene = bpy.context.scene if bpy.context.scene in managed else managed[0]
    if bpy.context.window is not None:
        bpy.context.window.scene = scene
    return scene


def _blend_path(path: Path) -> Path:
    from spectral_core.errors import BlenderError

    if path.suffix != ".blend":
        raise BlenderError("is no name for a Blender file", where=path, remedy="end it with .blend")
    return path.resolve()


def _save(path: Path) -> None:
    from spectral_core.files import atomic_path

    with atomic_path(path) as temporary:
        temporary.unlink()  # Blender would keep the empty file as a backup
        bpy.ops.wm.save_as_mainfile(filepath=str(temporary), check_existing=False, compress=True, copy=True)


if __name__ == "__main__":
    from . import props

    props.register()
    code = main()
    sys.stdout.flush()
    sys.stderr.flush()
    # The bpy module's threads can deadlock when the interpreter ends; all results are written by now.
    os._exit(code)
