"""Options that several commands share."""

from __future__ import annotations

import math
from typing import Any

import click

from spectral_core.standards import DEFAULT_OBSERVER, OBSERVERS


class FiniteRange(click.FloatRange):
    """A range without NaN, which compares as inside any."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """The number, or a usage error."""
        number = float(super().convert(value, param, ctx))
        if math.isnan(number):
            self.fail(f"{value} is not a number", param, ctx)
        return number


as_json = click.option("--json", is_flag=True, help="print one JSON object")
light_option = click.option("--light", metavar="LIGHT", default="D65", show_default=True)
profile_option = click.option(
    "--profile", metavar="PROFILE", default="sRGB", show_default=True, help="built-in display profile or JSON file"
)
observer_option = click.option(
    "--observer", type=click.Choice(list(OBSERVERS)), default=DEFAULT_OBSERVER, show_default=True
)
