"""Numerical inverse kinematics of any serial chain: the coordinates q along a path of its tip.

The first sample is solved from many seeds at once. From there the path is traced with steps in q
of a bounded size (predictor and Newton corrector), whatever the samples are; Hermite
interpolation of that trace seeds one Newton iteration over all samples together.

Shapes: n samples or seeds, n_q coordinates, n_j joints, d = 2 or 3 components of the tip.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from eigassign.errors import TrajectoryError
from eigassign.mechanism.paths import WAYPOINTS, Course
from eigassign.mechanism.tip_chain import (
    ROUND_OFF,
    Arm,
    Floats,
    TipChain,
    least_norm,
    levenberg,
    newton,
    orientation,
    prepare,
    regularity,
)

RESIDUAL = 1e-10  # largest distance of the tip from its path, relative to the longest lever arm
_TRACE = 1e-7  # the same for the trace, which only seeds the samples
_SINGULAR = 1e-3  # of the lever: a smaller singular value of J is a chain stretched or folded;
# angles are known there to the root of the distance, 3e-4, so that _TRACE can tell it
_TURNS = (0.2, 0.02)  # rad: largest step of the trace, and of a second try where that was too bold
_STRAY = 0.5  # of a trace's largest step: a corrector that moves further has left the branch
_MAX_ADVANCE = 0.125  # of the path, a trace step
_MIN_ADVANCE = 1e-8  # below, the angles turn faster and faster without advancing
_SAME = 1e-4  # rad: solutions nearer than this are one solution
_FULL_TURN_SLACK = 1e-9  # rad below 2π, taken for round-off below 0
_ATTEMPTS = 4  # first solutions that are followed before giving up


@dataclass(frozen=True)
class Followed:
    """The coordinates q (n, n_q) in rad along a course, and what is worth telling about them."""

    q: Floats
    notes: tuple[str, ...]


@dataclass(frozen=True)
class _Pose:
    """A solution q (1, n_q) at path parameter s, with dq/ds."""

    s: float
    q: Floats
    slope: Floats


@dataclass(frozen=True)
class _Trace:
    """Solutions at path parameters s_i (m,) with their slopes dq/ds, up to where it got."""

    s: Floats
    q: Floats  # (m, n_q)
    slope: Floats  # (m, n_q)
    sense: float  # sign of det J all along


def follow(
    chain: TipChain,
    course: Course,
    branch: Mapping[str, tuple[float, float]] | None = None,
    start: Sequence[float] | Floats | None = None,
) -> Followed:
    """Coordinates q(t_k), continuous in k, with position(q(t_k)) = path(s_k).

    ``branch`` keeps the relative angle of a joint in [low, high] modulo 2π (rad). The first sample
    is the solution nearest to ``start`` (modulo 2π, and within π of it), else the one bent least,
    with angles in [0, 2π). Chains with more coordinates than the tip has components take the steps
    of least norm, dq = J⁺ dp, to the few percent that finite steps leave. The tip is on its path
    to RESIDUAL times the longest lever arm.

    Raises TrajectoryError naming the first sample that is out of reach, outside the branch, or
    behind a stretched or folded configuration; MechanismError if branch or start make no sense.
    """
    arm = prepare(chain, branch or {}, start)
    candidates = _first_solutions(arm, course)
    failures = []
    for q0 in candidates[:_ATTEMPTS]:
        try:
            q = _along(arm, course, q0)
        except TrajectoryError as error:
            failures.append(error)
            continue
        q.setflags(write=False)
        return Followed(q, _notes(arm, candidates))
    raise max(failures, key=lambda error: error.sample)


# --- the first sample ---


def _first_solutions(arm: Arm, course: Course) -> list[Floats]:
    """Solutions q (n_q,) of the first sample within the branch, the preferred one first."""
    target = course.path.point(course.s[0])
    q = arm.seeds if arm.start is None else np.vstack([arm.start, arm.seeds])
    for iterations in (8, 20, 100):  # the last for targets at the end of the reach
        q, miss = levenberg(arm, q, target, iterations)
        reached = miss <= RESIDUAL * arm.lever
        wanted = reached & arm.inside(q).all(axis=1)
        if wanted.any():
            return _ordered(arm, q[wanted])
    if reached.any():
        raise _outside(arm, course, 0, q[np.argmax(reached)])
    raise _out_of_reach(course, 0, arm.chain.position(q[np.argmin(miss)][None])[0])


def _ordered(arm: Arm, q: Floats) -> list[Floats]:
    """Distinct solutions: nearest to ``start`` first, else least bent, else bent anticlockwise."""

    def preference(candidate: Floats) -> tuple[float, ...]:
        if arm.start is not None:
            return (float(np.linalg.norm(candidate - arm.start)),)
        bend = _wrapped(arm.relative(candidate[None])[0])[1:].round(6)
        return (round(float(bend @ bend), 6), *(-bend))

    distinct: list[Floats] = []
    for candidate in sorted(_normalised(q, arm.start), key=preference):
        if all(np.abs(_wrapped(candidate - other)).max() > _SAME for other in distinct):
            distinct.append(candidate)
    return distinct


def _wrapped(angle: Floats) -> Floats:
    """The same angle in [−π, π)."""
    return np.asarray(np.mod(angle + np.pi, 2.0 * np.pi) - np.pi)


def _normalised(q: Floats, start: Floats | None) -> Floats:
    """The same pose within π of ``start``, else in [0, 2π), where round-off below 0 stays 0."""
    if start is not None:
        return np.asarray(start + _wrapped(q - start))
    turned = np.mod(q, 2.0 * np.pi)
    return np.where(turned >= 2.0 * np.pi - _FULL_TURN_SLACK, turned - 2.0 * np.pi, turned)


# --- along the path ---


def _along(arm: Arm, course: Course, q0: Floats) -> Floats:
    """All samples (n, n_q) of the solution that begins with q0; TrajectoryError where it ends."""
    points = course.path.point(course.s)
    for turn in _TURNS:
        trace = _trace(arm, course, q0, turn)
        n = int(np.searchsorted(course.s, trace.s[-1], side="right"))
        seeds = _interpolated(trace, course.s[:n])
        q, J, settled = newton(arm, seeds, points[:n], ROUND_OFF)
        strayed = ~settled | (np.abs(q - seeds).max(axis=1) > turn)
        strayed |= orientation(arm, J) * trace.sense < 0.0
        if not strayed.any():
            break
    n = int(np.argmax(strayed)) if strayed.any() else n
    _check(arm, course, q[:n])
    if n < len(points):
        raise _blocked(arm, course, n, trace)
    return q


def _trace(arm: Arm, course: Course, q0: Floats, turn: float) -> _Trace:
    """dq/ds = J⁺ dp/ds from q0 in steps of about ``turn`` rad, corrected back onto the path.

    It steps onto every corner of the path, lest it cuts one that is out of reach.
    """
    stops = np.append(course.path.corners(), course.s[-1])
    J = arm.chain.jacobian(q0[None])
    sense = float(orientation(arm, J)[0])
    here = _pose(arm, course, float(course.s[0]), q0[None], J)
    poses, advance, bend = [here], _MAX_ADVANCE, np.zeros_like(here.q)
    while here.s < stops[-1] and advance >= _MIN_ADVANCE:
        advance = min(advance, turn / max(float(np.abs(here.slope).max()), turn))
        stop = float(stops[np.searchsorted(stops, here.s, side="right")])
        there = _step(arm, course, here, min(here.s + advance, stop), bend, sense, turn)
        if there is None:
            advance = 0.5 * min(advance, stop - here.s)
            continue
        bend = 0.5 * (there.slope - here.slope) / (there.s - here.s) * (there.s < stop)
        poses.append(there)
        here, advance = there, min(2.0 * advance, _MAX_ADVANCE)
    q, slopes = np.vstack([p.q for p in poses]), np.vstack([p.slope for p in poses])
    return _Trace(np.array([p.s for p in poses]), q, slopes, sense)


def _step(
    arm: Arm, course: Course, here: _Pose, s: float, bend: Floats, sense: float, turn: float
) -> _Pose | None:
    """The pose at s ahead: a quadratic guess, corrected; None if that is not the same branch."""
    guess = here.q + (s - here.s) * (here.slope + (s - here.s) * bend)
    q, J, settled = newton(arm, guess, course.path.point(s), _TRACE)
    strayed = np.abs(q - guess).max() > _STRAY * turn
    crossed = orientation(arm, J)[0] * sense < 0.0 or regularity(arm, J)[0] < _SINGULAR
    return _pose(arm, course, s, q, J) if settled[0] and not strayed and not crossed else None


def _pose(arm: Arm, course: Course, s: float, q: Floats, J: Floats) -> _Pose:
    return _Pose(s, q, least_norm(J, course.path.derivative(s), arm.rank))


def _interpolated(trace: _Trace, s: Floats) -> Floats:
    """Cubic Hermite interpolation of a trace at parameters s (n,) within it."""
    i = np.clip(np.searchsorted(trace.s, s, side="right") - 1, 0, max(len(trace.s) - 2, 0))
    j = np.minimum(i + 1, len(trace.s) - 1)
    h = np.where(j > i, trace.s[j] - trace.s[i], 1.0)[:, None]
    t = (s - trace.s[i])[:, None] / h
    rise = trace.q[j] - trace.q[i]
    left, right = h * trace.slope[i] - rise, rise - h * trace.slope[j]
    return np.asarray(trace.q[i] + t * rise + t * (1.0 - t) * ((1.0 - t) * left + t * right))


# --- what can go wrong ---


def _check(arm: Arm, course: Course, q: Floats) -> None:
    """Raises TrajectoryError for the first of the samples q that leaves its branch or its point."""
    tip = arm.chain.position(q)
    miss = np.linalg.norm(tip - course.path.point(course.s[: len(q)]), axis=1)
    off_path = miss > RESIDUAL * arm.lever
    off_branch = ~arm.inside(q).all(axis=1)
    if (off_path | off_branch).any():
        k = int(np.argmax(off_path | off_branch))
        raise _out_of_reach(course, k, tip[k]) if off_path[k] else _outside(arm, course, k, q[k])


def _outside(arm: Arm, course: Course, k: int, q: Floats) -> TrajectoryError:
    """Sample k can be reached, but not in the branch."""
    ranged = int(np.argmin(arm.inside(q[None])[0]))
    low, width = np.degrees(arm.low[ranged]), np.degrees(arm.width[ranged])
    angle = np.degrees(arm.relative(q[None])[0, arm.rows[ranged]]) % 360.0
    joint = arm.chain.joints[arm.rows[ranged]]
    message = (
        f"{course.label(k)} needs joint {joint} at {angle:.6g} deg, "
        f"outside its range [{low:.6g}, {low + width:.6g}] deg (modulo 360)"
    )
    return TrajectoryError(f"trajectory.branch.{joint}", message, k)


def _out_of_reach(course: Course, k: int, nearest: Floats) -> TrajectoryError:
    """Sample k cannot be reached; ``nearest`` is the tip (d,) as near as it comes."""
    distance = float(np.linalg.norm(nearest - course.path.point(course.s[k])[0]))
    where = ", ".join(f"{x:.6g}" for x in nearest)
    message = f"{course.label(k)} is {distance:.3g} m out of reach; the tip comes to ({where}) m"
    return TrajectoryError(WAYPOINTS, message, k)


def _blocked(arm: Arm, course: Course, k: int, trace: _Trace) -> TrajectoryError:
    """Why the solution could not be continued from the end of the trace to sample k."""
    q, miss = levenberg(
        arm, np.vstack([trace.q[-1], arm.seeds]), course.path.point(course.s[k]), 115
    )
    best = int(np.argmin(miss))
    if miss[best] > RESIDUAL * arm.lever:
        return _out_of_reach(course, k, arm.chain.position(q[best][None])[0])
    where = ", ".join(f"{x:.6g}" for x in course.path.point(trace.s[-1])[0])
    message = (
        f"{course.label(k)} cannot be reached without a jump: near ({where}) m the links stand "
        "stretched or folded in line, at the end of their reach; keep the path away from there"
    )
    return TrajectoryError(WAYPOINTS, message, k)


def _notes(arm: Arm, candidates: Sequence[Floats]) -> tuple[str, ...]:
    """What was chosen where the case leaves a choice."""
    n_q = len(candidates[0])
    if arm.rank < n_q:
        return (
            f"the tip fixes {arm.rank} of {n_q} coordinates: of the many solutions, the one that "
            "moves the joints least from sample to sample is taken",
        )
    if len(candidates) > 1 and arm.start is None:
        return (
            f"the first sample can be reached in {len(candidates)} ways; "
            "name a branch or a start to choose another",
        )
    return ()
