"""How a scene is shown: coloured or coded lamps, baked colours or a spectral basis, in a window or a headset.

All of it is state of the scene, and `rebuild` makes materials and shared node groups from that state alone. So
any of it can be changed at any time and back, and the same state always gives the same nodes.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace

import bpy
import numpy as np

from spectral_core.display.export import XYZ_VIEW
from spectral_core.errors import BlenderError, SpectralBoothError
from spectral_core.scene import light_parts
from spectral_core.standards import srgb_to_XYZ_matrix
from spectral_core.steps import finished
from spectral_core.surfaces import Surface

from ..eyes import EYE_PROPERTY
from . import colour_nodes, encoded, headset, lighting, live, materials, shading, state
from .images import empty_image
from .node_builder import Builder, new_group

# Set on node groups that all materials of a scene share.
SHARED_KEY = "spectral_booth_shared"
_CYCLES = "CYCLES"
# What of a scene's state decides how its materials are made, and tells of that.
_CHOICES = (
    "way", "target", "display_left", "display_right", "display_notes",
    "basis_tolerance", "basis_half", "basis_error", "basis_notes", "texture_notes",
)  # fmt: skip

Images = Mapping[str, Sequence[bpy.types.Image]]


def set_way(scene: bpy.types.Scene, way: str, target: str | None = None) -> list[str]:
    """Light a managed scene by coloured or coded lamps; returns what a user should know.

    Raises
    ------
    BlenderError, LightError
        If the scene does not fit that way; it is then as it was.
    """
    kept = scene.spectral_booth
    target = target or ("WINDOW" if way == "COLOURED" and kept.target == "WIDE" else kept.target)
    if (way, target) == ("COLOURED", "WIDE"):
        raise BlenderError(
            "coloured lamps hold no colours outside Rec.709", remedy="choose coded lamps, or the target Window"
        )
    if target == "HEADSET" and not kept.display_left:
        raise BlenderError("no headset's profile was chosen", remedy="use Show in Headset and name one")
    if way == "CODED":
        if scene.render.engine == _CYCLES:
            raise BlenderError("Cycles cannot show coded lamps", remedy="render with Eevee, or use coloured lamps")
        lighting.channels(scene)  # more than three spectra are refused before anything changes
    with _as_before_on_failure(scene):
        kept.way, kept.target = way, target
        rebuild(scene)
    return notes(scene)


def show_in_headset(scene: bpy.types.Scene, left: str, right: str = "") -> headset.Shown:
    """Show a managed scene through a profile (built-in name or file), or through one per eye.

    Raises
    ------
    DisplayError
        If a profile cannot be read, or its display cannot show the scene's white; the scene is then as it was.
    """
    shown = headset.load(left, right)
    if not state.all_managed_materials(scene):
        raise BlenderError(f"'{scene.name}' has no spectral materials", remedy="build a scene first")
    kept = scene.spectral_booth
    with _as_before_on_failure(scene):
        kept.display_left, kept.display_right, kept.target = left, right, "HEADSET"
        scene[EYE_PROPERTY] = 0.0
        rebuild(scene)
    kept.display_notes = "; ".join(shown.notes)
    return shown


def show_in_window(scene: bpy.types.Scene, wide: bool = False) -> None:
    """Show the scene's own colours: for Blender's views, or `wide` as XYZ for a view of an exported config."""
    kept = scene.spectral_booth
    if wide and kept.way == "COLOURED":
        raise BlenderError("coloured lamps hold no colours outside Rec.709", remedy="choose coded lamps first")
    with _as_before_on_failure(scene):
        kept.target = "WIDE" if wide else "WINDOW"
        kept.display_left = kept.display_right = kept.display_notes = ""
        rebuild(scene)


def light(scene: bpy.types.Scene, light_name: str, level: int, only: bool = False) -> lighting.Applied:
    """Set a managed scene to a light at a level, see `lighting.apply`; its basis learns what it does not know."""
    notes = learn(scene, [light_name])
    return _with_notes(scene, lighting.apply(scene, light_name, level, only), notes)


def _with_notes(scene: bpy.types.Scene, applied: lighting.Applied, notes: Sequence[str]) -> lighting.Applied:
    """A lighting that also tells of what had to be done before."""
    told = (*notes, *applied.lighting.notes)
    scene.spectral_booth.notes = "; ".join(told)
    return replace(applied, lighting=replace(applied.lighting, notes=told))


def learn(scene: bpy.types.Scene, names: Sequence[str]) -> list[str]:
    """Let a scene's basis learn lights that it does not know; returns what a user should know.

    Where it cannot show one within its tolerance, all surfaces are encoded again.
    """
    folder, kept, notes = state.description(scene).folder, scene.spectral_booth, []
    parts = [part for name in names for part, _ in light_parts(name, folder)]
    for each in encoded.unknown(scene, parts):
        error = encoded.learn(scene, each)
        basis = encoded.basis_of(scene)
        if basis is not None and encoded.unknown(scene, [each]):
            lights = [*(old for old in basis.lights if old.name != each.name), each]
            show_encoded(scene, finished(encoded.encoding_steps(scene, lights, kept.basis_tolerance, kept.basis_half)))
            notes.append(f"{each.name} was new to the basis (dE00 up to {error:.2g}): all surfaces were encoded again")
        else:
            notes.append(f"{each.name} was new to the basis, which shows it with dE00 up to {error:.2g}")
    return notes


def set_lamp_light(scene: bpy.types.Scene, lamps: Sequence[str], light_name: str) -> lighting.Applied:
    """Give lamps a light of their own, or, without a name, the scene's again.

    Raises
    ------
    BlenderError
        If no managed lamp is among them, or one shares its data with a lamp that is not.
    LightError, SpectrumError
        If the light cannot be used, or coded lamps would need more than three; nothing is changed then.
    """
    chosen = [lamp for lamp in state.managed_lamps(scene) if lamp.name in lamps]
    if not chosen:
        raise BlenderError("no managed lamp is selected", remedy="select lamps of the scene, or name them")
    for other in state.managed_lamps(scene):
        if other not in chosen and other.data in [lamp.data for lamp in chosen]:
            raise BlenderError(
                f"'{other.name}' shares its data, and so its colour, with a chosen lamp",
                remedy="choose it too, or use Object > Relations > Make Single User > Object & Data",
            )
    before = {lamp.name: lamp.get(state.LAMP_LIGHT_KEY) for lamp in chosen}
    notes = learn(scene, [light_name]) if light_name else []
    for lamp in chosen:
        _set_own_light(lamp, light_name)
    kept = scene.spectral_booth
    try:
        return _with_notes(scene, light(scene, kept.light, int(kept.level)), notes)
    except SpectralBoothError:
        for lamp in chosen:
            _set_own_light(lamp, before[lamp.name] or "")
        raise


def _set_own_light(lamp: bpy.types.Object, name: str) -> None:
    if name:
        lamp[state.LAMP_LIGHT_KEY] = name
    elif state.LAMP_LIGHT_KEY in lamp:
        del lamp[state.LAMP_LIGHT_KEY]


def show_encoded(scene: bpy.types.Scene, encoding: encoded.Encoding) -> None:
    """Show a scene by its spectral basis: from now on a change of light touches no material."""
    try:
        with _as_before_on_failure(scene):
            encoded.keep(scene, encoding.basis, encoding.tolerance, encoding.half, encoding.largest_error)
            scene.spectral_booth.texture_notes = "; ".join(encoding.notes)
            rebuild(scene, encoding.images)
    except SpectralBoothError:
        _drop_unused(image for images in encoding.images.values() for image in images)
        raise


def show_baked(scene: bpy.types.Scene) -> None:
    """Show a scene by colours that are computed anew for each light.

    Raises
    ------
    SpectralBoothError
        If a texture cannot be read any more; the scene keeps its basis then.
    """
    with _as_before_on_failure(scene):
        encoded.forget(scene)
        rebuild(scene)


@contextmanager
def _as_before_on_failure(scene: bpy.types.Scene) -> Iterator[None]:
    """Put state and materials back if these cannot follow a change of it, which may need files that are gone."""
    kept = scene.spectral_booth
    basis = None if kept.basis is None else kept.basis.as_string()
    before = {name: getattr(kept, name) for name in _CHOICES}
    images = {state.surface_name(each): shading.images_of(each) for each in state.all_managed_materials(scene)}
    try:
        yield
    except SpectralBoothError:
        if basis is None:
            encoded.forget(scene)
        elif kept.basis is None or kept.basis.as_string() != basis:
            encoded.keep_text(scene, basis)
        for name, value in before.items():
            setattr(kept, name, value)
        with suppress(SpectralBoothError):  # where it was not whole before
            rebuild(scene, images)
        drop_unused_groups()
        raise


def rebuild(scene: bpy.types.Scene, images: Images | None = None) -> lighting.Applied:
    """Make all materials anew from the scene's state, and light them; `images` replace those of some surfaces."""
    description, basis = state.description(scene), encoded.basis_of(scene)
    surfaces, shown = state.shown_surfaces(scene), _shading(scene)
    before = [shading.images_of(material) for material, _ in surfaces]
    wanted = None if basis is None else encoded.quads(basis)
    after = [
        list((images or {}).get(surface.name, ())) or _images(kept, surface, shown, wanted)
        for (_, surface), kept in zip(surfaces, before, strict=True)
    ]
    for (material, surface), now in zip(surfaces, after, strict=True):
        shading.apply(material, shown, now)
        if basis is not None and surface.uniform:
            encoded.write_uniform(material, surface, basis, description)
    live.forget(scene)  # what only another way reads must not stay
    if scene.spectral_booth.target != "HEADSET" and EYE_PROPERTY in scene:
        del scene[EYE_PROPERTY]
    applied = lighting.apply(scene, scene.spectral_booth.light, int(scene.spectral_booth.level))
    _drop_unused(image for kept in before for image in kept)  # only now: what they hold may need files that are gone
    drop_unused_groups()
    choose_view(scene)
    for tree, part in zip((shown.basis, shown.coded, shown.display), ("Basis", "Coded", "Display"), strict=True):
        if tree is not None:
            tree.name = f"Spectral {part} {scene.name}"  # only now: it was the old one's
    scene.spectral_booth.way_notes = "; ".join(notes(scene))
    return applied


