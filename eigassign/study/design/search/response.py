"""Frequencies along the trajectory and their slopes in the design, as the assignment asks for them.

    ∂f/∂y = (∂λ/∂y + ∂λ/∂q dq/dy) / (8π² f)

Exactly, from a solve at every sample.

**Monotone** is every frequency in masses, which lower it, and in stiffnesses, which raise it.
K and M are K_0 + Σ k_i A_i and M_0 + Σ m_j B_j in stiffnesses k of springs and drives and moduli of
materials, and in masses, inertias and densities m, A_i and B_j positive semidefinite at every pose.
By the min-max principle every λ grows with each k and falls with each m, so that over a box of them
the least and largest frequency are those of two corners: two exact solves a pose. With gravity
masses are weights, too, and springs and links share the load: of neither anything is known then.
Nor of inertias where a coordinate is free: elastic modes move it along the more the less inertia it
has, and what the weight does along that way is in K (see `apart_from_rigid`).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from eigassign.arrays import Bools, Floats, Ints
from eigassign.assignment.exact.design_problem import best_first
from eigassign.assignment.exact.requirements import Requirements
from eigassign.assignment.requirements.kinds import ForbiddenBand
from eigassign.assignment.requirements.requirement import Frequencies, Requirement, Solved
from eigassign.case.case_file import CaseFile
from eigassign.errors import EigassignError, LostModeError, MissingMassError
from eigassign.mechanism.trajectory.trajectory import Trajectories
from eigassign.modal.exact.dense import Modes
from eigassign.modal.exact.solver import exact_slopes, in_hz, mode_slopes
from eigassign.modal.model import Model
from eigassign.study.design.followed import Named, follow_all, followers, unfollowed, with_followed
from eigassign.study.scene import Scene


@dataclass
class DesignResponse:
    """The lowest ``count`` frequencies at every sample and the one above, then those followed.

    By exact solves, which are remembered.
    """

    model: Model
    path: Trajectories
    wanted: Bools  # (n_x,): where slopes are wanted
    count: int
    followers: tuple[Named, ...] = ()
    exact_solves: int = 0  # so far
    known: dict[bytes, Frequencies] = field(default_factory=dict)
    lost: list[str] = field(default_factory=list)  # designs at which a followed mode is lost

    def __call__(self, y: Floats) -> Frequencies:
        """Raises EigassignError where the mechanism has no modes, or no pose, at this design.

        LostModeError where a followed mode is lost.
        """
        key = y.tobytes()
        if key in self.known:
            return self.known[key]
        q, of_design = self.path.at(y)
        try:
            self.known[key] = self._exact(y, q, of_design)
        except LostModeError as error:
            self.lost.append(str(error))
            raise
        return self.known[key]

    def _exact(self, y: Floats, q: Floats, of_design: Floats) -> Frequencies:
        self.exact_solves += len(q)
        pencil, wanted = self.model.pencil, self.wanted
        if self.followers:
            found = follow_all(self.model, self.path, self.followers, y, self.count)
            own = Modes(*(each[..., : self.count + 1] for each in found.modes))
            slopes, mixed = mode_slopes(pencil, found.x, own, wanted, mixed=True)
            slopes = np.concatenate([slopes, found.slopes(pencil, wanted)], axis=1)
            lam = np.hstack([own.lam, found.followed.lam])
        else:
            lam, slopes, mixed = exact_slopes(pencil, self.model.x(q, y), self.count, wanted, 1)
        hz, slopes = in_hz(lam, slopes)
        lower, upper = (hz[:, k : k + mixed.shape[1]] for k in (0, 1))
        mixed = mixed / (4.0 * np.pi**2 * (lower + upper))[..., None]
        return Frequencies(hz, *(self.path.in_design(own, of_design) for own in (slopes, mixed)))


def response_of(scene: Scene, count: int, followers: tuple[Named, ...] = ()) -> DesignResponse:
    """The response at all samples of the scene's trajectory."""
    lower, upper = scene.bounds
    moving = np.full(scene.path.q.shape[1], scene.path.follows_design)
    moving[scene.model.pencil.n_joints :] = False  # loads do not follow the design
    free = upper > lower
    if scene.file.assignment.robust:  # what deviates has slopes, though it may have no choice
        free = free | scene.tolerances.given
    wanted = np.append(moving, free)
    return DesignResponse(scene.model, scene.path, wanted, count, followers)


