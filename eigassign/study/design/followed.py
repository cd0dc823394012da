"""Modes that targets follow by their shape, and antiresonances, at samples and any design.

From the pose that names a mode, the design of the file changes first, in a straight line and at
that pose. Then the shape goes from sample to sample: from the pose's time to both ends of its own
trajectory, of others from their samples nearest to the pose. The way depends on nothing but the
design, so that frequencies and slopes do not either; where modes only cross, the way is all the
same. How a shape is carried, and when it is lost, is for `modal.exact.tracking` to say.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TypeAlias

import numpy as np

from eigassign.arrays import Bools, Floats, Ints
from eigassign.assignment.program import frozen
from eigassign.assignment.requirements.requirement import Requirement, Solved
from eigassign.assignment.requirements.sampling import followed_modes
from eigassign.case.case_file import CaseFile
from eigassign.case.schema.targets import Antiresonance, FollowedMode
from eigassign.case.units import shown_point
from eigassign.errors import LostModeError
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.mechanism.kinematics.parameters import initial_design, written_loads
from eigassign.mechanism.trajectory.trajectory import Trajectories
from eigassign.modal.antiresonances import Antiresonances
from eigassign.modal.exact.dense import Modes
from eigassign.modal.exact.solver import mode_slopes
from eigassign.modal.exact.tracking import (
    EXTRA,
    FollowedShape,
    ModesAtPoint,
    MoreModesError,
    follow,
    places,
)
from eigassign.modal.model import Model
from eigassign.study.scene import Scene

# Samples in the order in which a shape is carried to them, and the sample that it comes from; None:
# from the pose that names the mode
Route = tuple[tuple[int, ...], int | None]


@dataclass(frozen=True, eq=False)
class Follower:
    """One followed mode: where it is named, and at which samples of the path it is needed."""

    mode: FollowedMode
    model: Model
    path: Trajectories
    named_y: Floats
    pose: Callable[[Floats], Floats]  # of a design: q where the mode is named
    needed: Bools  # (n_t,)

    def along(self, y: Floats, samples: Sequence[ModesAtPoint]) -> dict[int, FollowedShape]:
        """The shape at design y and the samples needed, by their numbers.

        ``samples`` are the modes there. Raises LostModeError, saying where; MoreModesError where
        the samples hold too few modes.
        """
        if not self.needed.any():
            return {}
        found: dict[int | None, FollowedShape] = {None: self._at_pose(y)}
        for route, origin in self.routes:
            try:
                shapes = follow(self.model.pencil, found[origin], [samples[k] for k in route])
            except LostModeError as lost:
                at = self.path.where(route[lost.step])
                raise self._lost(lost, f"on the way to {at}", y) from None
            found |= dict(zip(route, shapes, strict=True))
        needed = {int(k): found[int(k)] for k in np.flatnonzero(self.needed)}
        for k, shape in needed.items():
            if shape.is_shared:
                raise self._lost(LostModeError(shape.candidates, k), f"at {self.path.where(k)}", y)
        return needed

    @cached_property
    def start(self) -> FollowedShape:
        """The mode where it is named."""
        like, x = self.mode.like, self.model.x(self.pose(self.named_y), self.named_y)
        (at,) = places(self.model.pencil, x, like, EXTRA)
        return FollowedShape(at, np.where(np.arange(len(at.lam)) == like - 1, 1.0, 0.0))

    def _at_pose(self, y: Floats) -> FollowedShape:
        """The shape where it is named, at another design."""
        if np.array_equal(y, self.named_y):
            return self.start
        x, count = self.model.x(self.pose(y), y), len(self.start.a)
        while True:
            there = places(self.model.pencil, x, self.mode.like, count - self.mode.like)
            try:
                return follow(self.model.pencil, self.start, there)[0]
            except MoreModesError:
                count *= 2
            except LostModeError as lost:
                raise self._lost(lost, "on the way from the design that it is of", y) from None

    def _lost(self, lost: LostModeError, where: str, y: Floats) -> LostModeError:
        nearest = " and ".join(map(str, lost.candidates)) or "none of the modes"
        design = shown_point(self.model.y_names, y, self.model.poses.case.design_units)
        message = (
            f"{self.mode.name} is lost {where} with {design}: no mode has its shape "
            f"there; nearest are {nearest}. Leave out that part of the trajectory "
            "(during), narrow the bounds, or name a mode by its number"
        )
        return LostModeError(lost.candidates, lost.step, message)

    @cached_property
    def routes(self) -> tuple[Route, ...]:
        """The routes from the pose to all samples needed."""
        return tuple(
            route
            for part, rows in zip(self.path.parts, self.path.rows, strict=True)
            if self.needed[rows].any()
            for route in self._routes(part.name, rows)
        )

    def _routes(self, name: str, rows: slice) -> Iterator[Route]:
        needed = rows.start + np.flatnonzero(self.needed[rows])
        first, last = int(needed[0]), int(needed[-1])
        pose, only = self.mode.at, len(self.path.whole.parts) == 1
        if pose.time is not None and (only or pose.trajectory == name):
            after = rows.start + int(np.searchsorted(self.path.time_s[rows], pose.time, "right"))
            yield tuple(range(after - 1, first - 1, -1)), None
            yield tuple(range(max(after, rows.start), last + 1)), None
            return
        q = self.path.q
        width = np.ptp(q, axis=0)
        away = (q[needed] - self.pose(self.named_y)) / np.where(width > 0.0, width, 1.0)
        nearest = int(needed[np.argmin(np.linalg.norm(away, axis=1))])
        yield tuple(range(nearest, first - 1, -1)), None
        yield tuple(range(nearest + 1, last + 1)), nearest


@dataclass(frozen=True, eq=False)
class Rest:
    """An antiresonance that targets name, and at which samples of the path it is needed."""

    mode: Antiresonance
    of: Antiresonances
    path: Trajectories
    needed: Bools  # (n_t,)

    def numbers(self, q: Floats, y: Floats) -> Ints:
        """Which modes (n,) of the held mechanism it is at poses (n, n_q) of a design, from 1."""
        return self.of.counted(self.of.model.x(q, y), self.mode.number)[1][:, -1] + 1


Named: TypeAlias = Follower | Rest


def named_pose(file: CaseFile, followed: FollowedMode, path: Trajectories, y: Floats) -> Floats:
    """q (n_q,) at which it has that shape, of design y where coordinates follow the design.

    What trajectories set is as in the file where the pose is given by its coordinates.
    """
    pose = followed.at
    if pose.time is None:
        return frozen(np.append(np.array(pose.q), written_loads(file)))
    return frozen(path.whole.pose(pose.time, pose.trajectory, y))


def followers(scene: Scene, wanted: Sequence[Requirement]) -> tuple[Named, ...]:
    """One for each of `followed_modes`, needed where ``wanted`` ask for it."""
    file, path, found = scene.file, scene.path, list[Named]()
    for mode in followed_modes(file):
        needed = np.zeros(len(path.q), dtype=np.bool_)
        for one in wanted:
            if mode in one.followed:
                needed[one.rows] = True
        if isinstance(mode, Antiresonance):
            own = Antiresonances.of(scene.model, mode.at, mode.direction)
            found.append(Rest(mode, own, path, needed))
            continue
        y = frozen(initial_design(file))
        pose = partial(named_pose, file, mode, path)
        found.append(Follower(mode, scene.model, path, y, pose, needed))
    return tuple(found)


def named_notes(file: CaseFile, model: Model, path: Trajectories) -> Iterator[str]:
    """Say which frequency each followed mode has where it is named."""
    y = initial_design(file)
    for mode in followed_modes(file):
        if isinstance(mode, Antiresonance):
            own = Antiresonances.of(model, mode.at, mode.direction)
            hz = own.frequencies(path.q[0], y, mode.number)[0, -1]
            yield f"{mode.name} has {hz:.6g} Hz in the first pose"
            continue
        hz = model.frequencies(named_pose(file, mode, path, y), y, mode.like)[0, -1]
        yield f"{mode.name} has {hz:.6g} Hz there, and is followed from there by its shape"


# --- All of them, with the modes that they are found among


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Modes at samples x (n, n_x): the lowest, and what is named but by a number."""

    x: Floats
    modes: Modes  # (n, count)
    named: Sequence[Named]
    followed: Modes  # (n, n_followed); NaN, and 0 for φ, where they are not needed
    numbers: Ints  # (n, n_followed): which mode from the lowest each is; 0 of antiresonances

    @property
    def solved(self) -> Solved:
        """The frequencies alone."""
        hz, followed = (np.sqrt(own.lam) / (2.0 * np.pi) for own in (self.modes, self.followed))
        return Solved(hz, followed, self.numbers)

    def slopes(self, pencil: Pencil, wanted: Bools) -> Floats:
        """∂λ/∂x (n, n_followed, n_x) of those that are named; NaN where they are not needed."""
        slopes = mode_slopes(pencil, self.x, self.followed, wanted)[0]
        for k, each in enumerate(self.named):
            if isinstance(each, Rest) and each.needed.any():
                at = self.x[each.needed]
                slopes[each.needed, k] = each.of.slopes(at, each.mode.number, wanted)[1]
        return slopes


