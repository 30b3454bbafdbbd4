"""What an export is called: fit for a file and for a list of displays."""

from __future__ import annotations

import re

from spectral_core.display.profile import DisplayProfile

# The view whose pixels are CIE XYZ (R = X, G = Y, B = Z; Y = 1 is the display's white) instead of Rec.709.
XYZ_VIEW = "Spectral XYZ"


def export_name(profile: DisplayProfile) -> str:
    """The profile's name, and its eye, in letters, digits, spaces and ``-_.()``; `display` if nothing is left."""
    eye = profile.state.eye
    named = f"{profile.name} {eye}" if eye in ("left", "right") and eye not in profile.name else profile.name
    name = re.sub(r"[^\w .()-]+", "_", named, flags=re.ASCII)
    return " ".join(name.split()).strip("._- ")[:80] or "display"
