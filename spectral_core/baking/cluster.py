"""The strips of a bake, computed by the workers of a Dask cluster.

Each worker opens the texture itself, so all machines must see the file under the same name; pixels
come back, and this process writes them. A strip whose worker dies is computed by another one.
Dask sends Python objects between its machines: use a scheduler that you trust.
"""

from __future__ import annotations

import socket
import threading
import uuid
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any

from spectral_core.baking.products import own_threads
from spectral_core.baking.projection import Strip, read_rows, strips
from spectral_core.baking.strips import BakedStrip, Recipe, bake_rows
from spectral_core.errors import ClusterError, MissingExtraError
from spectral_core.textures import HyperspectralTexture, Reading, open_texture

# Strips under way for each thread of the cluster: one is computed, the others travel.
_STRIPS_PER_THREAD = 3
_CONNECTING_SECONDS = 15
_DEFAULT_PORT = 8786

# Where a texture is, how it is read, and for which bake.
_Source = tuple[str, Reading, str]


class Cluster:
    """A Dask cluster that computes strips; the `strips` of `spectral_core.baking.bake`.

    Parameters
    ----------
    client
        A `distributed.Client`.
    path, reading
        Where the workers find the texture, and how they read it.
    """

    def __init__(self, client: Any, path: Path, reading: Reading) -> None:
        self._client = client
        self._path = path
        self._reading = reading

    def __call__(self, texture: HyperspectralTexture, plan: Recipe) -> Iterator[BakedStrip]:
        """All strips from the top; a bounded number of them is under way.

        Raises
        ------
        ClusterError
            If workers keep dying, or the scheduler is gone.
        """
        waiting: deque[Any] = deque()
        # Workers live on from bake to bake, and files may change in between: each bake opens them anew.
        source = (str(self._path), self._reading, uuid.uuid4().hex)
        threads = max(1, sum(self._client.nthreads().values()))
        try:
            for strip in strips(texture):
                waiting.append(self._client.submit(_bake_part, source, plan, strip, pure=False))
                if len(waiting) >= _STRIPS_PER_THREAD * threads:
                    yield self._result(waiting.popleft())
            while waiting:
                yield self._result(waiting.popleft())
        finally:
            self._client.cancel(list(waiting))

    def _result(self, future: Any) -> BakedStrip:
        from distributed import KilledWorker
        from distributed.client import FutureCancelledError

        try:
            result: BakedStrip = future.result()
        except KilledWorker as error:
            raise ClusterError(
                f"workers died again and again over one part ({str(error)[:120]})", remedy="see the workers' logs"
            ) from None
        except (FutureCancelledError, TimeoutError, OSError) as error:
            raise ClusterError(
                f"the cluster was lost ({type(error).__name__}: {str(error)[:120]})",
                remedy="start it again; whole images are kept",
            ) from None
        future.release()
        return result


@contextmanager
def connected(address: str) -> Iterator[Any]:
    """A client of the scheduler at an address like ``tcp://host:8786``.

    Raises
    ------
    MissingExtraError
        Without `dask.distributed`.
    ClusterError
        If nobody answers there, or there is no worker.
    """
    try:
        from distributed import Client
    except ImportError:
        raise MissingExtraError(
            "a cluster needs dask.distributed", remedy="pip install 'spectral-booth[cluster]'"
        ) from None
    try:
        _check_that_somebody_listens(address)
        client: Any = Client(address, timeout=_CONNECTING_SECONDS, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ClusterError(
            f"no scheduler answers ({str(error)[:120]})", where=address, remedy="start one with `dask scheduler`"
        ) from None
    try:
        if not client.nthreads():
            raise ClusterError("has no workers", where=address, remedy=f"start some with `dask worker {address}`")
        yield client
    finally:
        client.close()


def _check_that_somebody_listens(address: str) -> None:
    """Before a client is made: one that finds nobody keeps trying, and can hang when it is given up."""
    from distributed.comm.addressing import parse_host_port

    scheme, _, place = address.rpartition("://")
    if scheme not in ("", "tcp", "tls"):
        raise ValueError(f"{scheme} is neither tcp nor tls")
    host, port = parse_host_port(place, _DEFAULT_PORT)
    socket.create_connection((host, port), timeout=_CONNECTING_SECONDS).close()


def _bake_part(source: _Source, plan: Recipe, strip: Strip) -> BakedStrip:
    """What a worker does."""
    texture = _opened(source, threading.get_ident())
    with own_threads() as product:
        return bake_rows(texture, plan, read_rows(texture, plan.how, Strip(*strip)), product)


@lru_cache(maxsize=16)
def _opened(source: _Source, thread: int) -> HyperspectralTexture:
    """A texture for each bake and thread, since not all formats can be read by several at once."""
    path, reading, _ = source
    return open_texture(path, reading)
