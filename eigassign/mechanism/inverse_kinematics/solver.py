"""Bringing the tip to given points: Levenberg–Marquardt from far away, Newton nearby, and tracing.

A solution is traced along a tip path by a predictor and a Newton corrector, in steps of a bounded
size, whatever the samples are; Hermite interpolation of the trace gives first guesses for those.

Shapes: n states u (n, n_q + n_p) of an `TipProblem`, m task components.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from eigassign.mechanism.inverse_kinematics.chain import (
    Bools,
    Floats,
    Reduced,
    TipEvaluation,
    reduced,
)
from eigassign.mechanism.inverse_kinematics.state import TipProblem
from eigassign.mechanism.inverse_kinematics.tip_path import Course, TipTarget

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


def newton(
    ik: TipProblem,
    u: Floats,
    target: TipTarget,
    tolerance: float,
    directions: Floats | None = None,
) -> Corrected:
    """Newton for tip(u) = target with closed loops.

    A chain that cannot fill the space (rank < m) settles, more slowly, on the nearest point. With
    ``directions`` V (n, n_q, rank) the coordinates move in these only, and J returned is J V.
    """
    for _ in range(8 if ik.rank == target.point.shape[1] + len(ik.chain.turned_by) else 40):
        seen = ik.evaluate(u)
        motion = within(reduced(seen, ik.n_q), directions)
        error = ik.error(seen, target) - motion.drift
        settled = _settled(ik, error, motion, tolerance)
        if settled.all():
            break
        step = least_norm(motion.J, error, ik.rank)
        if directions is not None:
            step = np.einsum("nqr,nr->nq", directions, step)
        passive = motion.closing + np.einsum("npq,nq->np", motion.following, step)
        step = np.hstack([step, passive])
        settled |= np.abs(step).max(axis=1) <= tolerance
        if settled.all():
            break
        u = u + np.clip(step, -1.0, 1.0)
    return Corrected(u, seen, motion, settled)


def within(motion: Reduced, directions: Floats | None) -> Reduced:
    """The motion with J V (n, m, rank) in place of J: coordinates move in directions V only."""
    return motion if directions is None else replace(motion, J=motion.J @ directions)


def _settled(ik: TipProblem, error: Floats, motion: Reduced, tolerance: float) -> Bools:
    """True where distance, turn and loops are each within the tolerance."""
    distance, turn = ik.misses(error)
    open_by = np.abs(motion.closing).max(axis=1, initial=0.0)
    return np.asarray(
        (distance <= tolerance * ik.lever) & (turn <= tolerance) & (open_by <= tolerance)
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


def handedness(ik: TipProblem, seen: TipEvaluation, motion: Reduced) -> Floats:
    """The signs of det J and det ∂F/∂p, (n, 2): they flip where the solution changes branch.

    0 for what is not square.
    """
    m, n_q = motion.J.shape[1:]
    F_p = seen.closure[:, :, n_q:]
    signs = np.zeros((len(motion.J), 2))
    if ik.rank == m == n_q:
        signs[:, 0] = np.sign(np.linalg.det(motion.J))
    if F_p.shape[2] and F_p.shape[1] == F_p.shape[2]:
        signs[:, 1] = np.sign(np.linalg.det(F_p))
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


@dataclass(frozen=True)
class TracePoint:
    """A solution u (1, n_z) at path parameter s, with du/ds."""

    s: float
    u: Floats
    slope: Floats


@dataclass(frozen=True)
class Trace:
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
    seen = ik.evaluate(u0[None])
    motion = reduced(seen, ik.n_q)
    sense = handedness(ik, seen, motion)[0]
    here = _pose(ik, course, float(course.s[0]), u0[None], motion)
    poses, advance, bend = [here], _MAX_ADVANCE, np.zeros_like(here.u)
    # below 1e-8 of the path the joints turn faster and faster without advancing
    while here.s < stops[-1] and advance >= 1e-8:
        fastest = float(np.abs(here.slope[:, : ik.n_q]).max())
        advance = min(advance, turn / max(fastest, turn))
        stop = float(stops[np.searchsorted(stops, here.s, side="right")])
        s = min(here.s + advance, stop)
        guess = here.u + (s - here.s) * (here.slope + (s - here.s) * bend)
        found = newton(ik, guess, course.target(np.array([s])), _TRACE)
        if (lost(ik, found, guess, _STRAY * turn, sense) | singular(ik, found))[0]:
            advance = 0.5 * min(advance, stop - here.s)
            continue
        there = _pose(ik, course, s, found.u, found.motion)
        bend = 0.5 * (there.slope - here.slope) / (there.s - here.s) * (there.s < stop)
        poses.append(there)
        here, advance = there, min(2.0 * advance, _MAX_ADVANCE)
    u, slopes = np.vstack([p.u for p in poses]), np.vstack([p.slope for p in poses])
    return Trace(np.array([p.s for p in poses]), u, slopes, sense)


def lost(ik: TipProblem, found: Corrected, guess: Floats, most: float, sense: Floats) -> Bools:
    """True where a corrector did not settle or moved by over ``most`` from its guess, or where a
    branch other than that of ``sense`` has been met, (n,).
    """
    crossed = (handedness(ik, found.seen, found.motion) * sense < 0.0).any(axis=1)
    return np.asarray(~found.settled | (np.abs(found.u - guess).max(axis=1) > most) | crossed)


def singular(ik: TipProblem, found: Corrected) -> Bools:
    """True where the chain is stretched or folded, or its loops at a dead point, (n,)."""
    regularity = np.linalg.svd(found.motion.J, compute_uv=False)[:, ik.rank - 1] / ik.lever
    return np.asarray((regularity < _SINGULAR) | (loop_regularity(ik, found.seen) < DEAD))


def _pose(ik: TipProblem, course: Course, s: float, u: Floats, motion: Reduced) -> TracePoint:
    velocity, spin = course.rates(s)
    spin = ik.lever * spin[:, list(ik.chain.turned_by)]
    slope = least_norm(motion.J, np.hstack([velocity, spin]), ik.rank)
    passive = np.einsum("npq,nq->np", motion.following, slope)
    return TracePoint(s, u, np.hstack([slope, passive]))


def interpolated(path: Trace, s: Floats) -> Floats:
    """Cubic Hermite interpolation of a trace at parameters s (n,) within it."""
    i = np.clip(np.searchsorted(path.s, s, side="right") - 1, 0, max(len(path.s) - 2, 0))
    j = np.minimum(i + 1, len(path.s) - 1)
    h = np.where(j > i, path.s[j] - path.s[i], 1.0)[:, None]
    t = (s - path.s[i])[:, None] / h
    rise = path.u[j] - path.u[i]
    left, right = h * path.slope[i] - rise, rise - h * path.slope[j]
    return np.asarray(path.u[i] + t * rise + t * (1.0 - t) * ((1.0 - t) * left + t * right))
