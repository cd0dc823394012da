"""What readers of matrices share: limits, places of entries, numbers as Fortran has them.

A reader gives a `Matrix`, whose rows may be labelled: 100 × the number of a node + the freedom,
1 to 6 for u_x, u_y, u_z, θ_x, θ_y, θ_z. It raises UnfitError for what is readable but not wanted,
and ValueError or whatever its parser raises for what is damaged. Neither quotes the file.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.files import how_to_raise, raised

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Cells = NDArray[np.bytes_]
MOST = 2_000_000  # dofs
ENTRIES = 20_000_000  # all that is done with an entry takes some 150 bytes: 3 GB
LARGEST = 1e30  # entry or coordinate, in any units: squares of squares are finite
LEAST = 1e-75  # an entry that is not zero: squares of squares are still normal numbers
COMPLEX = "has complex entries: damping is not modelled, export the real stiffness and mass"
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
