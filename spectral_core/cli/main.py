"""The command ``spectral-booth``."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import click

from spectral_core import documents
from spectral_core.cli.assign import add_assign_command
from spectral_core.cli.blender import add_blender_commands
from spectral_core.cli.compare import add_compare_command
from spectral_core.cli.console import emit, facts, rounded, table
from spectral_core.cli.display import add_display_commands
from spectral_core.cli.luminance import add_luminance_commands
from spectral_core.cli.options import FiniteRange, as_json, light_option, observer_option, profile_option
from spectral_core.cli.patches import add_patch_commands
from spectral_core.cli.probe import add_probe_command
from spectral_core.cli.profile import add_profile_commands
from spectral_core.cli.textures import add_texture_commands
from spectral_core.display import load_profile
from spectral_core.errors import LightError, SpectralBoothError
from spectral_core.lights import Light
from spectral_core.spectra import colorchecker_spectra, read_spectra, write_spectra


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(package_name="spectral-booth")
def cli() -> None:
    """Spectrally true colour for Blender and VR light booths.

    A LIGHT is a built-in name (see `lights`) or a CSV file: nm, power.
    """


@cli.command()
@click.argument("light")
@click.option("--luminance", type=FiniteRange(0, 1e9, min_open=True), default=100.0, show_default=True)
@profile_option
@observer_option
@as_json
def light(light: str, luminance: float, profile: str, observer: str, json: bool) -> None:
    """Colour and quality of a LIGHT."""
    document = documents.light_document(Light.load(light), luminance, load_profile(profile), observer)
    emit(document, json, lambda console: console.print(facts(document)))


@cli.command()
@as_json
def lights(json: bool) -> None:
    """List the built-in lights."""
    document = documents.lights_document()
    rows = [
        [each["name"], each["kind"], *rounded(each["xy"], 4), *rounded([each["cct_K"]], 0), *rounded([each["rf"]])]
        for each in document["lights"]
    ]
    columns = ("light", "kind", "x", "y", "CCT / K", "Rf")
    emit(document, json, lambda console: console.print(table(columns, rows)))


@cli.command("light-design")
@click.option("--match", metavar="LIGHT", help="the light whose chromaticity is wanted; D65 if left out")
@click.option("--peak", type=float, metavar="NM", help="two spectral lines, this one and one that is solved")
@click.option("--leds", type=int, metavar="N", help="a mixture of this many LEDs")
@click.option("--rf", type=float, help="the wanted CIE 224 Rf of the mixture")
@click.option("--xy", metavar="X,Y", help="the wanted chromaticity, instead of --match")
@click.option(
    "--cct", type=float, metavar="K", help="the wanted CCT on the daylight or Planckian locus, instead of --match"
)
@click.option("-o", "--output", type=click.Path(path_type=Path), help="write the SPD as CSV")
@observer_option
@as_json
def light_design(
    match: str | None, peak: float | None, leds: int | None, rf: float | None, xy: str | None, cct: float | None,
    output: Path | None, observer: str, json: bool,
) -> None:  # fmt: skip
    """Design a light of a given chromaticity: two lines (--peak) or LEDs (--leds, --rf)."""
    if (peak is None) == (leds is None):
        raise LightError(
            "give either --peak or --leds", remedy="for example --match D65 --peak 456, or --leds 6 --rf 88"
        )
    if leds is not None and rf is None:
        raise LightError("--leds needs the wanted Rf", remedy="for example --leds 6 --rf 88")
    target = documents.target_chromaticity(match, xy, cct, observer)
    designed, document = documents.design(target, peak, leds, rf, observer)
    if output is not None:
        powers, is_lines = documents.design_table(designed)
        write_spectra(output, designed.wavelengths_nm, powers[None, :], (designed.name,), is_lines)
        document["file"] = str(output)
    emit(document, json, lambda console: console.print(facts(document, documents.long_lists(document))))


@cli.command()
@click.argument("file")
@light_option
@profile_option
@observer_option
@as_json
def reflectance(file: str, light: str, profile: str, observer: str, json: bool) -> None:
    """Colours of the reflectances in FILE (CSV: nm, one column a spectrum) under a light.

    FILE may be `colorchecker`, the 24 built-in patches.
    """
    spectra = colorchecker_spectra() if file == "colorchecker" else read_spectra(file, "reflectance")
    document = documents.reflectance_document(spectra, Light.load(light), load_profile(profile), observer)
    rows = [
        [each["name"], *rounded(each["Lab"]), *rounded(each["rgb_8bit"]), each["in_gamut"]]
        for each in document["colours"]
    ]
    columns = (f"under {document['light']}", "L*", "a*", "b*", "R", "G", "B", "in gamut")
    emit(document, json, lambda console: console.print(table(columns, rows)))


add_display_commands(cli)
add_profile_commands(cli)
add_luminance_commands(cli)
add_probe_command(cli)
add_compare_command(cli)
add_assign_command(cli)
add_patch_commands(cli)
add_texture_commands(cli)
add_blender_commands(cli)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line: 0 done, 1 a check failed, 2 bad input with one line on stderr."""
    try:
        result = cli.main(args=None if argv is None else list(argv), prog_name="spectral-booth", standalone_mode=False)
    except SpectralBoothError as error:
        return _refuse(str(error))
    except click.exceptions.NoArgsIsHelpError as error:
        print(error.format_message())
        return 2
    except click.ClickException as error:
        return _refuse(f"{error.format_message()} (see `spectral-booth --help`)")
    except click.Abort:
        print("stopped; nothing half-written is left", file=sys.stderr)
        return 130
    except BrokenPipeError:
        return 0
    return result if isinstance(result, int) else 0


def _refuse(message: str) -> int:
    print(f"error: {' '.join(message.split())}", file=sys.stderr)
    return 2
