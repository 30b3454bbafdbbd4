"""Self-contained HTML pages from this package's templates and its one style sheet."""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import Any

from spectral_core.files import atomic_path
from spectral_core.report import numerals
from spectral_core.report.extras import extra


def write_page(path: Path, template: str, context: dict[str, Any]) -> None:
    """Write a template of this package as one file, the same bytes for the same context.

    Raises
    ------
    MissingExtraError
        If jinja2 is not installed.
    OutputError
        If the file cannot be written.
    """
    jinja2 = extra("jinja2")
    environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(_resource),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters.update(fixed=numerals.fixed, small=numerals.small, percent=numerals.percent)
    environment.globals.update(css=_resource("report.css"), count=numerals.count)
    text = environment.get_template(template).render(context)
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _resource(name: str) -> str:
    return resources.files("spectral_core.report").joinpath(name).read_text(encoding="utf-8")
