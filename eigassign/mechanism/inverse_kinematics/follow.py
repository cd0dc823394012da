"""The coordinates q along a path of the tip of any chain, and how they follow the design.

The first sample is solved from many seeds at once; all solutions are kept, the preferred one first.
From there the path is traced, position and orientation, coordinates and the passive freedoms of
loops together; Hermite interpolation of that trace seeds one Newton iteration over all samples.

The tip's path p(t_k) and the times are the same for every design. With the tip at T(q, y), its
loops closed, every sample k by itself is an implicit function of y through the known q_k(y0):

    T(q_k, y) = p(t_k),    dq_k/dy = −(∂T/∂q)⁻¹ ∂T/∂y

It is continued along the straight line from y0 to y, so that it stays in the branch of the initial
design, and depends on y alone.

Shapes: n samples, n_q coordinates, n_y design parameters, n_z entries of a state u.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from eigassign.arrays import Floats
from eigassign.case.units import handy, shown_point
from eigassign.errors import MechanismError, SingularityError, TrajectoryError
from eigassign.mechanism.inverse_kinematics.chain import (
    WAYPOINTS,
    Bools,
    Course,
    Reduced,
    TipChain,
    reduced,
)
from eigassign.mechanism.inverse_kinematics.solver import (
    DEAD,
    ROUND_OFF,
    TipProblem,
    Trace,
    change,
    handedness,
    interpolated,
    levenberg,
    loop_regularity,
    lost,
    newton,
    prepare,
    singular,
    trace,
)
from eigassign.mechanism.kinematics.loop_closure import as_assembly, wrapped


def pose(ik: TipProblem, u: Floats) -> str:
    """The coordinates of a state in words, angles within half a turn of 0."""
    q, turning = ik.coordinates(u[None])[0], ik.chain.of_kind("turn")[: ik.n_q]
    return shown_point(ik.chain.names, np.where(turning, wrapped(q), q), ik.chain.units)


def _assembly(ik: TipProblem, u: Floats) -> str:
    """The key `assembly` that puts the loops together as they are in a state."""
    tables, (q, p) = ik.chain.tables, np.split(u * ik.scale, [ik.n_q])
    key = as_assembly(tables.case, tables.motion.tree, q, p) if tables else pose(ik, u)
    return f"mechanism.assembly: {key}"


def out_of_reach(ik: TipProblem, course: Course, k: int, u: Floats) -> TrajectoryError:
    """Sample k cannot be reached; u (n_z,) comes as near as possible to point and turn together."""
    seen = ik.evaluate(u[None])
    distance, turn = ik.misses(ik.error(seen, course.target(course.s[[k]])))
    near = "(" + ", ".join(f"{x:.6g}" for x in seen.point[0]) + ") m"
    if ik.chain.assembly is not None:
        near += f", at {pose(ik, u)}"
    elif len(seen.point[0]) == 2 and ik.chain.kinds[0] == "turn":
        spin = np.linalg.inv(ik.chain.relative_map[0])[:, 0]  # of joint coordinate 1 alone
        reach = float(np.linalg.norm(seen.jacobian[0, :2, : ik.n_q] @ spin))
        near += f", {reach:.3g} m from joint {ik.chain.joints[0]}"
    i = course.waypoint(k)
    key = WAYPOINTS if i is None else f"{WAYPOINTS}[{i}]"
    message = f"is {distance[0]:.3g} m out of reach; the tip comes to {near}"
    # a turn within 1e-6 rad is reached: the blame is the position's
    if course.attitude is not None and turn[0] > 1e-6:
        key = f"trajectory.{course.attitude.key}"
        message = (
            f"cannot be reached with the {course.attitude.key} asked for; the nearest compromise "
            f"misses the point by {distance[0]:.3g} m and the {course.attitude.key} by "
            f"{np.degrees(turn[0]):.3g} deg"
        )
    if ik.n_q < (wanted := ik.task(course, 0.0).shape[1]):
        message += (
            f"; the coordinates move {ik.n_q} of the {wanted} components asked for, so the path "
            "must lie exactly where the tip can go: give points or samples of the coordinates "
            "instead"
        )
    return TrajectoryError(key, f"{course.label(k)} {message}", k)


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
        least = 0.5 * (low + high) - 180.0  # the turn nearest to the range
        value, modulo = least + (value - least) % 360.0, " (modulo 360)"
    joint = ik.chain.joints[row]
    message = (
        f"{course.label(k)} needs joint {joint} at {value:.6g} {unit}, "
        f"outside its range [{low:.6g}, {high:.6g}] {unit}{modulo}"
    )
    return TrajectoryError(f"trajectory.branch.{joint}", message, k)


RESIDUAL = 1e-10  # largest miss of a sample: of L in m, and in rad
_TURNS = (0.2, 0.02)  # rad: largest step of the trace, and of a second try where that was too bold


class Followed(NamedTuple):
    """The coordinates q (n, n_q) in rad or m along a course."""

    q: Floats
    notes: tuple[str, ...]
    problem: TipProblem
    u: Floats  # its states (n, n_q + n_p)
    path: Trace  # what the states between the samples are found from


def follow(
    chain: TipChain,
    course: Course,
    branch: Mapping[str, tuple[float, float]] | None = None,
    start: Sequence[float] | Floats | None = None,
) -> Followed:
    """Coordinates q(t_k), continuous in k, with position(q(t_k)) = path(s_k), turned as asked for.

    ``branch`` keeps the relative angle of a joint in [low, high] modulo 2π (rad), or its place (m).
    The first sample is the solution nearest to ``start`` (angles modulo 2π, and within π of it);
    without one, nearest to where the loops were put together, else bent least, the path on the turn
    nearest to its branch, else to 0. The tip is on its path to RESIDUAL times L in m (see
    `solver`), and RESIDUAL in rad; loops stay in the assembly of the model.

    Raises TrajectoryError naming the first sample that is out of reach, outside the branch, or
    behind a stretched, folded or dead configuration; MechanismError if branch or start make no
    sense, or the tip fixes fewer directions than there are coordinates.
    """
    ik = prepare(chain, course, branch or {}, start)
    candidates = first_solutions(ik, course)
    failures = []
    # eight first solutions are followed before giving up
    for candidate in candidates[:8]:
        try:
            u0 = _own(ik, candidate[None])
            if _off(ik, course, u0, 10.0 * RESIDUAL)[0]:
                continue
            u, path = _along(ik, course, u0[0])
        except SingularityError:
            continue
        except TrajectoryError as error:
            failures.append(error)
            continue
        turns = _turns(ik, u)
        u, path = u - turns, path._replace(u=path.u - turns)
        return Followed(ik.coordinates(u), _notes(ik, candidates), ik, u, path)
    if not failures:
        message = (
            f"{course.label(0)} can be reached only with the loops put together otherwise than at "
            f"{pose(ik, ik.seeds[0])}, or past a dead point: move the path, or write "
            f"{' or '.join(_assembly(ik, u) for u in candidates[:4])}"
        )
        raise TrajectoryError(WAYPOINTS, message, 0)
    furthest = max(failures, key=lambda failure: failure.sample)
    if furthest.sample and ".branch." not in furthest.path:
        knots, (before, there) = course.path.knots, course.s[[furthest.sample - 1, furthest.sample]]
        first, last = np.searchsorted(knots, before, side="right"), np.searchsorted(knots, there)
        for s in knots[first : last + 1]:
            try:  # 1e-6: loops come no nearer to a dead point, see `_blocked`
                first_solutions(ik, course._replace(s=s[None]), 1e-6)
            except TrajectoryError as error:
                raise TrajectoryError(error.path, error.message, furthest.sample) from None
    raise furthest


def _turns(ik: TipProblem, u: Floats) -> Floats:
    """The whole turns (n_z,) in rad that bring the middle of a path (n, n_z) nearest to its branch,
    else the joint coordinates to 0; none where there is a start.
    """
    turns, q = np.zeros(u.shape[1]), ik.joint_coordinates(u)
    if ik.start is None:
        off = 0.5 * (q.min(axis=0) + q.max(axis=0))
        off[list(ik.rows)] -= ik.low + 0.5 * ik.width
        whole = np.ceil(off / (2.0 * np.pi) - 0.5 - 1e-9)  # half a turn, but for round-off, stays
        whole *= ik.chain.of_kind("turn")[: ik.n_q]
        turns[: ik.n_q] = 2.0 * np.pi * np.linalg.solve(ik.chain.relative_map[0], whole).round()
    return turns


def at_parameters(followed: Followed, course: Course) -> Floats:
    """States (n, n_z) at the parameters of a course along the path that was followed."""
    ik, seeds = followed.problem, interpolated(followed.path, course.s)
    return _own(ik, newton(ik, seeds, course.target(course.s), ROUND_OFF).u)


def _along(ik: TipProblem, course: Course, u0: Floats) -> tuple[Floats, Trace]:
    """The states (n, n_z) of the solution that begins with u0; TrajectoryError where it ends."""
    for turn in _TURNS:
        path = trace(ik, course, u0, turn)
        n = int(np.searchsorted(course.s, path.s[-1], side="right"))
        seeds = interpolated(path, course.s[:n])
        found = newton(ik, seeds, course.target(course.s[:n]), ROUND_OFF)
        strayed = lost(ik, found, seeds, turn, path.sense)
        if not strayed.any():
            break
    n = int(np.argmax(strayed)) if strayed.any() else n
    require_reached(ik, course, found.u[:n])
    if n < len(course.s):
        raise _blocked(ik, course, n, path)
    return as_assembled(ik, course, found.u), path


def require_reached(ik: TipProblem, course: Course, u: Floats) -> None:
    """Raises TrajectoryError for the first of the samples u that leaves its branch or its point."""
    off_path = _off(ik, course, u, RESIDUAL)
    off_branch = ~ik.inside(u).all(axis=1)
    if (off_path | off_branch).any():
        k = int(np.argmax(off_path | off_branch))
        why = out_of_reach if off_path[k] else outside
        raise why(ik, course, k, u[k])


def _off(ik: TipProblem, course: Course, u: Floats, tolerance: float) -> Bools:
    """True where tips of the first samples are off their points or their orientations, (n,)."""
    distance, turn = ik.misses(ik.error(ik.evaluate(u), course.target(course.s[: len(u)])))
    return np.asarray((distance > tolerance * ik.lever) | (turn > tolerance))


def as_assembled(ik: TipProblem, course: Course, u: Floats) -> Floats:
    """The path with the passive freedoms as the model has them; TrajectoryError if others."""
    own = _own(ik, u)
    other = _off(ik, course, own, 100.0 * RESIDUAL)
    if other.any():
        k = int(np.argmax(other))
        message = (
            f"{course.label(k)} is reached at {pose(ik, u[k])}, but on the straight way there the "
            f"model puts its loops together otherwise: write {_assembly(ik, u[k])}"
        )
        raise TrajectoryError(WAYPOINTS, message, k)
    return own


def _own(ik: TipProblem, u: Floats) -> Floats:
    """States with the model's own passive freedoms; raises SingularityError if it has none."""
    if ik.chain.assembly is None:
        return u
    q = ik.coordinates(u)
    return np.hstack([q, ik.chain.assembly.passive(q)]) / ik.scale


