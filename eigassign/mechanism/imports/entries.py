"""What readers of matrices share; NumPy's .npy and .npz, MATLAB's .mat.

A reader gives a `Matrix`, whose rows may be labelled: 100 × the number of a node + the freedom,
1 to 6 for u_x, u_y, u_z, θ_x, θ_y, θ_z. It raises UnfitError for what is readable but not wanted,
and ValueError or whatever its parser raises for what is damaged. Neither quotes the file.

Such files come from anywhere. What they unpack to is bounded before they are read, and the indices
of sparse ones before anything is computed with them: SciPy follows an index that is out of range
wherever it points.

What `matlab_child` sends is only numbers: it may crash, or be ended by its limits, and indices of
sparse matrices are checked here before anything is computed with them.
"""

from __future__ import annotations

import io
import json
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.arrays import Floats
from eigassign.files import MATRIX, how_to_raise, raised
from eigassign.mechanism.imports.matlab_child import TOO_MUCH
from eigassign.process import ONE_THREAD

Ints = NDArray[np.int64]
Cells = NDArray[np.bytes_]
MOST = 2_000_000  # dofs
ENTRIES = 20_000_000  # all that is done with an entry takes some 150 bytes: 3 GB
LARGEST = 1e30  # entry or coordinate, in any units: squares of squares are finite
LEAST = 1e-75  # an entry that is not zero: squares of squares are still normal numbers
COMPLEX = "has complex entries: damping is not modelled, export the real stiffness and mass"
_EMPTY = 16  # lines are filled to their length: one number of 8 characters in a line of 80 is less
LABEL = 100  # freedoms of a node that are told apart: Abaqus numbers them up to 40
_EXPONENTS = bytes.maketrans(b"dD", b"EE")  # as Fortran writes double precision


class UnfitError(Exception):
    """The file is readable but its content is not what is wanted; begins with a verb."""


class Matrix(NamedTuple):
    """A square matrix, its rows labelled (n,) or only counted.

    ``grows``: the file does not say how large it is; further rows and columns are zero.
    """

    matrix: Any
    labels: Ints | None = None
    grows: bool = False


@dataclass(frozen=True)
class Contents:
    """What a file holds: matrices by name, read when they are asked for, and places of nodes."""

    matrices: Mapping[str, Callable[[], Matrix]] = field(default_factory=dict)
    places: Mapping[int, Floats] = field(default_factory=dict)  # (3,), NaN: in axes of its own
    labels: Ints | None = None  # of the rows of matrices that stand elsewhere


def places_of(rows: Iterable[tuple[int, Floats]]) -> dict[int, Floats]:
    """Places of nodes by number, NaN of one that stands at several."""
    places: dict[int, Floats] = {}
    for node, place in rows:
        same = node not in places or (places[node] == place).all()
        places[node] = place if same else np.full(3, np.nan)
    return places


def require_few(rows: int, entries: int) -> None:
    """Raise UnfitError for a matrix with more than MOST rows, or ENTRIES entries."""
    if rows > MOST:
        raise UnfitError(f"has {rows} rows; up to {MOST} are supported")
    if entries > raised(ENTRIES):
        most = f"more than {raised(ENTRIES):.3g} are not read; {how_to_raise(entries, ENTRIES)}"
        raise UnfitError(f"has {entries} entries: {most}")


def assembled(n: int, rows: Ints, columns: Ints, values: Floats, half: bool) -> sparse.csr_array:
    """A (n, n) of entries counted from 0; ``half``: an entry may stand for its mirror image.

    Raises ValueError for places outside of it, UnfitError for a place that is given twice.
    """
    require_few(n, len(values))
    places = np.concatenate([rows, columns])
    if len(places) and not (places.min() >= 0 and places.max() < n):
        raise ValueError("an entry outside")
    A = sparse.coo_array((values, (rows, columns)), shape=(n, n)).tocsr()
    if A.nnz < len(values):
        raise UnfitError("gives an entry twice: does the same matrix stand in it several times?")
    if half:
        given = sparse.csr_array((np.ones(A.nnz), A.indices, A.indptr), shape=A.shape)
        A = sparse.csr_array(A + A.T - A.T * given)
    return A


def labelled(rows: Ints, columns: Ints, values: Floats, half: bool) -> Matrix:
    """The matrix of entries at labels; its rows are in the order of these."""
    labels, places = np.unique(np.concatenate([rows, columns]), return_inverse=True)
    n = len(rows)
    return Matrix(assembled(len(labels), places[:n], places[n:], values, half), labels)


