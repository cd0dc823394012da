"""MATLAB's .mat files read by SciPy and h5py, in a process of its own: damaged ones crash them.

    python -P matlab_child.py MEMORY SECONDS ENTRIES ROOM < K.mat

MEMORY and ROOM are in bytes, SECONDS the processor's, ENTRIES those of a full matrix. To stdout go
of each matrix a line of JSON, [name, shape, [[dtype, length], …]], and arrays of these dtypes and
lengths: of a full one all columns, of a sparse one values, their rows and where columns start, and
of one that is not square, or has more entries, none. More than ROOM bytes, or MEMORY, end in the
exit code TOO_MUCH. Nothing of eigassign is imported, so that this starts fast.
"""

from __future__ import annotations

import contextlib
import importlib.util
import io
import json
import sys
from collections.abc import Iterator
from math import prod
from typing import Any

import numpy as np

TOO_MUCH = 7
_INTEGERS = {f"{sign}int{8 << k}" for sign in ("u", "") for k in range(4)}
_NUMBERS = {"double", "single", "sparse"} | _INTEGERS
Found = Iterator[tuple[str, tuple[int, ...], list[Any]]]


def main(memory: int, seconds: int, entries: int, room: int) -> None:
    """Write the matrices of the file at stdin to stdout."""
    if importlib.util.find_spec("resource"):  # not on Windows
        import resource

        for limit, most in (("CORE", 0), ("CPU", seconds), ("AS", memory)):
            with contextlib.suppress(OSError, ValueError):  # macOS has no limit on addresses
                resource.setrlimit(getattr(resource, f"RLIMIT_{limit}"), (most, most))
    out = sys.stdout.buffer
    try:
        data = sys.stdin.buffer.read()
        read = _of_hdf5 if data.startswith(b"MATLAB 7.3") else _of_scipy
        for name, shape, arrays in read(data, entries):
            if (room := room - sum(array.nbytes for array in arrays)) < 0:
                raise MemoryError
            parts = [(array.dtype.str, array.size) for array in arrays]
            out.write(json.dumps([name, shape, parts]).encode() + b"\n")
            for array in arrays:
                out.write(np.ascontiguousarray(array).data)
    except MemoryError:
        raise SystemExit(TOO_MUCH) from None


def _of_scipy(data: bytes, entries: int) -> Found:
    """Versions 4 to 7, without objects, cells, structures and text."""
    from scipy.io import loadmat, whosmat

    stream: Any = io.BytesIO(data)
    for name, shape, kind in whosmat(stream):
        if kind not in _NUMBERS or len(shape) != 2:
            continue
        if kind != "sparse" and not _is_wanted(shape, entries):
            yield name, shape, []
            continue
        read = loadmat(stream, variable_names=[name])[name]
        if kind == "sparse":
            A = read.tocsc()
            yield name, A.shape, [A.data, A.indices, A.indptr]
        else:
            yield name, read.shape, [read.T.reshape(-1)]


def _of_hdf5(data: bytes, entries: int) -> Found:
    """Version 7.3; full ones are arrays by columns. Text is stored as whole numbers: passed over.

    So are links, and what lies in other files.
    """
    import h5py

    def member(group: Any, name: str) -> Any:
        if isinstance(group.get(name, getlink=True), h5py.HardLink):
            found = group[name]
            if isinstance(found, h5py.Group) or not (found.external or found.is_virtual):
                return found
        return None

    with h5py.File(io.BytesIO(data)) as file:
        for name in file:
            found = member(file, name)
            if isinstance(found, h5py.Dataset) and found.dtype.kind == "f":
                is_wanted = _is_wanted(found.shape, entries)
                yield name, found.shape[::-1], [found[()].reshape(-1)] if is_wanted else []
            elif isinstance(found, h5py.Group) and "MATLAB_sparse" in found.attrs:
                arrays = [member(found, key) for key in ("data", "ir", "jc")]
                n = arrays[2].size - 1
                yield name, (n, n), [array[()] for array in arrays]


def _is_wanted(shape: tuple[int, ...], entries: int) -> bool:
    return len(shape) == 2 and shape[0] == shape[1] and prod(shape) <= entries


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
