"""The report's tables, as rows of text from the documents of `verify`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from spectral_core import standards
from spectral_core.arrays import Float64Array
from spectral_core.display import srgb, srgb_encode
from spectral_core.lights import Light, LightQuality
from spectral_core.report.documents import Document
from spectral_core.report.numerals import NONE, fixed, small, spread
from spectral_core.report.published import published_differences, published_hyperspectral_srgb, published_lights
from spectral_core.surfaces import colorchecker_maker_srgb

LEVELS = (0, 1, 2)
# Luminance of the perfect diffuser of the published table of lights, relative to a D65 white.
TABLE_LUMINANCE = 0.85
CHANNELS = "RGB"
# The one stage that is the same at every level.
_ROUNDING = "8-bit rounding"


@dataclass(frozen=True)
class Row:
    """A row of cells; `group` starts a new block, `aside` is set back (published figures), `strong` stands out."""

    cells: tuple[str, ...]
    group: bool = False
    aside: bool = False
    strong: bool = False
    swatches: tuple[str, ...] = ()

    @property
    def kind(self) -> str:
        """Its class in the page's style sheet."""
        return "aside" if self.aside else "strong" if self.strong else "group" if self.group else ""


@dataclass(frozen=True)
class Table:
    """A table: headings over columns (`groups`: text and how many columns), rows, text columns on the left."""

    caption: str
    headers: tuple[str, ...]
    rows: tuple[Row, ...]
    groups: tuple[tuple[str, int], ...] = ()
    text_columns: int = 1
    foot: tuple[Row, ...] = field(default=())


def levels_of(light: Document) -> list[int]:
    """Which levels a light of a document was verified at."""
    return [level for level in LEVELS if f"level{level}" in light]


def css_colour(rgb_8bit: Sequence[float] | Float64Array) -> str:
    """An 8-bit colour as CSS, clipped and rounded."""
    return "#" + "".join(f"{round(float(each)):02x}" for each in np.clip(rgb_8bit, 0, 255))


def rgb_at(light: Light, luminance: float = TABLE_LUMINANCE) -> Float64Array:
    """8-bit sRGB (3,) of the perfect diffuser under a light, neither rounded nor clipped."""
    return np.asarray(255 * srgb_encode(srgb().to_linear(light.XYZ() * luminance)))


def lights_table(lights: Mapping[str, Light], qualities: Mapping[str, LightQuality]) -> Table:
    """Colour and quality of each light, with the published row beneath where there is one."""
    published = published_lights()
    rows = []
    for name, light in lights.items():
        quality, rgb = qualities[name], rgb_at(light)
        colour = (*(fixed(each, 4) for each in light.xy()), fixed(quality.cct_K, 0), fixed(quality.duv, 4))
        indices = (fixed(quality.rf, 1), fixed(quality.ra, 1))
        codes = tuple(fixed(each, 1) for each in rgb)
        rows.append(Row((name, *colour, *indices, *codes), group=True, swatches=(css_colour(rgb),)))
        if name in published:
            theirs = published[name]
            xy = (fixed(theirs.xy[0], 4), fixed(theirs.xy[1], 4))
            codes = tuple(str(each) for each in theirs.rgb_8bit)
            cells = ("published", *xy, fixed(theirs.cct_K, 0), "", f"{theirs.rf:g}", "", *codes)
            rows.append(Row(cells, aside=True))
    return Table(
        "Lights of the scenes. Chromaticity for the CIE 1931 2° observer, CCT and Duv after Ohno (2013), fidelity "
        "index Rf of CIE 224, rendering index Ra of CIE 13.3. Lamp colour: 8-bit sRGB levels of a perfect diffuser "
        "at Y = 85 (scene white 100), neither rounded nor clipped; above 255 a lamp in 8 bits would clip, Blender's "
        "floating-point lamps do not. Rows in italics are the published figures.",
        ("light", "x", "y", "CCT / K", "Duv", "Rf", "Ra", "R", "G", "B"),
        tuple(rows),
        groups=(("", 1), ("chromaticity", 2), ("temperature", 2), ("quality", 2), ("lamp, 8-bit levels", 3)),
    )


