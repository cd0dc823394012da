"""Expansions and reduced models as named plain arrays, for files that outlive the process.

The frozen objects that they consist of become a tree in JSON whose leaves point at arrays, and come
back equal bit for bit. Only the classes listed here are ever made from such a tree.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from math import prod
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.errors import UsageError
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.expansion import Cluster, Expansion
from eigassign.modal.reduced.added_mass import AddedMass
from eigassign.modal.reduced.error_estimate import ErrorTerms
from eigassign.modal.reduced.model import ReducedModel
from eigassign.modal.reduced.rehearsal import answers, same_answers
from eigassign.modal.reduced.residual import JointCorrection, ResidualTerms
from eigassign.series.compiler import Instruction, Program
from eigassign.series.implicit import ImplicitFunction
from eigassign.series.multi_index import LowerSet

Array = NDArray[Any]
ALGORITHM = "expansion 3"  # raise it whenever the numbers an expansion is made of may change
FORMAT = "reduced model 6"  # raise it whenever what the arrays of a reduced model mean changes
STORED: tuple[type, ...] = (
    Expansion,
    Cluster,
    LowerSet,
    ReducedModel,
    ErrorTerms,
    AddedMass,
    ResidualTerms,
    JointCorrection,
    Program,
    Instruction,
    ImplicitFunction,
)
NAMES = {c: c.__name__ for c in STORED} | {Instruction: "Step"}  # in files
CLASSES = {name: c for c, name in NAMES.items()}
_DAMAGE = (LookupError, ValueError, TypeError, AttributeError, ArithmeticError, RecursionError)
_KINDS: dict[str, Any] = {"f": np.float64, "i": np.int64, "u": np.uint8}


def expansion_arrays(*expansions: Expansion) -> dict[str, Array]:
    """Everything that some expansions consist of but their pencil, as int64, float64 and bytes."""
    return _arrays(tuple(replace(e, pencil=None) for e in expansions), ALGORITHM)


def expansions_from_arrays(arrays: Mapping[str, Array], count: int) -> tuple[Expansion, ...]:
    """The ``count`` expansions that `expansion_arrays` took apart, equal to them bit for bit.

    Raises UsageError for arrays that are something else, of another version, or of shapes that do
    not fit each other.
    """
    found = _object(arrays, ALGORITHM, "expansions")
    if not (isinstance(found, tuple) and [type(e) for e in found] == [Expansion] * count):
        raise UsageError(f"these arrays are not {count} expansions")
    try:
        fits = all(_shapes_fit(expansion) for expansion in found)
    except (ValueError, TypeError, IndexError, AttributeError):
        fits = False
    if not fits:
        raise UsageError("these arrays are not an expansion: their shapes do not fit")
    return found


def reduced_arrays(reduced: ReducedModel) -> dict[str, Array]:
    """A reduced model and its answers at some points, as int64, float64 and byte arrays."""
    return _arrays((replace(reduced, certified=reduced.error_terms), answers(reduced)), FORMAT)


def reduced_from_arrays(arrays: Mapping[str, Array]) -> ReducedModel:
    """The reduced model that `reduced_arrays` took apart, equal to it bit for bit.

    Raises UsageError for arrays that are something else, of another version, or of a model that
    does not answer as it did when it was stored.
    """
    try:
        model, given = _object(arrays, FORMAT, "a reduced model")
        same = same_answers(answers(model), given, len(model.modes))
    except UsageError:
        raise
    except Exception as error:  # of what is no model, anything may come
        name = type(error).__name__
        raise UsageError(f"these arrays are not a reduced model ({name})") from error
    if not same:
        raise UsageError("it does not answer as it did when it was stored")
    return cast(ReducedModel, model)


def _shapes_fit(expansion: Expansion) -> bool:
    n_w, n_x = expansion.directions.shape
    fits = expansion.space.indices.shape[1] == expansion.vector_space.indices.shape[1] == n_w
    fits &= expansion.x0.shape == (n_x,)
    fits &= set(expansion.modes) <= {m for c in expansion.clusters for m in c.modes}
    fits &= len(expansion.clusters) == len(expansion.vectors)
    for cluster, vectors in zip(expansion.clusters, expansion.vectors, strict=False):
        r = len(cluster.modes)
        fits &= cluster.coefficients.shape == (r, r, len(expansion.space))
        fits &= vectors.shape[::2] == (len(expansion.vector_space), r)
    return bool(fits)


# --- Objects as a tree, its leaves in arrays


def _arrays(thing: Any, version: str) -> dict[str, Array]:
    arrays: dict[str, Array] = {}
    tree = {"format": version, "content": _tree(thing, arrays)}
    text = np.frombuffer(json.dumps(tree, allow_nan=False).encode(), dtype=np.uint8)
    return {**flatten(arrays), "tree": text}


def _object(arrays: Mapping[str, Array], version: str, what: str) -> Any:
    try:
        tree = json.loads(arrays["tree"].tobytes())
        if tree["format"] != version:
            raise UsageError(f"these arrays are a {tree['format']!r}, not a {version!r}")
        return _built(tree["content"], unflatten(arrays))
    except _DAMAGE as error:
        raise UsageError(f"these arrays are not {what} ({type(error).__name__})") from error


def _tree(thing: Any, arrays: dict[str, Array]) -> Any:
    if thing is None or isinstance(thing, (bool, int, str)):
        return thing
    if isinstance(thing, tuple):
        return {"tuple": [_tree(part, arrays) for part in thing]}
    if isinstance(thing, sparse.csr_array):
        csr = (thing.data, thing.indices, thing.indptr)
        return {"csr": list(thing.shape), "parts": [_tree(p, arrays) for p in csr]}
    if isinstance(thing, np.ndarray):
        stored = {"f": np.float64, "i": np.int64, "b": np.uint8}.get(thing.dtype.kind)
        if stored is None:
            raise UsageError(f"arrays of dtype {thing.dtype} cannot be stored")
        name = f"a{len(arrays)}"
        arrays[name] = np.ascontiguousarray(thing, dtype=stored)
        return {"array": name, "kind": thing.dtype.kind}
    if (stored_as := NAMES.get(type(thing))) is not None:
        members = {f.name: _tree(getattr(thing, f.name), arrays) for f in fields(thing)}
        return {"class": stored_as, "fields": members}
    raise UsageError(f"a {type(thing).__name__} cannot be stored")


def _built(tree: Any, arrays: Mapping[str, Array]) -> Any:
    if not isinstance(tree, dict):
        return tree
    if "tuple" in tree:
        return tuple(_built(part, arrays) for part in tree["tuple"])
    if "csr" in tree:
        data, indices, indptr = (_built(part, arrays) for part in tree["parts"])
        matrix = sparse.csr_array((data, indices, indptr), shape=tuple(tree["csr"]))
        matrix.check_format(full_check=True)
        return matrix
    if "array" in tree:
        kind: Any = {"f": np.float64, "i": np.intp, "b": np.bool_}[tree["kind"]]
        array: Array = np.array(arrays[tree["array"]], dtype=kind)
        array.setflags(write=False)
        return array
    members = {name: _built(part, arrays) for name, part in tree["fields"].items()}
    return CLASSES[tree["class"]](**members)


# --- Many arrays as three


def flatten(arrays: Mapping[str, Array]) -> dict[str, Array]:
    """Any number of named int64, float64 and byte arrays as three: one read, not one for each.

    ``integers`` and ``numbers`` hold the values one array after the other, ``layout`` as JSON in
    bytes says what they are: name, kind and shape of each.
    """
    layout: list[list[Any]] = []
    integers: list[Array] = []
    numbers: list[Array] = []
    for name, array in arrays.items():
        floating = array.dtype == np.float64
        if not floating and array.dtype not in (np.int64, np.uint8):
            raise UsageError(f"{name}: arrays of dtype {array.dtype} cannot be stored")
        layout.append([name, array.dtype.kind, list(array.shape)])
        (numbers if floating else integers).append(array.ravel())
    return {
        "layout": np.frombuffer(json.dumps(layout).encode(), dtype=np.uint8),
        "integers": np.concatenate([np.zeros(0, dtype=np.int64), *integers], dtype=np.int64),
        "numbers": np.concatenate([np.zeros(0), *numbers]),
    }


def unflatten(flat: Mapping[str, Array]) -> dict[str, Array]:
    """The arrays that `flatten` took together; raises UsageError for anything else."""
    try:
        taken = {"f": 0, "i": 0}
        found: dict[str, Array] = {}
        for name, kind, shape in json.loads(flat["layout"].tobytes()):
            store = "f" if kind == "f" else "i"
            end = taken[store] + prod(shape)
            piece = flat["numbers" if store == "f" else "integers"][taken[store] : end]
            found[name] = piece.reshape(shape).astype(_KINDS[kind], copy=False)
            taken[store] = end
    except _DAMAGE as error:
        name = type(error).__name__
        raise UsageError(f"these arrays are not what was stored ({name})") from error
    return found


# --- What an expansion is filed under


def pencil_parts(pencil: Pencil) -> list[Any]:
    """All numbers a pencil consists of, as nested lists of arrays, integers and text.

    Two pencils with equal parts have bit for bit equal K and M everywhere, and their expansions
    agree: this is what a stored expansion is filed under.
    """
    numbers = [pencil.n_dof, pencil.n_u, pencil.n_q, pencil.n_loads, pencil.rigid]
    numbers += [pencil.rows, pencil.columns]
    matrices = [pencil.stiffness, pencil.mass, pencil.to_program, pencil.shift]
    return [*numbers, *map(_parts, [*matrices, pencil.program])]


def _parts(thing: Any) -> Any:
    if isinstance(thing, tuple):
        return [_parts(part) for part in thing]
    if isinstance(thing, sparse.csr_array | sparse.csc_array):
        return [list(thing.shape), thing.data, thing.indices, thing.indptr]
    if is_dataclass(thing):
        return [_parts(getattr(thing, f.name)) for f in fields(thing)]
    return thing
