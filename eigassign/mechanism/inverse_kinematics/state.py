"""A chain prepared for inverse kinematics: one measure for metres and radians, and first guesses.

Inside, states are u = z / c with c = 1 rad for what turns and c = L for what slides, and turning
counts L per radian among the residuals: so everything is in metres over a dimensionless u. L is the
longest lever of a loop-free chain of turning joints, else the size of the path: its length, or its
largest distance from the origin if that is more. First guesses are spread over all that the chain
can do.

Shapes: n states or seeds, n_q coordinates, n_p passive freedoms, n_z = n_q + n_p entries of a
state, m task components.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from eigassign.errors import MechanismError, SingularityError
from eigassign.mechanism.inverse_kinematics.chain import (
    Bools,
    ChainDesign,
    Floats,
    TipChain,
    TipEvaluation,
    reduced,
)
from eigassign.mechanism.inverse_kinematics.tip_path import Course, TipTarget
from eigassign.mechanism.kinematics.loop_closure import kronecker

_SLACK = 1e-9  # rad: round-off at the end of a branch's range
_STRUCTURAL = 1e-6  # of L: a smaller singular value everywhere is round-off


@dataclass(frozen=True)
class TipProblem:
    """Inverse kinematics of one chain: its wanted branch, and what to know before solving."""

    chain: TipChain
    rows: tuple[int, ...]  # joint coordinates with a wanted range
    low: Floats  # (n_branch,) rad or m
    width: Floats  # (n_branch,)
    start: Floats | None  # u (n_q + n_p,) near which the first sample is wanted
    guessed: bool  # whether that is the user's guess
    seeds: Floats  # u (n_seeds, n_q + n_p), spread over all the branch allows, loops closed
    scale: Floats  # c (n_q + n_p,) in rad or m
    lever: float  # L in m
    rank: int  # of J, in general position

    @property
    def n_q(self) -> int:
        """Number of coordinates."""
        return self.chain.n_q

    def evaluate(self, u: Floats) -> TipEvaluation:
        """The chain's evaluation with metres and radians in one measure."""
        return self._measured(self.chain.evaluate(u * self.scale), self.scale)

    def evaluate_with_design(self, u: Floats, design: ChainDesign, y: Floats) -> TipEvaluation:
        """The same at design y, with its columns, per unit of y, after those of q."""
        scale = np.insert(self.scale, self.n_q, np.ones(len(y)))
        return self._measured(design.evaluate(u * self.scale, y), scale)

    def _measured(self, seen: TipEvaluation, scale: Floats) -> TipEvaluation:
        chain, J, r = self.chain, seen.jacobian * scale, len(self.chain.turned_by)
        if r:
            J[:, -r:] *= self.lever
        if chain.assembly is None:
            return seen._replace(jacobian=J)
        # open loops weigh 100 times a missed point: what is nearest must be closed
        weight = 100.0 * np.where(chain.assembly.turning, self.lever, 1.0)
        closure = seen.closure * scale * weight[:, None]
        return TipEvaluation(seen.point, seen.rotation, J, seen.gap * weight, closure)

    def error(self, seen: TipEvaluation, target: TipTarget) -> Floats:
        """Target minus tip (n, m): position in m, and L log(R_target Rᵀ) of what can turn."""
        turned_by, apart = self.chain.turned_by, target.point - seen.point
        if not turned_by or seen.rotation is None or target.rotation is None:
            return apart
        missing = target.rotation @ np.swapaxes(seen.rotation, 1, 2)
        if turned_by == (2,):
            turn = np.arctan2(missing[:, 1, 0], missing[:, 0, 0])[:, None]
        else:
            from scipy.spatial.transform import Rotation  # takes 0.1 s, which few paths wait for

            turn = Rotation.from_matrix(missing).as_rotvec()
        return np.hstack([apart, self.lever * turn])

    def misses(self, error: Floats) -> tuple[Floats, Floats]:
        """Distance in m and turn in rad of an error, (n,) each."""
        d = error.shape[1] - len(self.chain.turned_by)
        turn = np.linalg.norm(error[:, d:], axis=1) / self.lever
        return np.linalg.norm(error[:, :d], axis=1), turn

    def joint_coordinates(self, u: Floats) -> Floats:
        """A q + b (n, n_q) in rad or m."""
        matrix, offset = self.chain.relative_map
        return np.asarray((u * self.scale)[:, : self.n_q] @ matrix.T + offset)

    def inside(self, u: Floats) -> Bools:
        """True where a ranged joint is in its range, angles modulo 2π, (n, n_branch)."""
        rows = list(self.rows)
        above = self.joint_coordinates(u)[:, rows] - self.low + _SLACK
        turns = self.chain.of_kind("turn")[rows]
        above = np.where(turns, np.mod(above, 2.0 * np.pi), above)
        return np.asarray((above >= 0.0) & (above <= self.width + 2.0 * _SLACK))


# --- before solving


