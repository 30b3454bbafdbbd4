"""Probing a headset's runtime: what it does to codes on their way to the panel, and what undoes it."""