def channels_table(document: Document) -> Table:
    """Per light and level the 8-bit differences of each channel."""
    rows = []
    for light in document["lights"]:
        for level in levels_of(light):
            rgb8 = light[f"level{level}"]["rgb8"]
            cells = [light["name"] if level == levels_of(light)[0] else "", str(level)]
            for channel in CHANNELS:
                cells += [spread(rgb8[channel]["mean"], rgb8[channel]["sd"]), fixed(rgb8[channel]["max"], 2)]
            rows.append(Row(tuple(cells), group=level == levels_of(light)[0]))
    return Table(
        f"{document['scene']}: rendered against exact colours, absolute differences in 8-bit sRGB levels before "
        "rounding, mean ± standard deviation and maximum over all patches, both sides clipped to 0…255.",
        ("light", "level", *(each for _ in CHANNELS for each in ("mean ± sd", "max"))),
        tuple(rows),
        groups=(("", 2), ("red", 2), ("green", 2), ("blue", 2)),
        text_columns=2,
    )


def difference_table(document: Document) -> Table:
    """Per light and level the CIEDE2000 differences, in gamut and over all patches."""
    rows = []
    for light in document["lights"]:
        for level in levels_of(light):
            result = light[f"level{level}"]
            cells = [light["name"] if level == levels_of(light)[0] else "", str(level)]
            cells.append(f"{result['in_gamut']} of {result['patches']}")
            for key, some in (("dE00_in_gamut", result["in_gamut"]), ("dE00", result["patches"])):
                cells += [fixed(result[key][each], 3) if some else NONE for each in ("mean", "p95", "max")]
            rows.append(Row(tuple(cells), group=level == levels_of(light)[0]))
    return Table(
        f"{document['scene']}: colour differences CIEDE2000 of rendered against exact colours, relative to the white "
        "under the light. In gamut: patches whose exact colour sRGB can show. All patches: against the exact colour "
        "not clipped, so it includes what no sRGB display can show; it is no error of the management.",
        ("light", "level", "in gamut", "mean", "95 %", "max", "mean", "95 %", "max"),
        tuple(rows),
        groups=(("", 2), ("patches", 1), ("in gamut", 3), ("all patches", 3)),
        text_columns=2,
    )


def published_table(document: Document) -> Table | None:
    """Published rendering differences beside ours, for the lights that both have."""
    rows = []
    for light in document["lights"]:
        for level in (1, 2):
            theirs = published_differences().get((light["name"], level))
            if theirs is None or f"level{level}" not in light:
                continue
            rgb8 = light[f"level{level}"]["rgb8"]
            cells = [light["name"] if level == 1 else "", str(level)]
            for index, channel in enumerate(CHANNELS):
                cells.append(_as_printed(theirs.mean[index], theirs.sd[index]))
                cells.append(spread(rgb8[channel]["mean"], rgb8[channel]["sd"]))
            rows.append(Row(tuple(cells), group=level == 1))
    if not rows:
        return None
    return Table(
        f"{document['scene']}: published differences beside ours, 8-bit sRGB levels, mean ± standard deviation over "
        "24 patches. The published ones compare screen captures, rounded to 8 bits, with theory; ours are taken "
        "before rounding, and level 1 starts from the maker's sRGB of the patches.",
        ("light", "level", *(each for _ in CHANNELS for each in ("published", "ours"))),
        tuple(rows),
        groups=(("", 2), ("red", 2), ("green", 2), ("blue", 2)),
        text_columns=2,
    )


def _as_printed(mean: float, sd: float) -> str:
    """Published differences with the digits they were printed with."""
    return f"{fixed(mean, 1 if mean < 10 else 0)} ± {sd:g}"


def textures_table(document: Document) -> Table | None:
    """Per textured object and light the 8-bit differences over single pixels at level 2."""
    lights = document["lights"]
    objects = list(dict.fromkeys(name for light in lights for name in light.get("textures", {})))
    if not objects:
        return None
    rows = [Row((name, *(_texture_cell(light.get("textures", {}).get(name)) for light in lights))) for name in objects]
    return Table(
        f"{document['scene']}: hyperspectral textures at level 2 against the texture's exact colours, both clipped to "
        "0…255, 8-bit sRGB levels before rounding: the object's mean colour / single pixels on average. Single pixels "
        "also differ because the renderer averages the texture over a pixel where theory takes its centre.",
        ("object", *(light["name"] for light in lights)),
        tuple(rows),
    )


def _texture_cell(difference: Mapping[str, Any] | None) -> str:
    if difference is None:
        return NONE
    return f"{fixed(difference['mean_colour'], 2)} / {fixed(difference['pixels']['mean'], 2)}"


