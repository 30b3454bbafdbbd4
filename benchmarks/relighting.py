"""Light switched in a spectral basis, against colours baked for each light, and a plain RGB texture: what each costs.

``python benchmarks/relighting.py``, on the bpy wheel; `--help` tells the options.

*Table*: a hyperspectral texture (a fruit of the booth, or a file) under the lights of the ColorChecker's scene, for
K = 3 to 12 coefficients as half and single floats. dE00 is of all pixels under all lights, as stored, before colours
outside Rec.709 are cut off, which all ways do alike. *all* is what must be kept in memory for every light. A switch is
`ways.light` and the update of the view layer.
*Frames*: K = 12 in three images against an 8-bit sRGB image on the same shader, in the booth with twelve spots and
under one sun where the texture fills the frame. Frame time is that of a sample: a render of many less a render of one,
without what starting costs. Ways take turns within a round, and a ratio is of one round, so that other load falls on
both. Beside elapsed time stands processor time, which is what software rendering costs whoever else computes.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import bpy
import gpu
import numpy as np

import blender_addon
from blender_addon.bridge import build, encoded, lighting, shading, state, ways
from spectral_core.basis import PackedTexture, SpectralBasis, encode_texture, fit_basis, surface_samples
from spectral_core.basis.metric import differences
from spectral_core.display import srgb, srgb_encode
from spectral_core.lighting import make_lighting
from spectral_core.lights import Light
from spectral_core.scene import SceneDescription, bundled_scene, load_scene, parse_scene
from spectral_core.standards import srgb_to_XYZ_matrix
from spectral_core.surfaces import Surface, scene_surfaces
from spectral_core.textures.synthetic.pigments import PIGMENT_TEXTURES

COEFFICIENTS = range(3, 13)
BOUNDS = {"booth": 1.1, "sun": 1.5}
# Of the long render; a sample of the booth takes seconds in software.
SAMPLES = {"booth": 4, "sun": 5}
# What a frame takes depends on how many images there are, not on how many of their channels are used.
TIMED = (4, 8, 12)
MB = 1e6
_TO_XYZ = srgb_to_XYZ_matrix()

SUN = """
format = 1
name = "{name}"
description = "A texture that fills the frame, under one sun"
reference = "D65"
lights = {lights}

[white]
object = "picture"
luminance = 0.85

[camera]
projection = "orthographic"
location = [0.0, 0.0, 1.0]
target = [0.0, 0.0, 0.0]
width = {width}

[render]
width = {columns}
height = {rows}
samples = 1

[[lamps]]
name = "sun"
type = "sun"
location = [0.0, 0.0, 1.0]
target = [0.0, 0.0, 0.0]

[surfaces.picture]
{source}

[[objects]]
name = "picture"
shape = "plane"
location = [0.0, 0.0, 0.0]
size = [{width}, {height}, 0.0]
surface = "picture"
"""


@dataclass(frozen=True)
class Row:
    """One way to show a texture; None where there is nothing to measure. Memory in MB, of one light and of all."""

    name: str
    mean: float
    p95: float
    max: float
    card_MB: float
    card_all_MB: float
    file_MB: float
    seconds: float | None
    switch_ms: float | None
    timed: str


@dataclass(frozen=True)
class Ratio:
    """Frame time against the plain texture's, elapsed and of the processor: the median of rounds, least and largest;
    and medians in seconds.
    """

    elapsed: tuple[float, float, float]
    processor: tuple[float, float, float]
    seconds: float
    processor_seconds: float

    @property
    def all(self) -> tuple[float, ...]:
        """The six ratios."""
        return (*self.elapsed, *self.processor)


def sun_scene(name: str, source: str, lights: Sequence[str], size: tuple[int, int]) -> SceneDescription:
    """One picture under one sun."""
    columns, rows = size
    # A little larger than the frame: no pixel sees anything else.
    text = SUN.format(
        name=name, lights=json.dumps(list(lights)), columns=columns, rows=rows, source=source,
        width=columns / 1000, height=rows / 1000,
    )  # fmt: skip
    return parse_scene(text, Path.cwd(), name)


def built(description: SceneDescription, name: str) -> bpy.types.Scene:
    """A scene as the add-on builds it, its colours baked."""
    scene = bpy.data.scenes.new(name)
    build.build_scene(scene, description)
    return scene


def plain_scene(description: SceneDescription, name: str) -> bpy.types.Scene:
    """The same shaders with textures as everybody has them: 8-bit sRGB, lit by lamps of the light's RGB (level 1)."""
    scene = built(description, name)
    lighting.apply(scene, description.light, 1)
    surfaces, reference = scene_surfaces(description), Light.load(description.reference)
    for surface_name, material in state.managed_materials(scene).items():
        surface = surfaces[surface_name]
        if surface.texture is None:
            continue
        codes = srgb_encode(surface.reference_rgb(reference))
        image = bpy.data.images.new(f"{surface_name} (8-bit)", surface.texture.width, surface.texture.height)
        rgba = np.ones((*codes.shape[:2], 4), dtype=np.float32)
        rgba[..., :3] = codes[::-1]
        image.pixels.foreach_set(rgba.ravel())
        image.update()
        image.pack()
        for node in material.node_tree.nodes:
            if node.type == "TEX_IMAGE":
                node.image = image
    return scene


