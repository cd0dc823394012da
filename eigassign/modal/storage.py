"""Expansions and reduced models as named plain arrays, for files that outlive the process.

Of an expansion that is what takes long to compute: coefficients and vectors. What a reduced model
or a key is made of becomes a tree in JSON, whose leaves are the next so many values of two arrays;
of such a tree only the classes listed here are ever made.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.errors import UsageError
from eigassign.modal.expansion import Cluster, Expansion
from eigassign.modal.reduced.added_mass import AddedMass
from eigassign.modal.reduced.design_stiffness import DesignStiffness
from eigassign.modal.reduced.error_estimate import ErrorTerms
from eigassign.modal.reduced.model import ReducedModel
from eigassign.modal.reduced.residual import JointCorrection, ResidualTerms
from eigassign.modal.reduced.spans import Spans
from eigassign.series.compiler import CompiledArrays, CompiledTable, Instruction, Program
from eigassign.series.implicit import ImplicitFunction

Array = NDArray[Any]
ALGORITHM = "expansion 3"  # raise it whenever the numbers an expansion is made of may change
FORMAT = "reduced model 9"  # raise it whenever what the arrays of a reduced model mean changes
CLASSES: dict[str, Any] = {
    made.__name__: made
    for made in (
        *(ReducedModel, ErrorTerms, AddedMass, ResidualTerms, JointCorrection, DesignStiffness),
        *(Program, Instruction, ImplicitFunction, CompiledTable, CompiledArrays, Spans),
    )
}
LONGEST_TREE = 2_000_000  # bytes: a hundred times those of the longest shipped case's


# --- Expansions: the clusters of each, one after the other


def expansion_arrays(*expansions: Expansion) -> dict[str, Array]:
    """Modes, coefficients and vectors of the clusters of some expansions."""
    return {
        f"{each.name}_{k}_{i}": np.asarray(getattr(cluster, each.name))
        for k, expansion in enumerate(expansions)
        for i, cluster in enumerate(expansion.clusters)
        for each in fields(Cluster)
    }


def stored_series(arrays: Mapping[str, Array], k: int) -> list[Cluster]:
    """The clusters of expansion k of those that `expansion_arrays` took apart.

    Raises UsageError where arrays are missing, or their numbers are not finite.
    """
    found: list[Cluster] = []
    while f"modes_{k}_{len(found)}" in arrays:
        parts = [arrays.get(f"{each.name}_{k}_{len(found)}") for each in fields(Cluster)]
        if any(part is None or not np.isfinite(part).all() for part in parts):
            raise UsageError("these arrays are not expansions")
        modes, coefficients, vectors = (np.asarray(part) for part in parts)
        found.append(Cluster(tuple(modes.ravel().tolist()), coefficients, vectors))
    return found


# --- Reduced models


def reduced_arrays(reduced: ReducedModel) -> dict[str, Array]:
    """A reduced model with what its error estimate needs."""
    return tree_arrays(_made(reduced))


def _made(reduced: ReducedModel) -> ReducedModel:
    """``reduced`` with nothing left to be made."""
    wider = None if reduced.wider is None else _made(reduced.wider)
    return replace(reduced, certified=reduced.error_terms, widened=wider)


def reduced_from_arrays(arrays: Mapping[str, Array]) -> ReducedModel:
    """The reduced model that `reduced_arrays` took apart, equal to it bit for bit.

    Raises UsageError for arrays that are something else: with numbers that are not finite, or of
    shapes that do not fit each other, for it is evaluated once, at an expansion point of its own.
    """
    try:
        model: ReducedModel = _Reader(arrays).whole()
        _check(model)
        if model.widened is not None:
            _check(model.widened)
    except Exception as error:  # of what is no model, anything may come
        name = type(error).__name__
        raise UsageError(f"these arrays are not a reduced model ({name})") from error
    return model


def _check(model: Any) -> None:
    """Raises anything where ``model`` does not answer at its expansion point."""
    if type(model) is not ReducedModel or type(model.certified) is not ErrorTerms:
        raise TypeError
    x, n_modes = model.points[:1], len(model.modes)
    with np.errstate(all="ignore"):
        hz = model.frequencies(x[:, : model.n_q], x[:, model.n_q :])
        error_estimate = model.error_estimate(x[:, : model.n_q], x[:, model.n_q :])
    shape = (1, n_modes)
    if hz.shape != shape or error_estimate.shape != shape or not np.isfinite(hz).all():
        raise ValueError


# --- Frozen objects as a tree, and its leaves in two arrays


def tree_arrays(thing: Any) -> dict[str, Array]:
    """Data classes, tuples, arrays, text and numbers as ``tree``, ``numbers`` and ``integers``.

    Two things with equal arrays are equal bit for bit. Raises UsageError for any other type.
    """
    leaves: dict[str, list[Array]] = {"f": [], "i": []}
    text = json.dumps(_tree(thing, leaves), allow_nan=False).encode()
    return {
        "tree": np.frombuffer(text, dtype=np.uint8),
        "numbers": np.concatenate([np.zeros(0), *leaves["f"]]),
        "integers": np.concatenate([np.zeros(0, np.int64), *leaves["i"]], dtype=np.int64),
    }


def _tree(thing: Any, leaves: dict[str, list[Array]]) -> Any:
    if thing is None or isinstance(thing, (bool, int, float, str)):
        return thing
    if isinstance(thing, tuple):
        return {"tuple": [_tree(part, leaves) for part in thing]}
    if isinstance(thing, sparse.csr_array):
        csr = (thing.data, thing.indices, thing.indptr)
        return {"csr": thing.shape, "parts": [_tree(part, leaves) for part in csr]}
    if isinstance(thing, np.ndarray) and thing.dtype.kind in "fib" and thing.itemsize <= 8:
        leaves["f" if thing.dtype.kind == "f" else "i"].append(thing.ravel())
        return {"array": thing.dtype.kind, "shape": thing.shape}
    if is_dataclass(thing):
        members = {f.name: _tree(getattr(thing, f.name), leaves) for f in fields(thing)}
        return {"class": type(thing).__name__, "fields": members}
    raise UsageError(f"a {type(thing).__name__} cannot be stored")


class _Reader:
    """What `tree_arrays` took apart, put together leaf by leaf.

    The file may be anybody's. Parsed JSON takes up to 35 times as much as its text, which is why
    that is limited; no count is larger than the number of values stored, so that nothing large is
    made of a few bytes.
    """

    def __init__(self, arrays: Mapping[str, Array]) -> None:
        self._arrays, self._taken = arrays, {"numbers": 0, "integers": 0}
        self._most = sum(arrays[name].size for name in self._taken)

    def whole(self) -> Any:
        """Raises ValueError, LookupError, TypeError or RecursionError for anything else."""
        if (
            self._arrays["tree"].size > LONGEST_TREE
            or not np.isfinite(self._arrays["numbers"]).all()
        ):
            raise ValueError
        made = self._built(json.loads(self._arrays["tree"].tobytes()))
        if sum(self._taken.values()) != self._most:
            raise ValueError
        return made

    def _built(self, tree: Any) -> Any:
        if not isinstance(tree, dict):
            if isinstance(tree, (int, float)) and not abs(tree) <= self._most:
                raise ValueError
            return tree
        if "tuple" in tree:
            return tuple(map(self._built, tree["tuple"]))
        if "csr" in tree:
            data, indices, indptr = map(self._built, tree["parts"])
            shape = tuple(map(self._built, tree["csr"]))
            # SciPy checks no row of a matrix whose last row says that it is empty
            counts = np.diff(indptr, prepend=0)
            if (counts < 0).any() or counts[0] or not len(data) == len(indices) == indptr[-1]:
                raise ValueError
            matrix = sparse.csr_array((data, indices, indptr), shape=shape)
            matrix.check_format(full_check=True)
            return matrix
        if "array" in tree:
            return self._array(tree["array"], tree["shape"])
        members = {name: self._built(part) for name, part in tree["fields"].items()}
        return CLASSES[tree["class"]](**members)

    def _array(self, kind: str, shape: list[int]) -> Array:
        name = "numbers" if kind == "f" else "integers"
        start = self._taken[name]
        self._taken[name] += prod(shape)
        piece = self._arrays[name][start : self._taken[name]].reshape(shape)
        types: dict[str, Any] = {"f": np.float64, "i": np.intp, "b": np.bool_}
        array = piece.astype(types[kind], copy=False)
        array.setflags(write=False)
        return array
