"""What an export is called: fit for a file and for a list of displays."""

from __future__ import annotations

import re

from spectral_core.display.profile import DisplayProfile


def export_name(profile: DisplayProfile) -> str:
    """The profile's name in letters, digits, spaces and ``-_.()``; `display` if nothing is left."""
    name = re.sub(r"[^\w .()-]+", "_", profile.name, flags=re.ASCII)
    return " ".join(name.split()).strip("._- ")[:80] or "display"
