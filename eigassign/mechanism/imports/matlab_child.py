"""MATLAB's .mat files read by SciPy, in a process of its own: damaged ones crash it.

    python -P matlab_child.py MEMORY SECONDS ROOM < K.mat

MEMORY and ROOM are in bytes, SECONDS the processor's. To stdout go of each matrix a line of JSON,
[name, shape, [[dtype, length], …]], and arrays of these dtypes and lengths: of a full one its
columns, of a sparse one values, their rows and where columns start. More than ROOM bytes of them,
or than MEMORY, end in the exit code TOO_MUCH. Nothing of eigassign is imported: this starts fast.
"""

from __future__ import annotations

import contextlib
import importlib.util
import io
import json
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np

TOO_MUCH = 7
_INTEGERS = {f"{sign}int{8 << k}" for sign in ("u", "") for k in range(4)}
_NUMBERS = {"double", "single", "sparse"} | _INTEGERS
Found = Iterator[tuple[str, tuple[int, ...], list[Any]]]


def main(memory: int, seconds: int, room: int) -> None:
    """Write the matrices of the file at stdin to stdout."""
    if importlib.util.find_spec("resource"):  # not on Windows
        import resource

        for limit, most in (("CORE", 0), ("CPU", seconds), ("AS", memory)):
            with contextlib.suppress(OSError, ValueError):  # macOS has no limit on addresses
                resource.setrlimit(getattr(resource, f"RLIMIT_{limit}"), (most, most))
    out = sys.stdout.buffer
    try:
        data = sys.stdin.buffer.read()
        for name, shape, arrays in _matrices(data):
            if (room := room - sum(array.nbytes for array in arrays)) < 0:
                raise MemoryError
            parts = [(array.dtype.str, array.size) for array in arrays]
            out.write(json.dumps([name, shape, parts]).encode() + b"\n")
            for array in arrays:
                out.write(np.ascontiguousarray(array).data)
    except MemoryError:
        raise SystemExit(TOO_MUCH) from None


def _matrices(data: bytes) -> Found:
    """Those of versions 5 to 7, in structures as SE.K; without objects, cells and text."""
    from scipy.io import loadmat, whosmat

    stream: Any = io.BytesIO(data)
    for name, shape, kind in whosmat(stream):
        if kind in _NUMBERS and len(shape) == 2:
            yield _sent(name, loadmat(stream, variable_names=[name])[name])
        elif kind == "struct" and shape == (1, 1):
            struct = loadmat(stream, variable_names=[name])[name][0, 0]
            for field in struct.dtype.names or ():
                if struct[field].ndim == 2 and struct[field].dtype.kind in "iuf":
                    yield _sent(f"{name}.{field}", struct[field])


def _sent(name: str, A: Any) -> tuple[str, tuple[int, ...], list[Any]]:
    if hasattr(A, "tocsc"):
        A = A.tocsc()
        return name, A.shape, [A.data, A.indices, A.indptr]
    return name, A.shape, [A.T.reshape(-1)]


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
