"""Whether a band of frequencies stays clear of modes all along a trajectory.

On a connected trajectory a band is clear if and only if the number k of modes below it is the same
at both of its edges everywhere. At every sample k is counted by Sylvester's law of inertia, so that
a mode nobody asked for counts too. Between samples, where the motion is known and the edges are
linear in time, the room that the modes k and k + 1 leave,

    g(t) = min( 1 − f_k / lower ,  f_{k+1} / ((1 + e) upper) − 1 ),

is followed on points between which no coordinate goes on by more than 10° or 5 % of its way. They
are halved at least once, until half the second difference of g there and beside, twice what a
parabola and as much as a kink can deviate from the chord, is less than the room that is left: that
is checked, not proved. Other targets, and what drives exert, are looked at there likewise.

Mesh and reduced links raise frequencies, by e at most, relative: mode k is below the band with more
right than its number says, and mode k + 1 has to stay above it without e. Where e has no bound, or
the model has no mode k + 1, which the beams themselves have, nothing is clear.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from eigassign.arrays import Floats
from eigassign.assignment.requirements.kinds import ForbiddenBand, Margin
from eigassign.assignment.requirements.quantity import RIGID, DriveLimit, StaticLimit
from eigassign.assignment.requirements.requirement import Requirement, Solved
from eigassign.errors import LostModeError, MissingMassError, TrajectoryError
from eigassign.mechanism.trajectory.trajectory import Trajectories, Trajectory
from eigassign.modal.exact.inertia import count_below
from eigassign.modal.model import Model
from eigassign.study.checks import judged_poses
from eigassign.study.design.followed import Named, Rest, follow_all, unfollowed
from eigassign.study.results import ClearanceRow

# Between two points, which are halved once at least: of a four-bar whose crank turns, mode 2 has a
# dip of 0.24 % that points 15° apart have missed, and rises by 5 % within 10° beside it.
TURN = np.radians(10.0)
SHARE = 0.05  # of the way of a coordinate, which may be a slide
LIMIT = 1e-4  # of a limit, by which it may be missed between samples
FINE = 1e-6  # of an edge, or Hz: a room that is told no nearer
WITHIN = 1e-4  # of a least frequency or room that is stated: what four digits show
# rad or m: over less no frequency changes; a coordinate may be still but for round-off
STILL = 1e-6


def check_band(
    model: Model,
    path: Trajectories,
    band: ForbiddenBand,
    below: int,
    y: Floats,
    own: Sequence[Named] = (),
    raised: float | None = None,
    within: float | None = None,
) -> ClearanceRow:
    """Judge a band along one trajectory at the design y, k = ``below``.

    e is ``raised``, or else what can be proved of it. Of one that is clear the room is as
    `least_along` has it. A band of a followed mode is not clear where the shape of its mode is lost
    between samples. Raises what the exact solves raise.
    """
    q = path.at(y)[0][band.rows]
    above = mode_above(model, below, band.counted, q, y)
    try:
        e = _raised(model, path, own, band, above, q, y) if raised is None else raised
        sides = list(band.kept_clear(below, above, Margin(0.0, e if np.isfinite(e) else 0.0)))
        room = np.inf
        if sides:
            solved = _solved(model, path, sides, y, own)
            room = least_along(partial(_room, sides, solved), q, within).room
    except (LostModeError, TrajectoryError):
        return ClearanceRow(band.label, below, False, 0.0, False, None)
    edges = np.column_stack([band.lower, band.upper])
    found = () if band.counted else count_below(model.pencil, model.x(q, y), edges)
    counted = bool(np.equal(found, below).all())  # of named modes only their order is known
    if not np.isfinite(e):
        return ClearanceRow(band.label, below, False, min(room, 0.0), counted, None)
    return ClearanceRow(band.label, below, counted and room > 0.0, room, counted, e)


def _raised(
    model: Model,
    path: Trajectories,
    own: Sequence[Named],
    band: ForbiddenBand,
    above: int | None,
    q: Floats,
    y: Floats,
) -> float:
    """e: by how much mesh and reduced links raise the mode above the band at most, relative."""
    if above == 0 or not (model.is_meshed or model.is_reduced or model.solids):
        return 0.0
    if above is None:
        return float(np.inf)
    modes: tuple[int, ...] = (above,)
    if above < 0 and isinstance(rest := own[above], Rest):
        model, modes = rest.of.held, tuple(set(rest.numbers(q, y).tolist()))
    elif above < 0:
        solved = _solved(model, path, [band], y, own)(np.arange(len(q), dtype=np.float64))
        modes = tuple(set(solved.numbers[:, above].tolist()))
    poses = judged_poses(model, q)
    both = model.discretisation_error(poses, y, modes), model.truncation_error(poses, y, modes)
    mesh, truncation = (float(error.max()) for error in both)
    return (1.0 + mesh) * (1.0 + truncation) - 1.0


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


# --- Room, at places along the rows of one trajectory: 1.5 is midway between second and third

Room = Callable[[Floats], Floats]


def _room(parts: Sequence[Requirement], solved: Callable[[Floats], Solved], at: Floats) -> Floats:
    """The least room (n,) that parts of targets on the same rows leave."""
    found, least = solved(at), np.full(len(at), np.inf)
    for part in parts:
        edges = _between(at, np.column_stack([part.lower, part.upper]))
        fine = replace(part, lower=edges[:, 0], upper=edges[:, 1], along=())
        fine = replace(fine, rows=slice(0, len(at)))
        curve = fine.curve(found)
        beyond = [rows.scale * (curve - rows.edge) for rows in fine.edge_rows()]
        least = np.minimum(least, -np.max(np.abs(beyond) if fine.is_goal else beyond, axis=0))
    return least


def _solved(
    model: Model,
    path: Trajectories,
    parts: Sequence[Requirement],
    y: Floats,
    own: Sequence[Named] = (),
) -> Callable[[Floats], Solved]:
    """The modes that parts are on, solved at places along their rows; ``own`` are followed."""
    rows, top, named = parts[0].rows, max(one.top for one in parts), parts[0].followed
    poses, name = path.between(rows, y), path.name_of(rows.start)
    if not named:
        return lambda at: unfollowed(model.frequencies(poses(at), y, top))

    def with_followed(at: Floats) -> Solved:
        time_s = _between(at, path.time_s[rows, None])[:, 0]
        fine = path.with_instants([time_s if one.name == name else () for one in path.parts])
        fine = fine.chosen(np.arange(len(fine.q))[fine.rows_of(name)])
        k = np.searchsorted(fine.time_s, time_s)
        needed = np.isin(np.arange(len(fine.q)), k)
        shapes = [replace(one, path=fine, needed=needed & (one.mode in named)) for one in own]
        found = follow_all(model, fine, shapes, y, top).solved
        return Solved(found.hz[k], found.followed[k], found.numbers[k])

    return with_followed


def _drive_room(
    model: Model, asked: DriveLimit, trajectory: Trajectory, y: Floats, at: Floats
) -> Floats:
    """1 − |τ|/max (n,) of one drive."""
    times = trajectory.time_s
    time_s = np.interp(at, np.arange(len(times)), times)
    tau = model.drives.exerted(trajectory, time_s, y)
    return np.asarray(1.0 - np.abs(tau[:, asked.column]) / asked.allowed[1])


def _static_room(asked: StaticLimit, poses: Room, y: Floats, at: Floats) -> Floats:
    """The room (n,) to a stiffness, a compliance or a sag."""
    w, most = asked.way.at(poses(at), y), asked.upper[0]
    if asked.way.target.limit == "at_least":  # of the stiffness, not of its inverse
        return np.asarray(most / np.maximum(w, RIGID) - 1.0)
    return np.asarray(1.0 - w / most)


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
        firsts, seconds = (start, middle, g_start, g_middle), (middle, end, g_middle, g_end)
        halves = np.stack([firsts, seconds], axis=2)[:, open_]
        start, end, g_start, g_end = halves.reshape(4, -1)
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
    """The largest (n,) of each piece and of the two that it meets, in the order of the pieces."""
    meet, found = start[1:] == end[:-1], change.copy()
    found[1:] = np.maximum(found[1:], np.where(meet, change[:-1], 0.0))
    found[:-1] = np.maximum(found[:-1], np.where(meet, change[1:], 0.0))
    return found


def lowest_room(
    model: Model,
    asked: Requirement,
    path: Trajectories,
    y: Floats,
    own: Sequence[Named] = (),
) -> Lowest:
    """The least room that a target leaves along its trajectories, relative, and the place of it.

    At a design y (n_y,), within `WITHIN`; −∞ where that cannot follow the path. That of a wanted
    frequency is its error, negative; that of what shall be highest is its frequency in Hz. Bands
    are checked for themselves. Modes that are followed by their shape are known at samples only,
    unless their followers are given; raises LostModeError where a shape is lost between samples.
    """
    if not asked.terms or (asked.followed and not own):
        return Lowest(0.0, 0.0)
    q, found = path.at(y)[0], []
    each: list[tuple[slice, Room]] = []
    if isinstance(asked, DriveLimit):
        for one, rows in zip(path.parts, path.rows, strict=True):
            each.append((rows, partial(_drive_room, model, asked, one.trajectory, y)))
    for name, rows in asked.along:
        part = asked.part(name, rows)
        room: Room = partial(_room, [part], _solved(model, path, [part], y, own))
        if isinstance(part, StaticLimit):
            room = partial(_static_room, part, path.between(part.rows, y), y)
        each.append((part.rows, room))
    for rows, room in each:
        try:
            low = least_along(room, q[rows], WITHIN)
        except TrajectoryError as lost:
            low = Lowest(-np.inf, lost.place or 0.0)
        found.append(Lowest(low.room, rows.start + low.at))
    return min(found)


def finer_path(
    path: Trajectories, model: Model, asked: Iterable[Requirement], designs: Sequence[Floats]
) -> Trajectories:
    """The trajectories with instants where designs (n_y,) have less room than at samples."""
    times: dict[str, list[float]] = {part.name: [] for part in path.parts}
    for one, y in itertools.product(asked, designs):
        low = lowest_room(model, one, path, y)
        room = low.room
        if one.is_aim:  # what it has at samples is what counts
            here = np.arange(len(one.lower), dtype=np.float64)
            own = _room([one], _solved(model, path, [one], y), here)
            room = low.room / float(own.min()) - 1.0
        if room < -LIMIT:
            k = int(low.at)
            name, last = path.name_of(k), min(k + 1, len(path.q) - 1)
            time_s = float(np.interp(low.at, [k, last], path.time_s[[k, last]]))
            times[name].append(time_s)
    return path.with_instants([*times.values()])


def wanting(found: Sequence[ClearanceRow]) -> float:
    """The largest lack of room that another design may have; 0 where all bands are clear."""
    open_ = (c for c in found if not c.clear and c.raised is not None)
    return max((-c.room for c in open_), default=0.0)