def basis_scene(
    description: SceneDescription, name: str, basis: SpectralBasis, textures: Mapping[str, PackedTexture], half: bool
) -> bpy.types.Scene:
    """The same scene shown by a basis."""
    scene = built(description, name)
    images = {
        surface: encoded.coefficient_images(f"{name} {surface}", packed, half) for surface, packed in textures.items()
    }
    largest = max(each.largest_error for each in textures.values())
    ways.show_encoded(scene, encoded.Encoding(basis, images, max(largest, 1e-3), half, largest, notes=()))
    return scene


def packed_MB(scene: bpy.types.Scene) -> float:
    """What a scene's textures take in the file."""
    return sum(image.packed_file.size for image in shading.images_in(scene) if image.packed_file) / MB


def dE00_of(shown: np.ndarray, exact: np.ndarray, whites: np.ndarray) -> tuple[float, float, float]:
    """Mean, 95th percentile and largest dE00 of XYZ (n, L, 3)."""
    found = differences(shown, exact, whites)
    return float(found.mean()), float(np.percentile(found, 95)), float(found.max())


def switch_ms(scene: bpy.types.Scene, lights: Sequence[str], rounds: int) -> float:
    """Median milliseconds of a change of light, all lights in turn."""
    layer, taken = scene.view_layers[0], []
    for number in range(rounds + 1):
        for light in lights:
            started = time.perf_counter()
            ways.light(scene, light, 2)
            layer.update()
            if number:  # not the first time: lights are loaded and the dependency graph is made
                taken.append(1e3 * (time.perf_counter() - started))
    return statistics.median(taken)


def sample_seconds(scene: bpy.types.Scene, samples: int) -> tuple[float, float]:
    """Elapsed and processor time of one sample of a render, without what starting costs."""
    taken = []
    for count in (1, 1 + samples):
        scene.eevee.taa_render_samples = count
        started = time.perf_counter(), time.process_time()
        bpy.ops.render.render(scene=scene.name)
        taken.append((time.perf_counter() - started[0], time.process_time() - started[1]))
    return (taken[1][0] - taken[0][0]) / samples, (taken[1][1] - taken[0][1]) / samples


def frame_ratios(scenes: Mapping[str, bpy.types.Scene], samples: int, rounds: int) -> dict[str, Ratio]:
    """Frame time of each scene against that of the one called "plain", which takes turns with the others."""
    for scene in scenes.values():  # shaders are compiled, textures are read
        scene.eevee.taa_render_samples = 1
        bpy.ops.render.render(scene=scene.name)
    taken: dict[str, list[tuple[float, float]]] = {name: [] for name in scenes}
    for number in range(rounds):
        names = list(scenes)
        for name in names[number % len(names) :] + names[: number % len(names)]:
            taken[name].append(sample_seconds(scenes[name], samples))
    plain = np.array(taken["plain"])
    found = {}
    for name, seconds in taken.items():
        ratios = np.array(seconds) / plain
        elapsed, processor = ((float(np.median(each)), float(each.min()), float(each.max())) for each in ratios.T)
        found[name] = Ratio(elapsed, processor, *(float(each) for each in np.median(seconds, axis=0)))
    return found


