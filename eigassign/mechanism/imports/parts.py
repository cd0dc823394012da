"""A part from another program: K and M in SI, and the rows and places of the link's nodes.

Messages quote nothing of a file, which may be of another kind altogether.

With u_file = D u and energies E times as large in SI, K = E Dᵀ K_file D; of the interior D may be
anything, so that only the freedoms of nodes need to be known.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.arrays import Floats
from eigassign.case.case_file import CaseFile
from eigassign.case.reader import listed, shown
from eigassign.case.rules.consistency import split_variable
from eigassign.case.table import CsvColumn, read_table
from eigassign.case.units import DIMENSIONS, PLAIN
from eigassign.errors import MechanismError, UsageError
from eigassign.files import MATRIX, how_to_raise, raised, read_bytes, seen_from
from eigassign.mechanism.imports import entries, programs

T = TypeVar("T")
_READERS: tuple[Callable[[bytes], entries.Contents | None], ...] = (
    programs.read_matrix_market,
    entries.read_numpy,
    entries.read_matlab,
    programs.read_op4_binary,
    programs.read_op4_text,
    programs.read_bulk,
    programs.read_nodes,
    programs.read_entries,
    programs.read_labels,
)
_KNOWN = "Nastran (DMIG, OP4, GRID), Abaqus, CalculiX, Ansys (Matrix Market), MATLAB or NumPy"


def read_contents(file: Path, key: str) -> entries.Contents | None:
    """What the file holds; None where it is of no kind that is told by its content.

    Raises MechanismError at ``key`` where it cannot be read.
    """

    def contents() -> entries.Contents | None:
        data = read_bytes(file, MATRIX)
        if (lines := data.count(b"\n")) > raised(entries.ENTRIES):  # readers make lists of lines
            raise entries.UnfitError(f"has {lines} lines; {how_to_raise(lines, entries.ENTRIES)}")
        return next(filter(None, (read(data) for read in _READERS)), None)

    return guarded(contents, file, key)


def matrix_of(
    contents: entries.Contents | None,
    file: Path,
    key: str,
    name: str = "",
    kind: str = "",
    alone: bool = True,
) -> entries.Matrix:
    """The matrix of that ``name``, or else of a ``kind``: called K or M, or else beginning so.

    ``alone``: one that is alone in its file may have any name but one of the other kind.

    Raises MechanismError at ``key`` for what is no real square matrix of finite numbers, is larger
    than limits allow, or is not there.
    """
    if contents is None:
        raise MechanismError(key, f"cannot read {file.name}: it is damaged, or no file of {_KNOWN}")
    found = contents.matrices
    named = [n for n in found if (n == name if name else kind in ("", kind_of(n)))]
    # of what an EXTSEOUT leaves, KAAX, MAAX, BAAX, MUG1T, …, the reduced ones
    usual = (kind, f"{kind}AAX", f"{kind}AA") if kind and not name else ()
    first = ([n for n in named if _own_name(n) == own] for own in usual)
    named = next(filter(None, first), named)
    if not name and not named and alone and len(found) == 1:
        named = [n for n in found if not kind_of(n)]
    if len(named) != 1:
        raise MechanismError(key, f"{file.name} {_missing(found, name, kind, len(named), alone)}")

    def matrix() -> entries.Matrix:
        read = found[named[0]]()
        return read._replace(matrix=_real(read.matrix))

    return guarded(matrix, file, key)


def _own_name(name: str) -> str:
    """In capitals, without that of the structure that it is in."""
    return name.rpartition(".")[2].upper()


def kind_of(name: str) -> str:
    """K or M by the name of a matrix: KAAX, stiffness, MAAX, mass; nothing of others."""
    own = _own_name(name)
    return "K" if own.startswith(("K", "STIF")) else "M" if own.startswith("M") else ""


def _missing(found: Mapping[str, Any], name: str, kind: str, count: int, alone: bool) -> str:
    names = listed(each or "one without a name" for each in found)
    if not found:
        return "holds no matrix"
    if name:
        return f"has no matrix {shown(name)}; it has {names}"
    if count > 1 or kind == "":
        own = "name one, as" if alone else "in place of file write stiffness: parts.mat:K and mass:"
        own += " parts.mat:K does" if alone else " parts.mat:M"
        return f"holds {len(found)} matrices, {names}: {own}"
    words = {"K": "stiffness", "M": "mass"}
    have = next((words[k] for k in map(kind_of, found) if k), f"matrices, {names}")
    twin = next((f" ({kind}{n[1:]})" for n in found if re.fullmatch("[KM]AAX?", n)), "")
    own = f"export the {words[kind]}{twin} too, or name stiffness and mass, a file each"
    return f"holds {have}, no {words[kind]}: {own}"


def guarded(
    read: Callable[[], T], file: Path, key: str, damaged: str = f"damaged, or no file of {_KNOWN}"
) -> T:
    """What ``read`` gives; whatever it raises is a MechanismError at ``key`` about the file."""
    try:
        return read()
    except OSError as error:
        reason = error.strerror or error
        raise MechanismError(key, f"cannot read {file.name}: {reason}") from error
    except (entries.UnfitError, UsageError) as error:
        raise MechanismError(key, f"{file.name} {error}") from error
    except MemoryError as error:
        raise MechanismError(key, f"cannot read {file.name}: too large for this memory") from error
    except MechanismError:
        raise
    except Exception:  # parsers of others raise anything, and quote the file
        raise MechanismError(key, f"cannot read {file.name}: it is {damaged}") from None


def _real(matrix: Any) -> sparse.csr_array:
    """``matrix`` in double precision."""
    if matrix.dtype.kind == "c":
        raise entries.UnfitError(entries.COMPLEX)
    if matrix.dtype.kind not in "fiu":
        raise entries.UnfitError(f"holds {matrix.dtype}, expected real numbers")
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1]:
        raise entries.UnfitError(f"is not a square matrix: {matrix.shape}")
    if not matrix.shape[0]:
        raise entries.UnfitError("is empty: 0 rows")
    entries.require_few(matrix.shape[0], matrix.size)
    with np.errstate(over="ignore"):
        out = sparse.csr_array(matrix, dtype=np.float64)
    if not np.isfinite(out.data).all():
        raise entries.UnfitError("has entries that are not finite")
    if np.abs(out.data).max(initial=0.0) > entries.LARGEST:
        raise entries.UnfitError(f"has entries beyond {entries.LARGEST:g}")
    out.data = np.where(np.abs(out.data) < entries.LEAST, 0.0, out.data)
    return out


IN_PLANE, ALL = (1, 2, 6), (1, 2, 3, 4, 5, 6)  # freedoms: u_x, u_y, u_z, θ_x, θ_y, θ_z


class Units(NamedTuple):
    """What a program's units of length, mass and time are in SI."""

    length: float
    mass: float
    time: float

    @property
    def energy(self) -> float:
        """Its unit of energy in J."""
        return self.mass * (self.length / self.time) ** 2


