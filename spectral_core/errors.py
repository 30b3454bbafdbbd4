"""Exceptions a user can meet: each says what is wrong, where, and what to do."""

from __future__ import annotations

from pathlib import Path


class SpectralBoothError(Exception):
    """Base of all expected errors.

    The message is one line, ``where: problem; remedy``, fit to be shown to a user as it is: what files
    put into it cannot move a terminal's cursor.
    """

    def __init__(self, problem: str, *, where: str | Path | None = None, remedy: str = "") -> None:
        self.problem = problem
        self.where = None if where is None else str(where)
        self.remedy = remedy
        head = f"{self.where}: " if self.where else ""
        tail = f"; {remedy}" if remedy else ""
        line = " ".join(f"{head}{problem}{tail}".split())
        super().__init__(line if line.isprintable() else "".join(c if c.isprintable() else "?" for c in line))


class SpectrumError(SpectralBoothError):
    """A table of spectra (SPD, reflectance) that cannot be used."""


class LightError(SpectralBoothError):
    """A light that does not exist, has no colour or cannot be designed."""


class TextureError(SpectralBoothError):
    """A hyperspectral texture that cannot be used."""


class DisplayError(SpectralBoothError):
    """A display profile that cannot be used."""


class SceneError(SpectralBoothError):
    """A scene description that cannot be used."""


class OutputError(SpectralBoothError):
    """A result that cannot be written."""


class ClusterError(SpectralBoothError):
    """A cluster that is not there, or did not do its part."""


class BlenderError(SpectralBoothError):
    """Blender is missing, or did not do what was asked."""


class MissingExtraError(SpectralBoothError):
    """An optional package that a task needs is not installed."""
