"""What is installed is what is in the repository."""

import tomllib
from pathlib import Path

PROJECT = Path(__file__).parents[2]


def test_every_package_is_listed():
    # A folder that is not listed is missing from the wheel and from the extension, though not from the tests.
    settings = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))
    listed = settings["tool"]["setuptools"]["packages"]
    folders = {
        path.parent.relative_to(PROJECT)
        for top in ("spectral_core", "blend_scenes", "blender_addon")
        for path in (PROJECT / top).rglob("__init__.py")
    }
    assert sorted(listed) == sorted(".".join(folder.parts) for folder in folders)