_INCH, _POUND = 0.0254, 4.4482216152605  # m, N: exact
UNITS = {
    "m-kg-s": Units(1.0, 1.0, 1.0),
    "mm-t-s": Units(1e-3, 1e3, 1.0),
    "mm-kg-ms": Units(1e-3, 1.0, 1e-3),
    "in-lbf-s": Units(_INCH, _POUND / _INCH, 1.0),
}


@dataclass(frozen=True, eq=False)
class ImportedPart:
    """K and M (n, n) as they are written, in SI, and of each named node its rows and its place."""

    K: sparse.csr_array
    M: sparse.csr_array
    rows: Mapping[str, NDArray[np.intp]]
    places: Mapping[str, tuple[float, ...]]  # m, in the part's axes
    held: int  # freedoms out of the plane of the nodes, left out
    null: tuple[str, ...]  # rows that are zero in K and M, left out: numbers, or node and freedom


def imported_part(case: CaseFile, name: str) -> ImportedPart:
    """The part of a superelement. Raises MechanismError at the key that is wrong."""
    link: Any = case.mechanism.links[name]
    folder = case.path.parent
    files = (link.stiffness, link.mass, link.file, *node_files(link))
    given = [seen_from(folder, split_variable(f)[0]) for f in files if f is not None]
    digests = tuple(case.files.get(file) for file in given)
    link = link.model_copy(update={"reduce_to": None})
    return _read(link, case.mechanism.space, f"mechanism.links.{name}", digests)


def matrix_keys(link: Any) -> tuple[str, str]:
    """The keys of a link that name its stiffness and its mass."""
    return ("file", "file") if link.file is not None else ("stiffness", "mass")


def node_files(link: Any) -> tuple[str, ...]:
    """The files of a link about its nodes."""
    given = link.nodes_file
    return given if isinstance(given, tuple) else () if given is None else (given,)


