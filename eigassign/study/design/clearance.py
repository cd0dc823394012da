"""Whether a band of frequencies stays clear of modes all along a trajectory.

On a connected trajectory a band is clear if and only if the number k of modes below it is the same
at both of its edges everywhere. At every sample k is counted by Sylvester's law of inertia, so that
a mode nobody asked for counts too. Between samples, where the motion is known and the edges are
linear in time, the room that the modes k and k + 1 leave,

    g(t) = min( 1 − f_k / lower ,  f_{k+1} / ((1 + e) upper) − 1 ),

is followed on points between which no coordinate goes on by more than 5° or 2.5 % of its way, and
which are made denser until half the second difference of g there and beside, twice what a parabola
and as much as a kink can deviate from the chord, is less than the room that is left: that is
checked, not proved. Other targets, and what drives exert, are looked at there likewise.

Mesh and reduced links raise frequencies, by e at most, relative: mode k is below the band with more
right than its number says, and mode k + 1 has to stay above it without e. Where e has no bound, or
the model has no mode k + 1, which the beams themselves have, nothing is clear.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.requirements.kinds import ForbiddenBand
from eigassign.assignment.requirements.quantity import DriveLimit
from eigassign.assignment.requirements.requirement import Requirement, Solved
from eigassign.assignment.requirements.static_limit import RIGID, StaticLimit
from eigassign.errors import LostModeError, MissingMassError, TrajectoryError
from eigassign.mechanism.trajectory.trajectory import Trajectories, Trajectory
from eigassign.modal.exact.inertia import count_below
from eigassign.modal.model import Model
from eigassign.study.checks.accuracy import judged_poses
from eigassign.study.design.followed import Follower, follow_all, followers
from eigassign.study.results import ClearanceRow
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
# Between two points, which are halved once at least: of a four-bar whose crank turns, mode 2 has a
# dip of 0.24 % that points 15° apart have missed, and rises by 5 % within 10° beside it.
TURN = np.radians(10.0)
SHARE = 0.05  # of the way of a coordinate, which may be a slide
LIMIT = 1e-4  # of a limit, by which it may be missed between samples
FINE = 1e-6  # of an edge, or Hz: a room that is told no nearer
WITHIN = 1e-4  # of a least frequency or room that is stated: what four digits show
STILL = (
    1e-6  # rad or m: over less no frequency changes; a coordinate may be still but for round-off
)


def check_band(
    scene: Scene,
    own: Sequence[Follower],
    band: ForbiddenBand,
    below: int,
    y: Floats,
    raised: float | None = None,
) -> ClearanceRow:
    """Judge a band along the trajectories of a scene at the design y, k = ``below``.

    e is ``raised``, or else what can be proved of it. A band of a followed mode is not clear where
    the shape of its mode is lost between samples. Raises what the exact solves raise.
    """
    q, poses = scene.path.at(y)[0][band.rows], scene.path.between(band.rows, y)
    shapes = (_Shape(band, scene.path, one, y) for one in own if one.mode in band.followed)
    try:
        shape = next(shapes, None)
        return BandMotion(scene.model, band, below, q, y, raised, shape, poses).judged()
    except (LostModeError, TrajectoryError):
        return ClearanceRow(band.label, below, False, 0.0, False, None)


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
class _Shape:
    """The mode of a band that is followed by its shape, at a design."""

    band: ForbiddenBand
    path: Trajectories
    follower: Follower
    y: Floats

    def at(self, places: Floats) -> tuple[Floats, Ints]:
        """Its frequency (n,) and number at places along the samples of the band."""
        path, at = _refined(self.path, self.band.rows, places)
        needed = np.isin(np.arange(len(path.q)), at)
        follower = replace(self.follower, path=path, needed=needed)
        found = follow_all(follower.model, path, [follower], self.y, 1)
        return found.solved.followed[at, 0], found.numbers[at, 0]


def _refined(path: Trajectories, rows: slice, at: Floats) -> tuple[Trajectories, Ints]:
    """One trajectory with instants at places along some of its rows, and their numbers (n,)."""
    name = path.name_of(rows.start)
    time_s = _between(at, path.time_s[rows, None])[:, 0]
    fine = path.with_instants([time_s if one.name == name else () for one in path.parts])
    own = fine.rows_of(name)
    fine = fine.chosen(np.arange(own.start, own.stop))
    return fine, np.searchsorted(fine.time_s, time_s)


@dataclass(frozen=True, eq=False)
class BandMotion:
    """A band, k, and the poses and the design at which it is looked at."""

    model: Model
    band: ForbiddenBand
    below: int
    q: Floats
    y: Floats
    given: float | None = None  # e
    shape: _Shape | None = None
    poses: Callable[[Floats], Floats] | None = None  # of places; None where q is linear between

    def judged(self) -> ClearanceRow:
        """What is found of it."""
        counted, room = self.counted(), least_along(self.room, self.q).room
        raised = self.raised if np.isfinite(self.raised) else None
        clear = counted and room > 0.0
        return ClearanceRow(self.band.label, self.below, clear, room, counted, raised)

    @cached_property
    def above(self) -> int | None:
        """The mode that has to stay above the band."""
        return mode_above(self.model, self.below, self.band.counted, self.q, self.y)

    @cached_property
    def raised(self) -> float:
        """e: by how much mesh and reduced links raise the mode above the band at most, relative."""
        if self.given is not None:
            return self.given
        if self.above == 0 or self.model.is_exact:
            return 0.0
        if self.above is None:
            return float(np.inf)
        q, modes = judged_poses(self.model, self.q), (self.above,)
        if self.shape is not None:
            modes = tuple(set(self.shape.at(np.arange(len(self.q), dtype=np.float64))[1].tolist()))
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

    def room(self, at: Floats) -> Floats:
        """g (n,) at places ``at`` along the samples: 1.5 is midway between second and third."""
        k, above = self.below, self.above
        q = _between(at, self.q) if self.poses is None else self.poses(at)
        lower, upper = (_between(at, e[:, None])[:, 0] for e in (self.band.lower, self.band.upper))
        if self.shape is None:
            low = self.band.counted[k - 1] if self.band.counted and k else k
            hz = self.model.frequencies(q, self.y, max(low, above or 0, 1))
        else:
            low, above, hz = 1, above and 1, self.shape.at(at)[0][:, None]
        g = np.full(len(at), np.inf)
        if k:
            g = np.minimum(g, 1.0 - hz[:, low - 1] / lower)
        if above:
            g = np.minimum(g, hz[:, above - 1] / (1.0 + self.raised) / upper - 1.0)
        return g if np.isfinite(self.raised) else np.minimum(g, 0.0)


class Lowest(NamedTuple):
    """The least of a curve along samples, and the place where it was found."""

    room: float
    at: float  # 1.5 is midway between second and third


def least_along(
    curve: Callable[[Floats], Floats], q: Floats, within: float | None = None
) -> Lowest:
    """The least of a curve over the samples q (n, n_q), less its possible deviation between them.

    As far as it takes to tell whether it is above 0; or ``within`` a share of itself, or `FINE`.
    ``curve`` is of places along the samples, as `places` returns them.
    """
    at = places(q)
    g = curve(at)
    least = Lowest(float(g.min()), float(at[g.argmin()]))
    low = least.room
    if (within is None and low <= 0.0) or len(at) < 2:
        return least
    start, end, g_start, g_end = at[:-1], at[1:], g[:-1], g[1:]
    for _ in range(9):  # halvings: 512 points between two samples
        middle = 0.5 * (start + end)
        g_middle = curve(middle)
        least = min(least, Lowest(float(g_middle.min()), float(middle[g_middle.argmin()])))
        if within is None and least.room <= 0.0:
            return least
        ends = np.minimum(np.minimum(g_start, g_end), g_middle)
        bound = ends - _beside(0.5 * np.abs(g_start - 2.0 * g_middle + g_end), start, end)
        deep = 0.0 if within is None else least.room - max(within * abs(least.room), FINE)
        open_ = bound <= deep
        low = min(low, least.room, float(bound[~open_].min(initial=np.inf)))
        if not open_.any():
            return Lowest(low, least.at)
        halves = ((start, middle, g_start, g_middle), (middle, end, g_middle, g_end))
        start, end, g_start, g_end = (
            np.concatenate([half[k][open_] for half in halves]) for k in range(4)
        )
    return Lowest(min(low if within is not None else 0.0, float(bound.min())), least.at)


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


def lowest_room(model: Model, asked: Requirement, path: Trajectories, y: Floats) -> Lowest:
    """The least room that a target leaves along its trajectories, relative, and the place of it.

    At a design y (n_y,), within `WITHIN`; −∞ where that cannot follow the path. That of a wanted
    frequency is its error, negative; that of what shall be highest is its frequency in Hz. Bands
    are checked for themselves, modes that are followed by their shape are known at samples only.
    """
    if not asked.terms or asked.followed:
        return Lowest(0.0, 0.0)
    q, found = path.at(y)[0], []
    if isinstance(asked, DriveLimit):
        for one, rows in zip(path.parts, path.rows, strict=True):
            low = least_along(_DriveRoom(model, asked, one.trajectory, y), q[rows], WITHIN)
            found.append(Lowest(low.room, rows.start + low.at))
        return min(found)
    for name, own in asked.along:
        part = asked.part(name, own)
        room = _Room(model, part, path.between(part.rows, y), y)
        try:
            low = least_along(room, q[part.rows], WITHIN)
        except TrajectoryError as lost:
            low = Lowest(-np.inf, lost.place or 0.0)
        found.append(Lowest(low.room, part.rows.start + low.at))
    return min(found)


@dataclass(frozen=True, eq=False)
class _DriveRoom:
    """1 − |τ|/max (n,) of one drive at places along the samples of a trajectory."""

    model: Model
    asked: DriveLimit
    trajectory: Trajectory
    y: Floats

    def __call__(self, at: Floats) -> Floats:
        times = self.trajectory.time_s
        time_s = np.interp(at, np.arange(len(times)), times)
        tau = self.model.drives.exerted(self.trajectory, time_s, self.y)
        return np.asarray(1.0 - np.abs(tau[:, self.asked.load.column]) / self.asked.allowed[1])


@dataclass(frozen=True, eq=False)
class _Room:
    """The room (n,) of one part of a target at places along its samples."""

    model: Model
    asked: Requirement
    poses: Callable[[Floats], Floats]
    y: Floats

    def __call__(self, at: Floats) -> Floats:
        edges = _between(at, np.column_stack([self.asked.lower, self.asked.upper]))
        fine = replace(self.asked, lower=edges[:, 0], upper=edges[:, 1], along=())
        fine, q = replace(fine, rows=slice(0, len(at))), self.poses(at)
        if isinstance(fine, StaticLimit):
            curve = fine.way.at(q, self.y)
            if fine.way.target.limit == "at_least":  # of the stiffness, not of its inverse
                return np.asarray(fine.upper / np.maximum(curve, RIGID) - 1.0)
        else:
            hz, nothing = self.model.frequencies(q, self.y, fine.top), np.zeros((len(at), 0))
            curve = fine.curve(Solved(hz, nothing, nothing.astype(np.intp)))
        beyond = [rows.scale * (curve - rows.edge) for rows in fine.edge_rows()]
        return np.asarray(-np.max(np.abs(beyond) if fine.is_goal else beyond, axis=0))


def least_room(
    model: Model, band: ForbiddenBand, row: ClearanceRow, path: Trajectories, y: Floats
) -> float:
    """The room of a band that was found to be clear, within `WITHIN` of itself."""
    if not row.clear:
        return row.room
    q, poses = path.at(y)[0][band.rows], path.between(band.rows, y)
    motion = BandMotion(model, band, row.below, q, y, row.raised, None, poses)
    return least_along(motion.room, q, WITHIN).room


def finer_path(
    path: Trajectories, model: Model, asked: Iterable[Requirement], designs: Sequence[Floats]
) -> Trajectories:
    """The trajectories with instants where designs (n_y,) have less room than at samples.

    By more than `LIMIT`, and none for what keeps its limit all along.
    """
    times: list[list[float]] = [[] for _ in path.parts]
    for one, y in itertools.product(asked, designs):
        low = lowest_room(model, one, path, y)
        room = low.room
        if one.is_aim:  # what it has at samples is what counts
            here = np.arange(len(one.lower), dtype=np.float64)
            own = _Room(model, one, path.between(one.rows, y), y)(here)
            room = low.room / float(own.min()) - 1.0
        if room < -LIMIT:
            k = int(low.at)
            name, last = path.name_of(k), min(k + 1, len(path.q) - 1)
            time_s = float(np.interp(low.at, [k, last], path.time_s[[k, last]]))
            next(t for t, part in zip(times, path.parts, strict=True) if part.name == name).append(
                time_s
            )
    return path.with_instants(times)


def followed_between(scene: Scene, asked: Requirement, y: Floats) -> float:
    """The largest error of a target on followed modes between samples that are far apart, else 0.

    Raises LostModeError where a shape is lost between samples.
    """
    q, worst = scene.path.at(y)[0], 0.0
    for name, rows in asked.along if asked.terms and asked.followed else ():
        part = asked.part(name, rows)
        at = places(q[part.rows])
        if len(at) == len(part.hz):
            continue
        path, k = _refined(scene.path, part.rows, at)
        needed = np.isin(np.arange(len(path.q)), k)
        shapes = [
            replace(one, path=path, needed=needed & one.needed.any())
            for one in followers(scene, [asked])
        ]
        found = follow_all(scene.model, path, shapes, y, part.mode).solved
        edges = _between(at, np.column_stack([part.lower, part.upper]))
        fine = replace(part, lower=edges[:, 0], upper=edges[:, 1], along=(), rows=slice(0, len(at)))
        errors = fine.errors(Solved(found.hz[k], found.followed[k], found.numbers[k]))
        worst = max(worst, float(np.abs(errors).max()))
    return worst


def wanting(found: Sequence[ClearanceRow]) -> float:
    """The largest lack of room that another design may have; 0 where all bands are clear."""
    open_ = (c for c in found if not c.clear and c.raised is not None)
    return max((-c.room for c in open_), default=0.0)
