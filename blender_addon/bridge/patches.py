"""The stage of the patch player: a scene of its own, so that the user's stays as it is.

Codes are shown by emission, without light. Blender's headset path ignores colour management and the
runtime encodes scene-linear to sRGB; the stage's view transform does the same in windows. So the
emission is the sRGB decode of the code in both.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import bpy
from mathutils import Matrix, Quaternion, Vector

from spectral_core.arrays import Float64Array
from spectral_core.display.models import srgb_decode
from spectral_core.errors import BlenderError
from spectral_core.shapes import build_mesh

from . import state
from .build import eevee_engine, mesh_data, set_black_world

NAME = "Patches"
# Marks all that belongs to the stage; it is found again by this, never by kept pointers.
KEY = "spectral_booth_patches"
# Where the capsule stands in a scene that has neither booth nor camera: at arm's length.
_VIEWER, _CENTRE = Vector((0.0, -0.7, 0.0)), Vector((0.0, 0.0, 0.0))
_ASPECT = 1.5
_WORKING_SPACE = "Linear Rec.709"
# The stage's camera sees this many capsules side by side.
_VIEW = 2.0
_WIDEST_VIEW_DEG = 120.0

_SHADING = {
    "type": "RENDERED",
    "use_scene_lights_render": True,
    "use_scene_world_render": True,
    "use_compositor": "DISABLED",
    "render_pass": "COMBINED",
}
_VIEW_3D = {
    "show_gizmo": False,
    "show_region_toolbar": False,
    "show_region_hud": False,
    "use_local_camera": False,
    "show_object_viewport_mesh": True,
    "overlay.show_overlays": False,
    "region_3d.view_perspective": "CAMERA",
    **{f"shading.{name}": value for name, value in _SHADING.items()},
}
_HEADSET = {
    "show_floor": False,
    "show_annotation": False,
    "show_selection": False,
    "show_controllers": False,
    "show_custom_overlays": True,  # the frames are counted as one
    "show_object_extras": False,
    "viewfinder_enabled": False,
    "show_object_viewport_mesh": True,
    **{f"shading.{name}": value for name, value in _SHADING.items()},
}


@contextmanager
def staged(user: bpy.types.Scene, width_deg: float, surround: bool) -> Iterator[bpy.types.Scene]:
    """A scene with the capsule before a camera; removed when the block ends.

    In a booth the capsule stands at its centre and is seen from the booth's camera. With `surround`
    the user's objects stay round it, otherwise all else is black.

    Raises
    ------
    BlenderError
        If this file or this Blender cannot show device codes.
    """
    _check_working_space()
    scene = user.copy() if surround else bpy.data.scenes.new(NAME)
    scene[KEY] = True
    scene.name = NAME
    try:
        _set_display(scene)
        if not surround:
            set_black_world(scene)
            scene.world[KEY] = True
        viewer, centre = _viewpoint(user)
        distance = (centre - viewer).length
        rotation = (centre - viewer).to_track_quat("-Z", "Y")
        _add(scene, _capsule(width_deg, distance), distance)
        scene.camera = _add(scene, _camera(width_deg), 0.0)
        place(scene, viewer, rotation)
        yield scene
    finally:
        _remove()


def show(scene: bpy.types.Scene, codes: Float64Array) -> None:
    """Device codes (3,), 0..1, on the stage's capsule."""
    material = _part(scene, "MESH").active_material
    material.node_tree.nodes["Emission"].inputs["Color"].default_value = (*srgb_decode(codes).tolist(), 1.0)


def place(scene: bpy.types.Scene, viewer: Vector, rotation: Quaternion) -> None:
    """The camera where the viewer is, who looks along -z with y up, and the capsule in the middle of
    what both see; its distance stays.
    """
    scene.camera.matrix_world = Matrix.LocRotScale(viewer, rotation, None)
    capsule = _part(scene, "MESH")
    middle = viewer + rotation @ Vector((0.0, 0.0, -capsule[KEY]))
    upright = Quaternion((1.0, 0.0, 0.0), -math.pi / 2)  # the capsule's axis is z, the viewer's y
    capsule.matrix_world = Matrix.LocRotScale(middle, rotation @ upright, None)