@lru_cache(maxsize=4)  # few, for parts are large; the digests tell files that change
def _read(link: Any, space: str, path: str, digests: tuple[str | None, ...]) -> ImportedPart:
    contents = _nodes(link, f"{path}.nodes_file")
    K, M, labels, of_matrices = _matrices(link, path, contents)
    unit = UNITS[link.units]
    wanted = IN_PLANE if space == "planar" else ALL
    rows, held = dict[str, NDArray[np.intp]](), list[int]()
    for name, node in link.nodes.items():
        if node.dofs is not None:
            rows[name] = np.array(node.dofs, dtype=np.intp)
        else:
            rows[name], more = _rows(labels, node.id, wanted, f"{path}.nodes.{name}")
            held += more
    places = _places(link, path, [*of_matrices, *contents], unit.length)
    n, scale = K.shape[0], np.ones(K.shape[0])
    flat = np.concatenate([*rows.values()])
    if len(set(flat.tolist())) != len(flat) or flat.min() < 0 or flat.max() >= n:
        message = f"dof numbers must be different and within 0 to {n - 1}"
        raise MechanismError(f"{path}.nodes", message)
    for own in rows.values():
        scale[own[: 2 if space == "planar" else 3]] = 1.0 / unit.length
    # rotations of nodes of solid elements, as programs leave them
    null = np.flatnonzero((abs(K).sum(axis=1) == 0.0) & (abs(M).sum(axis=1) == 0.0))
    for name, own in rows.items():
        if (nothing := np.intersect1d(own, null).tolist()) != []:
            message = f"its rows {listed(map(str, nothing))} are zero in stiffness and in mass"
            raise MechanismError(f"{path}.nodes.{name}", message)
    kept = np.setdiff1d(np.arange(n), [*held, *null])
    D = sparse.diags_array(scale).tocsr()[:, kept]
    return ImportedPart(
        sparse.csr_array(unit.energy * (D.T @ K @ D)),
        sparse.csr_array(unit.energy * unit.time**2 * (D.T @ M @ D)),
        {name: np.searchsorted(kept, own) for name, own in rows.items()},
        places,
        len(held),
        tuple(
            str(k)
            if labels is None
            else f"{labels[k] // entries.LABEL}.{labels[k] % entries.LABEL}"
            for k in null
        ),
    )


# --- Files


def _nodes(link: Any, key: str) -> list[entries.Contents]:
    """What the files about nodes hold; a CSV of another kind than all others."""
    found = []
    for file in map(Path, node_files(link)):
        contents = read_contents(file, key)
        found.append(_table(file, key, UNITS[link.units].length) if contents is None else contents)
    return found


def _table(file: Path, key: str, length: float) -> entries.Contents:
    """Places from a CSV of id, x, y, z; without units in its header in those of the matrices."""
    metre = DIMENSIONS["length"]
    axes = [CsvColumn(axis, (PLAIN, metre), optional=axis == "z") for axis in "xyz"]
    table = read_table(file, key, [CsvColumn("id", (PLAIN,)), *axes])
    own = [1.0 if table.dimensions.get(axis) == metre else length for axis in "xyz"]
    ids, x, y = (table.numbers[name] for name in ("id", "x", "y"))
    points = np.array([x, y, table.numbers.get("z", np.zeros(len(x)))]).T * own / length
    if any(node % 1 for node in ids):
        raise MechanismError(key, f"{file.name}: column id: expected whole numbers")
    return entries.Contents(
        places=entries.places_of((int(n), x) for n, x in zip(ids, points, strict=True))
    )


