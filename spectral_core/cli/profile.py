"""The group ``spectral-booth profile``."""

from __future__ import annotations

import click

from spectral_core.cli.export import export


@click.group()
def profile() -> None:
    """Look into display profiles, and write them for other programs."""


profile.add_command(export)
