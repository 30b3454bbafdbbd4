"""Options that several commands share."""

from __future__ import annotations

import click

from spectral_core.standards import DEFAULT_OBSERVER, OBSERVERS

as_json = click.option("--json", is_flag=True, help="print one JSON object")
light_option = click.option("--light", metavar="LIGHT", default="D65", show_default=True)
profile_option = click.option(
    "--profile", metavar="PROFILE", default="sRGB", show_default=True, help="built-in display profile or JSON file"
)
observer_option = click.option(
    "--observer", type=click.Choice(list(OBSERVERS)), default=DEFAULT_OBSERVER, show_default=True
)