def _blocked(ik: TipProblem, course: Course, k: int, path: Trace) -> TrajectoryError:
    """Why the solution could not be continued from the end of the trace to sample k."""
    last = path.u[-1]
    dead = bool(loop_regularity(ik, ik.evaluate(last[None]))[0] < 10.0 * DEAD)
    where = ", ".join(f"{x:.6g}" for x in course.path.value(path.s[-1])[0])
    why = (
        "the loops are at a dead point"
        if dead
        else "the links stand stretched or folded in line, at the end of their reach"
    )
    message = (
        f"cannot be reached without a jump: near ({where}) m, {pose(ik, last)}, {why}; keep the "
        "path away from there"
    )
    # a dead point, where two assemblies meet, can be come as near to as 1e-6 of L
    return _beyond(ik, course, k, last, message, 1e-6 if dead else RESIDUAL)


def _beyond(
    ik: TipProblem, course: Course, k: int, u: Floats, message: str, tolerance: float = RESIDUAL
) -> TrajectoryError:
    """Sample k is out of reach, or else what ``message`` says of the way to it from u (n_z,)."""
    tried, miss = levenberg(ik, np.vstack([u, ik.seeds]), course.target(course.s[[k]]), 115)
    best = int(np.argmin(miss))
    if miss[best] > tolerance * ik.lever:
        return out_of_reach(ik, course, k, tried[best])
    return TrajectoryError(WAYPOINTS, f"{course.label(k)} {message}", k)


