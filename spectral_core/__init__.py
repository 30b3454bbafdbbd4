"""Spectral core."""
