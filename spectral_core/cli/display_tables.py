"""What people see of `characterise`: checks, models, advice."""

from __future__ import annotations

from rich.console import Console

from spectral_core.cli.console import Document, rounded, table

_MARKS = {True: "pass", False: "FAIL", None: "-"}


def show_characterisation(console: Console, document: Document) -> None:
    """The measurements in a line, a table of checks, a table of models."""
    white = f"white {document['white_XYZ'][1]:.5g}, black {document['black_XYZ'][1]:.3g} {document['unit']}"
    gamma = ", ".join(f"{name} {each['value']:.2f}" for name, each in document["gamma"].items() if each["r2"] > 0)
    console.print(f"{document['patches']} patches; {white}" + (f"; gamma {gamma}" if gamma else ""))
    rows = [
        [each["name"], *rounded([each["value"]], 2), *rounded([each["limit"]], 2), each["unit"], _MARKS[each["passed"]]]
        for each in document["checks"]
    ]
    console.print(table(("check", "found", "at most", "unit", "verdict"), rows))
    hints = dict.fromkeys(each["advice"] for each in document["checks"] if each["passed"] is None)
    for hint in hints:
        console.print(f"- {hint}", soft_wrap=True)
    rows = [_model_row(each, each["name"] == document["model"]) for each in document["models"]]
    columns = ("model (* chosen)", "mean", "95 %", "max", "fit", "us/pixel")
    console.print(table(columns, rows, "dE00 on held-out mixes, and of the fit"))


def show_advice(console: Console, document: Document) -> None:
    """What each size promises, and what to do."""
    rows = [
        [
            each["patches"], each["set"], *rounded([each["dE00"]["mean"], each["dE00"]["spread"]], 2),
            "*" if each["chosen"] else "",
        ]
        for each in document["predicted"]
    ]  # fmt: skip
    console.print(table(("patches", "set", "mean dE00", "+-", "advised"), rows))
    console.print(document["why"], soft_wrap=True)


def _model_row(each: Document, chosen: bool) -> list[str]:
    held_out = each["held_out"] or {"mean": None, "p95": None, "max": None}
    figures = [held_out[key] for key in ("mean", "p95", "max")] + [each["fit"]["mean"]]
    cost = rounded([each["nanoseconds_per_pixel"] / 1000], 2)
    return [f"{each['name']} {'*' if chosen else ''}".strip(), *rounded(figures, 3), *cost]