def table(
    source: str, lights: Sequence[str], size: tuple[int, int], ks: Sequence[int]
) -> tuple[list[Row], dict[str, bpy.types.Scene]]:
    """All ways to show one texture, and scenes whose frames are worth timing."""
    description = sun_scene("relighting", source, lights, size)
    surface = scene_surfaces(description)["picture"]
    assert surface.texture is not None
    known = [Light.load(name) for name in lights]
    exact = np.stack([surface.XYZ(light).reshape(-1, 3) for light in known], axis=1)
    whites = np.stack([light.XYZ() for light in known])
    pixels = len(exact)
    scenes = {"plain": plain_scene(description, "plain")}
    rows = []
    for level in (0, 1):
        shown = plain_XYZ(surface, known, level)
        rows.append(
            Row(f"8-bit RGB, level {level}", *dE00_of(shown, exact, whites), pixels * 4 / MB, pixels * 4 / MB,
                packed_MB(scenes["plain"]), None, None, "plain")
        )  # fmt: skip
    scenes["baked"] = built(description, "baked")
    size_MB = pixels * 16 / MB
    rows.append(
        Row("baked, single", *dE00_of(baked_XYZ(exact, known), exact, whites), size_MB, size_MB * len(known),
            packed_MB(scenes["baked"]), None, switch_ms(scenes["baked"], lights, 1), "baked")
    )  # fmt: skip
    started = time.perf_counter()
    samples = surface_samples([surface], known)
    sampling = time.perf_counter() - started
    for K in ks:
        started = time.perf_counter()
        basis = fit_basis(samples, known, K)
        fitting = time.perf_counter() - started + sampling
        for half in (True, False):
            name = f"K = {K}, {'half' if half else 'single'}"
            started = time.perf_counter()
            packed = encode_texture(surface.texture, basis, half)
            seconds = fitting + time.perf_counter() - started
            shown = basis.XYZ(packed.coefficients().reshape(-1, K))
            scene = basis_scene(description, name, basis, {"picture": packed}, half)
            card = len(packed.images) * pixels * 4 * (2 if half else 4) / MB
            timed = f"{len(packed.images)} {'half' if half else 'single'}"
            rows.append(
                Row(name, *dE00_of(shown, exact, whites), card, card, packed_MB(scene), seconds,
                    switch_ms(scene, lights, 5), timed)
            )  # fmt: skip
            print(rows[-1], file=sys.stderr, flush=True)
            if K in TIMED:
                scenes[timed] = scene
    return rows, scenes


def plain_XYZ(surface: Surface, lights: Sequence[Light], level: int) -> np.ndarray:
    """What an RGB texture shows (n, L, 3): its RGB times that of the lamps."""
    rgb = surface.reference_rgb(Light.load("D65")).reshape(-1, 3)
    return np.stack([rgb * make_lighting(light, level, 1.0).lamp_rgb for light in lights], axis=1) @ _TO_XYZ.T


def baked_XYZ(exact: np.ndarray, lights: Sequence[Light]) -> np.ndarray:
    """What baked colours show (n, L, 3): relative to the lamps', in single floats."""
    found = []
    for index, light in enumerate(lights):
        lamp = make_lighting(light, 2, 1.0).lamp_rgb
        stored = (srgb().to_linear(exact[:, index]) / lamp).astype(np.float32)
        found.append(stored * lamp)
    return np.stack(found, axis=1) @ _TO_XYZ.T


def booth_scenes() -> dict[str, bpy.types.Scene]:
    """The booth with plain textures, and with K = 12 in three images, of half and of single floats."""
    description = load_scene(bundled_scene("booth"))
    known = [Light.load(name) for name in description.lights]
    surfaces = scene_surfaces(description)
    basis = fit_basis(surface_samples(surfaces.values(), known), known, COEFFICIENTS[-1])
    scenes = {"plain": plain_scene(description, "booth plain")}
    for name in ("half", "single"):
        textures = {
            each.name: encode_texture(each.texture, basis, name == "half")
            for each in surfaces.values()
            if each.texture is not None
        }
        scenes[f"3 {name}"] = basis_scene(description, f"booth {name}", basis, textures, name == "half")
    return scenes