def _drop_unused(images: Iterable[bpy.types.Image]) -> None:
    for image in dict.fromkeys(images):
        if not image.users:
            bpy.data.images.remove(image)


def drop_unused_groups() -> None:
    """Remove the shared node groups that no material shows any more."""
    for tree in [each for each in bpy.data.node_groups if SHARED_KEY in each and not each.users]:
        headset.remove_group(tree)


def choose_view(scene: bpy.types.Scene) -> None:
    """The view that fits what surfaces emit, where Blender was started with a config that has it; and back."""
    kept, view = scene.spectral_booth, scene.view_settings
    if kept.target == "WIDE" and view.view_transform != XYZ_VIEW:
        before = view.view_transform
        with suppress(TypeError):  # what Blender raises for a view that it does not have
            view.view_transform = XYZ_VIEW
            kept.window_view = before
    elif kept.target != "WIDE" and view.view_transform == XYZ_VIEW:
        view.view_transform, kept.window_view = kept.window_view or "Standard", ""


def notes(scene: bpy.types.Scene) -> list[str]:
    """What does not fit the way that a scene is shown, one sentence each."""
    kept, found = scene.spectral_booth, []
    unmanaged = [each.name for each in state.unmanaged_materials(scene)]
    if kept.way == "CODED" and unmanaged:
        found.append(f"Not managed, shown in the colours of the lamps' codes: {', '.join(unmanaged)}")
    strangers = [each.name for each in scene.objects if each.type == "LIGHT" and state.LAMP_KEY not in each]
    if strangers:
        found.append(
            f"Lamps that are not managed keep their own colour: {', '.join(strangers)}. Use copies of a managed one"
        )
    found += [
        f"Scene '{other}' has these materials too, where they look wrong. Give it copies of {', '.join(names)}"
        for other, names in _shared_materials(scene).items()
    ]
    if kept.way == "CODED" and scene.render.engine == _CYCLES:
        found.append("Cycles cannot show coded lamps: render with Eevee")
    if kept.way == "CODED":
        found += [note for each in state.all_managed_materials(scene) for note in materials.not_coded(each)]
    if kept.target == "WIDE":
        view = scene.view_settings.view_transform
        if view != XYZ_VIEW:
            found.append(f"Surfaces emit XYZ: choose the view '{XYZ_VIEW}' of an exported config, not '{view}'")
    if kept.target == "HEADSET" and unmanaged:
        found.append(f"Not managed, shown without the headset's profile: {', '.join(unmanaged)}")
    return found


