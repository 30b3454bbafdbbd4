"""A scene of 200 surfaces, 4 of them textures, that one look of its camera shows all."""

from __future__ import annotations

from pathlib import Path

import numpy as np

COLUMNS = 14
TEXTURES = 4
UNIFORM = COLUMNS * COLUMNS
LIGHTS = ("D65", "A", "FL11")
_NM = np.arange(400.0, 701.0, 10.0)
_TEXELS = 32

_HEAD = f"""
format = 1
name = "Many surfaces"
lights = {list(LIGHTS)}
light = "D65"
[white]
object = "u0"
luminance = 0.8
[camera]
projection = "orthographic"
location = [0.0, 0.0, 1.0]
target = [0.0, 0.0, 0.0]
width = 1.9
[render]
samples = 1
[[lamps]]
name = "sun"
type = "sun"
location = [0.0, 0.0, 1.0]
target = [0.0, 0.0, 0.0]
"""


def write_scene(folder: Path) -> Path:
    """Its description, and the files that it names."""
    rng = np.random.default_rng(0)
    names = [f"u{number}" for number in range(UNIFORM)]
    columns = np.vstack([_NM, _smooth(rng, UNIFORM).T.reshape(UNIFORM, -1)]).T
    rows = [",".join(["wavelength", *names])] + [",".join(f"{each:.5f}" for each in row) for row in columns]
    (folder / "many.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    text = [_HEAD]
    for number, name in enumerate(names):
        x, y = number % COLUMNS - (COLUMNS - 1) / 2, number // COLUMNS - (COLUMNS - 1) / 2
        text.append(f'[surfaces.{name}]\nfile = "many.csv"\nspectrum = "{name}"\n')
        text.append(_plane(name, 0.06 * x, 0.06 * y + 0.08, 0.05))
    for number in range(TEXTURES):
        name = f"t{number}"
        cube = _smooth(rng, _TEXELS * _TEXELS).T.reshape(_TEXELS, _TEXELS, -1).astype(np.float32)
        np.savez(folder / f"{name}.npz", reflectance=cube, wavelengths_nm=_NM)
        text.append(f'[surfaces.{name}]\ntexture = "{name}.npz"\n')
        text.append(_plane(name, 0.2 * (number - 1.5), -0.42, 0.15))
    path = folder / "many.toml"
    path.write_text("".join(text), encoding="utf-8")
    return path


def _plane(name: str, x: float, y: float, side: float) -> str:
    place = f"location = [{x:.3f}, {y:.3f}, 0.0]\nsize = [{side}, {side}, 0.0]\n"
    return f'[[objects]]\nname = "{name}"\nshape = "plane"\nsurface = "{name}"\n{place}'


def _smooth(rng: np.random.Generator, count: int) -> np.ndarray:
    """(bands, count) reflectances as wide as those of paints: three broad bumps each."""
    centres, widths = rng.uniform(400, 700, (3, count)), rng.uniform(40, 120, (3, count))
    bumps = np.exp(-(((_NM[:, None, None] - centres) / widths) ** 2)) * rng.uniform(0.05, 0.5, (3, count))
    return np.clip(0.03 + bumps.sum(axis=1), 0, 0.95)
