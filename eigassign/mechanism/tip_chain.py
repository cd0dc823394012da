"""The tip of a chain: what is known of it before solving, and how it is brought to given points.

Shapes: n samples or seeds, n_q coordinates, n_j joints, d = 2 or 3 components of the tip.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import MechanismError

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

_SLACK = 1e-9  # rad: round-off at the end of a branch's range
ROUND_OFF = 1e-13  # of the longest lever: as near to a point as the tip can be computed
_STRUCTURAL = 1e-6  # of the longest lever: a smaller singular value everywhere is round-off


@dataclass(frozen=True)
class TipChain:
    """The position of one node (the tip) of a chain of revolute joints, batched over n."""

    position: Callable[[Floats], Floats]  # q (n, n_q) in rad -> tip (n, d) in m
    jacobian: Callable[[Floats], Floats]  # q (n, n_q) in rad -> d tip / d q (n, d, n_q) in m/rad
    joints: tuple[str, ...]  # (n_j,) names, from the base on
    relative_map: tuple[Floats, Floats]  # A (n_j, n_q), b (n_j,): relative angles A q + b in rad


@dataclass(frozen=True)
class Arm:
    """A chain with its wanted branch, and what to know before solving."""

    chain: TipChain
    rows: tuple[int, ...]  # joints with a wanted range
    low: Floats  # (n_branch,) rad
    width: Floats  # (n_branch,) rad
    start: Floats | None  # (n_q,) rad, the user's guess of the first sample
    seeds: Floats  # (n_seeds, n_q) rad, spread over all angles the branch allows
    lever: float  # m/rad, the longest
    rank: int  # of the Jacobian, in general position

    def relative(self, q: Floats) -> Floats:
        """Relative joint angles A q + b, (n, n_j) in rad."""
        matrix, offset = self.chain.relative_map
        return np.asarray(q @ matrix.T + offset)

    def inside(self, q: Floats) -> Bools:
        """Whether each ranged joint is in its range modulo 2π, (n, n_branch)."""
        above = self.relative(q)[:, list(self.rows)] - self.low + _SLACK
        return np.asarray(np.mod(above, 2.0 * np.pi) <= self.width + 2.0 * _SLACK)


def prepare(
    chain: TipChain,
    branch: Mapping[str, tuple[float, float]],
    start: Sequence[float] | Floats | None,
) -> Arm:
    """The arm for a branch {joint: (low, high)} in rad and a guess of the first q.

    Raises MechanismError if a joint does not exist, a range does not go upwards, the guess does
    not fit the coordinates, or there is none for a coordinate that does not move the tip.
    """
    rows = tuple(_row(chain, joint) for joint in branch)
    limits = np.array([_limits(joint, *ends) for joint, ends in branch.items()]).reshape(-1, 2)
    seeds = _seeds(chain, rows, limits)
    guess = _checked_start(start, seeds.shape[1])
    J = chain.jacobian(seeds)
    lever = float(np.linalg.norm(J, axis=1).max())
    _check_idle(J, lever, guess)
    singular_values = np.linalg.svd(J, compute_uv=False)
    rank = int((singular_values > _STRUCTURAL * lever).sum(axis=1).max())
    return Arm(chain, rows, limits[:, 0], limits[:, 1], guess, seeds, lever, rank)


def _row(chain: TipChain, joint: str) -> int:
    if joint not in chain.joints:
        known = ", ".join(chain.joints)
        raise MechanismError(f"trajectory.branch.{joint}", f"no such joint; there are {known}")
    return chain.joints.index(joint)


def _limits(joint: str, low: float, high: float) -> tuple[float, float]:
    """Low end and width of a range in rad."""
    if not low < high:
        message = (
            f"[{np.degrees(low):.6g} deg, {np.degrees(high):.6g} deg] must go upwards; "
            "angles count modulo 360 deg, so [350 deg, 370 deg] is allowed"
        )
        raise MechanismError(f"trajectory.branch.{joint}", message)
    return low, high - low


def _checked_start(start: Sequence[float] | Floats | None, n_q: int) -> Floats | None:
    if start is None:
        return None
    guess = np.array(start, dtype=np.float64)
    if guess.shape != (n_q,) or not np.isfinite(guess).all():
        raise MechanismError("trajectory.start", f"must be {n_q} finite coordinates")
    return guess


def _check_idle(J: Floats, lever: float, start: Floats | None) -> None:
    """Coordinates that do not move the tip stay where ``start`` says; nothing else can know it."""
    idle = np.flatnonzero(np.abs(J).max(axis=(0, 1)) <= _STRUCTURAL * lever)
    if start is None and len(idle):
        numbers = ", ".join(str(i + 1) for i in idle)
        message = f"is needed: the tip does not depend on coordinate {numbers} (counted from 1)"
        raise MechanismError("trajectory.start", message)


def _seeds(chain: TipChain, rows: tuple[int, ...], limits: Floats) -> Floats:
    """Evenly spread q (n_seeds, n_q): a Kronecker sequence over the angles the branch allows."""
    matrix, offset = chain.relative_map
    n_j = len(offset)
    low, width = np.zeros(n_j), np.full(n_j, 2.0 * np.pi)
    low[list(rows)], width[list(rows)] = limits.T
    count = min(128, 8 * 2**n_j)
    strides = _harmonious(n_j) ** -np.arange(1.0, n_j + 1.0)
    fractions = np.mod(0.5 + np.arange(count)[:, None] * strides, 1.0)
    angles = low + np.minimum(width, 2.0 * np.pi) * fractions
    return np.asarray((angles - offset) @ np.linalg.pinv(matrix).T)


def _harmonious(n: int) -> float:
    """The root > 1 of x^(n+1) = x + 1: the golden ratio for n = 1 and its kin above."""
    x = 1.5
    for _ in range(60):  # contracts by at least 2 a step
        x = (1.0 + x) ** (1.0 / (n + 1.0))
    return float(x)


# --- bringing the tip to points ---


def levenberg(arm: Arm, q: Floats, target: Floats, iterations: int) -> tuple[Floats, Floats]:
    """Least |target − position(q)| from many q (n, n_q) at once; returns q and the distances (n,).

    δ = (JᵀJ + μ I)⁻¹ Jᵀ (target − position), μ falling while it helps and rising where it does not.
    """
    error = target - arm.chain.position(q)
    miss = np.linalg.norm(error, axis=1)
    mu = np.full(len(q), 1e-2 * arm.lever**2)
    for _ in range(iterations):
        if (miss <= ROUND_OFF * arm.lever).all():
            break
        J = arm.chain.jacobian(q)
        H = np.einsum("nda,ndb->nab", J, J) + mu[:, None, None] * np.eye(q.shape[1])
        trial = q + np.linalg.solve(H, np.einsum("nda,nd->na", J, error)[:, :, None])[:, :, 0]
        trial_error = target - arm.chain.position(trial)
        trial_miss = np.linalg.norm(trial_error, axis=1)
        better = trial_miss < miss
        q = np.where(better[:, None], trial, q)
        error = np.where(better[:, None], trial_error, error)
        miss = np.where(better, trial_miss, miss)
        mu = np.clip(mu * np.where(better, 0.2, 4.0), 1e-15 * arm.lever**2, arm.lever**2)
    return q, miss


def newton(arm: Arm, q: Floats, targets: Floats, tolerance: float) -> tuple[Floats, Floats, Bools]:
    """Newton for position(q) = targets, batched; returns q, J there and who settled (n,).

    A chain that cannot fill the space (rank < d) settles, more slowly, on the nearest point.
    """
    for _ in range(8 if arm.rank == targets.shape[1] else 40):
        error = targets - arm.chain.position(q)
        J = arm.chain.jacobian(q)
        settled = np.asarray(np.linalg.norm(error, axis=1) <= tolerance * arm.lever)
        if settled.all():
            break
        step = least_norm(J, error, arm.rank)
        settled |= np.abs(step).max(axis=1) <= tolerance
        if settled.all():
            break
        q = q + np.clip(step, -1.0, 1.0)
    return q, J, settled


def least_norm(J: Floats, error: Floats, rank: int) -> Floats:
    """J⁺ e (n, n_q) for J (n, d, n_q) and e (n, d): least error first, least norm second."""
    d, n_q = J.shape[1:]
    Jt, e = np.swapaxes(J, 1, 2), error[:, :, None]
    try:
        if rank == d == n_q:
            step = np.linalg.solve(J, e)
        elif rank == d:
            step = Jt @ np.linalg.solve(J @ Jt, e)
        elif rank == n_q:
            step = np.linalg.solve(Jt @ J, Jt @ e)
        else:
            step = np.linalg.pinv(J, rcond=1e-9) @ e
    except np.linalg.LinAlgError:  # exactly singular somewhere
        step = np.linalg.pinv(J, rcond=1e-9) @ e
    return np.asarray(step[:, :, 0])


def orientation(arm: Arm, J: Floats) -> Floats:
    """The sign of det J (n,): it flips where the solution changes branch. 0 if J is not square."""
    d, n_q = J.shape[1:]
    if not arm.rank == d == n_q:
        return np.zeros(len(J))
    return np.asarray(np.sign(np.linalg.det(J)))


def regularity(arm: Arm, J: Floats) -> Floats:
    """The smallest singular value of J (n,) over the longest lever: 0 in a singular pose."""
    return np.asarray(np.linalg.svd(J, compute_uv=False)[:, arm.rank - 1] / arm.lever)
