"""An OpenColorIO config: Blender's own, with the headset as one more display.

The new display's view ``Standard`` is colorimetric: what the scene's XYZ says is what the headset
shows, and scene-linear Y = 1 is its white's luminance. The scene's white is not adapted to the
headset's. Colours out of gamut are clipped channel by channel.

The view `XYZ_VIEW` does the same with pixels that are XYZ themselves, written where scene-linear RGB is
expected: Blender clamps negative RGB, so that colours outside Rec.709 never reach ``Standard``, while no
light has a negative X, Y or Z. Blender's own display ``sRGB`` gets that view too.

The config is text that is edited, not parsed: comments and everything of Blender's stay as they were.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import re
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from spectral_core.arrays import Float64Array
from spectral_core.display.builtin import srgb
from spectral_core.display.export.luts import write_cube, write_spi1d
from spectral_core.display.export.names import XYZ_VIEW, export_name
from spectral_core.display.models.stages import SHAPER, Power, Stages, Tables, stages
from spectral_core.display.profile import DisplayProfile
from spectral_core.errors import DisplayError, OutputError
from spectral_core.files import atomic_path, is_file, read_text

VIEW = "Standard"
# Blender's own display of an ordinary monitor.
_PLAIN = "sRGB"
_MARK = "# Made by Spectral Booth from"
_REMEDY = "give Blender's own config.ocio (in its folder datafiles/colormanagement)"
_SUFFIX = " (profile)"
_CURVE_NODES = 4096
# Twice the nodes a side halve the error and take eight times the memory of a graphics card: 3.3 MB here.
_TABLE_NODES = 65
# OpenColorIO keeps a file that it has read once: another content must have another name.
_OWN_TABLE = re.compile(r".+ (curves|interaction) [0-9a-f]{8}\.(spi1d|cube)")


@dataclass(frozen=True)
class OcioExport:
    """Where the config is, and what to choose in it."""

    config: Path
    display: str
    view: str
    files: tuple[Path, ...]
    xyz_view: str = XYZ_VIEW


def blender_config() -> Path:
    """The config that the variable OCIO names, or that of the Blender in this Python, without importing it.

    Raises
    ------
    DisplayError
        If there is neither.
    """
    if is_file(named := Path(os.environ.get("OCIO", ""))):
        return named
    spec = importlib.util.find_spec("bpy")
    for folder in (spec.submodule_search_locations or ()) if spec else ():
        for found in Path(folder).glob("*/datafiles/colormanagement/config.ocio"):
            return found
    raise DisplayError("no OpenColorIO config of Blender was found", remedy=f"{_REMEDY} with --base")


def export_ocio(profile: DisplayProfile, folder: Path, base: Path) -> OcioExport:
    """Write a self-contained copy of the config `base` to `folder`, with the profile as one more display,
    and with a view of XYZ for that display and for Blender's ``sRGB``.

    An earlier export under the same name is replaced; a name of Blender's own gets a suffix.

    Raises
    ------
    DisplayError
        If `base` is not such a config.
    OutputError
        If `folder` holds something that is not from here.
    """
    text = read_text(base, DisplayError, _REMEDY)
    config = folder / "config.ocio"
    _refuse_foreign(folder, config)
    paths = _search_path(text, base)
    display = export_name(profile)
    text = _without(text, display)
    while display.casefold() in _names(text) | {XYZ_VIEW.casefold()}:
        display += _SUFFIX
        text = _without(text, display)
    tables, transforms = _transforms(stages(profile.model), display)
    edited = _with_display(text, base, display, transforms)
    edited = _with_plain_display(edited, base)

    own = folder / ("luts" if "luts" in paths else paths[0])
    files = [_table(own / name, values) for name, values in tables.items()]
    for source in (source for path in paths for source in _files(base.parent / path)):
        target = folder / source.relative_to(base.parent)
        if target not in files and not _is_left_over(source, edited):
            files.append(_copied(source, target))
    with atomic_path(config) as temporary:
        temporary.write_text(edited, encoding="utf-8")
    for path in _files(own):
        if _is_left_over(path, edited):
            path.unlink()
    return OcioExport(config, display, VIEW, (config, *files))


def _is_left_over(path: Path, text: str) -> bool:
    """Whether a table of an earlier export is used no more."""
    return _OWN_TABLE.fullmatch(path.name) is not None and path.name not in text


def _refuse_foreign(folder: Path, config: Path) -> None:
    """A folder that is there must be empty or hold a config from here."""
    try:
        inside = any(folder.iterdir()) if folder.is_dir() else folder.exists()
    except OSError as error:
        raise OutputError(f"cannot be read ({error.strerror})", where=folder, remedy="choose another folder") from None
    if inside and not (is_file(config) and read_text(config, OutputError, "choose another folder").startswith(_MARK)):
        raise OutputError("holds files that are not from here", where=folder, remedy="choose an empty or new folder")


def _search_path(text: str, base: Path) -> list[str]:
    found = re.search(r'^search_path:[ ]*"?([^"\n]+)"?[ ]*$', text, re.MULTILINE)
    paths = [path for path in (found[1].split(":") if found else []) if path]
    if not paths or any(Path(path).is_absolute() or ".." in Path(path).parts for path in paths):
        raise DisplayError("has no folders of its own for tables (search_path)", where=base, remedy=_REMEDY)
    return paths


def _files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.iterdir() if path.is_file()) if folder.is_dir() else []


def _copied(source: Path, target: Path) -> Path:
    if source.resolve() != target.resolve():
        with atomic_path(target) as temporary:
            shutil.copyfile(source, temporary)
    return target


def _names(text: str) -> set[str]:
    """Every display, colour space, alias and role that the config has, and more words."""
    return {word.strip(" \"'").casefold() for word in re.split(r"[,:\[\]\n{}]", text)}


def _without(text: str, display: str) -> str:
    """The config without a display that an earlier export put there."""
    begin, end = _bounds(display)
    bare = re.sub(f"^{re.escape(begin)}\n.*?^{re.escape(end)}\n", "", text, flags=re.MULTILINE | re.DOTALL)
    return text if bare == text else bare.replace(f", {_quoted(display)}]", "]").replace(f", {_quoted(display)},", ",")


def _bounds(display: str) -> tuple[str, str]:
    """Comments around what an export puts into a config."""
    return f"  # Spectral Booth: {display}", f"  # Spectral Booth: end of {display}"


def _transforms(steps: Stages, name: str) -> tuple[dict[str, Float64Array], list[str]]:
    """The tables that the steps need, by file name, and OCIO's transforms from XYZ to codes."""
    tables: dict[str, Float64Array] = {}
    transforms = [_matrix(steps.matrix, steps.offset)]
    if steps.interaction is not None:
        low, high = steps.interaction.span
        scale = 1 / (high - low)
        table = steps.interaction.sampled(_TABLE_NODES)
        file = f"{name} interaction {_digest(table)}.cube"
        tables[file] = table
        # CIE 1976 lightness is this function with these numbers, below zero too.
        transforms += [
            "!<ExponentWithLinearTransform> {gamma: 3, offset: 0.16, direction: inverse}",
            _matrix(np.diag(scale), -low * scale),
            _file(file, "tetrahedral"),
        ]
    transforms.append(_CLAMP)
    if isinstance(curve := steps.curve, Tables):
        codes = curve.sampled(_CURVE_NODES)
        file = f"{name} curves {_digest(codes)}.spi1d"
        tables[file] = codes
        transforms += [_power(np.full(3, 1 / SHAPER)), _file(file, "linear")]
    elif isinstance(curve, Power):
        transforms.append(_power(curve.gamma))
        if curve.threshold.any():
            transforms += [_matrix(np.diag(1 - curve.threshold), curve.threshold), _CLAMP]
    else:
        transforms.append("!<ExponentWithLinearTransform> {gamma: 2.4, offset: 0.055, direction: inverse}")
    return tables, transforms