def _shared_materials(scene: bpy.types.Scene) -> dict[str, list[str]]:
    """Materials that other scenes have too, by the scene: they follow this one."""
    own, found = state.all_managed_materials(scene), {}
    for other in bpy.data.scenes:
        theirs = set(state.all_managed_materials(other)) if other != scene else set()
        if shared := [each.name for each in own if each in theirs]:
            found[other.name] = shared
    return found


@contextmanager
def scene_linear(scene: bpy.types.Scene) -> Iterator[None]:
    """What leaves the surfaces, for whoever measures it in a render, and no display's codes.

    XYZ with coded lamps, else linear Rec.709 (`lighting.linear_rgb` makes that of both).
    """
    shown = [each for each in state.all_managed_materials(scene) if shading.show_before_display(each)]
    try:
        yield
    finally:
        for material in shown:
            shading.show_after_display(material)


def _shading(scene: bpy.types.Scene) -> shading.Shading:
    """The scene's state as shared node groups, made anew."""
    kept, basis = scene.spectral_booth, encoded.basis_of(scene)
    coded = kept.way == "CODED"
    display = _display(scene, coded)  # first: a profile may be unreadable
    made = shading.Shading(
        colour_nodes.basis_group("Spectral Basis", encoded.quads(basis), coded) if basis else None,
        colour_nodes.coded_group("Spectral Coded") if coded else None,
        display,
    )
    for tree in filter(None, (made.basis, made.coded, made.display)):
        tree[SHARED_KEY] = True
    return made


