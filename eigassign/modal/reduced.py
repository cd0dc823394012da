"""Building the reduced model: Taylor vectors, guards and probes, rank, projection, residual.

The basis holds the Taylor vectors of the wanted modes to order m; those of the modes below them
and of the next one above to order m − 1; and a few modes above those as they are, so that one that
comes down is seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.mechanism.pencil import Pencil
from eigassign.modal.arguments import mode_numbers, whole_within
from eigassign.modal.basis import orthonormal
from eigassign.modal.expansion import expand
from eigassign.modal.half_norm import accurate_factors
from eigassign.modal.lowest import lowest_modes
from eigassign.modal.pose import joint_rows, pose
from eigassign.modal.project import project
from eigassign.modal.reduced_model import ReducedModel
from eigassign.modal.roundoff import rounding_weights
from eigassign.modal.samples import samples
from eigassign.series.algebra import Samples

__all__ = ["ReducedModel", "reduce"]

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
MAX_HALF_ORDER = 10
PROBES = 6  # modes above the guard that may join as they are at the expansion point
DISTANT = 10.0  # λ beyond this multiple of the highest wanted one needs no probe


def reduce(
    pencil: Pencil,
    q0: ArrayLike,
    y0: ArrayLike,
    modes: Sequence[int] = (1,),
    half_order: int = 2,
    guard: bool = True,
    given: Floats | None = None,
) -> ReducedModel:
    """Reduced model from the Taylor vectors of ``modes`` to order m at one or several points.

    q0 (n_q,) or (n_points, n_q), y0 likewise. ``guard=False`` leaves out all vectors but those of
    ``modes`` and the modes below them as they are: smaller, but its estimate refuses far sooner.
    ``given`` are Taylor vectors (n_dof, N) of ``modes`` at the one point that are known already.
    Raises UsageError for impossible arguments, AccuracyError where no basis can be made.
    """
    wanted = mode_numbers(modes)
    half_order = whole_within(half_order, "half_order", 0, MAX_HALF_ORDER)
    n_y = pencil.to_program.shape[1] - pencil.n_q
    points = samples(q0, y0, pencil.n_q, n_y)
    theta0 = pencil.theta(points)
    found = lowest_modes(pencil, theta0, wanted[-1], 2 + PROBES if guard else 1)
    count = _represented(found.lam, wanted[-1]) if guard else wanted[-1]
    plan = _plan(pencil, wanted, half_order, guard)
    columns = [_taylor_vectors(pencil, x, plan) for x in points] if given is None else [given]
    if given is not None:
        columns.append(_taylor_vectors(pencil, points[0], plan[1:]))
    columns += [phi[:, :count] for phi in found.phi]
    theta_mean = _mean_theta(pencil, points)
    K = pencil.sparse(pencil.stiffness @ theta_mean)[pencil.elastic][:, pencil.elastic].tocsc()
    V = orthonormal(K, np.hstack(columns)[pencil.elastic])
    at = joint_rows(pencil, K)
    projected = _project(pencil, V, at.responses, theta0[:, 0])
    k_terms = projected.stiffness_terms
    material = _material_terms(pencil, k_terms, theta0[:, 0])
    return ReducedModel(
        modes=wanted,
        n_q=pencil.n_q,
        n_y=n_y,
        half_order=half_order,
        points=points,
        program=pencil.program,
        to_program=pencil.to_program,
        shift=pencil.shift,
        stiffness_terms=k_terms,
        stiffness=projected.stiffness,
        mass_terms=projected.mass_terms,
        mass=projected.mass,
        residual=accurate_factors(pencil, K, V, pencil.elastic),
        pose=pose(pencil, at, theta_mean, projected.stiffness_rows, projected.mass_rows),
        material_terms=material,
        material=theta0[material, 0],
        anchors=_anchors(found.lam, count),
        shapes=np.array([V.T @ (K @ phi[pencil.elastic, :count]) for phi in found.phi]),
        stiffness_rounding=projected.stiffness_rounding,
        mass_rounding=projected.mass_rounding,
    )


def _represented(lam: Floats, highest: int) -> int:
    """How many modes join the basis at least as they are: a guard, and probes up to DISTANT."""
    near = (lam < DISTANT * lam[:, [highest - 1]]).any(axis=0)
    wished = max(int(near.sum()), highest + 1)
    return int(min(wished, highest + 1 + PROBES, lam.shape[1]))


def _anchors(lam: Floats, count: int) -> Floats:
    """μ of the represented modes and of the next one; 0 where there is none."""
    following = 1.0 / lam[:, count : count + 1] if lam.shape[1] > count else np.zeros((len(lam), 1))
    return np.hstack([1.0 / lam[:, :count], following])


def _plan(
    pencil: Pencil, wanted: tuple[int, ...], half_order: int, guard: bool
) -> list[tuple[tuple[int, ...], int]]:
    """(modes, order) of their Taylor vectors: the wanted ones and, to one order less, guards."""
    guards = [m for m in range(1, wanted[-1] + 2) if m not in wanted and m <= len(pencil.elastic)]
    if not guard or not guards or half_order < 2:
        return [(wanted, half_order)]
    return [(wanted, half_order), (tuple(guards), half_order - 1)]


def _taylor_vectors(
    pencil: Pencil, x0: Floats, plan: Sequence[tuple[Sequence[int], int]]
) -> Floats:
    """Columns φ_γ (n_dof, N)."""
    columns = [np.zeros((pencil.n_dof, 0))]
    for modes, order in plan:
        q0, y0 = x0[: pencil.n_q], x0[pencil.n_q :]
        found = expand(pencil, q0, y0, modes, order=max(order, 1), vector_order=order)
        columns += [X.transpose(1, 0, 2).reshape(pencil.n_dof, -1) for X in found.vectors]
    return np.hstack(columns)


def _mean_theta(pencil: Pencil, points: Floats) -> Floats:
    """θ averaged over turned poses; its K_E is the inner product of basis and residual.

    A vector smooth in one pose kinks the joints of another, with a strain energy many times that of
    a mode. In K_E(x0) numbers of that size would have to cancel; in the mean stiffness they do not.
    Loops are not turned: where they close at all, a passive carriage may have left its beam, whose
    stiffness is then not one.
    """
    if pencil.program.is_implicit:
        return np.asarray(pencil.theta(points).mean(axis=1))
    z = points @ pencil.to_program.T + pencil.shift
    z[:, pencil.n_q :] = z[0, pencil.n_q :]
    turns = np.zeros(len(pencil.shift))
    turns[: pencil.n_q] = _periodic(pencil, z[0])
    turned = np.concatenate([z + k * turns * (np.pi / 2.0) for k in range(4)])
    theta = _theta_at(pencil, turned)
    return np.asarray(theta[:, np.isfinite(theta).all(axis=0)].mean(axis=1))


def _theta_at(pencil: Pencil, z: Floats) -> Floats:
    """θ (n_theta, n) at program variables z (n, n_z)."""
    return np.vstack([np.ones((1, len(z))), pencil.program.run(Samples(), z.T)])


def _periodic(pencil: Pencil, z: Floats) -> NDArray[np.bool_]:
    """Which joint coordinates are angles (n_q,): a full turn changes nothing but round-off."""
    return np.array([_turns(pencil, z, k) for k in range(pencil.n_q)], dtype=bool)


def _turns(pencil: Pencil, z: Floats, k: int) -> bool:
    turned = np.array([z, z])
    turned[1, k] += 2.0 * np.pi
    here, there = _theta_at(pencil, turned).T
    scale = np.maximum(np.abs(here), np.abs(there))
    return bool((np.abs(there - here) <= 1e-9 * scale).all())


@dataclass(frozen=True, eq=False)
class _Projected:
    """Non-zero terms of K̂ on V and of M̂ on [V, I_F], and their rows on other vectors."""

    stiffness_terms: Ints
    stiffness: Floats
    stiffness_rows: Floats
    mass_terms: Ints
    mass: Floats
    mass_rows: Floats
    stiffness_rounding: Floats
    mass_rounding: Floats


def _project(pencil: Pencil, V: Floats, others: Floats, theta0: Floats) -> _Projected:
    """Project on V (n_elastic, k) with the rigid-body modes; ``others`` (n_dof, j) for the rows."""
    k, f = V.shape[1], len(pencil.rigid)
    wide = np.zeros((pencil.n_dof, k + f + others.shape[1]))
    wide[pencil.elastic, :k] = V
    wide[pencil.rigid, k : k + f] = np.eye(f)
    wide[:, k + f :] = others
    stiffness, mass = project(pencil, wide)
    k_terms, m_terms = (
        np.flatnonzero(np.diff(w.tocsc().indptr)) for w in (pencil.stiffness, pencil.mass)
    )
    d_K, d_M = rounding_weights(pencil, theta0)
    basis = wide[:, : k + f]
    return _Projected(
        k_terms,
        stiffness[k_terms, :k, :k],
        stiffness[k_terms, k + f :, :k],
        m_terms,
        mass[m_terms, : k + f, : k + f],
        mass[m_terms, k + f :, : k + f],
        (basis[:, :k].T * d_K) @ basis[:, :k],
        (basis.T * d_M) @ basis,
    )


def _material_terms(pencil: Pencil, k_terms: Ints, theta0: Floats) -> Ints:
    """Indices of θ with a stiffness term that design parameters scale and no joint enters."""
    jointless = ~np.asarray(pencil.program.dependence[:, : pencil.n_q].any(axis=1))
    scaled = [t for t in k_terms.tolist() if t and jointless[t - 1] and theta0[t]]
    return np.array(scaled, dtype=np.intp)
