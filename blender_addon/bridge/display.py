"""Render a managed scene through a display of Blender's colour management, and read its codes."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from spectral_core.arrays import Float32Array
from spectral_core.display.export import XYZ_VIEW
from spectral_core.display.judging.shown import ShownLight, ShownPatch, compare_shown
from spectral_core.display.profile import DisplayProfile
from spectral_core.errors import BlenderError
from spectral_core.scene import resolve_light
from spectral_core.standards import srgb_to_XYZ_matrix

from . import state, verify, ways
from .render import render_linear, save_shown

Progress = Callable[[float, str], None]


@dataclass(frozen=True)
class Display:
    """A display of the OpenColorIO config that Blender was started with, and its views of linear Rec.709 and of XYZ."""

    name: str
    view: str
    xyz_view: str = XYZ_VIEW


def config_path() -> Path:
    """Blender's own OpenColorIO config, whatever the variable OCIO says."""
    folder = bpy.utils.system_resource("DATAFILES", path="colormanagement")
    return Path(folder) / "config.ocio"


@contextmanager
def shown_on(scene: bpy.types.Scene, display: Display, in_XYZ: bool = False) -> Iterator[None]:
    """The scene through a display and nothing else: no look, exposure, curves or dither; restored afterwards.

    Its pixels are linear Rec.709 unless they are `in_XYZ`.

    Raises
    ------
    BlenderError
        If Blender's colour management has no such display or view.
    """
    device, view, render = scene.display_settings, scene.view_settings, scene.render
    kept = (device.display_device, view.view_transform, view.look, view.exposure, view.gamma, view.use_curve_mapping)
    dither = render.dither_intensity
    chosen = display.xyz_view if in_XYZ else display.view
    try:
        try:
            device.display_device, view.view_transform = display.name, chosen
        except TypeError:
            raise BlenderError(
                f"Blender's colour management has no display '{display.name}' with a view '{chosen}'",
                remedy="export the profile with --ocio and start Blender with the variable OCIO set to its config",
            ) from None
        view.look, view.exposure, view.gamma, view.use_curve_mapping = "None", 0.0, 1.0, False
        render.dither_intensity = 0.0
        yield
    finally:
        device.display_device, view.view_transform, view.look = kept[:3]
        view.exposure, view.gamma, view.use_curve_mapping = kept[3:]
        render.dither_intensity = dither


def verify_display(
    scene: bpy.types.Scene,
    lights: Sequence[str],
    profile: DisplayProfile,
    display: Display,
    progress: Progress,
) -> list[ShownLight]:
    """Codes of the scene's patches through `display`, against the profile's own, per light at level 2.

    With coded lamps surfaces emit XYZ, whatever the scene's target, and the display's view of XYZ is used.
    """
    description, in_XYZ = state.description(scene), scene.spectral_booth.way == "CODED"
    to_pixels = srgb_to_XYZ_matrix() if in_XYZ else np.eye(3)
    for light in lights:
        resolve_light(light, description.folder)  # refuse a wrong name before the first render
    ways.learn(scene, lights)
    progress(0.0, "what the camera sees")
    results = []
    with verify.as_found(scene), shown_on(scene, display, in_XYZ):
        view = verify.survey(scene)
        for index, light in enumerate(lights):
            progress((index + 0.5) / (len(lights) + 0.5), f"{light} through {display.name}")
            applied = ways.light(scene, light, 2, only=True)
            rendered = render_linear(scene).pixels
            readings = verify.read_patches(scene, applied, rendered, view)
            codes = _codes(scene)
            patches = []
            for reading in readings:
                mask = view.identity.masks[reading.name]
                pixels = rendered[mask].astype(np.float64), codes[mask].astype(np.float64)
                exact = to_pixels @ reading.exact * reading.irradiance
                patches.append(ShownPatch(reading.name, *pixels, exact))
            results.append(compare_shown(light, patches, profile, in_XYZ))
    return results


def _codes(scene: bpy.types.Scene) -> Float32Array:
    """The last render through the scene's display, in the 16 bits of a PNG."""
    with tempfile.TemporaryDirectory() as folder:
        return save_shown(scene, Path(folder) / "shown.png")