def follow_all(
    model: Model, path: Trajectories, own: Sequence[Named], y: Floats, least: int
) -> Spectrum:
    """At least ``least`` modes at all samples of design y, and the followed ones among them.

    Raises what exact solves raise, TrajectoryError where the design has no pose, LostModeError.
    """
    x = model.x(path.at(y)[0], y)
    shaped = {k: each for k, each in enumerate(own) if isinstance(each, Follower)}
    extra = (EXTRA if shaped else 1) + max(0, 0, *(e.mode.like - least for e in shaped.values()))
    while True:
        samples = places(model.pencil, x, least, extra)
        try:
            shapes = {k: each.along(y, samples) for k, each in shaped.items()}
            break
        except MoreModesError:
            extra += len(samples[0].lam)
    found = Modes(*(np.array([getattr(each, of) for each in samples]) for of in ("lam", "phi")))
    lam, phi = np.full((len(x), len(own)), np.nan), np.zeros((len(x), model.n_dof, len(own)))
    numbers = np.zeros((len(x), len(own)), dtype=np.intp)
    for column, one in enumerate(own):
        if isinstance(one, Rest) and one.needed.any():
            lam[one.needed, column] = one.of.counted(x[one.needed], one.mode.number)[0][:, -1]
        for k, shape in shapes.get(column, {}).items():
            lam[k, column], phi[k, :, column] = shape.lam, shape.phi
            numbers[k, column] = shape.number
    return Spectrum(x, found, own, Modes(lam, phi), numbers)


# --- Exact frequencies of a design


def solve_design(
    scene: Scene,
    own: Sequence[Named],
    y: Floats,
    count: int | None = None,
    progress: Callable[[int, int], None] = lambda _done, _of: None,
) -> Solved:
    """Solve ``count`` or all shown modes, and those followed; raises LostModeError too."""
    return with_followed(scene, own, y, scene.exact(y, count, progress))


def with_followed(scene: Scene, own: Sequence[Named], y: Floats, hz: Floats) -> Solved:
    """Frequencies (n_t, n_modes) of a design (n_y,) with those of the modes that are followed."""
    if not own:
        return unfollowed(hz)
    return replace(follow_all(scene.model, scene.path, own, y, 1).solved, hz=hz)


def unfollowed(hz: Floats) -> Solved:
    """Frequencies (n_t, n_modes) of which none is followed."""
    return Solved(hz, np.zeros((len(hz), 0)), np.zeros((len(hz), 0), dtype=np.intp))
