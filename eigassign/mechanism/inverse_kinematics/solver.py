"""Bringing the tip to given points: metres and radians in one measure, first guesses, Newton.

Inside, states are u = z / c with c = 1 rad for what turns and c = L for what slides, and turning
counts L per radian among the residuals: so everything is in metres over a dimensionless u. L is the
longest lever of a loop-free chain of turning joints, else the size of the path: its length, or its
largest distance from the origin if that is more. First guesses are spread over all that the chain
can do.

A solution is traced along a tip path by a predictor and a Newton corrector, in steps of a bounded
size, whatever the samples are; Hermite interpolation of the trace gives first guesses for those.

Shapes: n states or seeds, n_q coordinates, n_p passive freedoms, n_z = n_q + n_p entries of a
state, m task components.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from eigassign.arrays import Floats
from eigassign.errors import MechanismError, SingularityError
from eigassign.mechanism.inverse_kinematics.chain import (
    Bools,
    Course,
    Reduced,
    TipChain,
    TipEvaluation,
    TipTarget,
    reduced,
)
from eigassign.mechanism.kinematics.loop_closure import kronecker

_SLACK = 1e-9  # rad: round-off at the end of a branch's range
_STRUCTURAL = 1e-6  # of L: a smaller singular value everywhere is round-off


class TipProblem(NamedTuple):
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

    @property
    def n_q(self) -> int:
        """Number of coordinates."""
        return self.chain.n_q

    def coordinates(self, u: Floats) -> Floats:
        """q (n, n_q) in rad or m, or rates of it; 0 for what is round-off, below 1e-12."""
        q = np.ascontiguousarray((u * self.scale)[:, : self.n_q])
        return np.where(np.abs(q) < 1e-12, 0.0, q)

    def task(self, course: Course, s: ArrayLike, order: int = 1) -> Floats:
        """dp/ds or d²p/ds² (n, m): the point in m, the turning times the lever."""
        velocity, spin = course.rates(s, order)
        return np.hstack([velocity, self.lever * spin[:, list(self.chain.turned_by)]])

    def moved(self, u: Floats, task: Floats) -> Floats:
        """W(u) ṗ (n, n_z): how the state moves where the tip moves by ``task`` (n, m)."""
        return change(reduced(self.evaluate(u), self.n_q), task[:, :, None])[:, :, 0]

    def evaluate(self, u: Floats, by_design: bool = False) -> TipEvaluation:
        """The chain's evaluation, m and rad in one measure; slopes by y come after those by q."""
        chain, scale, z = self.chain, self.scale, u * self.scale
        seen = chain.evaluate(z, by_design=True) if by_design else chain.evaluate(z)
        if by_design:
            scale = np.insert(scale, self.n_q, np.ones(len(chain.y)))
        J, r = seen.jacobian * scale, len(chain.turned_by)
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

    Raises MechanismError if the guess does not fit the loops, or the tip fixes fewer directions
    than there are coordinates.
    """
    n_q = chain.n_q
    if not n_q:
        raise MechanismError("trajectory.tip", "no coordinate moves this mechanism")
    rows = tuple(chain.joints.index(joint) for joint in branch)
    low, high = np.array([*branch.values()], dtype=np.float64).reshape(-1, 2).T
    near = None if start is None else np.array(start, dtype=np.float64)
    if chain.assembly is not None:  # the guess, or where the loops were put together
        q = chain.assembly.reference if near is None else near
        try:
            near = np.concatenate([q, chain.assembly.passive(q[None])[0]])
        except SingularityError as error:
            raise MechanismError("trajectory.start", str(error)) from error
    z = _spread(chain, course, rows, np.column_stack([low, high - low]), near)
    if near is not None:
        z = np.hstack([z, np.broadcast_to(near[n_q:], (len(z), len(near) - n_q))])
        z = np.vstack([near, z])
    if chain.assembly is not None:
        z = _closed(chain, z, course.size)
    J = reduced(chain.evaluate(z), n_q).J
    of_point = J.shape[1] - len(chain.turned_by)
    slides = chain.of_kind("slide")
    lever = course.size
    if chain.assembly is None and not slides.any():
        lever = float(np.linalg.norm(J[:, :of_point], axis=1).max())
    scale = np.where(slides, lever, 1.0)
    J[:, of_point:] *= lever
    J *= scale[:n_q]
    singular_values = np.linalg.svd(J, compute_uv=False)
    rank = int((singular_values > _STRUCTURAL * lever).sum(axis=1).max())
    if rank < n_q:
        idle = np.flatnonzero(np.abs(J).max(axis=(0, 1)) <= _STRUCTURAL * lever)
        names = ", ".join(chain.joints[i] for i in idle)
        message = f"fixes {rank} of {n_q} coordinates"
        message += f", and what drives {names} not at all" * bool(names)
        message += ": ask for its angle or orientation too, or give points or samples of q"
        raise MechanismError("trajectory.tip", message)
    first = None if near is None else near / scale
    guessed = start is not None
    return TipProblem(chain, rows, low, high - low, first, guessed, z / scale, scale, lever)


def _spread(
    chain: TipChain, course: Course, rows: tuple[int, ...], limits: Floats, near: Floats | None
) -> Floats:
    """Evenly spread q (n_seeds, n_q), a Kronecker sequence: over a turn, or about ``near``."""
    (matrix, offset), n_q = chain.relative_map, chain.n_q
    middle = matrix @ (np.zeros(n_q) if near is None else near[:n_q]) + offset
    seen = chain.evaluate(np.zeros((1, len(chain.kinds))))
    reach = course.size + float(np.linalg.norm(seen.point))
    pitch = np.abs(seen.jacobian[0, : seen.point.shape[1], :n_q]).max(axis=0)
    # a screw's first guesses go as far as 500 rad
    screws = np.clip(reach / np.maximum(pitch, 1e-12), 2.0 * np.pi, 500.0)
    half = np.where(chain.of_kind("slide")[:n_q], reach, screws)
    turns = chain.of_kind("turn")[:n_q]
    low, width = np.where(turns, 0.0, middle - half), np.where(turns, 2.0 * np.pi, 2.0 * half)
    low[list(rows)], width[list(rows)] = limits.T
    width = np.where(turns, np.minimum(width, 2.0 * np.pi), width)
    count = min(128, 8 * 2**n_q)
    return np.asarray((low + width * kronecker(count, n_q) - offset) @ np.linalg.pinv(matrix).T)


def _closed(chain: TipChain, z: Floats, size: float) -> Floats:
    """The states whose loops close by moving the passive freedoms alone, the first for sure."""
    n_q = chain.n_q
    for _ in range(20):
        step = reduced(chain.evaluate(z), n_q).closing
        z[:, n_q:] += np.clip(step, -0.5, 0.5)
    # loops are closed to 1e-9 of the path's size
    good = np.abs(chain.evaluate(z).gap).max(axis=1) <= 1e-9 * max(size, 1.0)
    good[0] = True
    return np.asarray(z[good])


ROUND_OFF = 1e-13  # of L: as near to a point as the tip can be computed


def levenberg(
    ik: TipProblem, u: Floats, target: TipTarget, iterations: int
) -> tuple[Floats, Floats]:
    """Least |(target − tip, −F)| from many u at once; returns u and that length (n,) in m.

    δ = (JᵀJ + μ L² I)⁻¹ Jᵀ e, μ falling while it helps and rising where it does not. Loops are
    open on the way and closed at the end.
    """
    error, J = _residual(ik, u, target)
    miss = np.linalg.norm(error, axis=1)
    mu = np.full(len(u), 1e-2 * ik.lever**2)
    for _ in range(iterations):
        if (miss <= ROUND_OFF * ik.lever).all():
            break
        Jt = np.swapaxes(J, 1, 2)
        H = Jt @ J + mu[:, None, None] * np.eye(u.shape[1])
        trial = u + np.linalg.solve(H, Jt @ error[:, :, None])[:, :, 0]
        trial_error, trial_J = _residual(ik, trial, target)
        trial_miss = np.linalg.norm(trial_error, axis=1)
        better = trial_miss < miss
        u = np.where(better[:, None], trial, u)
        error = np.where(better[:, None], trial_error, error)
        J = np.where(better[:, None, None], trial_J, J)
        miss = np.where(better, trial_miss, miss)
        mu = np.clip(mu * np.where(better, 0.2, 4.0), 1e-15 * ik.lever**2, ik.lever**2)
    return u, miss


def _residual(ik: TipProblem, u: Floats, target: TipTarget) -> tuple[Floats, Floats]:
    """The error and the open gaps together, and their derivative."""
    seen = ik.evaluate(u)
    error = ik.error(seen, target)
    if ik.chain.assembly is None:
        return error, seen.jacobian
    return np.hstack([error, -seen.gap]), np.concatenate([seen.jacobian, seen.closure], axis=1)


class Corrected(NamedTuple):
    """States (n, n_z) that Newton's iteration came to, what is seen there, and who settled (n,)."""

    u: Floats
    seen: TipEvaluation
    motion: Reduced
    settled: Bools


