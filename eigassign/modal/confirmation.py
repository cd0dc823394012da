"""Whether stored coefficients are those of a model: every one of them, seen along one plane.

A file that was kept says of itself whose coefficients it holds. That is not believed. Over a plane
w = s a + t b, a generic in the coordinates and b in the design, the expansion has few coefficients,

    λ_ij = Σ_{|α| = i, |β| = j} λ_αβ a^α b^β ,

and the model gives these anew for little work: one eigenproblem and a recursion in two variables.
No entry of a and b is zero or special, so that a wrong coefficient shows in its sum, however high
its order. Sums are compared relative to what they may be, |λ_00| ρ_a^i ρ_b^j with the growth ρ of
the coefficients: a coefficient that is wrong by less moves no eigenvalue within the radius of
convergence by more than CLOSE. The same holds for the eigenvectors, and for each cluster.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb, prod

import numpy as np
from numpy.typing import NDArray

from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.expansion import Expansion, notes
from eigassign.modal.taylor.local_coordinates import LocalSpace, local_space, vector_set
from eigassign.modal.taylor.rayleigh import eigenvalue_series
from eigassign.modal.taylor.vectors import taylor_vectors
from eigassign.series.multi_index import LowerSet, total_degree

Floats = NDArray[np.float64]
CLOSE = 1e-8  # relative; round-off is below 2e-10 in all shipped cases


@dataclass(frozen=True)
class ExpansionRequest:
    """Expansions as they were asked for: modes, point x0, orders and kinds."""

    x0: Floats
    modes: tuple[int, ...]
    cluster_gap: float
    sets: tuple[tuple[int, bool], ...]  # order, and whether linear in y, of each


def unlike(pencil: Pencil, stored: Sequence[Expansion], wanted: ExpansionRequest) -> str | None:
    """How ``stored`` differ from the expansions of ``pencil`` wanted; None if they do not.

    Point, modes, sets and notes must be equal, coefficients and vectors as close as CLOSE.
    """
    locals_ = [local_space(pencil, order, linear, None) for order, linear in wanted.sets]
    n_a, of_x = int(np.count_nonzero(pencil.active[: pencil.n_q])), locals_[0].directions
    plane = _plane(of_x @ wanted.x0, n_a)
    inner = total_degree(plane.shape[1], max(local.space.order for local in locals_))
    on_plane = LocalSpace(inner, locals_[0].to_z @ plane, plane.T @ of_x, 0)
    halves = [vector_set(local.space, local.n_linear, None)[0] for local in locals_]
    order = max(half.order for half in halves)
    found = taylor_vectors(pencil, wanted.x0, wanted.modes, on_plane, order, wanted.cluster_gap)
    series = [eigenvalue_series(pencil, found.theta, inner, found.space, Y) for Y in found.vectors]
    for expansion, local, half in zip(stored, locals_, halves, strict=True):
        if not (
            np.array_equal(expansion.x0, wanted.x0)
            and len(expansion.q0) == pencil.n_q
            and expansion.n_linear == local.n_linear
            and np.array_equal(expansion.directions, local.directions)
            and np.array_equal(expansion.space.indices, local.space.indices)
            and np.array_equal(expansion.vector_space.indices, half.indices)
            and tuple(c.modes for c in expansion.clusters) == found.groups
            and expansion.modes == tuple(m for g in found.groups for m in g if m in wanted.modes)
            and expansion.notes == notes(found.groups, local, pencil)
            and all(X.shape[1] == pencil.n_dof for X in expansion.vectors)
        ):
            return "they are of another expansion"
        for cluster, X, c, Y in zip(
            expansion.clusters, expansion.vectors, series, found.vectors, strict=True
        ):
            values, of_model = (np.moveaxis(each, 2, 0) for each in (cluster.coefficients, c))
            if not _agree(local.space, values, inner, of_model, plane):
                return "their eigenvalues are not those of the model"
            if not _agree(half, X, found.space, Y, plane):
                return "their eigenvectors are not those of the model"
    return None


def _plane(w0: Floats, n_a: int) -> Floats:
    """a and b as columns (n_w, ≤ 2): of coordinates, in rad or m, and of the design, as a share."""
    generic = np.random.default_rng(20221122).uniform(0.5, 1.0, len(w0))
    both = np.zeros((len(w0), 2))
    both[:n_a, 0] = generic[:n_a]
    both[n_a:, 1] = (generic * np.where(w0 != 0.0, w0, 1.0))[n_a:]
    return both[:, [n_a > 0, len(w0) > n_a]]


def _agree(space: LowerSet, stored: Floats, inner: LowerSet, right: Floats, plane: Floats) -> bool:
    """Whether the sums over the plane of ``stored`` (N, …) are ``right`` (N_inner, …).

    Only those count of which the set has every member.
    """
    if not np.isfinite(stored).all():
        return False
    stored, right = stored.reshape(len(stored), -1), right.reshape(len(right), -1)
    on = plane != 0.0
    place = inner.find(space.indices @ on.astype(np.int64))
    known = np.flatnonzero(place >= 0)
    powers = np.prod(plane.sum(axis=1) ** space.indices[known], axis=1)
    sums = np.zeros(right.shape)
    with np.errstate(over="ignore", invalid="ignore"):
        np.add.at(sums, place[known], powers[:, None] * stored[known])
        close = np.abs(sums - right).max(axis=1) <= CLOSE * _envelope(inner, right)
    each = on.sum(axis=0)  # variables of a and of b: C(i + n − 1, i) members have degree i
    whole = [
        prod(comb(i + n - 1, i) for i, n in zip(row, each.tolist(), strict=True))
        for row in inner.indices.tolist()
    ]
    members = np.bincount(place[known], minlength=len(inner))
    return bool((close | (members != whole)).all())


def _envelope(space: LowerSet, c: Floats) -> Floats:
    """|c_0| ρ^γ (N,) with the least ρ of each variable that bounds its own coefficients.

    At least 1e-4 |c_0|: where nothing depends on a variable there is round-off alone.
    """
    sizes = np.abs(c).max(axis=1, initial=0.0)
    envelope = np.full(len(space), sizes[0])
    for powers in space.indices.T:
        own = (powers > 0) & (powers == space.degrees)
        growth = (sizes[own] / sizes[0]) ** (1.0 / powers[own])
        envelope *= growth.max(initial=0.0) ** powers
    return np.asarray(np.maximum(envelope, np.maximum(sizes, 1e-4 * sizes[0])))
