"""How the coordinates along a path of the tip follow the design: q(y), with its slopes.

The tip's path p(t_k) and the times are the same for every design. With the tip at T(q, y), its
loops closed, every sample k by itself is an implicit function of y through the known q_k(y0):

    T(q_k, y) = p(t_k),    dq_k/dy = −(∂T/∂q)⁻¹ ∂T/∂y

It is continued along the straight line from y0 to y, so that it stays in the branch of the initial
design, and depends on y alone. Where the tip fixes fewer directions than there are coordinates,
those that leave it in place at the initial design are kept as they are there: q_k moves in the
space of rows of ∂T/∂q(q_k(y0), y0) only, with the orthonormal basis V_k,

    q_k = q_k(y0) + V_k ξ_k,    dq_k/dy = −V_k (∂T/∂q V_k)⁻¹ ∂T/∂y ,

which at y0 is the change of least norm, a slide of L counting as 1 rad (see `solver`).

Shapes: n samples, n_q coordinates, n_y design parameters, n_z entries of a state u.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from eigassign.errors import MechanismError, TrajectoryError
from eigassign.mechanism.inverse_kinematics.chain import Bools, Floats, reduced
from eigassign.mechanism.inverse_kinematics.follow import (
    RESIDUAL,
    Followed,
    as_assembled,
    out_of_reach,
    pose,
    require_reached,
)
from eigassign.mechanism.inverse_kinematics.solver import (
    ROUND_OFF,
    TipProblem,
    handedness,
    levenberg,
    lost,
    newton,
    singular,
)
from eigassign.mechanism.inverse_kinematics.tip_path import WAYPOINTS, Course


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

    @cached_property
    def directions(self) -> Floats | None:
        """V (n, n_q, rank), in u; None where the tip fixes all coordinates."""
        ik = self.problem
        if ik.rank == ik.n_q:
            return None
        rows = np.linalg.svd(reduced(ik.evaluate(self.u), ik.n_q).J, full_matrices=False)[2]
        return np.asarray(np.swapaxes(rows[:, : ik.rank], 1, 2))

    def problem_at(self, y: Floats) -> TipProblem:
        """The problem at a design, in the measure of the first one, and in its directions."""
        chain = self.problem.chain.redesigned(y)
        return replace(self.problem, chain=chain, directions=self.directions)

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
        target = self.course.target(self.course.s[[k]])
        tried, miss = levenberg(ik, np.vstack([u[k], ik.seeds]), target, 115)
        best = int(np.argmin(miss))
        if miss[best] > RESIDUAL * ik.lever:
            return out_of_reach(ik, self.course, k, tried[best])
        why = (
            "the links come to stand stretched or folded in line, or the loops at a dead point"
            if ik.rank == ik.n_q
            else "the motion that leaves the tip in place, kept as in the initial design, has to "
            "change"
        )
        message = (
            f"{self.course.label(k)} can be reached, but not by changing the design steadily from "
            f"the initial one: near {pose(ik, u[k])} {why}; take narrower bounds"
        )
        return TrajectoryError(WAYPOINTS, message, k)


def behind(values: Floats, loads: Floats) -> Floats:
    """Loads (n_loads,), or their rates, behind coordinates (n, n_q)."""
    return np.hstack([values, np.broadcast_to(loads, (len(values), len(loads)))])


def _slopes(ik: TipProblem, u: Floats) -> Floats:
    """du/dy (n, n_z, n_y) where the samples are at their points and the loops are closed."""
    n_y = len(ik.chain.y)
    motion = ik.motion(ik.evaluate(u, by_design=True), n_y)
    both = motion.J, motion.following
    (by_q, by_y), (follow_q, follow_y) = (np.split(of, [of.shape[2] - n_y], 2) for of in both)
    change = ik.change(replace(motion, J=by_q, following=follow_q), -by_y)
    change[:, ik.n_q :] += follow_y
    return change


def path_of_design(followed: Followed, course: Course) -> PathOfDesign:
    """How the solution that was followed along the course changes with the design.

    Raises MechanismError for a parameter that moves the tip where no coordinate can bring it back.
    """
    ik, u = followed.problem, followed.u
    n_q, chain = ik.n_q, ik.chain
    J = ik.motion(ik.evaluate(u, by_design=True), len(chain.y)).J
    left = J[:, :, n_q:] + J[:, :, :n_q] @ _slopes(ik, u)[:, :n_q]
    # what moves the tip is in m or rad, and may be 0: it counts as L or 1 at least
    size = np.maximum(np.abs(chain.y), min(ik.lever, 1.0))
    off = np.linalg.norm(left, axis=1).max(axis=0) * size
    for name, length in zip(chain.y_names, off, strict=True):
        # 1e-6 of L, per relative change of the parameter, is round-off
        if length > 1e-6 * ik.lever:
            raise MechanismError(
                f"design.{name}.parameter",
                f"moves the tip where no coordinate can bring it back: they move {ik.rank} of "
                f"{J.shape[1]} components of the path. Give samples of the coordinates instead",
            )
    return PathOfDesign(course, ik, u)