# --- Of many designs, without slopes

SPREAD = (4, 16, 64)  # samples that are looked at before all are
ENDLESS = 1e150  # Hz; squares of it are numbers


@dataclass
class Glances:
    """The lowest ``count`` frequencies of many designs at more and more samples, remembered."""

    model: Model
    path: Trajectories
    count: int
    known: dict[bytes, Floats] = field(default_factory=dict)  # (n, count) in Hz; NaN: no answer
    exact_solves: int = 0  # so far

    @cached_property
    def order(self) -> Ints:
        """All samples, those first that are spread over the trajectories."""
        spread = [one for few in SPREAD for one in self.path.spread(few).tolist()]
        return np.array([*dict.fromkeys([*spread, *range(len(self.path.q))])])

    @cached_property
    def levels(self) -> tuple[int, ...]:
        """The numbers of samples to look at, one after the other: none first, and all last."""
        seen = (np.flatnonzero(np.isin(self.order, self.path.spread(few))) for few in SPREAD)
        return tuple(sorted({0, *(int(own.max()) + 1 for own in seen), len(self.order)}))

    def look(self, designs: Floats, few: int) -> None:
        """Solve designs (n, n_y) at the first samples, as far as they are not known."""
        each = {y.tobytes(): y for y in designs}
        had = {key: self.known.setdefault(key, np.zeros((0, self.count))) for key in each}
        left = [key for key in each if len(had[key]) < few]
        if not left:
            return
        try:
            q = [self.path.at(each[key])[0][self.order[len(had[key]) : few]] for key in left]
            lengths = [len(poses) for poses in q]
            y = np.repeat([each[key] for key in left], lengths, axis=0)
            hz = self.model.frequencies(np.concatenate(q), y, self.count)
        except EigassignError:
            if len(left) == 1:
                self.known[left[0]] = np.full((len(self.order), self.count), np.nan)
                return
            for key in left:
                self.look(each[key][None], few)
            return
        self.exact_solves += len(hz)
        for key, own in zip(left, np.split(hz, np.cumsum(lengths)[:-1]), strict=True):
            self.known[key] = np.concatenate([had[key], own])

    def solved(self, y: Floats, few: int, unknown: float) -> Solved | None:
        """A design at the first samples, ``unknown`` Hz elsewhere; None without an answer."""
        hz = np.full((len(self.order), self.count), unknown)
        hz[self.order[:few]] = self.known[y.tobytes()][:few] if few else np.zeros((0, self.count))
        return None if np.isnan(hz).any() else unfollowed(hz)


class Outlook(NamedTuple):
    """What is known of all designs between two without solving for the best, by requirements.

    Their frequencies are between those at two corners, where they differ only in parameters in
    which every frequency is monotone: with others there is no level but that without samples.
    """

    file: CaseFile
    requirements: Requirements
    glances: Glances
    levels: int

    def __call__(self, level: int, lower: Floats, upper: Floats) -> Iterator[tuple[float, Floats]]:
        """Yield the violation and the magnitudes of residuals (m,) that no design is below."""
        few, own = self.glances.levels[level], self.glances
        boxes = zip(lower, upper, *corners(self.file, lower, lower, upper), strict=True)
        own.look(np.concatenate(corners(self.file, lower, lower, upper)), few)
        for low, high, softest, stiffest in boxes:
            lowest, highest = own.solved(softest, few, 0.0), own.solved(stiffest, few, ENDLESS)
            with suppress(EigassignError):  # no mechanism has such properties
                if lowest is not None and highest is not None:
                    yield self.requirements.least(low, high, lowest, highest)
                    continue
            # of several designs others may have an answer
            yield np.inf if np.array_equal(low, high) else 0.0, np.zeros(0)


