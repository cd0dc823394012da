"""K and M of a part from files of another program: read, and refused where they cannot be one."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.errors import MechanismError
from eigassign.mechanism.definite import is_semidefinite

Floats = NDArray[np.float64]
SYMMETRY = 1e-8  # relative asymmetry of K or M that is taken for round-off
ROUNDED = 1e-6  # of the diagonal: files of six digits make eigenvalues that small negative
MOST = 2_000_000  # dofs


def read_pair(stiffness: Path, mass: Path, path: str) -> tuple[sparse.csr_array, sparse.csr_array]:
    """Symmetric positive semidefinite K and M of one size; raises MechanismError naming the key."""
    K = _checked(read_matrix(stiffness, f"{path}.stiffness"), f"{path}.stiffness", stiffness.name)
    M = _checked(read_matrix(mass, f"{path}.mass"), f"{path}.mass", mass.name)
    if K.shape != M.shape:
        raise MechanismError(f"{path}.mass", f"is {M.shape}, the stiffness is {K.shape}")
    return K, M


def read_matrix(file: Path, key: str) -> sparse.csr_array:
    """A real square matrix from Matrix Market (.mtx) or NumPy (.npy, .npz of scipy.sparse)."""
    try:
        matrix = _read(file, key)
    except (OSError, ValueError, TypeError, KeyError, EOFError, OverflowError) as error:
        raise MechanismError(key, f"cannot read {file.name}: {error}") from error
    except (zipfile.BadZipFile, MemoryError) as error:
        raise MechanismError(key, f"cannot read {file.name}: {error or 'too large'}") from error
    if matrix.dtype.kind == "c":
        message = "has complex entries: damping is not modelled, export the real stiffness and mass"
        raise MechanismError(key, f"{file.name} {message}")
    if matrix.dtype.kind not in "fiu":
        raise MechanismError(key, f"{file.name} holds {matrix.dtype}, expected real numbers")
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1]:
        raise MechanismError(key, f"{file.name} is not a square matrix: {matrix.shape}")
    out = sparse.csr_array(matrix, dtype=np.float64)
    if not np.isfinite(out.data).all():
        raise MechanismError(key, f"{file.name} has entries that are not finite")
    return out


def _read(file: Path, key: str) -> Any:
    """Whatever the file holds, as an array, dense or sparse."""
    suffix = file.suffix.lower()
    if suffix in (".npy", ".npz"):
        with open(file, "rb") as stream:
            if suffix == ".npz":
                return sparse.load_npz(stream)
            return np.load(stream, allow_pickle=False)
    from scipy.io import mminfo, mmread

    rows, columns, _, _, field, symmetry = mminfo(file)
    if field == "pattern":
        raise MechanismError(key, f"{file.name} is a pattern: it has places but no values")
    if symmetry == "skew-symmetric":
        raise MechanismError(key, f"{file.name} is skew-symmetric, expected a symmetric matrix")
    if max(rows, columns) > MOST:
        raise MechanismError(key, f"{file.name} has {rows} rows; up to {MOST} are supported")
    return mmread(file)


def _checked(A: sparse.csr_array, key: str, name: str) -> sparse.csr_array:
    lost = abs(A - A.T).max() if A.nnz else 0.0
    if lost > SYMMETRY * abs(A).max():
        only = sparse.tril(A, -1).nnz == 0 or sparse.triu(A, 1).nnz == 0
        hint = (
            f"{name} holds one triangle only: say 'symmetric' in its header, or write both"
            if only
            else f"entries differ by {lost:.3g}"
        )
        raise MechanismError(key, f"is not symmetric: {hint}")
    A = sparse.csr_array(0.5 * (A + A.T))
    if not is_semidefinite(A, ROUNDED):
        raise MechanismError(
            key, "is not positive semidefinite: some motion would have negative energy"
        )
    return A
