"""The scene description: TOML as frozen dataclasses. Lengths in metres, angles in degrees, z up."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from importlib import resources
from pathlib import Path

from spectral_core.chart import chart_objects, patch_surfaces
from spectral_core.errors import LightError, SceneError, SpectrumError, TextureError
from spectral_core.files import is_file
from spectral_core.lights import Light, check_shares, mixed_light, mixture_parts
from spectral_core.scene_reader import TableReader, Vector, parse_toml, read_toml
from spectral_core.shapes import SHAPES
from spectral_core.textures.base import KINDS
from spectral_core.textures.reading import Reading

FORMAT = 1
LEVELS = (0, 1, 2)
SURFACE_SOURCES = ("colorchecker", "reflectance", "file", "texture", "pigments")


@dataclass(frozen=True)
class Camera:
    """A camera at `location` looking at `target`: `width` in metres if orthographic, else focal length."""

    orthographic: bool
    location: Vector
    target: Vector
    width_m: float
    focal_length_mm: float


@dataclass(frozen=True)
class RenderSettings:
    """Size, samples per pixel, and Eevee's way to shade: forward is exact, deferred faster."""

    width: int
    height: int
    samples: int
    forward: bool


@dataclass(frozen=True)
class Lamp:
    """One lamp: a sun (directional) or a spot. `power` is relative; the white calibration scales all.

    `light` is a light of its own; without one it has the scene's.
    """

    name: str
    type: str
    location: Vector
    target: Vector
    cone_deg: float
    edge: float
    radius_m: float
    power: float
    light: str = ""


@dataclass(frozen=True)
class SurfaceSource:
    """Where a surface's reflectance comes from, and its neutral gloss (share of light at normal incidence).

    `reading` is what the scene says of a texture's file.
    """

    name: str
    source: str
    value: str
    spectrum: str
    constant: float
    gloss: float
    roughness: float
    reading: Reading = field(default_factory=Reading)


@dataclass(frozen=True)
class SceneObject:
    """A shape (see `spectral_core.shapes`) of `size` with its centre of the base at `location`."""

    name: str
    shape: str
    location: Vector
    size: Vector
    rotation_deg: Vector
    surface: str


@dataclass(frozen=True)
class White:
    """The calibration target: which object, and the luminance it shall have (scene white = 1)."""

    object: str
    luminance: float


@dataclass(frozen=True)
class SceneDescription:
    """A whole scene, checked.

    Attributes
    ----------
    reference
        The light under which the RGB colours of levels 0 and 1 are known.
    lights
        What the scene offers; `verify` takes them all unless told.
    adopted
        Whether it tells of surfaces only: objects and lamps are a user's own, and there may be no white target.
    text, folder
        The TOML itself, and where relative file names start.
    """

    name: str
    description: str
    reference: str
    lights: tuple[str, ...]
    light: str
    level: int
    white: White
    camera: Camera
    render: RenderSettings
    lamps: tuple[Lamp, ...]
    surfaces: dict[str, SurfaceSource]
    objects: tuple[SceneObject, ...]
    adopted: bool
    text: str
    folder: Path

    @property
    def single_sun(self) -> bool:
        """One directional lamp and nothing else: irradiance is known without rendering."""
        return len(self.lamps) == 1 and self.lamps[0].type == "sun"


def load_scene(path: str | Path) -> SceneDescription:
    """Read and check a scene description.

    Raises
    ------
    SceneError
        Naming the file and the key.
    """
    path = Path(path)
    text, reader = read_toml(path)
    return _scene(reader, text, path)


def bundled_scene(name: str) -> Path:
    """A scene description that comes with the project, by its name without ``.toml``.

    Raises
    ------
    SceneError
        If there is none of that name.
    """
    path = Path(str(resources.files("blend_scenes").joinpath(f"{name}.toml")))
    if not path.is_file():
        raise SceneError(f"no scene '{name}' comes with this installation", remedy="give the path of a TOML file")
    return path


def parse_scene(text: str, folder: Path, name: str = "scene") -> SceneDescription:
    """A scene description from TOML text, as kept inside a .blend file."""
    return _scene(parse_toml(text, Path(name)), text, folder / name.replace("/", "-"))


