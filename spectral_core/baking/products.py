"""The matrix product of pixels and weights, for threads that each have their own pixels.

Two things stand between a plain product and the processor's limit here, both measured
(``benchmarks/projection.py``). A BLAS that starts threads of its own gets in the way of ours, so
products are kept below the size where it does. And NumPy 1.26 brings an OpenBLAS of 2023 that takes
later processors for ones of 2004 and computes without their vector instructions, at a third of the
speed; the SciPy that colour-science brings there has a newer one, and is asked instead.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

import numpy as np

from spectral_core.arrays import Float32Array
from spectral_core.textures.base import Samples

Product = Callable[[Float32Array, Float32Array, Float32Array], None]
"""``product(pixels (m, bands), factors (bands, n), out (m, n))``: one of the pixels' axes is contiguous."""

# OpenBLAS starts threads beyond m n k = 65536 times its GEMM_MULTITHREAD_THRESHOLD of 4 (interface/gemm.c).
_LARGEST_SINGLE_THREADED = 262_144
_FEWEST_ROWS = 16
_FLOAT_BYTES = 4


@contextmanager
def own_threads() -> Iterator[Product]:
    """The fastest product at hand, to be called from several threads at once while the block runs."""
    sgemm = _better_sgemm()
    if sgemm is None:
        yield _by_numpy
        return
    with one_blas_thread():
        yield _by_blas(sgemm)


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """No thread of BLAS is woken while the block runs, where threadpoolctl is at hand.

    The OpenBLAS of NumPy 1.26 wakes them even to invert three by three numbers; then they spin for a tenth
    of a second, and take a processor from whatever comes next.
    """
    controller = _libraries()
    if controller is None:
        yield
        return
    with controller.limit(limits=1, user_api="blas"):
        yield


@cache
def _libraries() -> Any | None:
    """The BLAS libraries of this process; looking for them takes a millisecond."""
    try:
        import threadpoolctl
    except ImportError:
        return None
    _better_sgemm()  # so that SciPy's is among them
    return threadpoolctl.ThreadpoolController()


def is_ready(pixels: Samples) -> bool:
    """Whether pixels (m, bands) can be multiplied as they lie in memory: float32, one axis contiguous, no overlap."""
    return pixels.dtype == np.float32 and (_along_bands(pixels) or _along_pixels(pixels))


def _along_bands(pixels: Samples) -> bool:
    return pixels.strides[1] == _FLOAT_BYTES and _is_leading(pixels.strides[0], pixels.shape[1])


def _along_pixels(pixels: Samples) -> bool:
    return pixels.strides[0] == _FLOAT_BYTES and _is_leading(pixels.strides[1], pixels.shape[0])


def _is_leading(stride: int, count: int) -> bool:
    return stride >= count * _FLOAT_BYTES and stride % _FLOAT_BYTES == 0


def _by_numpy(pixels: Float32Array, factors: Float32Array, out: Float32Array) -> None:
    """Many small products in one call, each too small for OpenBLAS to start threads."""
    bands, columns = factors.shape
    rows = max(_FEWEST_ROWS, _LARGEST_SINGLE_THREADED // (bands * columns) // _FEWEST_ROWS * _FEWEST_ROWS)
    whole = len(pixels) // rows * rows
    if whole:
        np.matmul(pixels[:whole].reshape(-1, rows, bands), factors, out=out[:whole].reshape(-1, rows, columns))
    if whole < len(pixels):
        np.matmul(pixels[whole:], factors, out=out[whole:])


def _better_sgemm() -> Any | None:
    """SciPy's, where NumPy brings an old one."""
    return _scipy_sgemm() if int(np.__version__.split(".")[0]) < 2 else None


@cache
def _scipy_sgemm() -> Any | None:
    """The sgemm that SciPy exports to other languages, as a function that lets go of the interpreter.

    Its Python wrapper holds the interpreter while it computes. None where SciPy or threadpoolctl is
    missing, or SciPy's integers are not 32 bits wide.
    """
    try:
        import threadpoolctl  # noqa: F401
        from scipy.linalg import cython_blas
    except ImportError:
        return None
    capsule = cython_blas.__pyx_capi__["sgemm"]
    api = ctypes.pythonapi
    api.PyCapsule_GetName.restype, api.PyCapsule_GetName.argtypes = ctypes.c_char_p, [ctypes.py_object]
    api.PyCapsule_GetPointer.restype = ctypes.c_void_p
    api.PyCapsule_GetPointer.argtypes = [ctypes.py_object, ctypes.c_char_p]
    signature = api.PyCapsule_GetName(capsule)
    # Two texts, and the ten numbers and arrays of the reference BLAS; integers of another width have another name.
    if b"(char *, char *, int *, int *, int *," not in signature:
        return None
    arguments = [ctypes.c_char_p] * 2 + [ctypes.c_void_p] * 11
    return ctypes.CFUNCTYPE(None, *arguments)(api.PyCapsule_GetPointer(capsule, signature))


def _by_blas(sgemm: Any) -> Product:
    one, zero = ctypes.c_float(1.0), ctypes.c_float(0.0)

    def product(pixels: Float32Array, factors: Float32Array, out: Float32Array) -> None:
        """BLAS counts by columns: it is asked for out' = factors' pixels'."""
        count, bands = pixels.shape
        columns = factors.shape[1]
        along_bands = _along_bands(pixels)
        leading = pixels.strides[0 if along_bands else 1] // _FLOAT_BYTES
        if not is_ready(pixels):
            raise ValueError(f"no axis of the pixels is contiguous: strides {pixels.strides}")
        if not (factors.flags.c_contiguous and out.flags.c_contiguous):
            raise ValueError("weights and result must be contiguous")
        sizes = [ctypes.c_int(each) for each in (columns, count, bands, columns, leading, columns)]
        n, m, k, ld_factors, ld_pixels, ld_out = (ctypes.byref(each) for each in sizes)
        sgemm(
            b"N", b"N" if along_bands else b"T", n, m, k, ctypes.byref(one), factors.ctypes.data, ld_factors,
            pixels.ctypes.data, ld_pixels, ctypes.byref(zero), out.ctypes.data, ld_out,
        )  # fmt: skip

    return product