def _notes(ik: TipProblem, candidates: Sequence[Floats]) -> tuple[str, ...]:
    """Notes on what was chosen where the case leaves a choice."""
    if len(candidates) == 1 or ik.guessed:
        return ()
    if ik.chain.assembly is not None:
        said = "the solution nearest to mechanism.assembly is taken at the first sample"
        return (f"{said}: name a branch or a start for another",)
    each = ik.coordinates(np.array(candidates[:8]))
    each = np.where(ik.chain.of_kind("turn")[: ik.n_q], wrapped(each), each)
    ways = [
        ", ".join(handy(v, unit, 6) for v, unit in zip(q, ik.chain.units, strict=True))
        for q in each
    ]
    said = f"the first sample can be reached in {len(candidates)} ways; taken is start: [{ways[0]}]"
    return (f"{said}, others are {' | '.join(f'[{way}]' for way in ways[1:])}",)


# --- the first sample


def first_solutions(ik: TipProblem, course: Course, tolerance: float = RESIDUAL) -> list[Floats]:
    """Solutions u (n_q + n_p,) of the first sample within the branch, whatever the assembly.

    The nearest to the start comes first, else the least bent. Raises TrajectoryError where there
    is none to a ``tolerance`` of L in m.
    """
    target = course.target(course.s[:1])
    u = ik.seeds
    # 28 find all eight ways of a six-axis arm; the last for targets at the end of the reach
    for iterations in (28, 100):
        u, miss = levenberg(ik, u, target, iterations)
        reached = miss <= tolerance * ik.lever
        wanted = reached & ik.inside(u).all(axis=1)
        if wanted.any():
            return _distinct(ik, u[wanted])
    if reached.any():
        raise outside(ik, course, 0, u[np.argmax(reached)])
    raise out_of_reach(ik, course, 0, u[np.argmin(miss)])