def _scene(reader: TableReader, text: str, path: Path) -> SceneDescription:
    version = reader.integer("format")
    if version != FORMAT:
        raise SceneError(f"'format' is {version}", where=path, remedy=f"this version reads format {FORMAT}")
    lights = reader.texts("lights")
    adopted = reader.boolean("adopted", False)
    objects = tuple(each for table in _tables(reader, "objects", adopted) for each in _objects(table))
    surfaces = {name: _surface(name, each) for name, each in reader.named_tables("surfaces").items()}
    for name, patch in patch_surfaces().items():
        if any(each.surface == name for each in objects):
            surfaces[name] = SurfaceSource(name, "colorchecker", patch, "", 0.0, 0.0, 0.4)
    scene = SceneDescription(
        name=reader.text("name"),
        description=reader.text("description", ""),
        reference=_light(reader, "reference", reader.text("reference", "D65"), path.parent),
        lights=tuple(_light(reader, "lights", each, path.parent) for each in lights),
        light=_light(reader, "light", reader.text("light", lights[0]), path.parent),
        level=reader.integer("level", 2, 0, 2),
        white=_white(reader.table("white"), adopted),
        camera=_camera(reader.table("camera")),
        render=_render(reader.table("render", {})),
        lamps=tuple(_lamp(each, path.parent) for each in _tables(reader, "lamps", adopted)),
        surfaces=surfaces,
        objects=objects,
        adopted=adopted,
        text=text,
        folder=path.parent.resolve(),
    )
    reader.finish()
    _check_references(scene, path)
    return scene


def _tables(reader: TableReader, key: str, optional: bool) -> list[TableReader]:
    return reader.tables(key, []) if optional else reader.tables(key)


def _light(reader: TableReader, key: str, name: str, folder: Path) -> str:
    """A light's name, refused here rather than in the middle of a build."""
    try:
        resolve_light(name, folder)
    except (LightError, SpectrumError) as error:
        raise reader.error(
            key, f"names a light that cannot be used ({error})", "give a built-in name or a file"
        ) from None
    return name


def resolve_light(name: str, folder: Path) -> Light:
    """A light of a scene: built-in, a file relative to the scene's folder, or a mixture of such."""
    parts = light_parts(name, folder)
    return parts[0][0] if len(parts) == 1 else mixed_light(parts)


def light_parts(name: str, folder: Path) -> list[tuple[Light, float]]:
    """The lights that a scene's light consists of, one unless it is a mixture, and their shares.

    Raises
    ------
    LightError, SpectrumError
        If one cannot be used, or the shares make no mixture.
    """
    found = [] if is_file(folder / name) else mixture_parts(name)
    if found:
        check_shares([share for _, share in found])
    return [(resolve_light(part, folder), share) for part, share in found] or [(_single_light(name, folder), 1.0)]


def _single_light(name: str, folder: Path) -> Light:
    """A light is told from others by its name: that of a file is where it lies, for many columns are called `power`."""
    path = folder / name
    return replace(Light.load(path), name=name) if is_file(path) else Light.load(name)


def _white(table: TableReader, adopted: bool) -> White:
    target = table.text("object", "") if adopted else table.text("object")
    white = White(target, table.number("luminance", 0.85, 1e-3, 100))
    table.finish()
    return white


def _camera(table: TableReader) -> Camera:
    orthographic = table.text("projection", "perspective", ("perspective", "orthographic")) == "orthographic"
    camera = Camera(
        orthographic,
        table.vector("location"),
        table.vector("target"),
        table.number("width", 1.0, 1e-3, 1e3) if orthographic else 1.0,
        35.0 if orthographic else table.number("focal_length_mm", 35.0, 1, 1000),
    )
    table.finish()
    if camera.location == camera.target:
        raise table.error("target", "is where the camera stands", "aim it elsewhere")
    return camera


def _render(table: TableReader) -> RenderSettings:
    settings = RenderSettings(
        table.integer("width", 960, 16, 16384),
        table.integer("height", 540, 16, 16384),
        table.integer("samples", 16, 1, 4096),
        table.text("shading", "forward", ("forward", "deferred")) == "forward",
    )
    table.finish()
    return settings


