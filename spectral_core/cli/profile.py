"""Commands of ``spectral-booth profile``: what a display's profile says, and setting what it keeps."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import click
import numpy as np

from spectral_core.chromaticities import XYZ_to_xy
from spectral_core.cli.console import Document, emit, facts
from spectral_core.cli.export import export
from spectral_core.cli.options import FiniteRange, as_json
from spectral_core.display import DisplayProfile, load_profile, write_profile
from spectral_core.display.limits.luminance import scene_white
from spectral_core.display.measuring.measurements import Measurements
from spectral_core.display.measuring.state import EYES, HeadsetState
from spectral_core.display.models import LEAST_LIGHT, DisplayModel
from spectral_core.display.models.fitting import gamma_fit
from spectral_core.display.profile import MODELS
from spectral_core.errors import DisplayError

Command = TypeVar("Command", bound=Callable[..., Any])
_PATH = click.Path(path_type=Path)
# A stated luminance that differs by more than instruments do contradicts the file.
_SAME_LUMINANCE = 0.02
_CHANNELS = ("R", "G", "B")


def _field_point(ctx: click.Context, param: click.Parameter, value: str | None) -> tuple[float, float] | None:
    """``X,Y`` as two numbers, or a usage error."""
    if value is None:
        return None
    try:
        x, y = (float(part) for part in value.split(","))
    except ValueError:
        raise click.BadParameter(f"'{value}' is not two numbers such as 10,-5", ctx, param) from None
    return x, y


_STATE_OPTIONS = (
    click.option("--headset", "model_name", metavar="TEXT", help="its maker and model"),
    click.option("--eye", type=click.Choice(EYES)),
    click.option("--brightness", metavar="TEXT", help="the headset's own setting"),
    click.option("--warm-up", "warm_up_minutes", type=FiniteRange(0), metavar="MINUTES"),
    click.option("--date", metavar="ISO", help="of the measurement"),
    click.option("--instrument", metavar="TEXT", help="what measured"),
    click.option(
        "--field", "field_deg", callback=_field_point, metavar="X,Y", help="degrees right and up from the centre"
    ),
    click.option("--note", metavar="TEXT"),
    click.option(
        "--white-luminance", "white_luminance_cd_m2", type=FiniteRange(0, min_open=True), metavar="CD_M2",
        help="of white, if the measurements are relative",
    ),
    click.option(
        "--scene-white", type=FiniteRange(0, 1, min_open=True), metavar="FRACTION",
        help="luminance to show a scene's white at, of white's",
    ),
)  # fmt: skip


def state_options(command: Command) -> Command:
    """Add the options of what a profile keeps beside its model; the command gets them by keyword."""
    for option in reversed(_STATE_OPTIONS):
        command = option(command)
    return command


def make_profile(
    name: str, model: DisplayModel, source: str, measured: Measurements, given: Mapping[str, Any]
) -> DisplayProfile:
    """A profile of measurements: what `state_options` did not give is taken from the file."""
    known = HeadsetState(date=measured.date, instrument=measured.instrument or None)
    luminance = given["white_luminance_cd_m2"]
    white_Y = float(measured.white_XYZ[1])
    # A file that says cd/m2 without meaning it is relative to whoever knows better.
    contradicted = luminance is not None and abs(white_Y / luminance - 1) > _SAME_LUMINANCE
    unit = "relative" if contradicted else measured.unit
    if unit == "cd/m2":
        luminance = None
    elif luminance is None:
        luminance = measured.white_luminance_cd_m2
    profile = DisplayProfile(name, model, source, white_Y, unit, luminance, known)
    return _with(profile, {**given, "white_luminance_cd_m2": None})


def profile_warnings(profile: DisplayProfile, measured: Measurements) -> list[str]:
    """What a user should know of a profile's absolute luminance."""
    luminance, white_Y = profile.white_luminance_cd_m2, profile.white_Y
    if luminance is None:
        return ["the measurements are relative: absolute luminance is unknown until --white-luminance says it"]
    if measured.unit != profile.unit:
        return [f"the file's white of {white_Y:.4g} is taken as relative, since --white-luminance is {luminance:.4g}"]
    stated = measured.white_luminance_cd_m2
    if stated is not None and abs(stated / luminance - 1) > _SAME_LUMINANCE:
        return [f"the file says that white has {stated:.4g} cd/m2; --white-luminance {luminance:.4g} is used"]
    return []


@click.group()
def profile() -> None:
    """Look into display profiles, set what they keep, and write them for other programs."""


@profile.command("show")
@click.argument("profile", metavar="PROFILE")
@as_json
def show(profile: str, json: bool) -> None:
    """What PROFILE says: a built-in name or a JSON file."""
    document = profile_document(load_profile(profile))
    shown = {**document, "state": _told_state(document["state"]), **_told(document)}
    emit(document, json, lambda console: console.print(facts(shown)))


