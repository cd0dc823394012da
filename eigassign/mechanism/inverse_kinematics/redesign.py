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

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from eigassign.errors import MechanismError, TrajectoryError
from eigassign.mechanism.inverse_kinematics.chain import Bools, Floats, TipTables, reduced
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
    least_norm,
    levenberg,
    lost,
    newton,
    singular,
    within,
)
from eigassign.mechanism.inverse_kinematics.tip_path import WAYPOINTS, Course


@dataclass(frozen=True, eq=False)
class PathOfDesign:
    """q(y) and dq/dy along one course; immutable, and a function of y alone."""

    course: Course
    problem: TipProblem  # at the initial design y0
    u: Floats  # states (n, n_z) at y0

    @property
    def design(self) -> TipTables:
        """The chain as a function of the design; MechanismError where it is not known."""
        if self.problem.chain.design is None:
            raise MechanismError("design", "this chain is not known as a function of the design")
        return self.problem.chain.design

    def __call__(self, y: Floats) -> tuple[Floats, Floats]:
        """q (n, n_q) in rad or m and dq/dy (n, n_q, n_y) at design y (n_y,), SI.

        Raises TrajectoryError naming the parameters' values and the first sample that is out of
        reach, outside the branch, or in another branch than at the initial design.
        """
        y = np.asarray(y, dtype=np.float64)
        try:
            u = self.u if np.array_equal(y, self.problem.chain.y) else self.states(y)
        except TrajectoryError as error:
            values = dict(zip(self.design.names, y.tolist(), strict=True))
            design = ", ".join(f"{name} = {values[name]:.6g}" for name in self.moving)
            message = f"with {design}: {error.message}"
            raise TrajectoryError(error.path, message, error.sample) from None
        n_q = self.problem.n_q
        q = (u * self.problem.scale)[:, :n_q]
        slopes = self._slopes(y, u)[:, :n_q] * self.problem.scale[:n_q, None]
        for array in (q, slopes):
            array.setflags(write=False)
        return q, slopes

    @cached_property
    def moving(self) -> tuple[str, ...]:
        """The parameters that move the tip, or what its loops consist of."""
        moves = np.abs(self._slopes(self.problem.chain.y, self.u)).max(axis=(0, 1)) > 0.0
        return tuple(name for name, one in zip(self.design.names, moves, strict=True) if one)

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
        """The problem at another design, in the measure of the first one."""
        return replace(self.problem, chain=self.design.chain(y))

    def states(self, y: Floats) -> Floats:
        """States (n, n_z) at design y, by steps from y0 as large as the branch can be told in."""
        y0, target = self.problem.chain.y, self.course.target(self.course.s)
        u, done, step = self.u, 0.0, 1.0
        seen = self.problem.evaluate(u)
        motion = within(reduced(seen, self.problem.n_q), self.directions)
        sense = handedness(self.problem, seen, motion)
        while done < 1.0:
            ahead = min(1.0, done + step)
            ik = self.problem_at(y0 + ahead * (y - y0))
            slopes = self._slopes(y0 + done * (y - y0), u)
            guess = u + (ahead - done) * (slopes @ (y - y0))
            found = newton(ik, guess, target, ROUND_OFF, self.directions)
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

    def _slopes(self, y: Floats, u: Floats) -> Floats:
        """du/dy (n, n_z, n_y) where the samples are at their points and the loops are closed."""
        ik, n_q, n_y = self.problem, self.problem.n_q, len(y)
        motion = reduced(ik.evaluate_with_design(u, self.design, y), n_q + n_y)
        by_q, by_y = np.split(motion.J, [n_q], axis=2)
        J = by_q if self.directions is None else by_q @ self.directions
        change = np.stack([least_norm(J, -by_y[:, :, j], ik.rank) for j in range(n_y)], axis=2)
        if self.directions is not None:
            change = self.directions @ change
        follow_q, follow_y = np.split(motion.following, [n_q], axis=2)
        return np.concatenate([change, follow_q @ change + follow_y], axis=1)


def path_of_design(followed: Followed, course: Course) -> PathOfDesign:
    """How the solution that was followed along the course changes with the design.

    Raises MechanismError for a parameter that moves the tip away from all that it can reach.
    """
    path = PathOfDesign(course, followed.problem, followed.u)
    _require_within_reach(path)
    return path


def _require_within_reach(path: PathOfDesign) -> None:
    """Refuse parameters whose effect on the tip no coordinate can undo, by their names."""
    ik, design = path.problem, path.design
    n_q, n_y = ik.n_q, len(ik.chain.y)
    moved = reduced(ik.evaluate_with_design(path.u, design, ik.chain.y), n_q + n_y).J
    left = moved[:, :, n_q:] + moved[:, :, :n_q] @ path._slopes(ik.chain.y, path.u)[:, :n_q]
    # what moves the tip is in m or rad, and may be 0: it counts as L or 1 at least
    size = np.maximum(np.abs(ik.chain.y), min(ik.lever, 1.0))
    off = np.linalg.norm(left, axis=1).max(axis=0) * size
    for name, length in zip(design.names, off, strict=True):
        # 1e-6 of L, per relative change of the parameter, is round-off
        if length > 1e-6 * ik.lever:
            raise MechanismError(
                f"design.{name}.parameter",
                f"moves the tip where no coordinate can bring it back: they move {ik.rank} of "
                f"{moved.shape[1]} components of the path. Give samples of the coordinates instead",
            )
