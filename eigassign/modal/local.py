"""The set of multi-indices an expansion is carried out over, in local variables w = V (x − x0).

w are the relative joint coordinates and design parameters on which anything depends, or, for a set
that was given over x, those of x.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import UsageError
from eigassign.mechanism.pencil import Pencil
from eigassign.modal.rayleigh import vector_members
from eigassign.series.lower_set import LowerSet, lower_set, partially_linear, total_degree

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Local:
    """The set over w, dz/dw and dw/dx."""

    space: LowerSet
    to_z: Floats
    directions: Floats
    n_linear: int
    kept: NDArray[np.bool_]


def local_space(pencil: Pencil, order: int, linear_in_y: bool, space: LowerSet | None) -> Local:
    """The set over w that was asked for; raises UsageError for one of the wrong width."""
    if space is not None:
        if not isinstance(space, LowerSet):
            raise UsageError(f"space must be a lower set, not {type(space).__name__}")
        return _given_space(pencil, space)
    to_z, directions, kept = pencil.local_directions
    n_a = int(np.count_nonzero(pencil.active[: pencil.n_q]))
    n_b = to_z.shape[1] - n_a
    chosen = partially_linear(n_a, n_b, order) if linear_in_y else total_degree(n_a + n_b, order)
    return Local(chosen, to_z, directions, n_b if linear_in_y else 0, kept)


def _given_space(pencil: Pencil, space: LowerSet) -> Local:
    """A set over x as it was given, the variables that do not matter taken out."""
    n_x = pencil.to_program.shape[1]
    if space.n_variables != n_x:
        raise UsageError(f"the set has {space.n_variables} variables, the model {n_x}")
    kept = (pencil.to_program[pencil.active] != 0.0).any(axis=0)
    selection = np.eye(n_x)[kept]
    return Local(_over(space, kept.tobytes()), pencil.to_program[:, kept], selection, 0, kept)


@lru_cache(maxsize=64)
def _over(space: LowerSet, kept: bytes) -> LowerSet:
    """The members without the variables that are not kept, over those that are."""
    columns = np.frombuffer(kept, dtype=bool)
    inside = (space.indices[:, ~columns] == 0).all(axis=1)
    return lower_set(space.indices[inside][:, columns])


@lru_cache(maxsize=64)
def vector_set(
    space: LowerSet, n_linear: int, vector_order: int | None
) -> tuple[LowerSet, NDArray[np.intp]]:
    """The set of eigenvector coefficients and its positions in the set of eigenvalues."""
    linear = np.arange(space.n_variables) >= space.n_variables - n_linear
    if vector_order is None:
        members = vector_members(space, linear)
    else:
        members = np.asarray(space.degrees <= vector_order)
    half = space.restrict(members)
    return half, space.find(half.indices)
