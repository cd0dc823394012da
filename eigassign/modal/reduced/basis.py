"""The basis of a reduced model: Taylor vectors, guards and probes, made K-orthonormal.

It holds the Taylor vectors of the wanted modes to order m; those of the modes below them and of the
next one above to order m − 1; and a few modes above those as they are, so that one that comes down
is seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.exact.solver import lowest_modes
from eigassign.modal.reduced.ritz import mean_theta, orthonormal
from eigassign.modal.taylor.expansion import expand

Floats = NDArray[np.float64]
PROBES = 6  # modes above the guard that may join as they are at the expansion point
DISTANT = 10.0  # λ beyond this multiple of the highest wanted one needs no probe
Plan = Sequence[tuple[Sequence[int], int]]  # modes, and the order of their Taylor vectors


@dataclass(frozen=True, eq=False)
class RitzBasis:
    """V, and what it was made from."""

    pencil: Pencil
    modes: tuple[int, ...]
    points: Floats  # (n_points, n_x): the expansion points
    theta0: Floats  # (n_theta, n_points)
    theta_mean: Floats  # (n_theta,): those of K0
    K0: sparse.csc_array  # elastic rows and columns: the inner product
    V: Floats  # (n_elastic, k) with VᵀK0V = I
    lam: Floats  # (n_points, …): the lowest eigenvalues at each point, more than are represented
    represented: Floats  # (n_points, n_dof, c): the modes that are in V as they are

    @property
    def wide(self) -> Floats:
        """[V 0; 0 I_F] (n_dof, k + f) on all dofs."""
        k, f = self.V.shape[1], len(self.pencil.rigid)
        wide = np.zeros((self.pencil.n_dof, k + f))
        wide[self.pencil.elastic, :k] = self.V
        wide[self.pencil.rigid, k:] = np.eye(f)
        return wide

    @property
    def shapes(self) -> Floats:
        """The represented modes in coordinates of V, (n_points, k, c)."""
        elastic = self.pencil.elastic
        return np.array([self.V.T @ (self.K0 @ phi[elastic]) for phi in self.represented])


def ritz_basis(
    pencil: Pencil,
    points: Floats,
    wanted: tuple[int, ...],
    half_order: int,
    guard: bool,
    given: Floats | None,
) -> RitzBasis:
    """See :func:`eigassign.modal.reduced.reduce.reduce`."""
    theta0 = pencil.theta(points)
    found = lowest_modes(pencil, theta0, wanted[-1], 2 + PROBES if guard else 1)
    count = _represented(found.lam, wanted[-1]) if guard else wanted[-1]
    plan = _plan(found.lam.shape[1], wanted, half_order, guard)
    if given is None:
        columns = [_taylor_vectors(pencil, x, plan) for x in points]
    else:
        columns = [given, _taylor_vectors(pencil, points[0], plan[1:])]
    columns += [phi[:, :count] for phi in found.phi]
    theta_mean = mean_theta(pencil, points)
    K0 = pencil.sparse(pencil.stiffness @ theta_mean)[pencil.elastic][:, pencil.elastic].tocsc()
    V = orthonormal(K0, np.hstack(columns)[pencil.elastic])
    represented = found.phi[:, :, :count]
    return RitzBasis(pencil, wanted, points, theta0, theta_mean, K0, V, found.lam, represented)


def _represented(lam: Floats, highest: int) -> int:
    """How many modes join the basis at least as they are: a guard, and probes up to DISTANT."""
    near = (lam < DISTANT * lam[:, [highest - 1]]).any(axis=0)
    wished = max(int(near.sum()), highest + 1)
    return int(min(wished, highest + 1 + PROBES, lam.shape[1]))


def _plan(most: int, wanted: tuple[int, ...], half_order: int, guard: bool) -> Plan:
    """The wanted modes and, to one order less, guards: of the ``most`` that have mass."""
    guards = [m for m in range(1, wanted[-1] + 2) if m not in wanted and m <= most]
    if not guard or not guards or half_order < 2:
        return [(wanted, half_order)]
    return [(wanted, half_order), (tuple(guards), half_order - 1)]


def _taylor_vectors(pencil: Pencil, x0: Floats, plan: Plan) -> Floats:
    """Columns φ_γ (n_dof, N)."""
    columns = [np.zeros((pencil.n_dof, 0))]
    for modes, order in plan:
        q0, y0 = x0[: pencil.n_q], x0[pencil.n_q :]
        found = expand(pencil, q0, y0, modes, order=max(order, 1), vector_order=order)
        columns += [X.transpose(1, 0, 2).reshape(pencil.n_dof, -1) for X in found.vectors]
    return np.hstack(columns)
