"""Build the Blender extension: one zip of pure wheels for every platform and Blender from 4.5 on.

Plain Python 3.11 and pip, no Blender: ``python tools/build_extension.py [--validate]``. The zip
goes to ``dist/``. ``--validate`` asks Blender's own checker, which comes with the bpy wheel of
this environment or with the application named by ``BLENDER``.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib.util
import json
import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
import zipfile
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[1]
ADDON = PROJECT / "blender_addon"
MANIFEST = "blender_manifest.toml"
CORE_NAME = "spectral-booth-core"
CORE_PACKAGES = ("spectral_core", "blend_scenes")
# Exactly these: what ships must be what was tested. 0.4.7 is the first colour-science without
# scipy and imageio; Blender lacks the typing_extensions that it imports.
BUNDLED = ("colour-science==0.4.7", "typing_extensions==4.16.0")
# Blender never unpacks a wheel of a name and version that it has, so that each development build
# needs a version of its own; a zip without time stamps is the same for the same sources.
_ZIP_TIME = (1980, 1, 1, 0, 0, 0)
_IGNORED = shutil.ignore_patterns("__pycache__", "*.pyc", ".*")


def main() -> int:
    """Build, and validate if asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=PROJECT / "dist", help="folder of the zip")
    parser.add_argument("--release", action="store_true", help="give the core's wheel the plain version")
    parser.add_argument("--validate", action="store_true", help="let Blender's checker judge the zip")
    arguments = parser.parse_args()
    path = build(arguments.output, arguments.release)
    if arguments.validate:
        validate(path)
    print(path)
    return 0


def build(output: Path, release: bool = False) -> Path:
    """Make the zip and return its path."""
    manifest = (ADDON / MANIFEST).read_text(encoding="utf-8")
    version = tomllib.loads(manifest)["version"]
    project = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    if version != project["version"]:
        sys.exit(f"error: {MANIFEST} says version {version}, pyproject.toml {project['version']}; make them equal")
    with tempfile.TemporaryDirectory() as folder:
        stage = Path(folder) / "extension"
        shutil.copytree(ADDON, stage, ignore=_IGNORED)
        shutil.copy2(PROJECT / "LICENSE", stage)
        wheels = stage / "wheels"
        _download(wheels)
        _build_core(wheels, Path(folder) / "core", version if release else f"{version}+{_digest()}")
        names = sorted(each.name for each in wheels.iterdir())
        impure = [name for name in names if not name.endswith("-none-any.whl")]
        if impure:
            sys.exit(f"error: not pure Python: {', '.join(impure)}")
        (stage / MANIFEST).write_text(_with_wheels(manifest, names), encoding="utf-8")
        output.mkdir(parents=True, exist_ok=True)
        path = output / f"{tomllib.loads(manifest)['id']}-{version}.zip"
        _zip(stage, path)
    return path


def validate(path: Path) -> None:
    """Let Blender's own checker judge the zip; ends the program if it refuses."""
    found = importlib.util.find_spec("bpy")
    if os.environ.get("BLENDER"):
        command = [os.environ["BLENDER"], "--command", "extension", "validate"]
    elif found is not None and found.origin:
        checker = next(Path(found.origin).parent.glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py"))
        command = [sys.executable, str(checker), "validate"]
    else:
        sys.exit("error: no checker here; install bpy in this environment, or set BLENDER")
    if subprocess.run([*command, str(path)], check=False).returncode:
        sys.exit(f"error: {path} is no valid extension")


def _download(folder: Path) -> None:
    # Neither numpy nor anything else that Blender has: a second copy would break other add-ons.
    _pip("download", "--no-deps", "--only-binary=:all:", "--dest", str(folder), *BUNDLED)


def _build_core(folder: Path, stage: Path, version: str) -> None:
    """The wheel of the core alone: inside Blender the add-on is the extension, not a package."""
    for name in CORE_PACKAGES:
        shutil.copytree(PROJECT / name, stage / name, ignore=_IGNORED)
    shutil.copy2(PROJECT / "LICENSE", stage)
    settings = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))
    data = {name: settings["tool"]["setuptools"]["package-data"][name] for name in CORE_PACKAGES}
    packages = [each for each in settings["tool"]["setuptools"]["packages"] if each.split(".")[0] in CORE_PACKAGES]
    lines = [
        "[build-system]",
        f"requires = {json.dumps(settings['build-system']['requires'])}",
        f"build-backend = {json.dumps(settings['build-system']['build-backend'])}",
        "[project]",
        f"name = {json.dumps(CORE_NAME)}",
        f"version = {json.dumps(version)}",
        f"description = {json.dumps(settings['project']['description'])}",
        f"license = {{ text = {json.dumps(settings['project']['license']['text'])} }}",
        "[tool.setuptools]",
        f"packages = {json.dumps(packages)}",
        "[tool.setuptools.package-data]",
        *(f"{name} = {json.dumps(patterns)}" for name, patterns in data.items()),
    ]
    (stage / "pyproject.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")
    _pip("wheel", "--no-deps", "--wheel-dir", str(folder), str(stage))


def _digest() -> str:
    """Short digest of the core's sources: the same sources make the same version."""
    digest = hashlib.sha256()
    for name in CORE_PACKAGES:
        for path in sorted((PROJECT / name).rglob("*")):
            if path.is_file() and "__pycache__" not in path.parts:
                digest.update(path.relative_to(PROJECT).as_posix().encode())
                digest.update(path.read_bytes())
    return f"d{digest.hexdigest()[:12]}"


def _with_wheels(manifest: str, names: list[str]) -> str:
    """The manifest with the wheels before its first table, where a TOML key of the top belongs."""
    listed = "wheels = [\n" + "".join(f'    "./wheels/{name}",\n' for name in names) + "]\n\n"
    head, table, rest = manifest.partition("[permissions]")
    return head + listed + table + rest


def _zip(stage: Path, path: Path) -> None:
    temporary = path.with_suffix(".part")
    with zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive:
        for each in sorted(stage.rglob("*")):
            if each.is_file():
                info = zipfile.ZipInfo(each.relative_to(stage).as_posix(), _ZIP_TIME)
                info.external_attr = 0o644 << 16
                archive.writestr(info, each.read_bytes(), zipfile.ZIP_DEFLATED)
    temporary.replace(path)


def _pip(*arguments: str) -> None:
    # The date of the files inside the core's wheel, for the reason above.
    environment = {**os.environ, "SOURCE_DATE_EPOCH": "315532800"}
    command = [sys.executable, "-m", "pip", "--quiet", *arguments]
    if subprocess.run(command, check=False, env=environment).returncode:
        sys.exit(f"error: pip {arguments[0]} failed; is there a network, or a folder of wheels in PIP_FIND_LINKS?")


if __name__ == "__main__":
    sys.exit(main())
