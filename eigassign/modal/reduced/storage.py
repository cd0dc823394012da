"""A reduced model as plain named arrays, so that it can be evaluated without its mechanism.

The frozen objects a reduced model consists of become a tree in JSON whose leaves point at arrays.
Only the classes listed here are ever made from such a tree.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.errors import UsageError
from eigassign.modal.reduced.error_estimate import ErrorTerms, Pose, Residual
from eigassign.modal.reduced.model import ReducedModel
from eigassign.modal.taylor.storage import flatten, unflatten
from eigassign.series.compiler import Program, Step
from eigassign.series.implicit import ImplicitFunction

Array = NDArray[Any]
FORMAT = "reduced model 2"  # raise it whenever what the arrays mean changes
STORED = (ReducedModel, ErrorTerms, Residual, Pose, Program, Step, ImplicitFunction)
CLASSES: dict[str, type] = {c.__name__: c for c in STORED}


def reduced_arrays(reduced: ReducedModel) -> dict[str, Array]:
    """Everything a reduced model consists of, as int64, float64 and byte arrays."""
    arrays: dict[str, Array] = {}
    complete = replace(reduced, certified=reduced.error_terms)
    tree = {"format": FORMAT, "model": _taken_apart(complete, arrays)}
    text = np.frombuffer(json.dumps(tree, allow_nan=False).encode(), dtype=np.uint8)
    return {**flatten(arrays), "tree": text}


def reduced_from_arrays(arrays: Mapping[str, Array]) -> ReducedModel:
    """The reduced model that `reduced_arrays` took apart, equal to it bit for bit.

    Raises UsageError for arrays that are something else or of another version.
    """
    try:
        tree = json.loads(arrays["tree"].tobytes())
        if tree["format"] != FORMAT:
            raise UsageError(f"these arrays are a {tree['format']!r}, not a {FORMAT!r}")
        model = _put_together(tree["model"], unflatten(arrays))
    except (KeyError, ValueError, TypeError) as error:
        raise UsageError(f"these arrays are not a reduced model: {error}") from error
    if not isinstance(model, ReducedModel):
        raise UsageError("these arrays are not a reduced model")
    return model


def _taken_apart(thing: Any, arrays: dict[str, Array]) -> Any:
    if thing is None or isinstance(thing, (bool, int, str)):
        return thing
    if isinstance(thing, tuple):
        return {"tuple": [_taken_apart(part, arrays) for part in thing]}
    if isinstance(thing, sparse.csr_array):
        csr = (thing.data, thing.indices, thing.indptr)
        return {"csr": list(thing.shape), "parts": [_taken_apart(p, arrays) for p in csr]}
    if isinstance(thing, np.ndarray):
        return _array(thing, arrays)
    if is_dataclass(thing) and type(thing).__name__ in CLASSES:
        members = {f.name: _taken_apart(getattr(thing, f.name), arrays) for f in fields(thing)}
        return {"class": type(thing).__name__, "fields": members}
    raise UsageError(f"a {type(thing).__name__} cannot be stored")


def _array(array: Array, arrays: dict[str, Array]) -> dict[str, Any]:
    stored = {"f": np.float64, "i": np.int64, "b": np.uint8}.get(array.dtype.kind)
    if stored is None:
        raise UsageError(f"arrays of dtype {array.dtype} cannot be stored")
    name = f"a{len(arrays)}"
    arrays[name] = np.ascontiguousarray(array, dtype=stored)
    return {"array": name, "kind": array.dtype.kind}


def _put_together(tree: Any, arrays: Mapping[str, Array]) -> Any:
    if not isinstance(tree, dict):
        return tree
    if "tuple" in tree:
        return tuple(_put_together(part, arrays) for part in tree["tuple"])
    if "csr" in tree:
        data, indices, indptr = (_put_together(part, arrays) for part in tree["parts"])
        return sparse.csr_array((data, indices, indptr), shape=tuple(tree["csr"]))
    if "array" in tree:
        kind: Any = {"f": np.float64, "i": np.intp, "b": np.bool_}[tree["kind"]]
        array: Array = np.array(arrays[tree["array"]], dtype=kind)
        array.setflags(write=False)
        return array
    members = {name: _put_together(part, arrays) for name, part in tree["fields"].items()}
    return CLASSES[tree["class"]](**members)
