"""Work that comes in steps: a generator yields what was done so far, and returns the result."""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import TypeVar

Step = TypeVar("Step")
Result = TypeVar("Result")


def finished(steps: Generator[Step, None, Result], told: Callable[[Step], object] | None = None) -> Result:
    """What steps return, all taken at once; `told` hears of each."""
    while True:
        try:
            step = next(steps)
        except StopIteration as end:
            result: Result = end.value
            return result
        if told:
            told(step)
