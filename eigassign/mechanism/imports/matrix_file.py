"""Matrix Market and NumPy's .npy and .npz: what SciPy and NumPy read, checked beforehand.

Such files come from anywhere. Their size is bounded before they are read, what they say of their
own size before it is believed, and the indices of sparse ones before anything is computed with
them: SciPy follows an index that is out of range wherever it points.
"""

from __future__ import annotations

import io
import re
import zipfile
from math import prod
from typing import Any

import numpy as np
from scipy import sparse

from eigassign.files import MATRIX, how_to_raise, raised
from eigassign.mechanism.imports.entries import COMPLEX, Contents, Matrix, UnfitError, require_few

_NUMPY, _ZIP, _MARKET = b"\x93NUMPY", b"PK\x03\x04", b"%%matrixmarket"
_INDICES = {f"{name}.npy" for name in ("indices", "indptr", "row", "col", "offsets")}


def read_numpy(data: bytes) -> Contents | None:
    """The array of .npy, or the sparse matrix of ``scipy.sparse.save_npz``; None of other files."""
    known = data.startswith((_NUMPY, _ZIP))
    return Contents({"": lambda: Matrix(_of_numpy(data))}) if known else None


def read_matrix_market(data: bytes) -> Contents | None:
    """The one matrix of a Matrix Market file; None of other files."""
    known = data[:20].lower().startswith(_MARKET)
    return Contents({"": lambda: Matrix(_matrix_market(data))}) if known else None


def _of_numpy(data: bytes) -> Any:
    """The array, dense or sparse."""
    if data.startswith(_NUMPY):
        _require_room(io.BytesIO(data), len(data))
        return np.load(io.BytesIO(data), allow_pickle=False)
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = archive.infolist()
        if (size := sum(member.file_size for member in members)) > raised(MATRIX):
            raise UnfitError(f"unpacks to {size / 1e6:.3g} MB: {how_to_raise(size, MATRIX)}")
        for member in members:
            with archive.open(member) as stream:
                dtype = _require_room(stream, member.file_size)
            if member.filename in _INDICES and dtype.kind not in "iu":
                raise ValueError("its indices are no whole numbers")
    matrix = sparse.load_npz(io.BytesIO(data))
    if hasattr(matrix, "check_format"):
        matrix.check_format(full_check=True)
    return matrix


def _require_room(stream: Any, size: int) -> np.dtype[Any]:
    """Its dtype; ValueError unless the array of a .npy stream of ``size`` bytes is all in there."""
    version = np.lib.format.read_magic(stream)
    header = {
        (1, 0): np.lib.format.read_array_header_1_0,
        (2, 0): np.lib.format.read_array_header_2_0,
    }[version]
    shape, _, dtype = header(stream)
    if dtype.hasobject or prod(shape) * dtype.itemsize > size:
        raise ValueError("it ends before its array does")
    require_few(0, prod(shape))
    return dtype


# What SciPy's reader, which runs past the end of a number that breaks off, is shown of a file
_BANNER = re.compile(
    rb"%%MatrixMarket[ \t]+matrix[ \t]+(coordinate|array)"
    rb"[ \t]+(real|double|integer|complex|pattern)"
    rb"[ \t]+(general|symmetric|skew-symmetric|hermitian)[ \t]*\r?\n"
    rb"(?:[ \t]*(?:%[^\n]*)?\n)*[ \t]*(\d{1,9})[ \t]+(\d{1,9})(?:[ \t]+(\d{1,15}))?[ \t]*\r?\n",
    re.IGNORECASE,
)
_NUMBER = rb"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d{1,4})?"
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
