"""The residual vibration of a move is within limits, for any motion time of the same path.

A limit is w(y) ≤ at_most, w the largest way of a node after the stop (`modal.residual_vibration`),
by the worst choice of ends of the damping. Slopes are differences: w has kinks where its largest
instant changes, and lobes over the motion time, which a scan of that has to find first.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from eigassign.arrays import Floats
from eigassign.assignment.requirements.quantity import LimitedQuantity, limit_between
from eigassign.case.case_file import CaseFile
from eigassign.case.schema.targets import ResidualTarget
from eigassign.case.units import SI, handy
from eigassign.mechanism.trajectory.trajectory import NamedTrajectory, Trajectories
from eigassign.modal.model import Model
from eigassign.modal.residual_vibration import SIZES, Move, ReducedMove, Sizes, move
from eigassign.modal.response import dampings

STEP = 1e-5  # of the range of a parameter: differences err by 1e-5 of the residual or so
MARGIN = 1e-3  # of a limit, by which it is kept where steps and basis are those of a search
KEPT = 64  # designs whose moves are remembered


@dataclass(frozen=True, eq=False)
class Residual:
    """The largest way w (m) of a node after a move, of designs (n_y,)."""

    target: ResidualTarget
    part: NamedTrajectory
    moves: tuple[Move, ...]  # of each choice of damping
    steps: Floats  # (n_y,) of differences; 0 where slopes are not wanted

    @property
    def column(self) -> int | None:
        """Which entry of y is the duration."""
        stretch = self.part.trajectory.stretch
        return None if stretch is None else stretch[0]

    def duration(self, y: Floats) -> float:
        """The motion time of a design, s."""
        given = float(np.ptp(self.part.trajectory.time_s))
        return given if self.column is None else float(y[self.column])

    @cached_property
    def _solved(self) -> object:
        def solved(design: bytes, sizes: Sizes) -> tuple[ReducedMove, ...]:
            return tuple(each.at(np.frombuffer(design), sizes) for each in self.moves)

        return lru_cache(maxsize=KEPT)(solved)

    def solved(self, y: Floats, sizes: Sizes = SIZES) -> tuple[ReducedMove, ...]:
        """The moves of a design, for each damping and any duration."""
        own = np.array(y, dtype=np.float64)
        if self.column is not None:
            own[self.column] = np.ptp(self.part.trajectory.time_s)
        found: tuple[ReducedMove, ...] = self._solved(own.tobytes(), sizes)  # type: ignore[operator]
        return found

    def along(self, y: Floats, durations: Floats, sizes: Sizes = SIZES) -> Floats:
        """w (n_T,) of a design for other durations (n_T,) in s."""
        last = self.target.residual.last
        each = [own.residuals(durations, last)[:, 0] for own in self.solved(y, sizes)]
        return np.asarray(np.max(each, axis=0))

    def amplitudes(self, y: Floats) -> Floats:
        """What w is made of, and zero with it: Re and Im of each mode at the node, (n,) in m."""
        found = []
        for own in self.solved(y):
            Z, _, tip = own.free(np.array([self.duration(y)]))
            each = np.zeros((len(tip), SIZES.modes), dtype=np.complex128)
            each[:, : tip.shape[1]] = Z * tip
            found += [each.real.ravel(), each.imag.ravel()]
        return np.concatenate(found)

    def __call__(self, y: Floats) -> tuple[float, Floats]:
        """w of a design, and its slopes (n_y,) by differences."""
        own, slopes = np.array([self.duration(y)]), np.zeros(len(y))
        value = float(self.along(y, own)[0])
        for k in np.flatnonzero(self.steps):
            near = y + np.eye(len(y))[k] * self.steps[k]
            moved = float(self.along(near, np.array([self.duration(near)]))[0])
            slopes[k] = (moved - value) / self.steps[k]
        return value, slopes


def residual_limits(file: CaseFile, model: Model, path: Trajectories) -> Iterator[LimitedQuantity]:
    """The limits of residual vibration, of each trajectory that they are asked of.

    Raises MechanismError where a coordinate is free, or a part has no inertia of its own.
    """
    columns = file.design.parameters.values()
    sizes = np.array([(c.max - c.min) or abs(c.min) * file.assignment.robust for c in columns])
    for k, target in enumerate(file.targets):
        if not isinstance(target, ResidualTarget):
            continue
        place = target.residual
        axes = np.eye(2 if file.mechanism.space == "planar" else 3).tolist()
        along = axes if isinstance(place.direction, str) else [list(place.direction)]
        for part in path.whole.parts:
            if target.trajectory not in (None, part.name):
                continue
            moves = (move(model, part.trajectory, {place.at: along}, d) for d in dampings(model))
            where = f" along {part.name!r}" if path.several else ""
            noun, unit = f"residual vibration of {place.name}{where}", SI("m", target.at_most)
            limit = limit_between(
                *(None, target.at_most, Residual(target, part, tuple(moves), STEP * sizes)),
                f"{noun} at most {handy(target.at_most, unit, 4)}",
                f"targets[{k}]",
                noun=noun,
                unit=unit,
                extreme=("the least found is", "the most found is"),
                is_affine=False,
                is_decided=False,
                is_residual=True,
                trajectory=target.trajectory,
            )
            yield replace(limit, upper=(1.0 - MARGIN) * limit.upper)
