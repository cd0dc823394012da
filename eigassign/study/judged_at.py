"""Where what is left to ``auto`` is judged: poses of the trajectory at designs all over the box."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.case import CaseFile
from eigassign.mechanism.trajectories import Trajectories

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
ENDS = ((False,), (True,))  # all parameters at their lower bounds, all at their upper ones
SAMPLES = 40  # along the trajectory, at each design that a mesh is judged at
SEED = 20211
CLIMBERS = 8  # poses and designs from which worse designs are looked for
MASKS = (1, 2, 4, 8, 15, 7, 11, 13, 14, 3, 5, 6, 9, 10, 12)  # of the Walsh functions in 4 bits


@dataclass(frozen=True, eq=False)
class JudgedAt:
    """x (n, n_x), and which of the trajectory's samples each row is at."""

    x: Floats
    samples: Ints
    trajectory: Trajectories | None

    def place(self, row: int) -> str:
        """A row in words: the sample, whatever the design."""
        if self.trajectory is None:
            return "the expansion point"
        return self.trajectory.sample(int(self.samples[row]))

    def with_rows(self, other: JudgedAt, rows: Ints) -> JudgedAt:
        """Some rows of another one at the end."""
        x, samples = np.vstack([self.x, other.x[rows]]), other.samples[rows]
        return replace(self, x=x, samples=np.append(self.samples, samples))


def at_corners(
    file: CaseFile,
    trajectory: Trajectories | None,
    q0: Floats,
    y0: Floats,
    at_upper: ArrayLike = ENDS,
    samples: int = SAMPLES,
) -> JudgedAt:
    """At y0 and corners of the box, one for each row of ``at_upper`` (k, n_y or 1).

    At up to so many ``samples`` each.
    """
    lower, upper = _bounds(file)
    outer = np.where(np.asarray(at_upper, dtype=bool), upper, lower)
    designs = np.unique(np.vstack([y0, outer]), axis=0) if len(y0) else np.zeros((1, 0))
    picked = np.zeros(1, dtype=np.intp) if trajectory is None else trajectory.spread(samples)
    rows, which = np.tile(picked, len(designs)), np.repeat(np.arange(len(designs)), len(picked))
    return _judged(trajectory, q0, rows, designs[which])


def at_random(
    file: CaseFile, trajectory: Trajectories | None, q0: Floats, y0: Floats, count: int
) -> JudgedAt:
    """At random samples, half with designs anywhere in the box, half with corners of it."""
    lower, upper = _bounds(file)
    random = np.random.default_rng(SEED)
    share = random.random((count, len(y0)))
    share[count // 2 :] = share[count // 2 :] > 0.5
    rows = random.integers(0, 1 if trajectory is None else len(trajectory.q), count)
    return _judged(trajectory, q0, rows, lower + share * (upper - lower))


def climbed(
    seen: JudgedAt, error: Callable[[Floats], Floats], file: CaseFile
) -> tuple[JudgedAt, Floats]:
    """``seen`` and its errors (n,), with designs like those of the largest errors but worse.

    From these, parameter after parameter goes to the bound at which the error is larger, if it is.
    """
    errors = error(seen.x)
    top = np.argsort(-errors, kind="stable")[:CLIMBERS]
    lower, upper = _bounds(file)
    x, most = seen.x[top], errors[top]
    for j in range(len(lower)):
        column = x.shape[1] - len(lower) + j
        tried = np.repeat(x[None], 2, axis=0)
        tried[0, :, column], tried[1, :, column] = lower[j], upper[j]
        higher = error(tried.reshape(-1, x.shape[1])).reshape(2, -1)
        best = higher.argmax(axis=0)
        better = higher.max(axis=0) > most
        x = np.where(better[:, None], tried[best, np.arange(len(x))], x)
        most = np.maximum(most, higher.max(axis=0))
    new = replace(
        seen, x=np.vstack([seen.x, x]), samples=np.append(seen.samples, seen.samples[top])
    )
    return new, np.append(errors, most)


def _judged(trajectory: Trajectories | None, q0: Floats, rows: Ints, y: Floats) -> JudgedAt:
    q = np.repeat(q0[None], len(rows), axis=0) if trajectory is None else trajectory.q[rows]
    return JudgedAt(np.hstack([q, y]), rows, trajectory)


def _bounds(file: CaseFile) -> tuple[Floats, Floats]:
    parameters = file.design.parameters.values()
    return np.array([p.min for p in parameters]), np.array([p.max for p in parameters])


def corners(n: int) -> NDArray[np.bool_]:
    """Corners of a box in n parameters, (k, n), True at the upper bound: that is where series err.

    All of up to 16; of more the Walsh functions w_j(r) = parity of r & `MASKS`_j, r = 0…15, in
    which any two of 15 parameters take all four combinations, and all at their upper bounds.
    """
    if n <= 4:
        return np.asarray((np.arange(2**n)[:, None] >> np.arange(n)) % 2 == 1)
    shared = np.arange(16)[:, None] & np.array(MASKS)[np.arange(n) % len(MASKS)]
    walsh = np.asarray(np.bitwise_count(shared) % 2 == 1)
    return np.vstack([walsh, np.ones((1, n), dtype=bool)])