def _matrices(
    link: Any, path: str, contents: Sequence[entries.Contents]
) -> tuple[sparse.csr_array, sparse.csr_array, entries.Ints | None, list[entries.Contents]]:
    """K and M with their rows in one order, the labels of these, and all that their files hold."""
    keys = matrix_keys(link)
    parts = [split_variable(getattr(link, key)) for key in keys]
    files = {file: f"{path}.{key}" for (file, _), key in zip(parts, keys, strict=True)}
    held = {file: read_contents(Path(file), key) for file, key in files.items()}
    K, M = (
        matrix_of(held[file], Path(file), f"{path}.{key}", name, kind, link.file is None)
        for (file, name), key, kind in zip(parts, keys, "KM", strict=True)
    )
    if (K.labels is None) != (M.labels is None):
        message = "only one of stiffness and mass says whose its rows are: export both alike"
        raise MechanismError(f"{path}.{keys[1]}", message)
    labels = next((each.labels for each in contents if each.labels is not None), None)
    if K.labels is not None and M.labels is not None:
        labels = np.union1d(K.labels, M.labels)
        K = _spread(K, np.searchsorted(labels, K.labels), len(labels))
        M = _spread(M, np.searchsorted(labels, M.labels), len(labels))
    elif K.matrix.shape != M.matrix.shape and (K.grows or M.grows):
        n = max(K.matrix.shape[0], M.matrix.shape[0])
        K, M = (_spread(A, np.arange(A.matrix.shape[0]), n) if A.grows else A for A in (K, M))
    if K.matrix.shape != M.matrix.shape:
        message = f"is {M.matrix.shape}, the stiffness is {K.matrix.shape}"
        raise MechanismError(f"{path}.{keys[1]}", message)
    if labels is not None and len(labels) != K.matrix.shape[0]:
        message = f"names {len(labels)} rows; the matrices have {K.matrix.shape[0]}"
        raise MechanismError(f"{path}.nodes_file", message)
    return K.matrix, M.matrix, labels, [each for each in held.values() if each]


def _spread(A: entries.Matrix, rows: entries.Ints, n: int) -> entries.Matrix:
    """``A`` among ``n`` rows."""
    matrix = A.matrix.tocoo()
    at = (rows[matrix.row], rows[matrix.col])
    return entries.Matrix(sparse.coo_array((matrix.data, at), shape=(n, n)).tocsr())


# --- Nodes


def _places(
    link: Any, path: str, contents: Sequence[entries.Contents], length: float
) -> dict[str, tuple[float, ...]]:
    """The place of each node, as the case or a file has it."""
    if all(node.position is not None for node in link.nodes.values()):
        return {name: node.position for name, node in link.nodes.items()}
    places: dict[int, Floats] = {}
    for each in contents:
        places |= each.places
    found = {}
    for name, node in link.nodes.items():
        number = node.id[0] if isinstance(node.id, tuple) else node.id
        place = node.position if node.position is not None else places.get(number)
        if place is None:
            message = (
                f"no place of node {number} is in the files: write its position, or name a "
                "nodes_file with it (CSV of id, x, y, z, or the other program's input file)"
            )
            raise MechanismError(f"{path}.nodes.{name}", message)
        if not np.isfinite(place).all():
            message = (
                f"node {number} stands at several places, or in a coordinate system of its own: "
                "write its position, and export its freedoms in the axes of the part"
            )
            raise MechanismError(f"{path}.nodes.{name}", message)
        own = place is node.position
        found[name] = tuple(place) if own else tuple((length * np.asarray(place)).tolist())
    return found


def _rows(
    labels: entries.Ints | None, node: Any, wanted: Sequence[int], key: str
) -> tuple[NDArray[np.intp], list[int]]:
    """The rows of the ``wanted`` freedoms of a node, and those of its others."""
    if labels is None:
        message = (
            "the matrices do not say whose their rows are: write dofs, or name a nodes_file that "
            "does (.dof of CalculiX, .mapping of Ansys, or a line node.freedom for each row)"
        )
        raise MechanismError(key, message)
    node, turning = node if isinstance(node, tuple) else (node, None)
    own = {
        int(labels[k] % entries.LABEL): int(k)
        for k in np.flatnonzero(labels // entries.LABEL == node)
    }
    if turning is not None:
        at = np.flatnonzero(labels // entries.LABEL == turning)
        own |= {3 + int(labels[k] % entries.LABEL): int(k) for k in at}
    if not own:
        nodes = np.unique(labels // entries.LABEL)
        nodes = nodes[nodes > 0]
        last = nodes.max(initial=0)
        message = (
            f"no row belongs to node {node}; the {len(nodes)} nodes of the matrices have numbers "
            f"from {nodes.min(initial=last)} to {last}"
        )
        raise MechanismError(f"{key}.id", message)
    if missing := [freedom for freedom in wanted if freedom not in own]:
        message = f"node {node} has no freedom {', '.join(map(str, missing))}"
        if set(missing) <= {4, 5, 6}:
            message += (
                ": nodes of solid elements do not rotate; couple them in the other program to a "
                "node that does (RBE2 or RBE3, *COUPLING, CERIG, *RIGID BODY with ROT NODE) and "
                "name that one"
            )
        raise MechanismError(f"{key}.id", message)
    others = [row for freedom, row in own.items() if freedom not in wanted and freedom in ALL]
    return np.array([own[freedom] for freedom in wanted], dtype=np.intp), others