@profile.command("set")
@click.argument("profile", metavar="PROFILE")
@click.option("-o", "--output", type=_PATH, required=True, help="the JSON to write, PROFILE itself if you like")
@state_options
@as_json
def set_command(profile: str, output: Path, json: bool, **given: Any) -> None:
    """Write PROFILE with another state, luminance or scene white; its model stays."""
    if all(value is None for value in given.values()):
        raise DisplayError("nothing to set", remedy="give for example --eye left or --scene-white 0.9")
    changed = _with(load_profile(profile), given)
    write_profile(changed, output)
    document = {**profile_document(changed), "file": str(output)}
    shown = {**document, "state": _told_state(document["state"]), **_told(document)}
    emit(document, json, lambda console: console.print(facts(shown)))


def profile_document(display: DisplayProfile) -> Document:
    """`profile show`: XYZ relative to white Y = 1; gamma by regression through full drive."""
    white, black = display.to_XYZ(np.ones(3)), display.to_XYZ(np.zeros(3))
    primaries = display.to_XYZ(np.eye(3)) - black
    kind = next((name for name, model in MODELS.items() if isinstance(display.model, model)), "sRGB")
    warnings = []
    if display.white_luminance_cd_m2 is None:
        warnings.append("the profile is relative: its absolute luminance is unknown")
    return {
        "name": display.name,
        "model": kind,
        "source": display.source,
        "state": display.state.to_json(),
        "unit": display.unit,
        "white_Y": display.white_Y,
        "white_XYZ": white.tolist(),
        "white_xy": XYZ_to_xy(white).tolist(),
        "primaries": {
            channel: {"xy": XYZ_to_xy(XYZ).tolist(), "Y": float(XYZ[1])}
            for channel, XYZ in zip(_CHANNELS, primaries, strict=True)
        },
        "black_XYZ": black.tolist(),
        "contrast": float(white[1] / black[1]) if black[1] > LEAST_LIGHT else None,
        "gamma": {channel: _gamma(display.model, index) for index, channel in enumerate(_CHANNELS)},
        "peak_luminance_cd_m2": _times(white[1], display.white_luminance_cd_m2),
        "black_luminance_cd_m2": _times(black[1], display.white_luminance_cd_m2),
        "white_luminance_cd_m2": display.white_luminance_cd_m2,
        "scene_white": _scene_white(display),
        "scene_white_set": display.scene_white is not None,
        "warnings": warnings,
    }


def _gamma(model: DisplayModel, index: int) -> dict[str, float]:
    """Gamma of a channel's ramp, whatever its model: the projection of its light on that at full drive."""
    codes = np.linspace(0, 1, 21)
    light = model.forward(codes[:, None] * np.eye(3)[index]) - model.forward(np.zeros(3))
    value, r2 = gamma_fit(codes, light @ light[-1] / (light[-1] @ light[-1]))
    return {"value": value, "r2": r2}


def _with(display: DisplayProfile, given: Mapping[str, Any]) -> DisplayProfile:
    """A profile with what was given, and else as it is."""
    known = {name: value for name, value in given.items() if value is not None}
    luminance, fraction = known.pop("white_luminance_cd_m2", None), known.pop("scene_white", None)
    if "model_name" in known:
        known["model"] = known.pop("model_name")
    changes: dict[str, Any] = {"state": replace(display.state, **known)}
    if luminance is not None:
        changes.update(unit="relative", white_luminance_cd_m2=luminance)
    if fraction is not None:
        changes["scene_white"] = fraction
    return replace(display, **changes)


def _scene_white(display: DisplayProfile) -> float | None:
    """None for a display that has no D65 and was given nothing."""
    try:
        return scene_white(display)
    except DisplayError:
        return None


def _times(Y: float, luminance: float | None) -> float | None:
    return None if luminance is None else float(Y * luminance)


def _told_state(state: Mapping[str, Any]) -> str:
    units = {"warm_up_minutes": "min", "field_deg": "deg"}
    parts = [
        f"{name.rsplit('_', 1)[0] if name in units else name} {_plain(value)} {units.get(name, '')}".strip()
        for name, value in state.items()
    ]
    return "; ".join(parts) or "not stated"


def _plain(value: Any) -> str:
    if isinstance(value, list):
        return ", ".join(f"{each:g}" for each in value)
    return f"{value:g}" if isinstance(value, float) else str(value)


def _told(document: Document) -> dict[str, str]:
    """Entries that need a sentence for people."""
    absolute, fraction = document["peak_luminance_cd_m2"], document["scene_white"]
    default = "" if document["scene_white_set"] else " (default)"
    return {
        "primaries": "; ".join(
            f"{channel}: x {each['xy'][0]:.4f}, y {each['xy'][1]:.4f}, Y {each['Y']:.4f}"
            for channel, each in document["primaries"].items()
        ),
        "gamma": ", ".join(f"{channel} {each['value']:.3f}" for channel, each in document["gamma"].items()),
        "contrast": f"{document['contrast']:.0f} : 1" if document["contrast"] else "unknown: no light in black",
        "peak_luminance_cd_m2": "unknown: the profile is relative" if absolute is None else f"{absolute:.4g}",
        "scene_white": "none: D65 is out of reach" if fraction is None else f"{fraction:.4f} of white{default}",
    }


def add_profile_commands(group: click.Group) -> None:
    """Add this module's commands to the program."""
    profile.add_command(export)
    group.add_command(profile)
