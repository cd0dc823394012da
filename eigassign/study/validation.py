"""Is the expansion of a case good enough: full Taylor and linearised against exact.

Three places are looked at, and all of them count against ``validation.max_error``, since together
they are what an assignment relies on:

trajectory
    every sample of the trajectory, or of each of several, at the initial design;
box of y at q0
    all designs within their bounds at the expansion point: a grid with its corners for up to three
    parameters, corners and seeded random designs beyond;
box of q and y
    seeded random points (``validation.samples`` of them). In q the box is what the joint angles
    travel along the trajectory. It is spanned in the joints' *relative* angles, on which the
    frequencies depend: the box of the absolute angles would also hold poses far from any that the
    mechanism takes. With ``validation.q_span`` it is instead q0 ± the span in the coordinates of
    the case, whatever poses that gives. In y it is the bounds.

Errors are in frequency (Hz), relative; a point where a polynomial gives λ < 0 counts as infinitely
wrong. Where the full set was too large for the order asked for, only the linearised error counts.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from eigassign.case import CaseFile
from eigassign.errors import CaseError
from eigassign.study.approximation import compare
from eigassign.study.findings import Comparison, ValidationRow
from eigassign.study.plan import joint_map
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]
TRAJECTORY, DESIGN_BOX, RANDOM_BOX = "trajectory", "box of y at q0", "box of q and y"
SEED = 20211204  # any: the same points every time
_GRID = {1: 61, 2: 13, 3: 7}  # points along each axis by the number of parameters
_CORNERS = 256  # at most, of a box with many parameters


@dataclass(frozen=True)
class Validation:
    """The rows of one case, and what else a reader should know."""

    rows: tuple[ValidationRow, ...]
    notes: tuple[str, ...]
    warnings: tuple[str, ...]
    seconds: float

    @property
    def passed(self) -> bool:
        """Whether every row is within the case's tolerance."""
        return all(row.passed for row in self.rows)


def validate_expansions(scene: Scene) -> tuple[ValidationRow, ...]:
    """One row for each place and expanded mode.

    Raises CaseError where there is nothing to look at: no trajectory, no design, no ``q_span``.
    """
    rows = [
        _row(scene, k, where, comparison)
        for where, x in _places(scene)
        for k, comparison in enumerate(compare(scene.model, scene.expansions, x))
    ]
    if not rows:
        message = "nothing to validate: give a trajectory, a design, or validation.q_span"
        raise CaseError((scene.file.problem("validation", message),))
    return tuple(rows)


def _places(scene: Scene) -> Iterator[tuple[str, Floats]]:
    """Where, and the points x (n, n_x) there."""
    model, random = scene.model, np.random.default_rng(SEED)
    if scene.trajectory is not None:
        for part in scene.trajectory.parts:
            where = f"{TRAJECTORY} {part.name!r}" if scene.trajectory.several else TRAJECTORY
            yield where, model.x(part.trajectory.q, scene.initial)
    lower, upper = scene.bounds
    if np.any(upper > lower):
        y = box_points(lower, upper, scene.file.validation.samples, random)
        yield DESIGN_BOX, model.x(scene.q0, y)
    q = random_q(scene, random)
    if q is not None:
        yield RANDOM_BOX, model.x(q, random.uniform(lower, upper, (len(q), len(lower))))


def box_points(lower: Floats, upper: Floats, samples: int, random: np.random.Generator) -> Floats:
    """Points (n, d) of a box that include its corners: a grid, or from four axes on at random."""
    d = len(lower)
    if d in _GRID:
        unit = np.array(list(product(np.linspace(0.0, 1.0, _GRID[d]), repeat=d)))
    else:
        unit = np.vstack([_corners(d, random), random.random((samples, d))])
    return np.asarray((1.0 - unit) * lower + unit * upper)


def _corners(d: int, random: np.random.Generator) -> Floats:
    """All corners of the unit box if they are few, else a random choice of them."""
    if 2**d <= _CORNERS:
        return np.array(list(product((0.0, 1.0), repeat=d)))
    chosen = random.integers(0, 2, (_CORNERS, d)).astype(np.float64)
    chosen[:2] = [[0.0], [1.0]]
    return chosen


def random_q(scene: Scene, random: np.random.Generator) -> Floats | None:
    """Random poses (n, n_q) of the box in q; None if the box is a point or unknown."""
    n, q0 = scene.file.validation.samples, scene.q0
    if scene.file.validation.q_span is not None:
        span = _spans(scene.file, len(q0))
        return q0 + random.uniform(-1.0, 1.0, (n, len(q0))) * span if span.any() else None
    S = joint_map(scene.model)
    if scene.trajectory is None or not len(S):
        return None
    travelled = scene.trajectory.q @ S.T
    s = random.uniform(travelled.min(axis=0), travelled.max(axis=0), (n, len(S)))
    return np.asarray(q0 + (s - S @ q0) @ np.linalg.pinv(S).T)


def _spans(file: CaseFile, n_q: int) -> Floats:
    """Half-widths (n_q,) of the box in q."""
    span = np.atleast_1d(np.array(file.validation.q_span, dtype=np.float64))
    if len(span) not in (1, n_q):
        message = f"{len(span)} values for {n_q} coordinates; give one, or one for each"
        raise CaseError((file.problem("validation.q_span", message),))
    return np.broadcast_to(span, (n_q,))


def _row(scene: Scene, k: int, where: str, values: Comparison) -> ValidationRow:
    expansions, limit = scene.expansions, scene.file.validation.max_error
    counts = expansions.full_order == expansions.order
    counted = [values.worst_linearised, *([values.worst_taylor] if counts else [])]
    return ValidationRow(
        case=scene.file.path.stem,
        mode=expansions.modes[k],
        order=expansions.order,
        where=where,
        points=values.exact_hz.size,
        worst_taylor=values.worst_taylor,
        worst_linearised=values.worst_linearised,
        rms_taylor=_rms(values.taylor_error),
        rms_linearised=_rms(values.linearised_error),
        limit=limit,
        passed=max(counted) <= limit,
    )


def _rms(errors: Floats) -> float:
    rms = float(np.sqrt(np.mean(np.square(errors))))
    return rms if rms == rms else float("inf")
