"""From a series in local variables w to one in x, by w = V (x − x0)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from eigassign.series.lower_set import LowerSet, lower_set, partially_linear, total_degree
from eigassign.series.power_series import multiply

Floats = NDArray[np.float64]


def substitute(
    space: LowerSet, coefficients: Floats, directions: Floats, n_q: int, n_linear: int
) -> tuple[LowerSet, Floats]:
    """The set over x and coefficients (k, N_x) of Σ c_γ (V (x − x0))^γ, c (k, N)."""
    selection = (np.count_nonzero(directions, axis=1) == 1).all()
    if selection and (directions.max(axis=1, initial=0.0) == 1.0).all():
        return _embed(space, coefficients, directions)
    used = np.flatnonzero((directions != 0.0).any(axis=0))
    n_y = int((used >= n_q).sum())
    n_a = len(used) - n_y
    inner = (
        partially_linear(n_a, n_y, space.order)
        if n_linear
        else total_degree(len(used), space.order)
    )
    values = coefficients @ _monomial_series(space, inner, directions[:, used])
    wide = np.zeros((len(inner), directions.shape[1]), dtype=np.int64)
    wide[:, used] = inner.indices
    return _sorted(wide, values)


def _embed(space: LowerSet, coefficients: Floats, directions: Floats) -> tuple[LowerSet, Floats]:
    """Every w is one of x: indices are only spread over the columns."""
    wide = space.indices @ (directions != 0.0).astype(np.int64)
    return _sorted(wide, coefficients)


def _sorted(wide: NDArray[np.int64], values: Floats) -> tuple[LowerSet, Floats]:
    target = lower_set(wide)
    ordered = np.empty_like(values)
    ordered[:, target.find(wide)] = values
    return target, ordered


def _monomial_series(space: LowerSet, inner: LowerSet, directions: Floats) -> Floats:
    """Rows: the series in x of w^γ for every γ, each a parent's times one linear form."""
    linear = np.zeros((space.n_variables, len(inner)))
    units = inner.find(np.eye(inner.n_variables, dtype=np.int64))
    linear[:, units[units >= 0]] = directions[:, units >= 0]
    rows = np.zeros((len(space), len(inner)))
    rows[0, 0] = 1.0
    for degree in range(1, space.order + 1):
        here = np.arange(space.degree_starts[degree], space.degree_starts[degree + 1])
        first = (space.indices[here] > 0).argmax(axis=1)
        parents = space.indices[here].copy()
        parents[np.arange(len(here)), first] -= 1
        rows[here] = multiply(inner, rows[space.find(parents)], linear[first])
    return rows