def _distinct(ik: TipProblem, u: Floats) -> list[Floats]:
    """Distinct solutions: nearest to the start first, else least bent, else bent anticlockwise."""

    def preference(candidate: Floats) -> tuple[float, ...]:
        if ik.start is not None:
            return (float(np.linalg.norm((candidate - ik.start)[: ik.n_q])),)
        turns = ik.chain.of_kind("turn")[: ik.n_q]
        bend = wrapped(ik.joint_coordinates(candidate[None])[0])[turns][1:].round(6)
        return (round(float(bend @ bend), 6), *(-bend))

    turns = ik.chain.of_kind("turn")
    distinct: list[Floats] = []
    for candidate in sorted(_normalised(ik, u, turns), key=preference):
        apart = (candidate - other for other in distinct)
        # solutions nearer than 1e-4 rad, or of L, are one
        if all(np.abs(np.where(turns, wrapped(d), d)).max() > 1e-4 for d in apart):
            distinct.append(candidate)
    return distinct


def _normalised(ik: TipProblem, u: Floats, turns: Bools) -> Floats:
    """The pose within π of the start, else in [0, 2π), where round-off below 0 stays 0."""
    if ik.start is not None:
        return np.where(turns, ik.start + wrapped(u - ik.start), u)
    turned = np.mod(u, 2.0 * np.pi)
    # 1e-9 rad below 2π is taken for round-off below 0
    turned = np.where(turned >= 2.0 * np.pi - 1e-9, turned - 2.0 * np.pi, turned)
    return np.where(turns, turned, u)


