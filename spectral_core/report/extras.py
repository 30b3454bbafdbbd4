"""The report's optional packages, imported on first use."""

from __future__ import annotations

import importlib
from typing import Any

from spectral_core.errors import MissingExtraError


def extra(module: str) -> Any:
    """Import a module of the ``report`` extra.

    Raises
    ------
    MissingExtraError
        If it is not installed; the message says what to install.
    """
    try:
        return importlib.import_module(module)
    except ImportError:
        package = {"PIL": "pillow"}.get(module.split(".")[0], module.split(".")[0])
        raise MissingExtraError(
            f"a report needs {package}, which is not installed", remedy="pip install 'spectral-booth[report]'"
        ) from None
