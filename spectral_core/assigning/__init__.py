"""Spectra for RGB textures: reflectances whose colours under the scanner's lamp are those of the texels."""

from spectral_core.assigning.assignment import Assignment, assign, spectra_source
from spectral_core.assigning.judging import HeldOut, Spread, held_out
from spectral_core.assigning.library import Library, read_library

__all__ = ["Assignment", "HeldOut", "Library", "Spread", "assign", "held_out", "read_library", "spectra_source"]
