"""Taylor vectors: the eigenvectors of some modes as power series about one point x0.

    φ(x0 + x) ≈ Σ_γ φ_γ w^γ,   w = V (x − x0)

in the local variables w of `local_coordinates`, cluster by cluster. Eigenvalues follow from them by
the Rayleigh quotient; a reduced model has them as its basis.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.exact.clusters import CLUSTER_GAP, whole_clusters
from eigassign.modal.taylor.local_coordinates import LocalSpace, local_space, vector_set
from eigassign.modal.taylor.recursion import expand_subspace
from eigassign.series.multi_index import LowerSet

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TaylorVectors:
    """X (N_H, n_dof, r) over ``space`` of each cluster of ``groups``; θ (n_theta, N) of the set."""

    groups: tuple[tuple[int, ...], ...]  # modes that are expanded together, counted from 1
    vectors: tuple[Floats, ...]
    space: LowerSet
    theta: Floats


def taylor_vectors(
    pencil: Pencil,
    x0: Floats,
    modes: Sequence[int],
    local: LocalSpace,
    order: int | None = None,
    cluster_gap: float = CLUSTER_GAP,
) -> TaylorVectors:
    """Those of ``modes`` to ``order``, or to what the eigenvalues over the set of ``local`` need.

    Modes closer than ``cluster_gap`` (relative in λ) are expanded together.
    """
    theta = pencil.theta_series(local.space, x0, local.to_z)
    found, groups = whole_clusters(pencil, theta[:, :1], modes, cluster_gap)
    half, kept = vector_set(local.space, local.n_linear, order)
    vectors = []
    for group in groups:
        pick = np.array(group) - 1
        lam0, phi0 = found.lam[0, pick], found.phi[0][:, pick]
        X = np.ascontiguousarray(expand_subspace(pencil, theta[:, kept], half, lam0, phi0).vectors)
        X.setflags(write=False)
        vectors.append(X)
    return TaylorVectors(groups, tuple(vectors), half, theta)


def vectors_to_order(pencil: Pencil, x0: Floats, modes: Sequence[int], order: int) -> Floats:
    """φ_γ of ``modes`` and of what lies close to them, |γ| ≤ ``order``, as columns (n_dof, N)."""
    local = local_space(pencil, order, linear_in_y=False, space=None)
    return as_columns(taylor_vectors(pencil, x0, modes, local, order).vectors)


def as_columns(vectors: Sequence[Floats]) -> Floats:
    """X (N_H, n_dof, r) of several clusters side by side, (n_dof, N)."""
    return np.hstack([X.transpose(1, 0, 2).reshape(X.shape[1], -1) for X in vectors])
