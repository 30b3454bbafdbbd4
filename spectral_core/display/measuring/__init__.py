"""Measuring a display: the patches to show, and the readings that come back."""