def outlook_of(
    scene: Scene,
    requirements: Requirements,
    followers: tuple[Named, ...],
    glances: dict[int, Glances],
) -> Outlook | None:
    """The outlook of requirements, ``glances`` by the number of modes; None of followed ones."""
    if followers:
        return None
    lower, upper = scene.bounds
    known = (effects(scene.file) != 0.0) | (lower == upper)
    known[[k for own in scene.file.design.catalogues for k in own.columns]] = True
    count = requirements.modes
    own = glances.setdefault(count, Glances(scene.model, scene.path, count))
    return Outlook(scene.file, requirements, own, len(own.levels) if known.all() else 1)


MOMENTS = ("inertia", "motor_inertia", "ratio")  # of which a moment of inertia is made
MOST_SIDES = 6  # of a box with at most 64 corners, as many as a tolerance study draws


def effects(file: CaseFile) -> Floats:
    """+1 for each parameter (n_y,) that raises every frequency, −1 that lowers it, 0 unknown."""
    columns = (column.factors.items() for column in file.design.parameters.values())
    each = [{np.sign(c) * _effect(file, path) for path, c in factors} for factors in columns]
    return np.array([found.pop() if len(found) == 1 else 0.0 for found in each])


def _effect(file: CaseFile, path: str) -> float:
    weighs = isinstance(file.mechanism.gravity, tuple)
    loose = weighs and any(c.moves == "free" for c in file.coordinates.values())
    group, name, *rest = path.split(".")
    if weighs and (group in ("springs", "materials") or rest == ["mass"]):  # loads change, too
        return 0.0
    if loose and rest[-1] in MOMENTS:
        return 0.0
    match group, ".".join(rest):
        case ("bodies" | "links", "mass") | ("materials", "density"):
            return -1.0
        case "bodies" | "links" | "coordinates", _ if rest[-1] in MOMENTS:
            return -1.0
        case ("springs", "translational" | "rotational") | ("coordinates", "drive.stiffness"):
            return 1.0
        case "materials", "youngs_modulus":  # with a G of its own a shear beam's M changes
            return float(file.mechanism.materials[name].shear_modulus is None)
    return 0.0


def corners(file: CaseFile, y: Floats, lower: Floats, upper: Floats) -> tuple[Floats, Floats]:
    """The designs of lowest and of highest frequencies in the box, each (n_y,).

    Parameters in which the frequencies are not known to be monotone stay as in ``y``.
    """
    effect = effects(file)
    softest = np.where(effect > 0.0, lower, np.where(effect < 0.0, upper, y))
    stiffest = np.where(effect > 0.0, upper, np.where(effect < 0.0, lower, y))
    return softest, stiffest


def box_corners(n: int) -> Floats:
    """The corners of a box of n sides 0 to 1; of more than six those along a face or an edge."""
    if n <= MOST_SIDES:
        return np.array(list(itertools.product((0.0, 1.0), repeat=n)))
    return np.concatenate([np.tri(n), 1.0 - np.tri(n), np.eye(n), 1.0 - np.eye(n)])


# --- Designs all over the bounds, and bands

ALL_OVER = 8  # beside corners and middle
MOST_CHOICES = 100_000  # of numbers of modes below the bands: 0.3 s to put them in order


