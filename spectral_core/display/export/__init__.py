"""A display profile for other programs: OpenColorIO, .cube, ICC; each written file is read back by another."""

from spectral_core.display.export.ocio import OcioExport, blender_config, export_ocio

__all__ = ["OcioExport", "blender_config", "export_ocio"]
