"""What a report says in words: the headline figures and the numerical conditions that were met."""

from __future__ import annotations

from dataclasses import dataclass

from spectral_core.report.documents import Document
from spectral_core.report.numerals import count
from spectral_core.report.tables import CHANNELS


@dataclass(frozen=True)
class Worst:
    """The largest errors at a level over all lights, patches and channels, and where they are."""

    level: int
    levels: float
    levels_light: str
    dE00: float
    dE00_light: str
    mean_dE00: float


@dataclass(frozen=True)
class WorstTexture:
    """The textured object whose mean colour is furthest off, in 8-bit levels, and single pixels on average."""

    mean_colour: float
    object: str
    light: str
    pixels: float


@dataclass(frozen=True)
class Kind:
    """A kind of numerical condition: its name, what marks its sentence, and what is done about it."""

    name: str
    marks: tuple[str, ...]
    answer: str


@dataclass(frozen=True)
class LightConditions:
    """The conditions one light met: (kind, detail)."""

    light: str
    met: tuple[tuple[str, str], ...]


KINDS = (
    Kind(
        "narrow lines",
        ("spectral lines",),
        "Each line is one exact node of the light; the colour-matching functions and the reflectance are interpolated "
        "to its wavelength, so no line falls between samples.",
    ),
    Kind(
        "folded lamp",
        ("for a lamp",),
        "Materials cannot be divided by a lamp channel near zero. The lamps become neutral and the materials carry the "
        "colour of surface and light together: just as exact for direct light.",
    ),
    Kind(
        "lamp outside sRGB",
        ("channels of the lamps",),
        "Blender's lamps cannot be negative; at level 1 the negative channel is set to 0 and its error is part of the "
        "figures.",
    ),
    Kind(
        "negative channels",
        ("negative channels shown as 0",),
        "Colours outside linear Rec.709 are shown with the negative channel at 0. These patches count as out of gamut; "
        "their exact, unclipped colour stays the reference.",
    ),
    Kind(
        "extended ends",
        ("repeated beyond",),
        "Where a reflectance ends before the light does, its last value is repeated; the share of the white's X, Y or "
        "Z that rests on this bounds the error.",
    ),
    Kind(
        "coarse or short table",
        ("sampled every", "with power left"),
        "The table is used as it is and the possible loss is stated.",
    ),
)
_OTHER = "note"
# Names of patches repeat the chart's in every sentence; readers know it.
_CHART_PREFIX = "colorchecker "


def worst(document: Document, level: int) -> Worst | None:
    """The headline figures of a level; None if it was not verified. dE00 counts patches in gamut."""
    key = f"level{level}"
    results = [(light["name"], light[key]) for light in document["lights"] if key in light]
    if not results:
        return None
    levels = {name: max(result["rgb8"][each]["max"] for each in CHANNELS) for name, result in results}
    inside = {name: result["dE00_in_gamut"] for name, result in results if result["in_gamut"]}
    levels_light = max(levels, key=lambda name: levels[name])
    dE00_light = max(inside, key=lambda name: inside[name]["max"], default="")
    return Worst(
        level,
        levels[levels_light],
        levels_light,
        inside[dE00_light]["max"] if inside else 0.0,
        dE00_light,
        sum(each["mean"] for each in inside.values()) / len(inside) if inside else 0.0,
    )


def worst_texture(document: Document) -> WorstTexture | None:
    """The headline figures of the textures at level 2; None if the scene has none."""
    found = [
        (each["mean_colour"], name, light["name"], each["pixels"]["mean"])
        for light in document["lights"]
        for name, each in light.get("textures", {}).items()
    ]
    if not found:
        return None
    mean_colour, name, light_name, _ = max(found)
    return WorstTexture(mean_colour, name, light_name, sum(each[-1] for each in found) / len(found))


def conditions_met(document: Document) -> list[LightConditions]:
    """Per light the conditions of a document, sorted into kinds."""
    found = []
    for light in document["lights"]:
        met = tuple(_sorted_in(text) for text in light.get("conditions", []))
        found.append(LightConditions(light["name"], met))
    return found


def kinds_met(documents: list[Document]) -> list[Kind]:
    """The kinds that occur in any of the documents, in the order of `KINDS`."""
    names = {name for document in documents for each in conditions_met(document) for name, _ in each.met}
    return [kind for kind in KINDS if kind.name in names]


def _sorted_in(text: str) -> tuple[str, str]:
    for kind in KINDS:
        if any(mark in text for mark in kind.marks):
            return kind.name, _detail(kind, text)
    return _OTHER, text


def _detail(kind: Kind, text: str) -> str:
    """The sentence without what its kind already says."""
    if kind.name == "negative channels" and ": " in text:
        names = text.split(": ", 1)[1].replace(_CHART_PREFIX, "").split(", ")
        return f"{count(len(names), 'surface')}: {', '.join(names)}"
    if kind.name == "extended ends" and ": " in text:
        share = text.split(": ", 1)[1].replace("0.000%", "less than 0.001%")
        return share.replace("%", " %")
    return text
