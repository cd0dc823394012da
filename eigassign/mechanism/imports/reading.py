"""A file of any program: what it is, told from its content, and what it holds.

Messages quote nothing of a file, which may be of another kind altogether.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from scipy import sparse

from eigassign.case.suggestions import listed, shown
from eigassign.errors import MechanismError, UsageError
from eigassign.files import MATRIX, how_to_raise, raised, read_bytes
from eigassign.mechanism.imports import (
    keyword_lists,
    matlab,
    matrix_file,
    nastran,
)
from eigassign.mechanism.imports.entries import (
    COMPLEX,
    ENTRIES,
    LARGEST,
    LEAST,
    Contents,
    Matrix,
    UnfitError,
    require_few,
)

T = TypeVar("T")
_READERS: tuple[Callable[[bytes], Contents | None], ...] = (
    matrix_file.read_matrix_market,
    matrix_file.read_numpy,
    matlab.read_matlab,
    nastran.read_bulk,
    keyword_lists.read_substructure,
    keyword_lists.read_nodes,
    keyword_lists.read_entries,
    keyword_lists.read_labels,
    matrix_file.read_table,
)
_KNOWN = (
    "Nastran (DMIG, GRID), Abaqus, CalculiX, Ansys (Matrix Market), MATLAB or NumPy, nor a square "
    "table of numbers"
)


def read_contents(file: Path, key: str) -> Contents | None:
    """What the file holds; None where it is of no kind that is told by its content.

    Raises MechanismError at ``key`` where it cannot be read.
    """

    def contents() -> Contents | None:
        data = read_bytes(file, MATRIX)
        if (lines := data.count(b"\n")) > raised(ENTRIES):  # readers make lists of lines
            raise UnfitError(f"has {lines} lines; {how_to_raise(lines, ENTRIES)}")
        return next(filter(None, (read(data) for read in _READERS)), None)

    return guarded(contents, file, key)


def matrix_of(
    contents: Contents | None,
    file: Path,
    key: str,
    name: str = "",
    kind: str = "",
    alone: bool = True,
) -> Matrix:
    """The matrix of that ``name``, or else of a ``kind``: called K or M, or else beginning so.

    ``alone``: one that is alone in its file may have any name but one of the other kind.

    Raises MechanismError at ``key`` for what is no real square matrix of finite numbers, is larger
    than limits allow, or is not there.
    """
    if contents is None:
        raise MechanismError(key, f"cannot read {file.name}: it is damaged, or no file of {_KNOWN}")
    found = contents.matrices
    named = [n for n in found if (n == name if name else kind in ("", kind_of(n)))]
    named = [n for n in named if n.upper() == kind] or named
    if not name and not named and alone and len(found) == 1:
        named = [n for n in found if not kind_of(n)]
    if len(named) != 1:
        raise MechanismError(key, f"{file.name} {_missing(found, name, kind, len(named))}")

    def matrix() -> Matrix:
        read = found[named[0]]()
        return read._replace(matrix=_real(read.matrix))

    return guarded(matrix, file, key)


def kind_of(name: str) -> str:
    """K or M by the name of a matrix: KAAX, stiffness, MAAX, mass; nothing of others."""
    own = name.upper()
    return "K" if own.startswith(("K", "STIF")) else "M" if own.startswith("M") else ""


def _missing(found: Mapping[str, Any], name: str, kind: str, count: int) -> str:
    if not found:
        return "holds no matrix"
    names = listed(each or "one without a name" for each in found)
    if name:
        return f"has no matrix {shown(name)}; it has {names}"
    if count > 1 or kind == "":
        return f"holds {len(found)} matrices, {names}: name one, as parts.mat:K does"
    words = {"K": "stiffness", "M": "mass"}
    have = [words[k] for k in map(kind_of, found) if k]
    twin = next((f" ({kind}{n[1:]})" for n in found if re.fullmatch("[KM]AAX?", n)), "")
    return (
        f"holds {have[0] if have else f'matrices, {names}'}, no {words[kind]}: export the "
        f"{words[kind]}{twin} too, or name stiffness and mass, a file each"
    )


def guarded(read: Callable[[], T], file: Path, key: str) -> T:
    """What ``read`` gives; whatever it raises is a MechanismError at ``key`` about the file."""
    try:
        return read()
    except OSError as error:
        reason = error.strerror or error
        raise MechanismError(key, f"cannot read {file.name}: {reason}") from error
    except (UnfitError, UsageError) as error:
        raise MechanismError(key, f"{file.name} {error}") from error
    except MemoryError as error:
        raise MechanismError(key, f"cannot read {file.name}: too large for this memory") from error
    except MechanismError:
        raise
    except Exception as error:  # parsers of others raise anything, and quote the file
        line = re.match(r"Line \d+", str(error))
        place = f" ({line.group()})" if line else ""
        message = f"cannot read {file.name}{place}: it is damaged, or no file of {_KNOWN}"
        raise MechanismError(key, message) from None


def _real(matrix: Any) -> sparse.csr_array:
    """``matrix`` in double precision."""
    if matrix.dtype.kind == "c":
        raise UnfitError(COMPLEX)
    if matrix.dtype.kind not in "fiu":
        raise UnfitError(f"holds {matrix.dtype}, expected real numbers")
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1]:
        raise UnfitError(f"is not a square matrix: {matrix.shape}")
    if not matrix.shape[0]:
        raise UnfitError("is empty: 0 rows")
    require_few(matrix.shape[0], matrix.size)
    with np.errstate(over="ignore"):
        out = sparse.csr_array(matrix, dtype=np.float64)
    if not np.isfinite(out.data).all():
        raise UnfitError("has entries that are not finite")
    if np.abs(out.data).max(initial=0.0) > LARGEST:
        raise UnfitError(f"has entries beyond {LARGEST:g}")
    out.data = np.where(np.abs(out.data) < LEAST, 0.0, out.data)
    return out
