"""Text in panels."""

from __future__ import annotations

import textwrap

import bpy

# Mean width of a character of the interface's font, at a scale of 1.
_CHARACTER_PIXELS = 7.0
# Borders of a box on both sides, and of an icon before the text.
_BOX_PIXELS = 60.0


def draw_lines(layout: bpy.types.UILayout, context: bpy.types.Context, lines: list[str], icon: str) -> None:
    """Lines of text broken to the sidebar's width; the first has the icon."""
    scale = context.preferences.system.ui_scale
    width = max(16, int((context.region.width / scale - _BOX_PIXELS) / _CHARACTER_PIXELS))
    column = layout.column(align=True)
    column.scale_y = 0.85
    for number, line in enumerate(part for each in lines for part in textwrap.wrap(each, width)):
        column.label(text=line, icon="BLANK1" if number else icon)
