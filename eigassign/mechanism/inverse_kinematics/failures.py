"""Why a tip path cannot be followed, in words: which sample, where, by how much, and what to do."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from eigassign.errors import TrajectoryError
from eigassign.mechanism.inverse_kinematics.chain import Floats
from eigassign.mechanism.inverse_kinematics.solver import TipProblem
from eigassign.mechanism.inverse_kinematics.tip_path import WAYPOINTS, Course


def pose(ik: TipProblem, u: Floats) -> str:
    """The coordinates of a state in words."""
    q = (u * ik.scale)[: ik.n_q]
    return "q = (" + ", ".join(f"{value:.6g}" for value in q) + ")"


def out_of_reach(ik: TipProblem, course: Course, k: int, u: Floats) -> TrajectoryError:
    """Sample k cannot be reached; u (n_z,) comes as near as possible to point and turn together."""
    seen = ik.evaluate(u[None])
    distance, turn = ik.misses(ik.error(seen, course.target(course.s[[k]])))
    near = "(" + ", ".join(f"{x:.6g}" for x in seen.point[0]) + ") m"
    if ik.chain.assembly is not None:
        near += f", at {pose(ik, u)}"
    key, message = WAYPOINTS, f"is {distance[0]:.3g} m out of reach; the tip comes to {near}"
    # a turn within 1e-6 rad is reached: the blame is the position's
    if course.attitude is not None and turn[0] > 1e-6:
        key = f"trajectory.{course.attitude.key}"
        message = (
            f"cannot be reached with the {course.attitude.key} asked for; the nearest compromise "
            f"misses the point by {distance[0]:.3g} m and the {course.attitude.key} by "
            f"{np.degrees(turn[0]):.3g} deg"
        )
    return TrajectoryError(key, f"{course.label(k)} {message}{_bound(ik, course)}", k)


def _bound(ik: TipProblem, course: Course) -> str:
    """A word about tips that have fewer freedoms than the path asks for."""
    wanted = course.path.coefficients.shape[2] + len(ik.chain.turned_by)
    if ik.rank >= wanted:
        return ""
    return (
        f"; the coordinates move {ik.rank} of the {wanted} components asked for, so the path must "
        "lie exactly where the tip can go: give points or samples of the coordinates instead"
    )


def outside(ik: TipProblem, course: Course, k: int, u: Floats) -> TrajectoryError:
    """Sample k can be reached, but not in the branch."""
    ranged = int(np.argmin(ik.inside(u[None])[0]))
    row = ik.rows[ranged]
    value = float(ik.joint_coordinates(u[None])[0, row])
    low, high = float(ik.low[ranged]), float(ik.low[ranged] + ik.width[ranged])
    kind, modulo = ik.chain.kinds[row], ""
    unit = "m" if kind == "slide" else "deg"
    if kind != "slide":
        value, low, high = (float(np.degrees(x)) for x in (value, low, high))
    if kind == "turn":
        value, modulo = value % 360.0, " (modulo 360)"
    joint = ik.chain.joints[row]
    message = (
        f"{course.label(k)} needs joint {joint} at {value:.6g} {unit}, "
        f"outside its range [{low:.6g}, {high:.6g}] {unit}{modulo}"
    )
    return TrajectoryError(f"trajectory.branch.{joint}", message, k)


def other_assembly(ik: TipProblem, course: Course) -> TrajectoryError:
    """The first sample can be reached only with the loops put together otherwise."""
    message = (
        f"{course.label(0)} can be reached only with the loops put together otherwise than at "
        f"{pose(ik, ik.seeds[0])}, or past a dead point: move the path, or mechanism.assembly"
    )
    return TrajectoryError(WAYPOINTS, message, 0)


def lost_assembly(ik: TipProblem, course: Course, k: int, u: Floats, why: str) -> TrajectoryError:
    """The model itself cannot follow sample k, for it comes from its own reference."""
    message = f"{course.label(k)} is reached at {pose(ik, u)}, but {why}"
    return TrajectoryError(WAYPOINTS, message, k)


def blocked(
    ik: TipProblem, course: Course, k: int, s: float, u: Floats, dead: bool
) -> TrajectoryError:
    """The path was followed to parameter s and state u (n_z,), and not on to sample k."""
    where = ", ".join(f"{x:.6g}" for x in course.path.point(s)[0])
    why = (
        "the loops are at a dead point"
        if dead
        else "the links stand stretched or folded in line, at the end of their reach"
    )
    message = (
        f"{course.label(k)} cannot be reached without a jump: near ({where}) m, {pose(ik, u)}, "
        f"{why}; keep the path away from there"
    )
    return TrajectoryError(WAYPOINTS, message, k)


def other_branch(ik: TipProblem, course: Course, k: int, u: Floats) -> TrajectoryError:
    """Sample k can be reached with another design, but not from state u (n_z,) of the first one."""
    why = (
        "the links come to stand stretched or folded in line, or the loops at a dead point"
        if ik.rank == ik.n_q
        else "the motion that leaves the tip in place, kept as in the initial design, has to change"
    )
    message = (
        f"{course.label(k)} can be reached, but not by changing the design steadily from the "
        f"initial one: near {pose(ik, u)} {why}; take narrower bounds"
    )
    return TrajectoryError(WAYPOINTS, message, k)


def with_design(values: Mapping[str, float], error: TrajectoryError) -> TrajectoryError:
    """The same error with the design parameters at which it was met, SI."""
    design = ", ".join(f"{name} = {value:.6g}" for name, value in values.items())
    return TrajectoryError(error.path, f"with {design}: {error.message}", error.sample)