def newton(ik: TipProblem, u: Floats, target: TipTarget, tolerance: float) -> Corrected:
    """Newton for tip(u) = target with closed loops; for n_q < m it settles on the nearest point."""
    for _ in range(8 if ik.n_q == target.point.shape[1] + len(ik.chain.turned_by) else 40):
        seen = ik.evaluate(u)
        motion = reduced(seen, ik.n_q)
        error = ik.error(seen, target) - motion.drift
        distance, turn = ik.misses(error)
        off = np.maximum(distance / ik.lever, turn)
        settled = np.maximum(off, np.abs(motion.closing).max(axis=1, initial=0.0)) <= tolerance
        if settled.all():
            break
        step = change(motion, error[:, :, None])[:, :, 0]
        step[:, ik.n_q :] += motion.closing
        settled |= np.abs(step).max(axis=1) <= tolerance
        if settled.all():
            break
        u = u + np.clip(step, -1.0, 1.0)
    return Corrected(u, seen, motion, settled)


def change(motion: Reduced, tasks: Floats) -> Floats:
    """The changes (n, n_z, k) of states of least error for tasks e (n, m, k), loops kept closed.

    J⁺ e of the coordinates, for J (n, m, n_q) with m ≥ n_q.
    """
    J, Jt = motion.J, np.swapaxes(motion.J, 1, 2)
    try:
        square = J.shape[1] == J.shape[2]
        own = np.linalg.solve(*((J, tasks) if square else (Jt @ J, Jt @ tasks)))
    except np.linalg.LinAlgError:  # exactly singular somewhere
        own = np.linalg.pinv(J, rcond=1e-9) @ tasks
    return np.concatenate([own, motion.following @ own], axis=1)


