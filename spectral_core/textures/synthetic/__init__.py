"""Textures that are computed, not captured."""
