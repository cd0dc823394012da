"""The first sample of a tip path: every way to reach it, the preferred one first."""

from __future__ import annotations

import numpy as np

from eigassign.errors import SingularityError
from eigassign.mechanism.arm import Arm
from eigassign.mechanism.course import Course, Target
from eigassign.mechanism.tip_chain import Bools, Floats
from eigassign.mechanism.tip_failures import out_of_reach, outside
from eigassign.mechanism.tip_solvers import levenberg

RESIDUAL = 1e-10  # largest miss of a sample: of L in m, and in rad
_SAME = 1e-4  # rad, or of L: solutions nearer than this are one solution
_FULL_TURN_SLACK = 1e-9  # rad below 2π, taken for round-off below 0


def first_solutions(arm: Arm, course: Course) -> list[Floats]:
    """Solutions u (n_q + n_p,) of the first sample within the branch, whatever the assembly.

    The nearest to the start comes first, else the least bent. Raises TrajectoryError where there
    is none.
    """
    target = course.target(course.s[:1])
    u = arm.seeds
    for iterations in (8, 20, 100):  # the last for targets at the end of the reach
        u, miss = levenberg(arm, u, target, iterations)
        reached = miss <= RESIDUAL * arm.lever
        wanted = reached & arm.inside(u).all(axis=1)
        if wanted.any():
            return _distinct(arm, u[wanted])
    if reached.any():
        raise outside(arm, course, 0, u[np.argmax(reached)])
    raise out_of_reach(arm, course, 0, u[np.argmin(miss)])


def _distinct(arm: Arm, u: Floats) -> list[Floats]:
    """Distinct solutions: nearest to the start first, else least bent, else bent anticlockwise."""

    def preference(candidate: Floats) -> tuple[float, ...]:
        if arm.start is not None:
            return (float(np.linalg.norm((candidate - arm.start)[: arm.n_q])),)
        turns = arm.chain.of_kind("turn")[: arm.n_q]
        bend = _wrapped(arm.joint_coordinates(candidate[None])[0])[turns][1:].round(6)
        return (round(float(bend @ bend), 6), *(-bend))

    turns = arm.chain.of_kind("turn")
    distinct: list[Floats] = []
    for candidate in sorted(_normalised(arm, u, turns), key=preference):
        if all(_apart(candidate - other, turns) > _SAME for other in distinct):
            distinct.append(candidate)
    return distinct


def _apart(difference: Floats, turns: Bools) -> float:
    return float(np.abs(np.where(turns, _wrapped(difference), difference)).max())


def _wrapped(angle: Floats) -> Floats:
    """The same angle in [−π, π)."""
    return np.asarray(np.mod(angle + np.pi, 2.0 * np.pi) - np.pi)


def _normalised(arm: Arm, u: Floats, turns: Bools) -> Floats:
    """The same pose within π of the start, else in [0, 2π), where round-off below 0 stays 0."""
    if arm.start is not None:
        return np.where(turns, arm.start + _wrapped(u - arm.start), u)
    turned = np.mod(u, 2.0 * np.pi)
    turned = np.where(turned >= 2.0 * np.pi - _FULL_TURN_SLACK, turned - 2.0 * np.pi, turned)
    return np.where(turns, turned, u)


def assembled(arm: Arm, target: Target, u: Floats) -> Floats | None:
    """The same solution if the model itself has the loops in that assembly, coming from its
    reference; else None.
    """
    assembly = arm.chain.assembly
    if assembly is None:
        return u
    q = (u * arm.scale)[: arm.n_q]
    try:
        p = assembly.passive(q[None])[0]
    except SingularityError:
        return None
    own = np.concatenate([q, p]) / arm.scale
    distance, turn = arm.misses(arm.error(arm.look(own[None]), target))
    met = distance[0] <= 10.0 * RESIDUAL * arm.lever and turn[0] <= 10.0 * RESIDUAL
    return own if met else None