@contextmanager
def shown_in(window: bpy.types.Window, area: bpy.types.Area, scene: bpy.types.Scene) -> Iterator[None]:
    """The stage in a window's 3D view, as it shall be measured; restored when the block ends."""
    space = area.spaces.active
    if space.local_view is not None:
        raise BlenderError("the 3D view is in local view", remedy="leave it (View > Local View), then play")
    user, layer = window.scene, window.view_layer.name
    window.scene = scene
    try:
        with _settings(space, _VIEW_3D, _place(window, area)):
            yield
    finally:
        window.scene = user
        window.view_layer = user.view_layers[layer]


@contextmanager
def in_headset(window: bpy.types.Window, area: bpy.types.Area, start: bool) -> Iterator[None]:
    """The stage without guides in a headset, whose session is started if asked for and stopped again."""
    settings = getattr(window.id_data, "xr_session_settings", None)
    if settings is None:
        if start:
            raise BlenderError("this Blender knows no headsets", remedy="use one that is built with OpenXR")
        yield
        return
    started = start and not headset_runs()
    if started:
        _toggle_headset(window, area)
    try:
        with _settings(settings, _HEADSET, _place(window, area)):
            yield
    finally:
        if started and window.id_data.xr_session_state is not None:
            _toggle_headset(window, area)


@contextmanager
def counting_frames(scene: bpy.types.Scene) -> Iterator[FrameCounts]:
    """Count how often the stage was drawn in 3D views and in the headset while the block runs."""
    counts, name, space = FrameCounts(), scene.name, bpy.types.SpaceView3D

    def drawn(region: str) -> None:
        ours = bpy.context.scene is None or bpy.context.scene.name == name
        if ours and not bpy.app.is_job_running("SHADER_COMPILATION"):  # nothing is seen until it is over
            setattr(counts, region, getattr(counts, region) + 1)

    handles = [(space.draw_handler_add(drawn, ("window",), "WINDOW", "POST_PIXEL"), "WINDOW")]
    if hasattr(bpy.types, "XrSessionState"):
        handles.append((space.draw_handler_add(drawn, ("headset",), "XR", "POST_VIEW"), "XR"))
    try:
        yield counts
    finally:
        for handle, region in handles:
            space.draw_handler_remove(handle, region)


@dataclass
class FrameCounts:
    """Drawings since the last reset; the headset draws twice a frame, once an eye."""

    window: int = 0
    headset: int = 0

    def reset(self) -> None:
        """Another patch: count anew."""
        self.window = self.headset = 0

    def enough(self) -> bool:
        """Whether what is measured was drawn twice: after the second the first is certainly shown."""
        return self.headset >= 4 if headset_runs() else self.window >= 2


def headset_runs() -> bool:
    """Whether a headset shows the scene now."""
    return bool(
        hasattr(bpy.types, "XrSessionState")
        and bpy.context.window_manager.xr_session_state is not None
        and bpy.types.XrSessionState.is_running(bpy.context)
    )


def follow_headset(scene: bpy.types.Scene) -> None:
    """Keep the capsule in the middle of the headset's view, wherever it lies."""
    if headset_runs():
        pose = bpy.context.window_manager.xr_session_state
        place(scene, Vector(pose.viewer_pose_location), Quaternion(pose.viewer_pose_rotation))


def _toggle_headset(window: bpy.types.Window, area: bpy.types.Area) -> None:
    try:
        with bpy.context.temp_override(**_place(window, area)):
            bpy.ops.wm.xr_session_toggle()
    except RuntimeError as error:
        raise BlenderError(
            f"the headset does not start ({' '.join(str(error).split())})", remedy="is its OpenXR runtime active?"
        ) from None


def _check_working_space() -> None:
    spaces = getattr(bpy.data, "colorspace", None)  # from 5.0
    if spaces is not None and spaces.working_space != _WORKING_SPACE:
        raise BlenderError(
            f"this file works in {spaces.working_space}: codes would change on their way to the display",
            remedy=f"play from a file that works in {_WORKING_SPACE}",
        )


