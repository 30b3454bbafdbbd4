"""The command ``spectral-booth``: one module per group of commands."""

from spectral_core.cli.main import main

__all__ = ["main"]
