"""Expansions as named plain arrays, for files that outlive the process, and what their key is of.

Of an expansion that is what takes long to compute: coefficients and vectors. What a key is made of
becomes a tree in JSON, whose leaves are the next so many values of two arrays.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.errors import UsageError
from eigassign.modal.expansion import Cluster, Expansion

Array = NDArray[Any]
ALGORITHM = "expansion 3"  # raise it whenever the numbers an expansion is made of may change


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
