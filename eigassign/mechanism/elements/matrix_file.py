"""A real square matrix from a file of another program: Matrix Market, or NumPy's .npy and .npz.

Such files come from anywhere. Their size is bounded before they are read, what they say of their
own size before it is believed, and the indices of sparse ones before anything is computed with
them: SciPy follows an index that is out of range wherever it points. Messages quote nothing of a
file, which may be of another kind altogether.
"""

from __future__ import annotations

import io
import re
import zipfile
from inspect import signature
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from scipy import sparse

from eigassign.errors import MechanismError, UsageError
from eigassign.files import MATRIX, how_to_raise, raised, read_bytes

MOST = 2_000_000  # dofs
_INDICES = {f"{name}.npy" for name in ("indices", "indptr", "row", "col", "offsets")}
_COMPLEX = "has complex entries: damping is not modelled, export the real stiffness and mass"
ENTRIES = 20_000_000  # all that is done with an entry takes some 150 bytes: 3 GB


def read_matrix(file: Path, key: str) -> sparse.csr_array:
    """The matrix in Matrix Market (.mtx), .npy, or .npz of ``scipy.sparse.save_npz``.

    Raises MechanismError at ``key`` for what is no real square matrix of finite numbers, or is
    larger than MOST and ENTRIES allow.
    """
    try:
        data = read_bytes(file, MATRIX)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise MechanismError(key, f"cannot read {file.name}: {reason}") from error
    try:
        return _real(_parsed(data, file.suffix.lower()))
    except (_UnfitError, UsageError) as error:
        raise MechanismError(key, f"{file.name} {error}") from error
    except MemoryError as error:
        raise MechanismError(key, f"cannot read {file.name}: too large for this memory") from error
    except Exception as error:  # parsers of others raise anything, and quote the file
        line = re.match(r"Line \d+", str(error))
        place = f" ({line.group()})" if line else ""
        message = f"cannot read {file.name}{place}: it is damaged, or no matrix of its ending"
        raise MechanismError(key, message) from None


class _UnfitError(Exception):
    """The file is readable but its content is not what is wanted; begins with a verb."""


def _parsed(data: bytes, suffix: str) -> Any:
    """Whatever the file holds, as an array, dense or sparse."""
    if suffix == ".npy":
        _require_room(io.BytesIO(data), len(data))
        return np.load(io.BytesIO(data), allow_pickle=False)
    if suffix == ".npz":
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = archive.infolist()
            if (size := sum(member.file_size for member in members)) > raised(MATRIX):
                raise _UnfitError(f"unpacks to {size / 1e6:.3g} MB: {how_to_raise(size, MATRIX)}")
            for member in members:
                with archive.open(member) as stream:
                    dtype = _require_room(stream, member.file_size)
                if member.filename in _INDICES and dtype.kind not in "iu":
                    raise ValueError("its indices are no whole numbers")
        matrix = sparse.load_npz(io.BytesIO(data))
        if hasattr(matrix, "check_format"):
            matrix.check_format(full_check=True)
        return matrix
    return _matrix_market(data)


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
    _require_few(0, prod(shape))
    return dtype


def _require_few(rows: int, entries: int) -> None:
    if rows > MOST:
        raise _UnfitError(f"has {rows} rows; up to {MOST} are supported")
    if entries > raised(ENTRIES):
        most = f"more than {raised(ENTRIES):.3g} are not read; {how_to_raise(entries, ENTRIES)}"
        raise _UnfitError(f"has {entries} entries: {most}")


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
        raise _UnfitError("is a pattern: it has places but no values")
    if field == b"complex":
        raise _UnfitError(_COMPLEX)
    if symmetry == b"skew-symmetric":
        raise _UnfitError("is skew-symmetric, expected a symmetric matrix")
    _require_few(rows, rows * columns if layout == b"array" else given)
    if (wrong := _LINES[layout].search(data + b"\n", banner.end(), len(data))) is not None:
        raise ValueError(f"Line {data.count(10, 0, wrong.start()) + 1}")
    explicit = "spmatrix" in signature(mmread).parameters  # from SciPy 1.15 on, where False is new
    stream = io.BytesIO(data + b"\n")
    return mmread(stream, spmatrix=False) if explicit else mmread(stream)


def _real(matrix: Any) -> sparse.csr_array:
    """``matrix`` in double precision."""
    if matrix.dtype.kind == "c":
        raise _UnfitError(_COMPLEX)
    if matrix.dtype.kind not in "fiu":
        raise _UnfitError(f"holds {matrix.dtype}, expected real numbers")
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1]:
        raise _UnfitError(f"is not a square matrix: {matrix.shape}")
    if not matrix.shape[0]:
        raise _UnfitError("is empty: 0 rows")
    _require_few(matrix.shape[0], matrix.size)
    with np.errstate(over="ignore"):
        out = sparse.csr_array(matrix, dtype=np.float64)
    if not np.isfinite(out.data).all():
        raise _UnfitError("has entries that are not finite")
    return out
