"""Textures in image formats: one image per wavelength, multi-band TIFF, spectral OpenEXR."""