def _set_display(scene: bpy.types.Scene) -> None:
    """What a device code takes through a window: only the sRGB encoding."""
    scene.render.engine = eevee_engine(scene)
    scene.render.dither_intensity = 0.0
    scene.render.film_transparent = False
    scene.render.resolution_x = scene.render.resolution_y = 1000
    scene.eevee.taa_samples = scene.eevee.taa_render_samples = 1  # nothing here becomes better by waiting
    view = scene.view_settings
    try:
        scene.display_settings.display_device = "sRGB"
        view.view_transform = "Standard"
        view.look = "None"
    except TypeError:
        raise BlenderError(
            "Blender's colour configuration has no view 'Standard' on a display 'sRGB'",
            remedy="start Blender without OCIO in its environment",
        ) from None
    view.exposure, view.gamma = 0.0, 1.0
    view.use_curve_mapping = view.use_white_balance = False


def _viewpoint(user: bpy.types.Scene) -> tuple[Vector, Vector]:
    """Where the viewer is and where the capsule's middle."""
    if state.is_managed(user):
        camera = state.description(user).camera
        return Vector(camera.location), Vector(camera.target)
    if user.camera is None:
        return _VIEWER, _CENTRE
    location, rotation, _ = user.camera.matrix_world.decompose()
    return location, location + rotation @ Vector((0.0, 0.0, -(_CENTRE - _VIEWER).length))


def _capsule(width_deg: float, distance: float) -> bpy.types.Object:
    width = 2 * distance * math.tan(math.radians(width_deg) / 2)
    data = mesh_data(NAME, build_mesh("capsule", (width, width, width * _ASPECT)))
    data.transform(Matrix.Translation((0.0, 0.0, -width * _ASPECT / 2)))
    data.materials.append(_emitter())
    return bpy.data.objects.new(NAME, data)


def _emitter() -> bpy.types.Material:
    material = bpy.data.materials.new(NAME)
    material[KEY] = True
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    nodes = material.node_tree.nodes
    nodes.clear()
    emission, output = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeOutputMaterial")
    emission.name = "Emission"  # Blender may translate the names it gives
    material.node_tree.links.new(emission.outputs[0], output.inputs["Surface"])
    return material


def _camera(width_deg: float) -> bpy.types.Object:
    data = bpy.data.cameras.new(NAME)
    data.clip_start = 0.01
    data.show_passepartout = False  # it would darken the patch beyond the frame
    data.angle = math.radians(min(_VIEW * width_deg, _WIDEST_VIEW_DEG))
    return bpy.data.objects.new(NAME, data)


def _add(scene: bpy.types.Scene, item: bpy.types.Object, distance: float) -> bpy.types.Object:
    """With its distance from the viewer, which `place` keeps."""
    item[KEY] = item.data[KEY] = distance
    scene.collection.objects.link(item)
    return item


def _part(scene: bpy.types.Scene, kind: str) -> bpy.types.Object:
    return next(each for each in scene.collection.objects if each.type == kind and KEY in each)


def _remove() -> None:
    data = bpy.data
    kinds = (data.scenes, data.objects, data.meshes, data.cameras, data.materials, data.worlds)
    data.batch_remove([each for kind in kinds for each in kind if KEY in each])


def _place(window: bpy.types.Window, area: bpy.types.Area) -> dict[str, object]:
    """The context of a 3D view."""
    return {"window": window, "area": area, "region": next(each for each in area.regions if each.type == "WINDOW")}


@contextmanager
def _settings(owner: object, values: dict[str, Any], place: dict[str, object]) -> Iterator[None]:
    """Attributes (``part.name``) set for the block; those that this Blender lacks are left out.

    Both happen in the context of their 3D view: Blender crashes if a region is hidden or shown
    while the context has no area, as in a timer.
    """
    kept = []
    try:
        with bpy.context.temp_override(**place):
            for path, value in values.items():
                *parts, name = path.split(".")
                part = owner
                for each in parts:
                    part = getattr(part, each)
                if hasattr(part, name):
                    kept.append((part, name, getattr(part, name)))
                    setattr(part, name, value)
        yield
    finally:
        with bpy.context.temp_override(**place):
            for part, name, value in reversed(kept):
                setattr(part, name, value)
