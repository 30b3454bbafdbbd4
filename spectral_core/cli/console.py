"""What the command line prints: one JSON object, or tables for people; progress on stderr."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from spectral_core.errors import DisplayError

Document = dict[str, Any]
Report = Callable[[float, str], None]


def emit(document: Document, as_json: bool, show: Callable[[Console], None]) -> None:
    """Print the document as JSON, or let `show` draw it; its warnings go to stderr either way."""
    for warning in document.get("warnings", ()):
        print(f"warning: {warning}", file=sys.stderr)
    if as_json:
        print(json.dumps(document, allow_nan=False))
    else:
        show(Console(highlight=False, markup=False, emoji=False))  # names are text, whatever is in them


def table(columns: Sequence[str], rows: Sequence[Sequence[Any]], title: str = "") -> Table:
    """A table; the first column is text, the others are numbers, right-aligned."""
    made = Table(title=title or None, title_justify="left")
    for index, column in enumerate(columns):
        made.add_column(column, justify="left" if index == 0 else "right", overflow="fold")
    for row in rows:
        made.add_row(*(cell(each) for each in row))
    return made


def cell(value: Any) -> str:
    """A value for people: four significant digits, lists side by side, nothing for None."""
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.4f}" if 1e-3 <= abs(value) < 100 else f"{value:.5g}"
    if isinstance(value, (list, tuple)):
        return "  ".join(cell(each) for each in value)
    return str(value)


def rounded(values: Sequence[float | None], decimals: int = 1) -> list[str]:
    """Numbers with a fixed number of decimals, so that columns line up; a dash for None."""
    return ["-" if value is None else f"{value:.{decimals}f}" for value in values]


def facts(document: Document, leave_out: Sequence[str] = ()) -> Table:
    """A two-column table of a document's own entries."""
    shown = [(key, value) for key, value in document.items() if key not in (*leave_out, "warnings")]
    made = Table(show_header=False)
    made.add_column()
    made.add_column(overflow="fold")
    for key, value in shown:
        made.add_row(key, cell(value))
    return made


@contextmanager
def naming(file: Path) -> Iterator[None]:
    """Whatever is wrong with what was read from a file names it."""
    try:
        yield
    except DisplayError as error:
        raise DisplayError(error.problem, where=error.where or file, remedy=error.remedy) from None


@contextmanager
def progress_bar(what: str) -> Iterator[Report]:
    """A bar on stderr while the block runs; silent when stderr is no terminal."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield lambda fraction, text: None
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task(what, total=1.0)
        yield lambda fraction, text: bar.update(task, completed=fraction, description=text)
