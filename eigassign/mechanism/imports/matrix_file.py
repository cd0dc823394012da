"""Matrix Market, NumPy's .npy and .npz, tables: what SciPy and NumPy read, checked beforehand.

Such files come from anywhere. What they unpack to is bounded before they are read, and the indices
of sparse ones before anything is computed with them: SciPy follows an index that is out of range
wherever it points.
"""

from __future__ import annotations

import io
import re
from functools import partial
from math import isqrt
from typing import Any

import numpy as np
from scipy import sparse

from eigassign.files import MATRIX, how_to_raise, raised
from eigassign.mechanism.imports.entries import (
    COMPLEX,
    ENTRIES,
    Contents,
    Matrix,
    UnfitError,
    require_few,
)

_NUMPY, _ZIP, _MARKET = b"\x93NUMPY", b"PK\x03\x04", b"%%matrixmarket"
_BLANKS = bytes.maketrans(b",;", b"  ")
_WIDEST = 26 * isqrt(ENTRIES)  # bytes of a line of as many numbers as rows can have
_INDICES = {"indices", "indptr", "row", "col", "offsets"}


def read_numpy(data: bytes) -> Contents | None:
    """The array of .npy, the sparse matrix of ``scipy.sparse.save_npz``, the arrays of ``savez``.

    None of other files; objects are refused.
    """
    if not data.startswith((_NUMPY, _ZIP)):
        return None
    if data.startswith(_NUMPY):
        return Contents({"": lambda: Matrix(np.load(io.BytesIO(data), allow_pickle=False))})
    archive = np.load(io.BytesIO(data), allow_pickle=False)
    size = sum(member.file_size for member in archive.zip.infolist())
    if size > raised(MATRIX):
        raise UnfitError(f"unpacks to {size / 1e6:.3g} MB: {how_to_raise(size, MATRIX)}")
    if "format" in archive:
        return Contents({"": lambda: _sparse(data, archive)})
    return Contents({name: partial(_array, archive, name) for name in archive})


def _array(archive: Any, name: str) -> Matrix:
    return Matrix(archive[name])


def _sparse(data: bytes, archive: Any) -> Matrix:
    if any(archive[name].dtype.kind not in "iu" for name in _INDICES.intersection(archive)):
        raise ValueError("its indices are no whole numbers")
    matrix: Any = sparse.load_npz(io.BytesIO(data))
    if hasattr(matrix, "check_format"):
        matrix.check_format(full_check=True)
    return Matrix(matrix)


def read_table(data: bytes) -> Contents | None:
    """A full matrix in text, a row a line; None of what is no square of numbers."""
    first = data[:_WIDEST].partition(b"\n")[0].translate(_BLANKS).split()
    if not first or not all(map(_WORD.fullmatch, first)):
        return None
    if len(first) != sum(not line.isspace() for line in io.BytesIO(data)):
        return None
    lines = iter(partial(io.BytesIO(data.translate(_BLANKS)).readline, _WIDEST), b"")
    return Contents({"": lambda: Matrix(np.loadtxt(lines, ndmin=2))})


def read_matrix_market(data: bytes) -> Contents | None:
    """The one matrix of a Matrix Market file; None of other files."""
    known = data[:20].lower().startswith(_MARKET)
    return Contents({"": lambda: Matrix(_matrix_market(data))}) if known else None


_NUMBER = rb"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d{1,4})?"
_WORD = re.compile(_NUMBER)
# What SciPy's reader, which runs past the end of a number that breaks off, is shown of a file
_BANNER = re.compile(
    rb"%%MatrixMarket[ \t]+matrix[ \t]+(coordinate|array)"
    rb"[ \t]+(real|double|integer|complex|pattern)"
    rb"[ \t]+(general|symmetric|skew-symmetric|hermitian)[ \t]*\r?\n"
    rb"(?:[ \t]*(?:%[^\n]*)?\n)*[ \t]*(\d{1,9})[ \t]+(\d{1,9})(?:[ \t]+(\d{1,15}))?[ \t]*\r?\n",
    re.IGNORECASE,
)
_LINES = {
    layout: re.compile(rb"^(?!%s[ \t]*\r?$|%%|[ \t]*\r?$)" % line, re.MULTILINE)
    for layout, line in (
        (b"array", rb"[ \t]*" + _NUMBER),
        (b"coordinate", rb"[ \t]*\d{1,9}[ \t]+\d{1,9}[ \t]+" + _NUMBER),
    )
}


def _matrix_market(data: bytes) -> Any:
    from scipy.io import mmread

    banner = _BANNER.match(data)
    if banner is None:
        raise ValueError("no Matrix Market file")
    layout, field, symmetry = (word.lower() for word in banner.groups()[:3])
    rows, columns, given = (int(number or 0) for number in banner.groups()[3:])
    if field == b"pattern":
        raise UnfitError("is a pattern: it has places but no values")
    if field == b"complex":
        raise UnfitError(COMPLEX)
    if symmetry == b"skew-symmetric":
        raise UnfitError("is skew-symmetric, expected a symmetric matrix")
    require_few(rows, rows * columns if layout == b"array" else given)
    if (wrong := _LINES[layout].search(data + b"\n", banner.end(), len(data))) is not None:
        raise ValueError(f"Line {data.count(10, 0, wrong.start()) + 1}")
    return mmread(io.BytesIO(data + b"\n"), spmatrix=False)
