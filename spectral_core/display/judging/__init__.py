"""Judging a display: predicted against measured, left eye against right, centre against edge."""
