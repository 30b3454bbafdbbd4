"""A display profile for other programs: OpenColorIO, .cube, ICC; what is written is read back by another."""

from spectral_core.display.export.cube import CubeInput, export_cube
from spectral_core.display.export.icc import export_icc
from spectral_core.display.export.names import XYZ_VIEW, export_name
from spectral_core.display.export.ocio import OcioExport, blender_config, export_ocio
from spectral_core.display.export.read_back import (
    ReadBack,
    read_back_cube,
    read_back_icc,
    read_back_ocio,
    read_back_ocio_xyz,
)

__all__ = [
    "XYZ_VIEW",
    "CubeInput",
    "OcioExport",
    "ReadBack",
    "blender_config",
    "export_cube",
    "export_icc",
    "export_name",
    "export_ocio",
    "read_back_cube",
    "read_back_icc",
    "read_back_ocio",
    "read_back_ocio_xyz",
]
