"""An expansion as named plain arrays, for files that outlive the process, and back bit for bit."""

from __future__ import annotations

import json
from collections.abc import Mapping
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import UsageError
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.taylor.expansion import Cluster, Expansion
from eigassign.series.algebra import Function
from eigassign.series.compiler import Program, Step
from eigassign.series.implicit import ImplicitFunction
from eigassign.series.multi_index import LowerSet

Array = NDArray[Any]
_KINDS = {"f": np.float64, "i": np.int64, "u": np.uint8}
ALGORITHM = "expansion 2"  # raise it whenever the numbers an expansion is made of may change


def expansion_arrays(expansion: Expansion) -> dict[str, Array]:
    """Everything an expansion consists of; names of letters, digits and underscores.

    ``cluster_<k>_modes`` (r,), ``cluster_<k>_coefficients`` (r, r, N) and ``cluster_<k>_vectors``
    (N_H, n_dof, r) for each cluster k; notes as UTF-8 bytes, one a line.
    """
    arrays: dict[str, Array] = {
        "modes": np.array(expansion.modes, dtype=np.int64),
        "q0": expansion.q0,
        "y0": expansion.y0,
        "indices": expansion.space.indices,
        "directions": expansion.directions,
        "n_linear": np.array(expansion.n_linear, dtype=np.int64),
        "kept": expansion.kept,
        "vector_indices": expansion.vector_space.indices,
        "notes": np.frombuffer("\n".join(expansion.notes).encode(), dtype=np.uint8),
    }
    for k, (cluster, vectors) in enumerate(zip(expansion.clusters, expansion.vectors, strict=True)):
        arrays[f"cluster_{k}_modes"] = np.array(cluster.modes, dtype=np.int64)
        arrays[f"cluster_{k}_coefficients"] = cluster.coefficients
        arrays[f"cluster_{k}_vectors"] = vectors
    return arrays


def expansion_from_arrays(arrays: Mapping[str, Array]) -> Expansion:
    """The expansion that `expansion_arrays` took apart, equal to it bit for bit.

    Raises UsageError when an array is missing or its shape does not fit the others.
    """
    try:
        expansion = _assembled(arrays)
    except (KeyError, ValueError, TypeError, IndexError) as error:
        raise UsageError(f"these arrays are not an expansion: {error}") from error
    _check_shapes(expansion)
    return expansion


def _assembled(arrays: Mapping[str, Array]) -> Expansion:
    count = sum(name.endswith("_coefficients") for name in arrays)
    text = arrays["notes"].tobytes().decode()
    return Expansion(
        modes=_integers(arrays["modes"]),
        clusters=tuple(
            Cluster(
                _integers(arrays[f"cluster_{k}_modes"]),
                _frozen(arrays[f"cluster_{k}_coefficients"]),
            )
            for k in range(count)
        ),
        q0=_frozen(arrays["q0"]),
        y0=_frozen(arrays["y0"]),
        space=LowerSet(_frozen(arrays["indices"])),
        directions=_frozen(arrays["directions"]),
        n_linear=int(arrays["n_linear"]),
        kept=_frozen(arrays["kept"]),
        vectors=tuple(_frozen(arrays[f"cluster_{k}_vectors"]) for k in range(count)),
        vector_space=LowerSet(_frozen(arrays["vector_indices"])),
        notes=tuple(text.split("\n")) if text else (),
    )


def _check_shapes(expansion: Expansion) -> None:
    n_w, n_x = expansion.directions.shape
    fits = expansion.space.indices.shape[1] == expansion.vector_space.indices.shape[1] == n_w
    fits &= len(expansion.x0) == len(expansion.kept) == n_x
    fits &= set(expansion.modes) <= {m for c in expansion.clusters for m in c.modes}
    for cluster, vectors in zip(expansion.clusters, expansion.vectors, strict=True):
        r = len(cluster.modes)
        fits &= cluster.coefficients.shape == (r, r, len(expansion.space))
        fits &= vectors.shape[::2] == (len(expansion.vector_space), r)
    if not fits:
        raise UsageError("these arrays are not an expansion: their shapes do not fit")


def _integers(array: Array) -> tuple[int, ...]:
    return tuple(int(value) for value in array)


def _frozen(array: Array) -> Array:
    array = np.ascontiguousarray(array)
    array.setflags(write=False)
    return array


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
    """What `flatten` took together; raises UsageError if that is not what it is given."""
    try:
        taken = {"f": 0, "i": 0}
        found: dict[str, Array] = {}
        for name, kind, shape in json.loads(flat["layout"].tobytes()):
            store = "f" if kind == "f" else "i"
            end = taken[store] + prod(shape)
            piece = flat["numbers" if store == "f" else "integers"][taken[store] : end]
            found[name] = piece.reshape(shape).astype(_KINDS[kind], copy=False)
            taken[store] = end
    except (KeyError, ValueError, TypeError) as error:
        raise UsageError(f"these arrays are not what was stored: {error}") from error
    return found


def pencil_parts(pencil: Pencil) -> list[Any]:
    """All numbers a pencil consists of, as nested lists of arrays, integers and text.

    Two pencils with equal parts have bit for bit equal K and M everywhere, and their expansions
    agree: this is what a stored expansion is filed under.
    """
    return [
        pencil.n_dof,
        pencil.n_u,
        pencil.n_q,
        pencil.rigid,
        pencil.rows,
        pencil.columns,
        *(_csr(weights) for weights in (pencil.stiffness, pencil.mass)),
        pencil.to_program,
        pencil.shift,
        _program(pencil.program),
    ]


def _program(program: Program) -> list[Any]:
    return [
        [program.n_variables, program.n_atoms, program.inputs, program.input_variables],
        [program.outputs, program.dependence],
        [_step(step) for step in program.steps],
    ]


def _step(step: Step) -> list[Any]:
    matrix = None if step.matrix is None else _csr(step.matrix)
    solved = [step.picked, None if step.function is None else _implicit(step.function)]
    return [step.kind, step.targets, step.left, step.right, step.numbers, matrix, *solved]


def _implicit(function: Function) -> list[Any]:
    if not isinstance(function, ImplicitFunction):
        raise UsageError(f"a {type(function).__name__} has no parts to compare by")
    counts = [function.size, function.n_equations, function.n_checks]
    return [_program(function.program), *counts, function.a0, function.p0]


def _csr(matrix: Any) -> list[Any]:
    return [list(matrix.shape), matrix.data, matrix.indices, matrix.indptr]