def cells(lines: list[bytes], width: int, most: int) -> Cells:
    """Columns of one ``width`` in lines of ``most`` of them; the last of a line may be missing."""
    if len(lines) * most * width > _EMPTY * (1000 + sum(map(len, lines))):
        raise ValueError("lines much shorter than announced")
    whole = b"".join(line.rstrip().ljust(most * width) for line in lines)
    if len(whole) != len(lines) * most * width:
        raise ValueError("a line too long")
    found = np.frombuffer(whole, f"S{width}")
    return np.asarray(found[np.char.strip(found) != b""])


def reals(found: Cells) -> Floats:
    """Numbers as Fortran and Nastran write them: 1.5E+3, 1.5D+03, 1.5+3."""
    text = np.frombuffer(found.tobytes().translate(_EXPONENTS), found.dtype)
    try:
        return text.astype(np.float64)
    except ValueError:  # without a letter
        full = [re.sub(rb"(?<=[\d.])(?=[-+]\d)", b"E", cell.strip()) for cell in text.tolist()]
        return np.array(full, dtype=np.bytes_).astype(np.float64)


def wholes(found: Cells) -> Ints:
    """Whole numbers; where nothing is written 0."""
    return np.where(np.char.strip(found) == b"", b"0", found).astype(np.int64)


_NUMPY, _ZIP = b"\x93NUMPY", b"PK\x03\x04"
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

    def array(name: str) -> Matrix:
        return Matrix(archive[name])

    return Contents({name: partial(array, name) for name in archive})


def _sparse(data: bytes, archive: Any) -> Matrix:
    if any(archive[name].dtype.kind not in "iu" for name in _INDICES.intersection(archive)):
        raise ValueError("its indices are no whole numbers")
    matrix: Any = sparse.load_npz(io.BytesIO(data))
    if hasattr(matrix, "check_format"):
        matrix.check_format(full_check=True)
    return Matrix(matrix)


_CHILD = str(Path(__file__).with_name("matlab_child.py"))
_START = 300e6  # bytes of addresses: 140 MB after all imports
_ENTRY = 32  # bytes, beside twice the file: 2·10⁷ entries took 680 MB in all, 190 of it the file
_SECONDS = 5.0  # of the processor: it starts in 0.3 s, and 150 MB, packed, took 1.5 s
_PACE = 2e7  # bytes of the file that have a second more


def read_matlab(data: bytes) -> Contents | None:
    """Its variables that are matrices of numbers; None of other files."""
    if not data.startswith(b"MATLAB "):
        return None
    if data.startswith(b"MATLAB 7.3"):
        raise UnfitError("is of MATLAB's version 7.3, which is not read: save it with '-v7'")
    sent, at, matrices = _sent(data), 0, dict[str, Callable[[], Matrix]]()
    while at < len(sent):
        end = sent.index(b"\n", at) + 1
        name, shape, parts = json.loads(sent[at:end])
        arrays, at = [], end
        for dtype, length in parts:
            arrays.append(np.frombuffer(sent, dtype, length, at))
            at += arrays[-1].nbytes
        matrices[name] = partial(_matrix, shape, arrays)
    return Contents(matrices)


def _sent(data: bytes) -> bytes:
    """What the other process makes of the file; raises UnfitError, ValueError if it dies of it."""
    room = int(raised(MATRIX))
    memory = int(_START + _ENTRY * raised(ENTRIES) + 2 * len(data))
    seconds = int(max(_SECONDS, raised(_SECONDS)) + len(data) / _PACE)
    command = [sys.executable, "-P", "-Wignore", _CHILD, *map(str, (memory, seconds, room))]
    done = subprocess.run(
        command,
        input=data,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        timeout=10 * seconds,  # the only limit on Windows, and for machines with other work
        env={**os.environ, **ONE_THREAD},
    )
    if done.returncode == TOO_MUCH:
        raised_by = how_to_raise(room + 1, MATRIX)
        raise UnfitError(f"unpacks to more than {room / 1e6:.3g} MB: {raised_by}")
    if done.returncode:
        raise ValueError(f"its reader ended with {done.returncode}")
    return done.stdout


def _matrix(shape: tuple[int, int], arrays: list[NDArray[Any]]) -> Matrix:
    if len(arrays) == 1:
        return Matrix(arrays[0].reshape(shape[::-1]).T)
    values, rows, starts = arrays
    require_few(max(shape), len(values))
    found = (values.copy(), rows.astype(np.int64), starts.astype(np.int64))
    A: Any = sparse.csc_array(found, shape)
    A.check_format(full_check=True)
    return Matrix(A)