def stages_table(document: Document) -> Table | None:
    """Error by stage per light at level 2, with level 1's material for comparison."""
    names = list(document.get("stages", {}))
    rows = []
    for light in document["lights"]:
        if "level2" not in light:
            continue
        stages = light["level2"]["stages"]
        first = light.get("level1", {}).get("stages", {}).get("material")
        cells = [light["name"], *(_mean_max(first) if first else (NONE, NONE))]
        cells += [each for name in names for each in _mean_max(stages[name])]
        rows.append(Row(tuple(cells)))
    if not rows:
        return None
    total = ["all lights", "", "", *(each for name in names for each in _mean_max(document["stages"][name]))]
    groups = [(name if name == _ROUNDING else f"level 2: {name}", 2) for name in names]
    return Table(
        f"{document['scene']}: what each stage costs, 8-bit sRGB levels, mean and maximum over patches and channels. "
        "8-bit rounding: an exact colour shown in 8 bits (not part of the other figures). Material: exact colour "
        "against lamp times material as stored in float32. Eevee: stored against rendered.",
        ("light", *(("mean", "max") * (1 + len(names)))),
        tuple(rows),
        groups=(("", 1), ("level 1: material", 2), *groups),
        foot=(Row(tuple(total)),),
    )


def _mean_max(stage: Mapping[str, Any]) -> tuple[str, str]:
    return small(stage["mean"]), small(stage["max"])


def time_table(document: Document) -> Table:
    """Per light and level the error with the time to switch and to render."""
    rows = []
    for light in document["lights"]:
        for level in levels_of(light):
            result = light[f"level{level}"]
            first = level == levels_of(light)[0]
            cells = (
                light["name"] if first else "",
                str(level),
                fixed(1000 * result["switch_seconds"], 1),
                fixed(result["render_seconds"], 2),
                fixed(result["dE00_in_gamut"]["mean"], 3) if result["in_gamut"] else NONE,
                fixed(result["dE00"]["mean"], 3),
            )
            rows.append(Row(cells, group=first))
    return Table(
        f"{document['scene']}: error against run time. Switch: from one light to the next, all lamps and materials. "
        "Render: one image. Wall-clock times of single runs on the machine that made this report.",
        ("light", "level", "switch / ms", "render / s", "in gamut", "all patches"),
        tuple(rows),
        groups=(("", 2), ("time", 2), ("mean CIEDE2000", 2)),
        text_columns=2,
    )


def colorchecker_srgb() -> Float64Array:
    """(24, 3) 8-bit sRGB of our ColorChecker reflectances under D65, white at 255, not clipped."""
    _, wavelengths, reflectance = standards.colorchecker()
    matrix = Light.builtin("D65").weighting_factors(wavelengths).matrix
    return np.asarray(255 * srgb_encode(srgb().to_linear(reflectance @ matrix)))


def colorchecker_table() -> Table:
    """24 patches under D65: the maker's sRGB, the published hyperspectral image's, ours."""
    names = standards.colorchecker()[0]
    maker, published, ours = colorchecker_maker_srgb(), published_hyperspectral_srgb(), colorchecker_srgb()
    shown = np.clip(ours, 0, 255)
    rows = []
    for index, name in enumerate(names):
        codes = [fixed(each, 0) for each in (*maker[index], *published[index])]
        codes += [fixed(each, 1) for each in ours[index]]
        swatches = tuple(css_colour(each[index]) for each in (maker, published, ours))
        rows.append(Row((f"{index + 1}", name, *codes), swatches=swatches))
    theirs, mine = np.abs(published - maker).mean(axis=0), np.abs(shown - maker).mean(axis=0)
    apart = np.abs(shown - published).mean(axis=0)
    from_maker = [fixed(each, 2) for each in (*theirs, *mine)]
    foot = (
        Row(("", "mean difference from the maker's", "", "", "", *from_maker)),
        Row(("", "mean difference, ours from published", *[""] * 6, *(fixed(each, 2) for each in apart))),
    )
    return Table(
        "ColorChecker under D65, 8-bit sRGB levels. Maker: as stated by the maker. Published: from a hyperspectral "
        "image of the chart. Ours: from the reflectances used here (BabelColor average of 30 charts, as in "
        "colour-science), before rounding; negative values are outside sRGB. For the mean absolute differences ours "
        "are clipped to 0…255 as the published ones are. Swatches: maker, published, ours.",
        ("", "patch", *("R", "G", "B") * 3),
        tuple(rows),
        groups=(("", 2), ("maker", 3), ("published", 3), ("ours", 3)),
        text_columns=2,
        foot=foot,
    )
