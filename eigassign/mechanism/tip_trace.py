"""A solution traced along a tip path, in steps of a bounded size, whatever the samples are.

Predictor and Newton corrector; Hermite interpolation of the trace seeds the samples.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from eigassign.mechanism.arm import Arm
from eigassign.mechanism.course import Course
from eigassign.mechanism.tip_chain import Floats, Look, Reduced, reduced
from eigassign.mechanism.tip_solvers import (
    handedness,
    least_norm,
    loop_regularity,
    newton,
    regularity,
)

_TRACE = 1e-7  # miss of the trace, relative to L, which only seeds the samples
_SINGULAR = 1e-3  # of L: a smaller singular value of J is a chain stretched or folded;
# angles are known there to the root of the distance, 3e-4, so that _TRACE can tell it
DEAD = 1e-3  # smallest over largest singular value of ∂F/∂p: as near a dead point, for that reason
_STRAY = 0.5  # of a trace's largest step: a corrector that moves further has left the branch
_MAX_ADVANCE = 0.125  # of the path, a trace step
_MIN_ADVANCE = 1e-8  # below, the joints turn faster and faster without advancing


@dataclass(frozen=True)
class Pose:
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


def trace(arm: Arm, course: Course, u0: Floats, turn: float) -> Trace:
    """du/ds = J⁺ dp/ds from u0 in steps of about ``turn``, corrected back onto the path.

    It steps onto every corner of the path, lest it cuts one that is out of reach.
    """
    stops = np.append(course.corners(), course.s[-1])
    seen = arm.look(u0[None])
    motion = reduced(seen, arm.n_q)
    sense = handedness(arm, seen, motion)[0]
    here = _pose(arm, course, float(course.s[0]), u0[None], motion)
    poses, advance, bend = [here], _MAX_ADVANCE, np.zeros_like(here.u)
    while here.s < stops[-1] and advance >= _MIN_ADVANCE:
        fastest = float(np.abs(here.slope[:, : arm.n_q]).max())
        advance = min(advance, turn / max(fastest, turn))
        stop = float(stops[np.searchsorted(stops, here.s, side="right")])
        there = _step(arm, course, here, min(here.s + advance, stop), bend, sense, turn)
        if there is None:
            advance = 0.5 * min(advance, stop - here.s)
            continue
        bend = 0.5 * (there.slope - here.slope) / (there.s - here.s) * (there.s < stop)
        poses.append(there)
        here, advance = there, min(2.0 * advance, _MAX_ADVANCE)
    u, slopes = np.vstack([p.u for p in poses]), np.vstack([p.slope for p in poses])
    return Trace(np.array([p.s for p in poses]), u, slopes, sense)


def _step(
    arm: Arm, course: Course, here: Pose, s: float, bend: Floats, sense: Floats, turn: float
) -> Pose | None:
    """The pose at s ahead: a quadratic guess, corrected; None if that is not the same branch."""
    guess = here.u + (s - here.s) * (here.slope + (s - here.s) * bend)
    u, seen, motion, settled = newton(arm, guess, course.target(np.array([s])), _TRACE)
    strayed = not settled[0] or np.abs(u - guess).max() > _STRAY * turn
    if strayed or crossed(arm, seen, motion, sense)[0] or _singular(arm, seen, motion):
        return None
    return _pose(arm, course, s, u, motion)


def crossed(arm: Arm, seen: Look, motion: Reduced, sense: Floats) -> Floats:
    """Whether a branch other than that of ``sense`` has been met, (n,)."""
    return np.asarray((handedness(arm, seen, motion) * sense < 0.0).any(axis=1))


def _singular(arm: Arm, seen: Look, motion: Reduced) -> bool:
    stretched = regularity(arm, motion)[0] < _SINGULAR
    return bool(stretched or loop_regularity(arm, seen)[0] < DEAD)


def _pose(arm: Arm, course: Course, s: float, u: Floats, motion: Reduced) -> Pose:
    velocity, spin = course.rates(s)
    spin = arm.lever * spin[:, list(arm.chain.turned_by)]
    slope = least_norm(motion.J, np.hstack([velocity, spin]), arm.rank)
    passive = np.einsum("npq,nq->np", motion.following, slope)
    return Pose(s, u, np.hstack([slope, passive]))


def interpolated(path: Trace, s: Floats) -> Floats:
    """Cubic Hermite interpolation of a trace at parameters s (n,) within it."""
    i = np.clip(np.searchsorted(path.s, s, side="right") - 1, 0, max(len(path.s) - 2, 0))
    j = np.minimum(i + 1, len(path.s) - 1)
    h = np.where(j > i, path.s[j] - path.s[i], 1.0)[:, None]
    t = (s - path.s[i])[:, None] / h
    rise = path.u[j] - path.u[i]
    left, right = h * path.slope[i] - rise, rise - h * path.slope[j]
    return np.asarray(path.u[i] + t * rise + t * (1.0 - t) * ((1.0 - t) * left + t * right))