def spread_designs(bounds: tuple[Floats, Floats], count: int, seed: int) -> Floats:
    """Designs (count, n_y) of a Latin hypercube over the ``bounds``, lower and upper (n_y,)."""
    lower, upper = bounds
    cells = np.tile(np.arange(count), (len(lower), 1))
    share = (np.random.default_rng(seed).permuted(cells, axis=1).T + 0.5) / count
    wide = (lower > 0.0) & (upper > 10.0 * lower)
    low = np.where(wide, lower, 1.0)
    ratio = np.where(wide, upper, 1.0) / low
    return np.where(wide, low * ratio**share, lower + share * (upper - lower))


@dataclass(frozen=True)
class Designs:
    """Designs all over the bounds with their frequencies, and what these say of bands.

    ``solved`` are the lowest frequencies of each on the samples of ``scene``, as many as reach
    beyond every band, and those followed; ``y`` (m, n_y) are the designs.
    """

    scene: Scene
    bands: Sequence[ForbiddenBand]
    y: Floats
    solved: Sequence[Solved]

    @classmethod
    def all_over(cls, scene: Scene, wanted: Sequence[Requirement]) -> Designs:
        """The initial design, corners and the middle, and `ALL_OVER` spread ones.

        Raises LostModeError where a followed mode is lost at all of them.
        """
        bands, own = [b for one in wanted for b in one.bands], followers(scene, wanted)
        lower, upper = scene.bounds
        extremes = corners(scene.file, scene.initial, lower, upper)
        designs = [scene.initial, lower, upper, 0.5 * (lower + upper), *extremes]
        if len(lower):
            designs += list(spread_designs(scene.bounds, ALL_OVER, 1))
        y, solved = list[Floats](), list[Solved]()
        for each in designs:
            try:
                solved.append(solved_below(scene, bands, own, each))
                y.append(each)
            except EigassignError as error:
                lost = error
        if not y:
            raise lost
        return cls(scene, bands, np.array(y), solved)

    @cached_property
    def choices(self) -> list[tuple[int, ...]]:
        """Choices of a number for every band, those that designs are nearest to first.

        From the fewest to the most of any design. Of more than `MOST_CHOICES` not all are listed.
        """
        each = [[band.below(solved) for solved in self.solved] for band in self.bands]
        near = np.array([[int(np.median(own[k])) for own in each] for k in range(len(self.y))])
        counts = (range(int(np.min(own)), int(np.max(own)) + 1) for own in each)
        listed = itertools.islice(itertools.product(*counts), MOST_CHOICES)
        return sorted(
            dict.fromkeys((*map(tuple, near.tolist()), *listed)),
            key=lambda choice: int(np.abs(near - choice).sum(axis=1).min()),
        )

    def best_of(
        self, modes: int, worth: Callable[[Floats, Floats], tuple[float, float]], most: int
    ) -> list[Floats]:
        """The designs that promise most, of a ``worth`` in y and frequencies (n_t, modes)."""

        def worth_of(k: int) -> tuple[float, float]:
            each = self.solved[k]
            lacking = ((0, 0), (0, max(modes - each.hz.shape[1], 0)))
            lowest = np.pad(each.hz, lacking, constant_values=np.inf)
            return worth(self.y[k], np.hstack([lowest, each.followed]))

        return [self.y[k] for k in best_first(range(len(self.y)), worth_of)[:most]]


def solved_below(
    scene: Scene, bands: Sequence[ForbiddenBand], own: tuple[Named, ...], y: Floats
) -> Solved:
    """The frequencies of a design (n_y,) that matter to the bands, at all samples, and followed."""
    q = scene.path.at(y)[0]
    available = scene.model.n_dof - scene.model.n_rigid
    beyond = max((float(band.upper.max()) for band in bands), default=0.0)
    named = (mode for band in bands for mode in band.counted)
    count = min(max((4, *named)), available)
    while True:
        try:
            hz = scene.model.frequencies(q, y, count)
        except MissingMassError as error:
            count = available = error.most
            continue
        if count == available or hz[:, -1].min() > beyond:
            return with_followed(scene, own, y, hz)
        count = min(2 * count, available)
