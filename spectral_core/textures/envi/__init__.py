"""ENVI images: a header of text and a file of samples."""