def handedness(ik: TipProblem, u: Floats) -> Floats:
    """The signs of det J and det ∂F/∂p (n, 2), which flip between branches; 0 if not square."""
    seen = ik.evaluate(u)
    return _signs(ik, seen, reduced(seen, ik.n_q))


def _signs(ik: TipProblem, seen: TipEvaluation, motion: Reduced) -> Floats:
    F_p, signs = seen.closure[:, :, ik.n_q :], np.zeros((len(motion.J), 2))
    for k, square in enumerate((motion.J, F_p)):
        if square.shape[2] and square.shape[1] == square.shape[2]:
            signs[:, k] = np.sign(np.linalg.det(square))
    return signs


def loop_regularity(ik: TipProblem, seen: TipEvaluation) -> Floats:
    """Smallest over largest singular value of ∂F/∂p (n,): 0 at a dead point; 1 without loops."""
    F_p = seen.closure[:, :, ik.n_q :]
    if not F_p.shape[2]:
        return np.ones(len(F_p))
    s = np.linalg.svd(F_p, compute_uv=False)
    return np.asarray(s[:, -1] / s[:, 0])


# --- tracing the path

_TRACE = 1e-7  # miss of the trace, relative to L, which only seeds the samples
_SINGULAR = 1e-3  # of L: a smaller singular value of J is a chain stretched or folded;
# angles are known there to the root of the distance, 3e-4, so that _TRACE can tell it
DEAD = 1e-3  # smallest over largest singular value of ∂F/∂p: as near a dead point, for that reason
_STRAY = 0.5  # of a trace's largest step: a corrector that moves further has left the branch
_MAX_ADVANCE = 0.125  # of the path, a trace step


