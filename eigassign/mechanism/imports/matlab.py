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
from eigassign.hdf5 import foreign_array, foreign_arrays
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
    """Full ones are arrays, sparse ones groups of the values, their rows and where columns start.

    Both by columns.
    """
    found = foreign_arrays(data, ("MATLAB_class", "MATLAB_sparse"))
    named = [n for n, each in found.items() if each.words.get("MATLAB_class") in _NUMBERS]

    def matrix(name: str) -> Matrix:
        rows = found[name].words.get("MATLAB_sparse")
        if rows is None:
            require_few(0, prod(found[name].shape))
            full = foreign_array(data, name)
            return Matrix(full.T if full.dtype.names is None else full[full.dtype.names[0]] * 1j)
        parts = (foreign_array(data, f"{name}/{key}") for key in ("data", "ir", "jc"))
        values, at, starts = parts
        shape = (int(rows), len(starts) - 1)
        require_few(max(shape), len(values))
        read = sparse.csc_array((values, at.astype(np.int64), starts.astype(np.int64)), shape)
        read.check_format(full_check=True)
        return Matrix(read)

    return Contents({name: partial(matrix, name) for name in named})