def _table(path: Path, values: Float64Array) -> Path:
    if values.ndim == 4:
        write_cube(path, values, ("From lightness of drives together to each channel's own",))
    else:
        write_spi1d(path, values)
    return path


def _digest(values: Float64Array) -> str:
    return hashlib.sha256(values.tobytes()).hexdigest()[:8]


_CLAMP = "!<RangeTransform> {min_in_value: 0, max_in_value: 1, min_out_value: 0, max_out_value: 1}"


def _matrix(matrix: Float64Array, offset: Float64Array) -> str:
    full = np.eye(4)
    full[:3, :3] = matrix
    numbers = ", ".join(f"{value:.12g}" for value in full.ravel())
    offsets = ", ".join(f"{value:.12g}" for value in (*offset, 0.0))
    return f"!<MatrixTransform> {{matrix: [{numbers}], offset: [{offsets}]}}"


def _power(gamma: Float64Array) -> str:
    numbers = ", ".join(f"{value:.12g}" for value in gamma)
    return f"!<ExponentTransform> {{value: [{numbers}, 1], direction: inverse}}"


def _file(name: str, interpolation: str) -> str:
    return f'!<FileTransform> {{src: "{name}", interpolation: {interpolation}}}'


def _with_display(text: str, base: Path, display: str, transforms: list[str]) -> str:
    """The config's text with a display of its own colour spaces, from the scene's reference space on."""
    for role in ("reference", "cie_xyz_d65_interchange", "scene_linear"):
        if not re.search(rf"^  {role}:", text, re.MULTILINE):
            raise DisplayError(f"has no role '{role}'", where=base, remedy=_REMEDY)
    begin, end = _bounds(display)
    views = [_view(VIEW, display), _view(XYZ_VIEW, _xyz_space(display)), _view("Raw", "Non-Color")]
    shown = [begin, f"  {_quoted(display)}:", *views, end]
    space = [
        begin,
        *_space(display, "colorimetric", "cie_xyz_d65_interchange", transforms),
        *_space(_xyz_space(display), "from pixels that are XYZ", "scene_linear", transforms),
        end,
    ]
    lines = _inserted(text.splitlines(), base, "displays", shown, at_end=True)
    lines = _inserted(lines, base, "colorspaces", space, at_end=False)
    active = re.compile(r"^(active_displays: \[.*)\]$", re.MULTILINE)
    edited, count = active.subn(lambda found: f"{found[1]}, {_quoted(display)}]", "\n".join(lines) + "\n")
    if count != 1:
        raise DisplayError("has no list active_displays", where=base, remedy=_REMEDY)
    return edited if edited.startswith(_MARK) else f"{_MARK} {base.name}, which says of itself:\n{edited}"


