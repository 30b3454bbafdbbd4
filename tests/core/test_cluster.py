"""Bakes on a local Dask cluster of two processes."""

from __future__ import annotations

import os
import signal
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spectral_core.baking import bake, projection
from spectral_core.baking.cluster import Cluster, connected
from spectral_core.errors import ClusterError, TextureError
from spectral_core.imaging import oiio
from spectral_core.lights import Light
from spectral_core.textures import Reading, open_texture

pytest.importorskip("distributed", reason="an optional extra")
pytestmark = pytest.mark.filterwarnings("ignore:::distributed", "ignore:::tornado", "ignore::ResourceWarning")

Run = Callable[..., tuple[int, str, str]]
NM = np.arange(400.0, 701.0, 5)
LIGHTS = [Light.builtin(name) for name in ("D65", "A")]


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    from distributed import LocalCluster

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        made = LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50)
        yield made
        made.close()


@pytest.fixture
def texture_path(tmp_path: Path) -> Path:
    cube = np.random.default_rng(0).random((600, 200, len(NM)), dtype=np.float32)
    np.savez(tmp_path / "t.npz", reflectance=cube, wavelengths_nm=NM)
    return tmp_path / "t.npz"


@pytest.fixture(autouse=True)
def small_strips(monkeypatch: pytest.MonkeyPatch) -> None:
    """Enough strips that some are left when a worker dies."""
    monkeypatch.setattr(projection, "_STRIP_BYTES", 20 * 200 * len(NM) * 4)


def pixels(folder: Path) -> dict[str, bytes]:
    """The images' pixels: their headers hold the time."""
    return {path.name: oiio().ImageBuf(str(path)).get_pixels(oiio().FLOAT).tobytes() for path in folder.glob("*.exr")}


def test_the_same_images_as_alone(cluster: Any, texture_path: Path, tmp_path: Path, run: Run) -> None:
    bake(open_texture(texture_path), LIGHTS, tmp_path / "alone")
    options = ("--light", "D65", "--light", "A", "-o", tmp_path / "together")
    code, out, err = run("bake", texture_path, *options, "--cluster", cluster.scheduler_address, "--json")
    assert code == 0, err
    assert '"kept": false' in out
    assert pixels(tmp_path / "together") == pixels(tmp_path / "alone")
    assert len(pixels(tmp_path / "alone")) == 2


def test_files_that_change_between_bakes_and_references_beside_oneself(
    cluster: Any, texture_path: Path, tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Workers stay in their own folder, and had the old file open."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "white.csv").write_text("nm,white\n" + "".join(f"{nm:g},2\n" for nm in NM))
    for value in (0.5, 1.5):
        with np.load(texture_path) as held:
            shape = next(iter(held.values())).shape
        np.savez(texture_path, radiance=np.full(shape, value, np.float32), wavelengths_nm=NM)
        options = ("--white", "white.csv", "--light", "D65", "-o", "out", "--cluster", cluster.scheduler_address)
        code, _, err = run("bake", "t.npz", *options)
        assert code == 0, err
        # Grey, in half floats: 2**-11 of it.
        green = oiio().ImageBuf("out/t_D65.exr").get_pixels(oiio().FLOAT)[..., 1]
        assert np.abs(green - value / 2).max() < value * 2**-11


@pytest.mark.skipif(sys.platform == "win32", reason="there is no SIGKILL on Windows")
def test_a_worker_killed_in_mid_bake_loses_nothing(cluster: Any, texture_path: Path, tmp_path: Path) -> None:
    bake(open_texture(texture_path), LIGHTS, tmp_path / "alone")
    with connected(cluster.scheduler_address) as client:
        workers = client.run(os.getpid)
        assert len(workers) == 2
        victim = min(workers.values())
        seen: list[float] = []

        def kill_one(fraction: float, text: str) -> None:
            seen.append(fraction)
            if len(seen) == 3:
                os.kill(victim, signal.SIGKILL)

        bake(
            open_texture(texture_path), LIGHTS, tmp_path / "together", progress=kill_one,
            strips=Cluster(client, texture_path, Reading()),
        )  # fmt: skip
        assert len(seen) > 20
        assert victim not in client.run(os.getpid).values()
    assert pixels(tmp_path / "together") == pixels(tmp_path / "alone")


def test_errors_of_workers_are_the_users(cluster: Any, texture_path: Path, tmp_path: Path, run: Run) -> None:
    with np.load(texture_path) as archive:
        cube = archive["reflectance"]
    cube[470, 3, 7] = np.nan
    np.savez(texture_path, reflectance=cube, wavelengths_nm=NM)
    options = ("--light", "A", "-o", tmp_path / "out", "--bad-pixels", "refuse", "--cluster", cluster.scheduler_address)
    code, _, err = run("bake", texture_path, *options)
    assert code == 2
    assert "no finite number in row 470" in err
    assert err.count("\n") == 1
    assert list((tmp_path / "out").iterdir()) == []


def test_a_cluster_that_is_not_there(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, texture_path: Path, run: Run
) -> None:
    monkeypatch.setattr("spectral_core.baking.cluster._CONNECTING_SECONDS", 0.5)
    for address in ("tcp://127.0.0.1:9", "nonsense", "tcp://[", "x://y"):
        code, _, err = run("bake", texture_path, "--light", "A", "-o", tmp_path, "--cluster", address)
        assert code == 2, err
        assert "no scheduler answers" in err
        assert err.count("\n") == 1
    assert issubclass(ClusterError, Exception)
    assert TextureError is not ClusterError
