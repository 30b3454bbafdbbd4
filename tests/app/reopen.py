"""Runs in the background on a saved file: ``reopen.py -- RESULT.json`` writes what it shows."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import bpy

sys.path.append(str(Path(__file__).parent))
from window_state import state

managed = next(scene for scene in bpy.data.scenes if scene.spectral_booth.is_managed)
Path(sys.argv[-1]).write_text(json.dumps(state(managed)), encoding="utf-8")
