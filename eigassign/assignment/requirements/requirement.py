"""What all kinds of requirements have in common: a curve, edges that it keeps to, modes that meet.

By size, mode i is the smaller of two crossing branches, then the larger: its slope jumps. The small
matrix of both modes φ_i, φ_j stays smooth; to first order in a change δ of the design it is

    [[f_i + f_i'δ,  c·δ        ],         c = φ_iᵀ (∂K/∂y − ½(λ_i + λ_j) ∂M/∂y) φ_j / 4π²(f_i + f_j)
     [c·δ,          f_j + f_j'δ]],

the square root of Λ(x) in Hz (off its diagonal, √Λ changes by Λ' / (√λ_i + √λ_j)), and the modes
are its eigenvalues. What is asked of one mode is a row, affine in its frequency; with the
neighbour's it makes the same matrix in units of the row, which is its larger or smaller eigenvalue.

The curve of a requirement is Σ c_i x_i. Its terms are pairs (x_i, c_i): x_i is a mode and stands
for its frequency, or a quantity of the design; one mode has 1, the two of a gap ±1. The curve shall
be between ``lower`` and ``upper``: both are the same where a frequency is wanted, and one is
missing (infinite) for a limit. Its error is

    f / f_d − 1                                   of a wanted frequency,
    1 − f / lower  or  f / upper − 1, above 0     of a limit: its relative violation.

It hands over its rows to the sequential method, `EdgeRows`. A kind is a class that says in which of
this it differs.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, NamedTuple, Self

import numpy as np

from eigassign.arrays import Bools, Floats, Ints
from eigassign.assignment.program import LinearConstraint, frozen
from eigassign.brief import Brief
from eigassign.case.schema.targets import AnyTarget, FollowedMode, NamedMode
from eigassign.errors import UsageError
from eigassign.facts import Fact, Unwritten, told

MEET = 1e-6  # relative distance in Hz below which two modes are at a kink
TURNED = 0.8  # cosine of twice the angle from where a mode is no longer what it was
ANGLES = np.pi / 4.0 * np.arange(1, 8)  # of the mixtures of two modes that optimality looks at


class NeighbourPairs(NamedTuple):
    """Rows whose mode may meet a neighbour, p of them; the matrix of each is

        [[value + slopes·δ,  mixed·δ          ],
         [mixed·δ,           other + others·δ ]]

    with the row's own value and slopes.
    """

    row: Ints  # (p,), of the residuals, then of the excesses
    other: Floats  # (p,), the row with the neighbour's frequency
    others: Floats  # (p, n_y), its slopes
    mixed: Floats  # (p, n_y)
    gap: Floats  # (p,), relative distance of both frequencies
    larger: Bools  # (p,), whether the row is the larger eigenvalue

    @classmethod
    def none(cls, n: int) -> NeighbourPairs:
        """No pairs, of n parameters."""
        rows, slopes = np.zeros(0), np.zeros((0, n))
        return cls(rows.astype(np.intp), rows, slopes, slopes, rows, rows.astype(bool))

    def scaled(self, free: list[int], width: Floats) -> NeighbourPairs:
        """The rows with slopes in units ``width`` of the design parameters ``free``."""
        return self._replace(others=self.others[:, free] * width, mixed=self.mixed[:, free] * width)

    def chosen(self, mask: Bools) -> NeighbourPairs:
        """The pairs of a mask."""
        return NeighbourPairs._make(column[mask] for column in self)

    def along(self, own: Floats, slopes: Floats, d: Floats) -> tuple[Floats, Floats, Bools]:
        """The rows' eigenvalues (p,) at a change d, their slopes, and whether the mode has turned.

        ``own`` (p,) are the rows at d, with their ``slopes`` (p, n).
        """
        other = self.other + self.others @ d
        half, off, sign = 0.5 * (own - other), self.mixed @ d, np.where(self.larger, 1.0, -1.0)
        size = np.hypot(half, off)
        cos = np.divide(sign * half, size, out=np.ones_like(size), where=size > 0.0)
        sin = np.divide(sign * off, size, out=np.zeros_like(size), where=size > 0.0)
        return 0.5 * (own + other) + sign * size, self._mixture(slopes, cos, sin), cos < TURNED

    def branches(self, slopes: Floats) -> Floats:
        """Slopes (7 p, n) of mixtures of both modes where they meet, beside the rows' own (p, n).

        Any convex combination of them and the row's own is a generalised slope of the row (Clarke).
        """
        return np.concatenate([self._mixture(slopes, np.cos([a]), np.sin([a])) for a in ANGLES])

    def _mixture(self, slopes: Floats, cos: Floats, sin: Floats) -> Floats:
        """Slopes of the form of both modes' mixture at half the angle."""
        a, b = slopes, self.others
        return np.asarray(0.5 * (a + b) + 0.5 * cos[:, None] * (a - b) + sin[:, None] * self.mixed)


