"""MATLAB's .mat files: of versions 4 to 7 by SciPy, of 7.3, which are HDF5, by `eigassign.hdf5`."""

from __future__ import annotations

import io
import zlib
from functools import partial
from math import prod
from typing import Any

import numpy as np
from scipy import sparse

from eigassign.files import MATRIX, how_to_raise, raised
from eigassign.hdf5 import ForeignFile
from eigassign.mechanism.imports.entries import Contents, Matrix, UnfitError, require_few

_HEADER, _COMPRESSED = 128, 15  # bytes before the first element; type of one that is compressed
_INTEGERS = {f"{sign}int{8 << k}" for sign in ("u", "") for k in range(4)}
_NUMBERS = {"double", "single", "sparse"} | _INTEGERS


def _is_oldest(data: bytes) -> bool:
    """Version 4 begins with its kind, 0000 to 4052, rows, columns, 0 or 1, and length of a name."""
    if len(data) < 20:
        return False
    for order in "<>":
        kind, rows, columns, imaginary, name = np.frombuffer(data, f"{order}u4", 5).tolist()
        known = kind < 5000 and kind % 10 in (0, 1, 2) and kind // 10 % 10 < 6
        if known and rows > 0 and columns > 0 and imaginary in (0, 1) and 1 < name < 65:
            return data[19 + name : 20 + name] == b"\0"
    return False


def read_matlab(data: bytes) -> Contents | None:
    """Its variables that are matrices of numbers; None of other files."""
    from scipy.io import whosmat

    if data.startswith(b"MATLAB 7.3"):
        return _of_hdf5(data)
    if data.startswith(b"MATLAB "):
        data = _unpacked(data)
    elif not _is_oldest(data):
        return None
    stream: Any = io.BytesIO(data)
    variables = whosmat(stream)
    shapes = {
        name: (shape[0], 0 if kind == "sparse" else prod(shape))
        for name, shape, kind in variables
        if kind in _NUMBERS and len(shape) == 2
    }
    return Contents({name: partial(_matrix, data, name, *size) for name, size in shapes.items()})


def _unpacked(data: bytes) -> bytes:
    """The same without compression, whose elements SciPy would unpack to any size."""
    order, parts, at = "<" if data[126:128] == b"IM" else ">", [data[:_HEADER]], _HEADER
    room = int(raised(MATRIX))
    while at + 8 <= len(data):
        kind, size = np.frombuffer(data, f"{order}u4", 2, at).tolist()
        element = data[at : at + 8 + size]
        if kind == _COMPRESSED:
            element = zlib.decompressobj().decompress(element[8:], room + 1)
        if len(element) < 8 or (room := room - len(element)) < 0:
            most = raised(MATRIX)
            raised_by = how_to_raise(most + 1, MATRIX)
            raise UnfitError(f"unpacks to more than {most / 1e6:.3g} MB: {raised_by}")
        parts.append(element)
        at += 8 + size
    return b"".join(parts)


def _matrix(data: bytes, name: str, rows: int, entries: int) -> Matrix:
    from scipy.io import loadmat

    require_few(rows, entries)
    stream: Any = io.BytesIO(data)
    read: Any = loadmat(stream, variable_names=[name])[name]
    require_few(read.shape[0], read.nnz if hasattr(read, "nnz") else read.size)
    if hasattr(read, "check_format"):
        read.check_format(full_check=True)
    return Matrix(read)


def _of_hdf5(data: bytes) -> Contents:
    """Full ones are arrays by columns, sparse ones values, their rows and where columns start.

    Text is stored as whole numbers, and these are passed over.
    """
    file = ForeignFile(data)
    kinds = {name: each.dtype.kind for name, each in file.arrays.items() if each.dtype is not None}
    by_columns = [name for name in file.arrays if f"{name}/jc" in kinds]

    def matrix(name: str) -> Matrix:
        if name in kinds:
            require_few(0, prod(file.arrays[name].shape))
            return Matrix(file.read(name).T)
        values, at, starts = (file.read(f"{name}/{key}") for key in ("data", "ir", "jc"))
        n = len(starts) - 1
        require_few(n, len(values))
        found = (values, at.astype(np.int64), starts.astype(np.int64))
        read = sparse.csc_array(found, (n, n))
        read.check_format(full_check=True)
        return Matrix(read)

    full = [name for name, kind in kinds.items() if kind == "f" and "/" not in name]
    return Contents({name: partial(matrix, name) for name in (*full, *by_columns)})