class Trace(NamedTuple):
    """Solutions at path parameters s_i (m,) with their slopes du/ds, up to where it got."""

    s: Floats
    u: Floats  # (m, n_z)
    slope: Floats  # (m, n_z)
    sense: Floats  # (2,) signs of det J and det ∂F/∂p all along


def trace(ik: TipProblem, course: Course, u0: Floats, turn: float) -> Trace:
    """du/ds = J⁺ dp/ds from u0 in steps of about ``turn``, corrected back onto the path.

    It steps onto every corner of the path, lest it cuts one that is out of reach.
    """
    stops = np.append(course.corners(), course.s[-1])
    sense = handedness(ik, u0[None])[0]
    s, u = [float(course.s[0])], [u0]
    slope = [ik.moved(u0[None], ik.task(course, s[0]))[0]]
    advance, bend = _MAX_ADVANCE, np.zeros_like(u0)
    # below 1e-8 of the path the joints turn faster and faster without advancing
    while s[-1] < stops[-1] and advance >= 1e-8:
        fastest = float(np.abs(slope[-1][: ik.n_q]).max())
        advance = min(advance, turn / max(fastest, turn))
        stop = float(stops[np.searchsorted(stops, s[-1], side="right")])
        there = min(s[-1] + advance, stop)
        step = there - s[-1]
        guess = (u[-1] + step * (slope[-1] + step * bend))[None]
        found = newton(ik, guess, course.target(np.array([there])), _TRACE)
        if (lost(ik, found, guess, _STRAY * turn, sense) | singular(ik, found))[0]:
            advance = 0.5 * min(advance, stop - s[-1])
            continue
        s, u = [*s, there], [*u, found.u[0]]
        slope.append(ik.moved(found.u, ik.task(course, there))[0])
        bend = 0.5 * (slope[-1] - slope[-2]) / step * (there < stop)
        advance = min(2.0 * advance, _MAX_ADVANCE)
    return Trace(np.array(s), np.array(u), np.array(slope), sense)


def lost(ik: TipProblem, found: Corrected, guess: Floats, most: float, sense: Floats) -> Bools:
    """True where a corrector did not settle or moved by over ``most`` from its guess, or where a
    branch other than that of ``sense`` has been met, (n,).
    """
    crossed = (_signs(ik, found.seen, found.motion) * sense < 0.0).any(axis=1)
    return np.asarray(~found.settled | (np.abs(found.u - guess).max(axis=1) > most) | crossed)


def singular(ik: TipProblem, found: Corrected) -> Bools:
    """True where the chain is stretched or folded, or its loops at a dead point, (n,)."""
    regularity = np.linalg.svd(found.motion.J, compute_uv=False)[:, -1] / ik.lever
    return np.asarray((regularity < _SINGULAR) | (loop_regularity(ik, found.seen) < DEAD))


def interpolated(path: Trace, s: Floats) -> Floats:
    """Cubic Hermite interpolation of a trace at parameters s (n,) within it."""
    i = np.clip(np.searchsorted(path.s, s, side="right") - 1, 0, max(len(path.s) - 2, 0))
    j = np.minimum(i + 1, len(path.s) - 1)
    h = np.where(j > i, path.s[j] - path.s[i], 1.0)[:, None]
    t = (s - path.s[i])[:, None] / h
    rise = path.u[j] - path.u[i]
    left, right = h * path.slope[i] - rise, rise - h * path.slope[j]
    return np.asarray(path.u[i] + t * rise + t * (1.0 - t) * ((1.0 - t) * left + t * right))