def joined(parts: Sequence[NeighbourPairs]) -> NeighbourPairs | None:
    """The rows of all parts as one; None where there are no parts."""
    if not parts:
        return None
    return NeighbourPairs._make(map(np.concatenate, zip(*parts, strict=True)))


Edges = tuple[Floats, Floats]
# of a design y (n_y,): its value, or one at each sample, and the slopes ((n,) n_y)
Quantity = Callable[[Floats], tuple[float | Floats, Floats]]
# of a number that two or three operations have rounded, such as a design put into its bounds
ROUND_OFF = 4.0 * np.finfo(np.float64).eps
Terms = tuple[tuple[int | Quantity, float], ...]


@dataclass(frozen=True, eq=False)
class Solved:
    """Exact frequencies of a design at all samples, in Hz.

    ``hz`` (n_t, n_modes) are the lowest; ``followed`` (n_t, n_followed) those of followed modes,
    NaN where no target needs them, and ``numbers`` say which modes these are.
    """

    hz: Floats
    followed: Floats
    numbers: Ints

    def curve(self, mode: int) -> Floats:
        """The curve (n_t,) of one mode, numbered as in `Requirement`."""
        return np.asarray(self.hz[:, mode - 1] if mode > 0 else self.followed[:, mode])


class Frequencies(NamedTuple):
    """Frequencies ``hz`` (n_t, n_modes) of a design: the lowest, ascending, then followed ones.

    ``slopes`` (n_t, n_modes, n_y) in Hz per SI unit of y; where the trajectory follows the design,
    they hold its part too. ``mixed`` (n_t, n_lowest − 1, n_y) are the slopes off the diagonal of
    the matrices that neighbours among the lowest make (`NeighbourPairs`), if known.
    """

    hz: Floats
    slopes: Floats
    mixed: Floats | None = None

    def of(self, mode: int, rows: slice) -> tuple[Floats, Floats]:
        """The frequency (n,) of a mode, numbered as in `Requirement`, and its slopes (n, n_y)."""
        column = mode - 1 if mode > 0 else mode
        return self.hz[rows, column], self.slopes[rows, column]