def prepare(
    chain: TipChain,
    course: Course,
    branch: Mapping[str, tuple[float, float]],
    start: Sequence[float] | Floats | None,
) -> TipProblem:
    """The problem for a branch {joint: (low, high)} in rad or m and a guess of the first q.

    Raises MechanismError if the guess does not fit the loops, or there is none for a coordinate
    that does not move the tip.
    """
    if not chain.n_q:
        raise MechanismError("trajectory.tip", "no coordinate moves this mechanism")
    rows = tuple(chain.joints.index(joint) for joint in branch)
    low, high = np.array([*branch.values()], dtype=np.float64).reshape(-1, 2).T
    limits = np.column_stack([low, high - low])
    guess = None if start is None else np.array(start, dtype=np.float64)
    near = _near(chain, guess)
    z, J = first_guesses(chain, course, rows, limits, near)
    lever = _lever(chain, course, J)
    scale = np.where(chain.of_kind("slide"), lever, 1.0)
    rows_of_J = np.ones(J.shape[1])
    rows_of_J[J.shape[1] - len(chain.turned_by) :] = lever
    J = J * rows_of_J[:, None] * scale[: chain.n_q]
    _check_idle(J, lever, guess)
    singular_values = np.linalg.svd(J, compute_uv=False)
    rank = int((singular_values > _STRUCTURAL * lever).sum(axis=1).max())
    first = None if near is None else near / scale
    guessed = guess is not None
    return TipProblem(chain, rows, low, high - low, first, guessed, z / scale, scale, lever, rank)


def _near(chain: TipChain, guess: Floats | None) -> Floats | None:
    """The state z near which the first sample is wanted: the guess, else where loops are chosen."""
    if chain.assembly is None:
        return guess
    q = chain.assembly.reference if guess is None else guess
    try:
        return np.concatenate([q, chain.assembly.passive(q[None])[0]])
    except SingularityError as error:
        raise MechanismError("trajectory.start", str(error)) from error


def _lever(chain: TipChain, course: Course, J: Floats) -> float:
    """L in m; see the module."""
    d = J.shape[1] - len(chain.turned_by)
    turning = ~chain.of_kind("slide")[: chain.n_q]
    if chain.assembly is not None or not turning.all():
        return course.size
    return float(np.linalg.norm(J[:, :d], axis=1).max())


def _check_idle(J: Floats, lever: float, start: Floats | None) -> None:
    """Coordinates that do not move the tip stay where ``start`` says; nothing else can know it."""
    idle = np.flatnonzero(np.abs(J).max(axis=(0, 1)) <= _STRUCTURAL * lever)
    if start is None and len(idle):
        numbers = ", ".join(str(i + 1) for i in idle)
        message = f"is needed: the tip does not depend on coordinate {numbers} (counted from 1)"
        raise MechanismError("trajectory.start", message)


# --- first guesses


def first_guesses(
    chain: TipChain, course: Course, rows: tuple[int, ...], limits: Floats, near: Floats | None
) -> tuple[Floats, Floats]:
    """States z (n_seeds, n_z) with closed loops, and their J (n_seeds, d + r, n_q), not scaled."""
    q = _spread(chain, course, rows, limits, near)
    if near is None:
        return q, reduced(chain.evaluate(q), chain.n_q).J
    z = np.hstack([q, np.broadcast_to(near[chain.n_q :], (len(q), len(near) - chain.n_q))])
    z = _closed(chain, np.vstack([near, z]), course.size)
    return z, reduced(chain.evaluate(z), chain.n_q).J


def _spread(
    chain: TipChain, course: Course, rows: tuple[int, ...], limits: Floats, near: Floats | None
) -> Floats:
    """Evenly spread q (n_seeds, n_q): a Kronecker sequence over all that the branch allows."""
    matrix, offset = chain.relative_map
    n_j = chain.n_q
    middle = matrix @ (np.zeros(n_j) if near is None else near[:n_j]) + offset
    low, width = _ranges(chain, course, middle)
    low[list(rows)], width[list(rows)] = limits.T
    turns = chain.of_kind("turn")[:n_j]
    width = np.where(turns, np.minimum(width, 2.0 * np.pi), width)
    count = min(128, 8 * 2**n_j)
    return np.asarray((low + width * kronecker(count, n_j) - offset) @ np.linalg.pinv(matrix).T)


def _ranges(chain: TipChain, course: Course, middle: Floats) -> tuple[Floats, Floats]:
    """Low end and width (n_q,) of each joint: a turn, or as far as the path and the tip may be."""
    n_q = chain.n_q
    low, width = np.zeros(n_q), np.full(n_q, 2.0 * np.pi)
    far = chain.kinds[:n_q]
    if set(far) == {"turn"}:
        return low, width
    state = np.zeros((1, len(chain.kinds)))
    seen = chain.evaluate(state)
    reach = course.size + float(np.linalg.norm(seen.point))
    pitch = np.abs(seen.jacobian[0, : seen.point.shape[1], :n_q]).max(axis=0)
    # a screw's first guesses go as far as 500 rad
    turns = np.clip(reach / np.maximum(pitch, 1e-12), 2.0 * np.pi, 500.0)
    half = np.where(chain.of_kind("slide")[:n_q], reach, turns)
    free = ~chain.of_kind("turn")[:n_q]
    return np.where(free, middle - half, low), np.where(free, 2.0 * half, width)


def _closed(chain: TipChain, z: Floats, size: float) -> Floats:
    """The states whose loops close by moving the passive freedoms alone."""
    n_q = chain.n_q
    if len(chain.kinds) == n_q:
        return z
    z = z.copy()
    for _ in range(20):
        step = reduced(chain.evaluate(z), n_q).closing
        z[:, n_q:] += np.clip(step, -0.5, 0.5)
    # loops are closed to 1e-9 of the path's size
    good = np.abs(chain.evaluate(z).gap).max(axis=1) <= 1e-9 * max(size, 1.0)
    good[0] = True  # the pose at which the loops are known to close
    return np.asarray(z[good])