@dataclass(frozen=True, eq=False)
class PathOfDesign:
    """q(y) and dq/dy along one course; immutable, and a function of y alone."""

    course: Course
    problem: TipProblem  # at the initial design y0
    u: Floats  # states (n, n_z) at y0
    loads: Floats = field(default_factory=lambda: np.zeros(0))  # (n_loads,) behind q

    def __call__(self, y: Floats) -> tuple[Floats, Floats]:
        """q (n, n_q) in rad or m and dq/dy (n, n_q, n_y) at design y (n_y,), SI.

        Raises TrajectoryError naming the parameters' values and the first sample that is out of
        reach, outside the branch, or in another branch than at the initial design.
        """
        y = np.asarray(y, dtype=np.float64)
        try:
            u = self.u if np.array_equal(y, self.problem.chain.y) else self.states(y)
        except TrajectoryError as error:
            values = dict(zip(self.problem.chain.y_names, y.tolist(), strict=True))
            design = ", ".join(f"{name} = {values[name]:.6g}" for name in self.moving)
            message = f"with {design}: {error.message}"
            raise TrajectoryError(error.path, message, error.sample) from None
        n_q, ik = self.problem.n_q, self.problem_at(y)
        slopes = _slopes(ik, u)[:, :n_q] * ik.scale[:n_q, None]
        still = [(0, 0), (0, len(self.loads)), (0, 0)]
        return behind(ik.coordinates(u), self.loads), np.pad(slopes, still)

    @cached_property
    def moving(self) -> tuple[str, ...]:
        """The parameters that move the tip, or what its loops consist of."""
        ik = self.problem_at(self.problem.chain.y)
        moves = np.abs(_slopes(ik, self.u)).max(axis=(0, 1)) > 0.0
        return tuple(name for name, one in zip(ik.chain.y_names, moves, strict=True) if one)

    @property
    def said(self) -> str:
        """The sentence that says what follows what."""
        return (
            f"the tip keeps its path for every {', '.join(self.moving)}: the coordinates of the "
            "joints follow the design"
        )

    def problem_at(self, y: Floats) -> TipProblem:
        """The problem at a design, in the measure of the first one."""
        tables = self.problem.chain.tables
        return self.problem._replace(chain=tables.chain(y)) if tables else self.problem

    def states(self, y: Floats) -> Floats:
        """States (n, n_z) at design y, by steps from y0 as large as the branch can be told in."""
        y0, target = self.problem.chain.y, self.course.target(self.course.s)
        u, done, step, ik = self.u, 0.0, 1.0, self.problem_at(y0)
        sense = handedness(ik, u)
        while done < 1.0:
            ahead = min(1.0, done + step)
            slopes = _slopes(self.problem_at(y0 + done * (y - y0)), u)
            ik = self.problem_at(y0 + ahead * (y - y0))
            guess = u + (ahead - done) * (slopes @ (y - y0))
            found = newton(ik, guess, target, ROUND_OFF)
            # a corrector that moves by 0.1 rad, or of L, may have left the branch, as in tracing
            strayed = lost(ik, found, guess, 0.1, sense) | singular(ik, found)
            if not strayed.any():
                u, done, step = found.u, ahead, 2.0 * step
            # steps below 1/256 of the way from y0 to y are given up
            elif (step := 0.5 * min(step, 1.0 - done)) < 1.0 / 256.0:
                raise self._lost(y, u, strayed)
        require_reached(ik, self.course, u)
        return as_assembled(ik, self.course, u)

    def _lost(self, y: Floats, u: Floats, strayed: Bools) -> TrajectoryError:
        """Why the first of the samples that ``strayed`` from u (n, n_z) cannot be had at y."""
        k, ik = int(np.argmax(strayed)), self.problem_at(y)
        message = (
            "can be reached, but not by changing the design steadily from the initial one: near "
            f"{pose(ik, u[k])} the links come to stand stretched or folded in line, or the loops "
            "at a dead point; take narrower bounds"
        )
        return _beyond(ik, self.course, k, u[k], message)


def behind(values: Floats, loads: Floats) -> Floats:
    """Loads (n_loads,), or their rates, behind coordinates (n, n_q)."""
    return np.hstack([values, np.broadcast_to(loads, (len(values), len(loads)))])


def _slopes(ik: TipProblem, u: Floats) -> Floats:
    """du/dy (n, n_z, n_y) where the samples are at their points and the loops are closed."""
    motion = _by_design(ik, u)
    both = motion.J, motion.following
    (by_q, by_y), (follow_q, follow_y) = (np.split(of, [ik.n_q], axis=2) for of in both)
    found = change(motion._replace(J=by_q, following=follow_q), -by_y)
    found[:, ik.n_q :] += follow_y
    return found


def _by_design(ik: TipProblem, u: Floats) -> Reduced:
    """The motion by the coordinates and by the design."""
    return reduced(ik.evaluate(u, by_design=True), ik.n_q + len(ik.chain.y))


def path_of_design(followed: Followed, course: Course) -> PathOfDesign:
    """How the solution that was followed along the course changes with the design.

    Raises MechanismError for a parameter that moves the tip where no coordinate can bring it back.
    """
    ik, u = followed.problem, followed.u
    n_q, chain = ik.n_q, ik.chain
    J = _by_design(ik, u).J
    left = J[:, :, n_q:] + J[:, :, :n_q] @ _slopes(ik, u)[:, :n_q]
    # what moves the tip is in m or rad, and may be 0: it counts as L or 1 at least
    size = np.maximum(np.abs(chain.y), min(ik.lever, 1.0))
    off = np.linalg.norm(left, axis=1).max(axis=0) * size
    for name, length in zip(chain.y_names, off, strict=True):
        # 1e-6 of L, per relative change of the parameter, is round-off
        if length > 1e-6 * ik.lever:
            raise MechanismError(
                f"design.{name}.parameter",
                f"moves the tip where no coordinate can bring it back: they move {n_q} of "
                f"{J.shape[1]} components of the path. Give samples of the coordinates instead",
            )
    return PathOfDesign(course, ik, u)