@dataclass(frozen=True, repr=False, eq=False)
class Requirement(Brief):
    """One target on one mode, or limit of a quantity, at those ``rows`` of all samples; edges (n,).

    A gap is on two modes, a band on all the ``modes`` it names, or without any on all there are.
    Modes are numbered from 1; those followed by their shape, and antiresonances, −1, −2, …, the
    last of them named being −1: they are in ``terms``, and in ``modes`` that of a band alone.
    ``along`` has each trajectory's part of the requirement's own arrays. Edges are in Hz, or in the
    SI unit of the quantity. Raises UsageError for a weight that is not finite and above 0.
    """

    form: ClassVar[type[AnyTarget]]  # of the case file
    columns: ClassVar[tuple[str, ...]] = ("target", "initial", "one shot", "exact")
    is_aim: ClassVar[bool] = False  # of the objective: always met, and the farther the better

    label: Annotated[str, Fact('what is asked, in words: "mode 2 at least 320 Hz"')]
    place: Unwritten[str]  # key path in the case file
    terms: Unwritten[Terms]
    rows: Unwritten[slice]
    lower: Unwritten[Floats]
    upper: Unwritten[Floats]
    modes: Annotated[tuple[int, ...], Fact("all that it names")] = ()
    along: Unwritten[tuple[tuple[str, slice], ...]] = ()
    weight: Unwritten[float] = 1.0
    trajectory: Annotated[str | None, Fact("the only one on which it holds", optional=True)] = None
    # ω (n,) of the integral over its own part; None: of all samples
    seconds: Unwritten[Floats | None] = None
    followed: Unwritten[tuple[NamedMode, ...]] = ()
    part_of: Unwritten[str] = ""  # the label of the whole, where it is a part of a band

    def __post_init__(self) -> None:
        for side in ("lower", "upper"):
            object.__setattr__(self, side, frozen(getattr(self, side)))
        if not (np.isfinite(self.weight) and self.weight > 0.0):
            raise UsageError(f"target weight: {self.weight} given; must be finite and above 0")

    @property
    @told()
    def kind(self) -> str:
        """The key that only its targets have, such as at_least; ``highest`` of the objective."""
        return self.form.kind

    @property
    def is_goal(self) -> bool:
        """True where its error is a distance; a limit's is a violation."""
        return self.form.is_goal

    @property
    def name(self) -> str:
        """The label of what the case file asks for, also of the parts and sides of a band."""
        return self.part_of or self.label

    @property
    def mode_terms(self) -> tuple[tuple[int, float], ...]:
        """The terms that are modes."""
        return tuple((term, c) for term, c in self.terms if isinstance(term, int))

    @property
    def top(self) -> int:
        """The highest numbered mode of its terms; 1 if there is none."""
        return max((1, *(mode for mode, _ in self.mode_terms)))

    def time_weights(self, of_all: Floats) -> Floats:
        """ω (n,) in s of the integral over its own rows; ``of_all`` (n_t,) are those of all."""
        return of_all[self.rows] if self.seconds is None else self.seconds

    def part(self, name: str, own: slice) -> Self:
        """What holds along one trajectory, at these of its own samples."""
        first, n = self.rows.start + own.start, own.stop - own.start
        return replace(
            self,
            rows=slice(first, first + n),
            lower=self.lower[own],
            upper=self.upper[own],
            along=((name, slice(0, n)),),
            seconds=None if self.seconds is None else self.seconds[own],
        )

    # --- Its curve and errors, where modes have some frequencies or lie between two

    @property
    def hz(self) -> Floats:
        """The wanted frequency, or the limit (n,); the lower edge of a band."""
        return self.lower if np.isfinite(self.lower).all() else self.upper

    def curve(self, solved: Solved) -> Floats:
        """The curve (n,) that stands for it."""
        return self.curve_range(solved, solved)[0]

    def curve_range(self, lowest: Solved, highest: Solved) -> Edges:
        """The range (n,) of its curve where each mode is between two frequencies."""
        both = [[c * s.curve(m)[self.rows] for m, c in self.mode_terms] for s in (lowest, highest)]
        each = np.reshape(both, (2, len(self.mode_terms), len(self.lower)))
        return each.min(axis=0).sum(axis=0), each.max(axis=0).sum(axis=0)

    def range_over(self, lower: Floats, upper: Floats, lowest: Solved, highest: Solved) -> Edges:
        """The range (n,) of its curve over designs between two (n_y,), of modes between two."""
        return self.curve_range(lowest, highest)

    def errors(self, solved: Solved) -> Floats:
        """The errors (n,)."""
        return self.worst_errors(solved, solved)

    def worst_errors(self, lowest: Solved, highest: Solved) -> Floats:
        """The largest errors (n,), in magnitude, of frequencies between two."""
        return self.outside(*self.curve_range(lowest, highest))

    def least_errors(self, lowest: Solved, highest: Solved) -> Floats:
        """The errors (n,) that no frequency between two avoids."""
        low, high = self.curve_range(lowest, highest)
        return self.outside(high, low)

    def outside(self, low: Floats, high: Floats) -> Floats:
        """The way (n,) of ``low`` below the lower edge, or of ``high`` above the upper one."""
        with_edge = np.isfinite(self.lower) & (self.lower != 0.0)
        below = np.where(with_edge, 1.0 - low / np.where(with_edge, self.lower, 1.0), 0.0)
        return np.maximum(np.maximum(below, high / self.upper - 1.0), 0.0)

    def near(self, initial: Solved, exact: Solved) -> tuple[int, ...] | None:
        """The modes to be shown with it, before and after; None where its curve says it all."""
        return None

    def stake(self, solved: Solved, raised: float) -> float:
        """The largest error where a model raises all frequencies so far at most, relative."""
        own = solved.hz / (1.0 + raised), solved.followed / (1.0 + raised), solved.numbers
        return float(self.worst_errors(Solved(*own), solved).max())

    # --- Its rows of the programs

    @property
    def in_one_shot(self) -> bool:
        """True where eqs. (13)–(14) take it: a wanted frequency of a numbered mode."""
        return self.is_goal and not self.followed

    @property
    def constraint(self) -> LinearConstraint | None:
        """The limit as one that is linear in the design; None where it is not."""
        return None

    @property
    def bands(self) -> tuple[Any, ...]:
        """Bands along each trajectory for itself, of which the program has a choice."""
        return ()

    def value(
        self, y: Floats, found: Frequencies, terms: Terms | None = None
    ) -> tuple[Floats, Floats]:
        """Its curve (n,) and slopes (n, n_y) at y (n_y,), or those of other ``terms``."""
        value: Floats | float = 0.0
        slopes: Floats | float = 0.0
        for term, c in self.terms if terms is None else terms:
            own, steep = found.of(term, self.rows) if isinstance(term, int) else term(y)
            value, slopes = value + c * own, slopes + c * steep
        return np.atleast_1d(value), np.atleast_2d(slopes)

    def edge_rows(self, factor: Floats | float = 1.0) -> Iterator[EdgeRows]:
        """Yield what the sequential method looks at: the way beyond each edge, relative to it."""
        for side, sign, edge in (("lower", -1.0, self.lower), ("upper", 1.0, self.upper)):
            if np.isfinite(edge).all():
                size = np.where(edge == 0.0, 1.0, np.abs(edge))
                yield EdgeRows(self, side, edge, sign * factor / size)

    # --- How it is shown

    @property
    def in_words(self) -> str:
        """Its name in a sentence about limits."""
        return self.name

    def relaxed(self, side: str, share: float) -> str:
        """The words for an edge, lower or upper, that is relaxed by a share of it."""
        return f"{self.name}, relaxed by {100 * share:g} %"

    @property
    def mode(self) -> int:
        """Its mode, of several the lowest, 1 of all; of a followed one what it is named by."""
        followed = (mode.like for mode in self.followed if isinstance(mode, FollowedMode))
        return min((*(mode for mode in self.modes if mode > 0), *followed), default=1)

    @property
    def curve_name(self) -> str:
        """The name of the mode whose frequency its curve is, to tell columns and files apart."""
        return self.followed[0].name if self.followed else f"mode {self.mode}"

    @property
    def followed_numbers(self) -> tuple[int, ...]:
        """The numbers of the modes ``followed``, all below 0."""
        each = {*self.modes, *(mode for mode, _ in self.mode_terms)}
        return tuple(sorted(number for number in each if number < 0))

    @property
    def forbidden_hz(self) -> tuple[Floats | None, Floats | None]:
        """The values (n,) between which its curve shall not be; None without an end."""
        lower = bool(np.isfinite(self.lower).all())
        return (None, self.lower) if lower else (self.upper, None)


