"""Whether a band of frequencies stays clear of modes all along a trajectory.

On a connected trajectory a band is clear if and only if the number k of modes below it is the same
at both of its edges everywhere. At every sample k is counted by Sylvester's law of inertia, so that
a mode nobody asked for counts too. Between samples, where the coordinates and the edges are linear
in time, the room that the modes k and k + 1 leave,

    g(t) = min( 1 − f_k / lower ,  f_{k+1} / ((1 + e) upper) − 1 ),

is followed on points between which no coordinate goes on by more than 5° or 2.5 % of its way, and
which are made denser until half the second difference of g there and beside, twice what a parabola
and as much as a kink can deviate from the chord, is less than the room that is left: that is
checked, not proved. Between samples that are farther apart, other targets are looked at likewise.

Mesh and reduced links raise frequencies, by e at most, relative: mode k is below the band with more
right than its number says, and mode k + 1 has to stay above it without e. Where e has no bound, or
the model has no mode k + 1, which the beams themselves have, nothing is clear.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.requirements.band import ForbiddenBand
from eigassign.assignment.requirements.requirement import Requirement, Solved
from eigassign.errors import MissingMassError
from eigassign.modal.exact.inertia import count_below
from eigassign.modal.model import Model
from eigassign.study.accuracy import judged_poses
from eigassign.study.results import ClearanceRow

Floats = NDArray[np.float64]
# Between two points, which are halved once at least: of a four-bar whose crank turns, mode 2 has a
# dip of 0.24 % that points 15° apart have missed, and rises by 5 % within 10° beside it.
TURN = np.radians(10.0)
SHARE = 0.05  # of the way of a coordinate, which may be a slide
STILL = (
    1e-6  # rad or m: over less no frequency changes; a coordinate may be still but for round-off
)


def check_clear(
    model: Model,
    band: ForbiddenBand,
    below: int,
    q: Floats,
    y: Floats,
    raised: float | None = None,
) -> ClearanceRow:
    """Judge a band along one trajectory, of poses q (n, n_q) at its rows and design y (n_y,).

    ``below`` is k; e is ``raised``, or else what can be proved of it. Raises what the exact solves
    raise.
    """
    motion = _Motion(model, band, below, q, y, raised)
    counted, room = motion.counted(), motion.least_room()
    raised = motion.raised if np.isfinite(motion.raised) else None
    return ClearanceRow(band.label, below, counted and room > 0.0, room, counted, raised)


def mode_above(model: Model, below: int, named: Sequence[int], q: Floats, y: Floats) -> int | None:
    """The mode that has to stay above a band: 0 for none, None for one that the model lacks.

    It lacks one that has no mass, as at the first of the poses q (n, n_q).
    """
    if named:
        return named[below] if below < len(named) else 0
    if below == model.n_dof - model.n_rigid:
        return None
    try:
        model.frequencies(q[:1], y, below + 1)
    except MissingMassError:
        return None
    return below + 1


@dataclass(frozen=True, eq=False)
class _Motion:
    """A band, k, and the poses and the design at which it is looked at."""

    model: Model
    band: ForbiddenBand
    below: int
    q: Floats
    y: Floats
    given: float | None = None  # e

    @cached_property
    def above(self) -> int | None:
        """The mode that has to stay above the band."""
        return mode_above(self.model, self.below, self.band.counted, self.q, self.y)

    @cached_property
    def raised(self) -> float:
        """e: by how much mesh and reduced links raise the mode above the band at most, relative."""
        if self.given is not None:
            return self.given
        if self.above == 0 or (self.model.meshed is None and self.model.reduced is None):
            return 0.0
        if self.above is None:
            return float(np.inf)
        q, modes = judged_poses(self.model, self.q), (self.above,)
        mesh, truncation = (
            float(error(q, self.y, modes).max())
            for error in (self.model.discretisation_error, self.model.truncation_error)
        )
        return (1.0 + mesh) * (1.0 + truncation) - 1.0

    def counted(self) -> bool:
        """k modes below both edges at every sample; of named modes only their order is known."""
        if self.band.counted:
            return True
        edges = np.column_stack([self.band.lower, self.band.upper])
        found = count_below(self.model.pencil, self.model.x(self.q, self.y), edges)
        return bool((found == self.below).all())

    def least_room(self) -> float:
        """The least g over the trajectory, less its possible deviation where not resolved."""
        at = places(self.q)
        g = self.room(at)
        least = float(g.min())
        if least <= 0.0 or len(at) < 2:
            return least
        start, end, g_start, g_end = at[:-1], at[1:], g[:-1], g[1:]
        for _ in range(9):  # halvings: 512 points between two samples
            middle = 0.5 * (start + end)
            g_middle = self.room(middle)
            ends = np.minimum(np.minimum(g_start, g_end), g_middle)
            least = min(least, float(ends.min()))
            bound = ends - _beside(0.5 * np.abs(g_start - 2.0 * g_middle + g_end), start, end)
            open_ = bound <= 0.0
            if least <= 0.0:
                return least
            least = min(least, float(bound[~open_].min(initial=np.inf)))
            if not open_.any():
                return least
            halves = ((start, middle, g_start, g_middle), (middle, end, g_middle, g_end))
            start, end, g_start, g_end = (
                np.concatenate([half[k][open_] for half in halves]) for k in range(4)
            )
        return min(0.0, float(bound.min()))

    def room(self, at: Floats) -> Floats:
        """g (n,) at places ``at`` along the samples: 1.5 is midway between second and third."""
        k, above, q = self.below, self.above, _between(at, self.q)
        lower, upper = (_between(at, e[:, None])[:, 0] for e in (self.band.lower, self.band.upper))
        low = self.band.counted[k - 1] if self.band.counted and k else k
        hz = self.model.frequencies(q, self.y, max(low, above or 0, 1))
        g = np.full(len(at), np.inf)
        if k:
            g = np.minimum(g, 1.0 - hz[:, low - 1] / lower)
        if above:
            g = np.minimum(g, hz[:, above - 1] / (1.0 + self.raised) / upper - 1.0)
        return g if np.isfinite(self.raised) else np.minimum(g, 0.0)


def places(q: Floats) -> Floats:
    """The samples q (n, n_q), and as many more between them as the pose changes by."""
    way = np.clip(SHARE * np.ptp(q, axis=0), STILL, TURN)
    steps = np.abs(np.diff(q, axis=0)) / way
    pieces = np.maximum(np.ceil(steps.max(axis=1, initial=0.0) - 1e-9), 1.0).astype(int)
    starts = np.repeat(np.arange(len(pieces)), pieces)
    within = np.arange(len(starts)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    return np.append(starts + within / np.repeat(pieces, pieces), len(q) - 1.0)


def _between(at: Floats, values: Floats) -> Floats:
    """Values (n, k) of the samples at places along them: 1.5 is midway between second and third."""
    samples = np.arange(len(values))
    return np.reshape([np.interp(at, samples, column) for column in values.T], (-1, len(at))).T


def _beside(change: Floats, start: Floats, end: Floats) -> Floats:
    """The largest of a piece and of the two that it meets, (n,)."""
    order = np.argsort(start)
    change, start, end = change[order], start[order], end[order]
    meet = np.concatenate([[False], start[1:] == end[:-1], [False]])
    before = np.where(meet[:-1], np.concatenate([[0.0], change[:-1]]), 0.0)
    after = np.where(meet[1:], np.concatenate([change[1:], [0.0]]), 0.0)
    found = np.empty_like(change)
    found[order] = np.maximum(change, np.maximum(before, after))
    return found


def error_between(model: Model, asked: Requirement, q: Floats, y: Floats) -> float:
    """The largest error of a target between samples that are far apart, else 0.

    Of poses q (n, n_q) of all samples and a design y (n_y,). Bands are checked for themselves, and
    modes that are followed by their shape are known at samples only.
    """
    worst = 0.0
    if not asked.terms or asked.followed is not None:
        return worst
    for name, own in asked.along:
        part = asked.part(name, own)
        poses = q[part.rows]
        at = places(poses)
        if len(at) == len(poses):
            continue
        edges = _between(at, np.column_stack([part.lower, part.upper]))
        fine = replace(part, rows=slice(0, len(at)), lower=edges[:, 0], upper=edges[:, 1], along=())
        hz = model.frequencies(_between(at, poses), y, max(m for m, _ in part.mode_terms))
        nothing = np.zeros((len(at), 0))
        errors = fine.errors(Solved(hz, nothing, nothing.astype(np.intp)))
        worst = max(worst, float(np.abs(errors).max()))
    return worst


def wanting(found: Sequence[ClearanceRow]) -> float:
    """The largest lack of room that another design may have; 0 where all bands are clear."""
    open_ = (c for c in found if not c.clear and c.raised is not None)
    return max((-c.room for c in open_), default=0.0)
