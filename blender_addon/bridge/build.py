"""A scene description becomes a Blender scene."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Vector

from spectral_core.scene import Camera, Lamp, RenderSettings, SceneDescription, SceneObject
from spectral_core.shapes import Mesh, build_mesh
from spectral_core.surfaces import scene_surfaces

from . import lighting, state, ways
from .materials import make_material


@dataclass(frozen=True)
class Built:
    """What a build made."""

    objects: int
    materials: int
    lights: int


def new_scene(description: SceneDescription, calibrate: bool = True) -> bpy.types.Scene:
    """Build a description as a new scene of the open file, and calibrate its white.

    Whatever goes wrong, the file is then as it was.
    """
    with _all_or_nothing():
        scene = bpy.data.scenes.new(description.name)
        build_scene(scene, description)
        if calibrate:
            lighting.calibrate_white(scene)
        return scene


def build_scene(scene: bpy.types.Scene, description: SceneDescription) -> Built:
    """Fill an empty scene from a description and light it as the description says."""
    surfaces = scene_surfaces(description)
    state.remember(scene, description)
    used = {each.surface for each in description.objects}
    materials = {
        name: make_material(surface, description.render.forward) for name, surface in surfaces.items() if name in used
    }
    for each in description.objects:
        _add_object(scene, each, materials[each.surface])
    for lamp in description.lamps:
        _add_lamp(scene, lamp)
    scene.camera = _add_camera(scene, description.camera)
    set_black_world(scene)
    _set_render(scene, description.render)
    ways.rebuild(scene)
    return Built(len(description.objects), len(materials), len(description.lamps))


@contextmanager
def _all_or_nothing() -> Iterator[None]:
    """Remove what was made in the block if it does not end well."""
    kinds = (
        bpy.data.scenes,
        bpy.data.objects,
        bpy.data.meshes,
        bpy.data.lights,
        bpy.data.cameras,
        bpy.data.materials,
        bpy.data.images,
        bpy.data.worlds,
        bpy.data.texts,
    )
    before = [{each.name for each in kind} for kind in kinds]
    try:
        yield
    except BaseException:
        bpy.data.batch_remove(
            [each for kind, names in zip(kinds, before, strict=True) for each in kind if each.name not in names]
        )
        raise


def eevee_engine(scene: bpy.types.Scene) -> str:
    """Eevee's engine id in this Blender."""
    known = scene.render.bl_rna.properties["engine"].enum_items.keys()
    return next((each for each in ("BLENDER_EEVEE_NEXT", "BLENDER_EEVEE") if each in known), "BLENDER_EEVEE")


def _add_object(scene: bpy.types.Scene, item: SceneObject, material: bpy.types.Material) -> None:
    data = mesh_data(item.name, build_mesh(item.shape, item.size))
    data.materials.append(material)
    made = bpy.data.objects.new(item.name, data)
    made.location = item.location
    made.rotation_euler = [math.radians(angle) for angle in item.rotation_deg]
    made[state.OBJECT_KEY] = item.name
    made[state.SURFACE_KEY] = item.surface
    scene.collection.objects.link(made)


def mesh_data(name: str, mesh: Mesh) -> bpy.types.Mesh:
    """A shape as a mesh of this file."""
    data = bpy.data.meshes.new(name)
    data.from_pydata(mesh.vertices.tolist(), [], [list(face) for face in mesh.faces])
    data.polygons.foreach_set("use_smooth", np.full(len(mesh.faces), mesh.smooth))
    layer = data.uv_layers.new(name="UVMap")
    layer.data.foreach_set("uv", mesh.uvs.astype(np.float32).ravel())
    data.update()
    return data


def _add_lamp(scene: bpy.types.Scene, lamp: Lamp) -> None:
    data = bpy.data.lights.new(lamp.name, "SUN" if lamp.type == "sun" else "SPOT")
    if lamp.type == "sun":
        data.angle = 0.0
    else:
        data.spot_size = math.radians(lamp.cone_deg)
        data.spot_blend = lamp.edge
        data.shadow_soft_size = lamp.radius_m
    data.energy = state.unit_energy(data) * lamp.power
    made = bpy.data.objects.new(lamp.name, data)
    made.location = lamp.location
    made.rotation_euler = _aim(lamp.location, lamp.target)
    made[state.LAMP_KEY] = lamp.power
    if lamp.light:
        made[state.LAMP_LIGHT_KEY] = lamp.light
    scene.collection.objects.link(made)


def _add_camera(scene: bpy.types.Scene, camera: Camera) -> bpy.types.Object:
    data = bpy.data.cameras.new("Camera")
    data.clip_start = 0.01
    if camera.orthographic:
        data.type = "ORTHO"
        data.ortho_scale = camera.width_m
    else:
        data.lens = camera.focal_length_mm
    made = bpy.data.objects.new("Camera", data)
    made.location = camera.location
    made.rotation_euler = _aim(camera.location, camera.target)
    scene.collection.objects.link(made)
    return made


def _aim(location: tuple[float, float, float], target: tuple[float, float, float]) -> tuple[float, float, float]:
    """Euler angles that turn -z to the target and keep y as far up as possible."""
    direction = Vector(target) - Vector(location)
    euler = direction.to_track_quat("-Z", "Y").to_euler()
    return (euler.x, euler.y, euler.z)


def set_black_world(scene: bpy.types.Scene) -> None:
    """Black: a new world is 5 % grey, which would light every surface."""
    world = bpy.data.worlds.new(f"{scene.name} (black)")
    if bpy.app.version < (5, 0, 0):
        world.use_nodes = True
    world.node_tree.nodes.clear()
    background = world.node_tree.nodes.new("ShaderNodeBackground")
    background.inputs["Color"].default_value = (0.0, 0.0, 0.0, 1.0)
    output = world.node_tree.nodes.new("ShaderNodeOutputWorld")
    world.node_tree.links.new(background.outputs[0], output.inputs["Surface"])
    scene.world = world


def _set_render(scene: bpy.types.Scene, settings: RenderSettings) -> None:
    scene.render.engine = eevee_engine(scene)
    scene.render.resolution_x, scene.render.resolution_y = settings.width, settings.height
    scene.render.resolution_percentage = 100
    scene.render.dither_intensity = 0.0
    scene.eevee.taa_render_samples = settings.samples
    scene.eevee.use_raytracing = False
    scene.eevee.light_threshold = 1e-6  # the default drops lamps that still add a part in a hundred
    scene.view_settings.view_transform = "Standard"
    scene.view_settings.look = "None"
    scene.view_settings.exposure = 0.0
    scene.view_settings.gamma = 1.0