@dataclass(frozen=True, eq=False)
class EdgeRows:
    """Rows (n,) of the sequential method: scale · (curve − edge) of one requirement.

    They are residuals of a wanted frequency, and of a limit excesses, positive where it is missed.
    """

    of: Requirement
    side: str  # lower | upper
    edge: Floats  # (n,)
    scale: Floats  # (n,)

    def at(self, y: Floats, found: Frequencies) -> tuple[Floats, Floats]:
        """The rows and their slopes (n, n_y) at a design y (n_y,) of frequencies ``found``."""
        value, slopes = self.of.value(y, found)
        return self.scale * difference(value, self.edge), self.scale[:, None] * slopes

    def least(self, low: Floats, high: Floats) -> Floats:
        """The rows (n,) that no curve between two is below; of a goal in magnitude."""
        ends = self.scale * (low - self.edge), self.scale * (high - self.edge)
        least, most = np.minimum(*ends), np.maximum(*ends)
        return np.maximum(np.maximum(least, -most), 0.0) if self.of.is_goal else least

    def curve(self, rows: Floats) -> Floats:
        """The curve (n,) that these rows stand for."""
        return rows / self.scale + self.edge

    def beside(
        self, found: Frequencies, first: int, along: Collection[int] = ()
    ) -> Iterator[NeighbourPairs]:
        """Yield the rows, numbered from ``first``, with those of the modes below and above.

        Of each of their modes, and not with modes that go ``along``, whose rows are smooth together
        with these. ``found`` must have its mixed slopes.
        """
        assert found.mixed is not None
        modes, rows, lowest = self.of.mode_terms, self.of.rows, found.mixed.shape[1] + 1
        along = {*along, *(mode for mode, _ in modes)}
        if len(modes) < len(self.of.terms):
            return
        for (mode, c), step in itertools.product(modes, (-1, 1)):
            neighbour, scale = mode + step, c * self.scale
            if mode < 0 or neighbour in along or not 1 <= neighbour <= lowest:
                continue
            swapped = tuple((neighbour if each == mode else each, own) for each, own in modes)
            hz, slopes = self.of.value(np.zeros(0), found, swapped)
            gap = found.of(neighbour, rows)[0] / found.of(mode, rows)[0] - 1.0
            yield NeighbourPairs(
                row=np.arange(first, first + len(hz)),
                other=self.scale * (hz - self.edge),
                others=self.scale[:, None] * slopes,
                mixed=scale[:, None] * found.mixed[rows, min(mode, neighbour) - 1],
                gap=np.abs(gap),
                larger=np.equal(neighbour < mode, scale > 0.0),
            )


def difference(a: Floats, b: Floats) -> Floats:
    """a − b (n,), 0 where it is round-off of what it is the difference of."""
    found = a - b
    return np.where(np.abs(found) <= ROUND_OFF * np.maximum(np.abs(a), np.abs(b)), 0.0, found)


def time_shares(goals: Sequence[Requirement], time_weights: Floats) -> tuple[Floats, ...]:
    """w ω_k / Σ w ω (n,) of each goal, 1 together; ``time_weights`` (n_t,) are ω of all samples."""
    own = [one.weight * one.time_weights(time_weights) for one in goals]
    total = sum(weights.sum() for weights in own)
    return tuple(weights / total for weights in own)