def _display(scene: bpy.types.Scene, coded: bool) -> bpy.types.NodeTree | None:
    """From what leaves a surface to what it must emit for the scene's target."""
    kept = scene.spectral_booth
    if kept.target == "HEADSET":
        shown = headset.load(kept.display_left, kept.display_right)
        return headset.group("Spectral Display", shown, from_XYZ=coded)
    if kept.target == "WIDE" or not coded:
        return None
    tree = new_group("Spectral Display", {"XYZ": "Vector"}, {"Color": "Color"})
    build = Builder(tree)
    build.finish(build.matrix(np.linalg.inv(srgb_to_XYZ_matrix()), build.inputs["XYZ"]))
    return tree


def _images(
    kept: Sequence[bpy.types.Image], surface: Surface, shown: shading.Shading, wanted: int | None
) -> list[bpy.types.Image]:
    """Images of a surface: what it had as far as it fits, the rest new; the `wanted` ones of coefficients always stay.

    Raises
    ------
    BlenderError
        If a user removed one of those: only encoding makes them.
    """
    if surface.texture is None:
        return []
    if wanted is not None:
        coefficients = [image for image in kept if encoded.holds_coefficients(image)]
        if len(coefficients) != wanted:
            raise BlenderError(
                f"'{surface.name}' has {len(coefficients)} of {wanted} images of coefficients",
                remedy="undo what removed them, make surfaces live again, or bake their colours",
            )
        return coefficients
    found = [image for image in kept if not encoded.holds_coefficients(image)][: shown.colours]
    for number in range(len(found) + 1, shown.colours + 1):
        name = f"{surface.name} (spectral{f' {number}' if number > 1 else ''})"
        found.append(empty_image(name, surface.texture.width, surface.texture.height))
    return found