def _with_plain_display(text: str, base: Path) -> str:
    """The config's text with the view of XYZ for Blender's own display, and in the list of views to show."""
    name = _xyz_space(_PLAIN)
    begin, end = _bounds(name)
    lines = _without(text, name).splitlines()
    heads = [index for index, line in enumerate(lines) if line in (f"  {_PLAIN}:", f"  {_quoted(_PLAIN)}:")]
    if not heads:
        raise DisplayError(f"has no display '{_PLAIN}'", where=base, remedy=_REMEDY)
    at = heads[0] + 1
    while at < len(lines) and lines[at].startswith("    "):
        at += 1
    lines[at:at] = [begin, _view(XYZ_VIEW, name), end]
    tables, transforms = _transforms(stages(srgb().model), _PLAIN)
    assert not tables  # sRGB's curve is a formula
    space = [begin, *_space(name, "from pixels that are XYZ", "scene_linear", transforms), end]
    edited = "\n".join(_inserted(lines, base, "colorspaces", space, at_end=False)) + "\n"
    return _with_active_view(edited, base)


def _with_active_view(text: str, base: Path) -> str:
    """The config's text with the view of XYZ among those that it shows; without a list it shows all."""
    if not re.search("^active_views:", text, re.MULTILINE):
        return text
    listed = re.search(r"^active_views: \[(.+)\]$", text, re.MULTILINE)
    if not listed:
        raise DisplayError("has no views in its list active_views", where=base, remedy=_REMEDY)
    if XYZ_VIEW in [view.strip(" \"'") for view in listed[1].split(",")]:
        return text
    return f"{text[: listed.end(1)]}, {XYZ_VIEW}{text[listed.end(1) :]}"


def _xyz_space(display: str) -> str:
    """The colour space of a display's view of XYZ; no display has a colon in its name (`export_name`)."""
    return f"{XYZ_VIEW}: {display}"


def _view(name: str, space: str) -> str:
    return f"    - !<View> {{name: {name}, colorspace: {_quoted(space)}}}"


def _space(name: str, what: str, pixels: str, transforms: list[str]) -> list[str]:
    """A colour space of device codes; `pixels` is the space whose numbers the transforms take."""
    return [
        "  - !<ColorSpace>",
        f"    name: {_quoted(name)}",
        "    family: Display",
        "    bitdepth: 32f",
        f"    description: Device codes of a display, {what}, clipped",
        "    isdata: false",
        "    from_scene_reference: !<GroupTransform>",
        "      children:",
        f"        - !<ColorSpaceTransform> {{src: reference, dst: {pixels}}}",
        *(f"        - {transform}" for transform in transforms),
    ]


def _quoted(name: str) -> str:
    return f'"{name}"'


def _inserted(lines: list[str], base: Path, section: str, new: list[str], *, at_end: bool) -> list[str]:
    """Lines with new ones at the begin or the end of a top-level section."""
    if f"{section}:" not in lines:
        raise DisplayError(f"has no section '{section}'", where=base, remedy=_REMEDY)
    at = lines.index(f"{section}:") + 1
    if at_end:
        at = next(_ends(lines, at))
    return [*lines[:at], *new, *lines[at:]]


def _ends(lines: list[str], start: int) -> Iterator[int]:
    """Where a section can end: at lines that are neither empty nor indented."""
    yield from (index for index in range(start, len(lines)) if lines[index][:1] not in ("", " "))
    yield len(lines)
