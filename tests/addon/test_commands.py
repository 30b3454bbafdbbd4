"""The background commands, in processes of their own."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest


def _command(*arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "blender_addon.command", *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )


def _refused(done: subprocess.CompletedProcess[str]) -> str:
    """The one line of an error; everything else on stderr is Blender's or progress."""
    assert done.returncode == 2, done.stderr
    assert "Traceback" not in done.stderr + done.stdout
    lines = [line for line in done.stderr.splitlines() if line.startswith("error: ")]
    assert len(lines) == 1, done.stderr
    return lines[0]


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory, shrunk: Callable[[str], str]) -> Path:
    from spectral_core.scene import bundled_scene

    folder = tmp_path_factory.mktemp("command")
    text = bundled_scene("colorchecker").read_text(encoding="utf-8")
    (folder / "chart.toml").write_text(shrunk(text), encoding="utf-8")
    result = folder / "result.json"
    done = _command("build", folder / "chart.toml", "-o", folder / "chart.blend", "--result", result)
    assert done.returncode == 0, done.stderr
    document = json.loads(result.read_text(encoding="utf-8"))
    assert document["objects"] == 26
    assert document["white_luminance"] == pytest.approx(0.85, rel=1e-4)  # float32 through the render
    return folder / "chart.blend"


def test_verify_and_render_a_built_file(built: Path) -> None:
    result = built.with_suffix(".json")
    done = _command("verify", built, "--light", "A", "--level", "2", "--result", result)
    assert done.returncode == 0, done.stderr
    (light,) = json.loads(result.read_text(encoding="utf-8"))["lights"]
    assert light["level2"]["dE00_in_gamut"]["max"] < 0.05  # see test_pixels
    picture = built.with_suffix(".png")
    done = _command("render", built, "--light", "A", "--level", "1", "-o", picture)
    assert done.returncode == 0, done.stderr
    assert picture.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("build", "nowhere.toml", "-o", "x.blend"), "nowhere.toml: no such file"),
        (("verify", "nowhere.blend"), "nowhere.blend: no such file"),
        (("render", "nowhere.blend"), "required: -o/--output"),
        (("dance",), "invalid choice: 'dance'"),
        ((), "required: VERB"),
    ],
)
def test_bad_arguments_end_with_one_line_and_code_2(arguments: tuple[str, ...], message: str) -> None:
    assert message in _refused(_command(*arguments))


def test_bad_content_ends_with_one_line_and_code_2(built: Path, tmp_path: Path) -> None:
    assert "'nope'" in _refused(_command("verify", built, "--light", "nope"))
    broken = tmp_path / "broken.blend"
    broken.write_bytes(b"no blender file")
    assert "broken.blend" in _refused(_command("verify", broken))
    assert "end it with .blend" in _refused(_command("build", built.with_suffix(".toml"), "-o", tmp_path / "x.txt"))