def _lamp(table: TableReader, folder: Path) -> Lamp:
    kind = table.text("type", "spot", ("spot", "sun"))
    spot = kind == "spot"
    lamp = Lamp(
        table.text("name"),
        kind,
        table.vector("location"),
        table.vector("target"),
        table.number("cone", 60.0, 1, 179) if spot else 0.0,
        table.number("edge", 0.3, 0, 1) if spot else 0.0,
        table.number("radius", 0.02, 0, 10) if spot else 0.0,
        table.number("power", 1.0, 1e-9, 1e9),
        _light(table, "light", table.text("light"), folder) if table.has("light") else "",
    )
    table.finish()
    if lamp.location == lamp.target:
        raise table.error("target", "is where the lamp stands", "aim it elsewhere")
    return lamp


def _surface(name: str, table: TableReader) -> SurfaceSource:
    written = [source for source in SURFACE_SOURCES if table.has(source)]
    if len(written) != 1:
        said = f"says {' and '.join(written)}" if written else "says no source"
        raise table.error("", said, f"give exactly one of {', '.join(SURFACE_SOURCES)}")
    source = written[0]
    constant = table.number("reflectance", low=0, high=1) if source == "reflectance" else 0.0
    value = "" if source == "reflectance" else table.text(source)
    surface = SurfaceSource(
        name,
        source,
        value,
        table.text("spectrum", "") if source == "file" else "",
        constant,
        table.number("gloss", 0.0, 0, 1),
        table.number("roughness", 0.4, 0, 1),
        _reading(table) if source == "texture" else Reading(),
    )
    table.finish()
    return surface


def _reading(table: TableReader) -> Reading:
    """The same that the command line takes of a texture; file names are relative to the scene's."""
    white, dark = table.text("white", ""), table.text("dark", "")
    try:
        return Reading(
            kind=table.text("kind", "", ("", *KINDS[:3])) or None,  # type: ignore[arg-type]
            scale=table.number("scale", 0.0) or None,
            white=Path(white) if white else None,
            dark=Path(dark) if dark else None,
            wavelengths=table.text("wavelengths", "") or None,
            variable=table.text("variable", "") or None,
            reduce=table.boolean("reduce", False),
        )
    except TextureError as error:
        raise table.error("texture", f"is described wrongly ({error.problem})", error.remedy) from None


def _objects(table: TableReader) -> list[SceneObject]:
    """One object; a ColorChecker becomes its frame and its 24 patches."""
    shape = table.text("shape", choices=(*SHAPES, "colorchecker"))
    one = SceneObject(
        table.text("name"),
        shape,
        table.vector("location"),
        table.vector("size", low=0),
        table.vector("rotation", (0.0, 0.0, 0.0)),
        table.text("surface"),
    )
    table.finish()
    return chart_objects(one) if shape == "colorchecker" else [one]


def _check_references(scene: SceneDescription, path: Path) -> None:
    def refuse(key: str, problem: str, remedy: str) -> SceneError:
        return SceneError(f"'{key}' {problem}", where=path, remedy=remedy)

    names = [each.name for each in scene.objects] + [each.name for each in scene.lamps]
    for name in names:
        if names.count(name) > 1:
            raise refuse("name", f"'{name}' is used twice", "give each object and lamp its own")
    if not scene.lamps and not scene.adopted:
        raise refuse("lamps", "is empty", "add a [[lamps]] table")
    for index, each in enumerate(scene.objects):
        if each.surface not in scene.surfaces:
            known = ", ".join(scene.surfaces) or "none"
            raise refuse(f"objects[{index}].surface", f"is '{each.surface}', which [surfaces] lacks", f"it has {known}")
    if scene.white.object not in [each.name for each in scene.objects] and not scene.adopted:
        raise refuse("white.object", f"is '{scene.white.object}', which no object is called", "name the white target")
    if scene.light not in scene.lights:
        raise refuse("light", f"is '{scene.light}', which 'lights' lacks", "add it there")
