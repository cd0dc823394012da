"""Bringing the tip to given points: Levenberg–Marquardt from far away, Newton nearby.

Shapes: n states u (n, n_q + n_p) of an `Arm`, m task components.
"""

from __future__ import annotations

import numpy as np

from eigassign.mechanism.arm import Arm
from eigassign.mechanism.course import Target
from eigassign.mechanism.tip_chain import Bools, Floats, Look, Reduced, reduced

ROUND_OFF = 1e-13  # of L: as near to a point as the tip can be computed


def levenberg(arm: Arm, u: Floats, target: Target, iterations: int) -> tuple[Floats, Floats]:
    """Least |(target − tip, −F)| from many u at once; returns u and that length (n,) in m.

    δ = (JᵀJ + μ L² I)⁻¹ Jᵀ e, μ falling while it helps and rising where it does not. Loops are
    open on the way and closed at the end.
    """
    error, J = _residual(arm, u, target)
    miss = np.linalg.norm(error, axis=1)
    mu = np.full(len(u), 1e-2 * arm.lever**2)
    for _ in range(iterations):
        if (miss <= ROUND_OFF * arm.lever).all():
            break
        Jt = np.swapaxes(J, 1, 2)
        H = Jt @ J + mu[:, None, None] * np.eye(u.shape[1])
        trial = u + np.linalg.solve(H, Jt @ error[:, :, None])[:, :, 0]
        trial_error, trial_J = _residual(arm, trial, target)
        trial_miss = np.linalg.norm(trial_error, axis=1)
        better = trial_miss < miss
        u = np.where(better[:, None], trial, u)
        error = np.where(better[:, None], trial_error, error)
        J = np.where(better[:, None, None], trial_J, J)
        miss = np.where(better, trial_miss, miss)
        mu = np.clip(mu * np.where(better, 0.2, 4.0), 1e-15 * arm.lever**2, arm.lever**2)
    return u, miss


def _residual(arm: Arm, u: Floats, target: Target) -> tuple[Floats, Floats]:
    """The error and the open gaps together, and their derivative."""
    seen = arm.look(u)
    error = arm.error(seen, target)
    if arm.chain.assembly is None:
        return error, seen.jacobian
    return np.hstack([error, -seen.gap]), np.concatenate([seen.jacobian, seen.closure], axis=1)


def newton(
    arm: Arm, u: Floats, target: Target, tolerance: float
) -> tuple[Floats, Look, Reduced, Bools]:
    """Newton for tip(u) = target with closed loops; returns u, what is seen there, who settled.

    A chain that cannot fill the space (rank < m) settles, more slowly, on the nearest point.
    """
    for _ in range(8 if arm.rank == target.point.shape[1] + len(arm.chain.turned_by) else 40):
        seen = arm.look(u)
        motion = reduced(seen, arm.n_q)
        error = arm.error(seen, target) - motion.drift
        settled = _settled(arm, error, motion, tolerance)
        if settled.all():
            break
        step = least_norm(motion.J, error, arm.rank)
        passive = motion.closing + np.einsum("npq,nq->np", motion.following, step)
        step = np.hstack([step, passive])
        settled |= np.abs(step).max(axis=1) <= tolerance
        if settled.all():
            break
        u = u + np.clip(step, -1.0, 1.0)
    return u, seen, motion, settled


def _settled(arm: Arm, error: Floats, motion: Reduced, tolerance: float) -> Bools:
    """Whether distance, turn and loops are each within the tolerance."""
    distance, turn = arm.misses(error)
    open_by = np.abs(motion.closing).max(axis=1, initial=0.0)
    return np.asarray(
        (distance <= tolerance * arm.lever) & (turn <= tolerance) & (open_by <= tolerance)
    )


def least_norm(J: Floats, error: Floats, rank: int) -> Floats:
    """J⁺ e (n, n_q) for J (n, m, n_q) and e (n, m): least error first, least norm second."""
    m, n_q = J.shape[1:]
    Jt, e = np.swapaxes(J, 1, 2), error[:, :, None]
    try:
        if rank == m == n_q:
            step = np.linalg.solve(J, e)
        elif rank == m:
            step = Jt @ np.linalg.solve(J @ Jt, e)
        elif rank == n_q:
            step = np.linalg.solve(Jt @ J, Jt @ e)
        else:
            step = np.linalg.pinv(J, rcond=1e-9) @ e
    except np.linalg.LinAlgError:  # exactly singular somewhere
        step = np.linalg.pinv(J, rcond=1e-9) @ e
    return np.asarray(step[:, :, 0])


def handedness(arm: Arm, seen: Look, motion: Reduced) -> Floats:
    """The signs of det J and det ∂F/∂p, (n, 2): they flip where the solution changes branch.

    0 for what is not square.
    """
    m, n_q = motion.J.shape[1:]
    F_p = seen.closure[:, :, n_q:]
    signs = np.zeros((len(motion.J), 2))
    if arm.rank == m == n_q:
        signs[:, 0] = np.sign(np.linalg.det(motion.J))
    if F_p.shape[2] and F_p.shape[1] == F_p.shape[2]:
        signs[:, 1] = np.sign(np.linalg.det(F_p))
    return signs


def regularity(arm: Arm, motion: Reduced) -> Floats:
    """The smallest singular value of J (n,) over L: 0 in a singular pose."""
    return np.asarray(np.linalg.svd(motion.J, compute_uv=False)[:, arm.rank - 1] / arm.lever)


def loop_regularity(arm: Arm, seen: Look) -> Floats:
    """Smallest over largest singular value of ∂F/∂p (n,): 0 at a dead point; 1 without loops."""
    F_p = seen.closure[:, :, arm.n_q :]
    if not F_p.shape[2]:
        return np.ones(len(F_p))
    s = np.linalg.svd(F_p, compute_uv=False)
    return np.asarray(s[:, -1] / s[:, 0])