def print_table(rows: Sequence[Row], frames: Mapping[str, Ratio]) -> None:
    print(
        f"{'':<22} {'dE00':>7} {'':>7} {'':>7} {'MB card':>9} {'':>7} {'MB':>6} {'fit and':>8} {'switch':>8} frame time"
    )
    print(
        f"{'':<22} {'mean':>7} {'p95':>7} {'max':>7} {'one light':>9} {'all':>7} {'file':>6} {'encode s':>8} {'ms':>8} "
        "elapsed processor"
    )
    for row in rows:
        seconds = "" if row.seconds is None else f"{row.seconds:.1f}"
        switch = "" if row.switch_ms is None else f"{row.switch_ms:.2f}"
        frame = frames.get(row.timed)
        ratios = "" if frame is None else f"{frame.elapsed[0]:7.2f} {frame.processor[0]:9.2f}"
        print(
            f"{row.name:<22} {row.mean:7.3f} {row.p95:7.3f} {row.max:7.3f} {row.card_MB:9.2f} {row.card_all_MB:7.2f} "
            f"{row.file_MB:6.2f} {seconds:>8} {switch:>8} {ratios}"
        )


def print_frames(found: Mapping[str, Mapping[str, Ratio]]) -> None:
    print("\nframe time against the plain texture: median of rounds, least and most")
    print(f"{'':<26} {'elapsed':>8} {'':>6} {'':>6} {'processor':>10} {'':>6} {'':>6}   K = 12 at most")
    for kind, ratios in found.items():
        print(f"{kind}: {ratios['plain'].seconds:.3f} s elapsed, {ratios['plain'].processor_seconds:.3f} s processor")
        for name, ratio in ratios.items():
            numbers = "".join(f"{each:{9 if not index % 3 else 7}.3f}" for index, each in enumerate(ratio.all))
            bound = f"{BOUNDS[kind]:7.1f}" if name.startswith("3 ") else ""
            print(f"  {name:<24}{numbers} {bound}")


def renderer() -> str:
    """What renders, which Blender knows in the background only once it has rendered."""
    try:
        return str(gpu.platform.renderer_get())
    except SystemError:
        return "nothing rendered"


def source_of(texture: str) -> str:
    """The texture as a scene names it."""
    if texture in PIGMENT_TEXTURES:
        return f'pigments = "{texture}"'
    return f"texture = {json.dumps(str(Path(texture).resolve()))}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--texture", default="tomato", help=f"a file, or one of {', '.join(PIGMENT_TEXTURES)}")
    parser.add_argument("--scene", type=Path, default=bundled_scene("colorchecker"), help="whose lights are taken")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--size", default="1280x720", help="of the frame that the texture fills")
    parser.add_argument("--K", type=int, nargs="+", default=list(COEFFICIENTS), help="4, 8 and 12 are timed")
    parser.add_argument("--frames", nargs="*", choices=tuple(BOUNDS), default=list(BOUNDS), help="which are timed")
    parser.add_argument("--samples", type=int, help="a frame, of those timed: thousands on a graphics card")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    arguments = parser.parse_args()
    size = tuple(int(each) for each in arguments.size.split("x"))
    lights = load_scene(arguments.scene).lights
    blender_addon.register()
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    load = os.getloadavg()[0]
    rows, scenes = table(source_of(arguments.texture), lights, size, arguments.K)
    found = {}
    if "sun" in arguments.frames:
        found["sun"] = frame_ratios(scenes, arguments.samples or SAMPLES["sun"], arguments.rounds)
    if "booth" in arguments.frames:
        found["booth"] = frame_ratios(booth_scenes(), arguments.samples or SAMPLES["booth"], arguments.rounds)
    about = {"blender": bpy.app.version_string, "renderer": renderer(), "texture": arguments.texture,
             "lights": list(lights), "size": arguments.size, "rounds": arguments.rounds,
             "load": [load, os.getloadavg()[0]], "processors": os.cpu_count()}  # fmt: skip
    if arguments.json:
        ratios = {kind: {name: asdict(each) for name, each in ratio.items()} for kind, ratio in found.items()}
        print(json.dumps({**about, "table": [asdict(row) for row in rows], "frames": ratios}))
        return
    print(
        f"Blender {about['blender']}, {about['renderer']}, {about['processors']} processors, load {load:.1f} before "
        f"and {about['load'][1]:.1f} after"
    )
    print(f"{arguments.texture}, frame {arguments.size}, {arguments.rounds} rounds, lights {', '.join(lights)}\n")
    print_table(rows, found.get("sun", {}))
    print_frames(found)


if __name__ == "__main__":
    main()
