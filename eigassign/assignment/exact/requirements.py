"""A set of requirements as an exact problem, at one design or at several that deviate.

A scenario σ (n_y,), each entry between −1 and 1, stands for the design

    D_j(y) = y_j + σ_j (share_j |y_j| + amount_j),      not below 0 where nature forbids that,

and what is asked of y is asked of D(y) too: its rows follow those of y, with the slopes of D.

A response gives the lowest frequencies f at all samples in time and their slopes in the design; of
it `appraise` stacks the rows of all requirements:

    residual of a wanted f_d   √(w ω_k / Σ w ω) (f / f_d − 1)     least squares, ω in s
                               w (f / f_d − 1)                    worst case
    excess of "at least b"     (b − Σ c_i x_i) / |b|
    excess of "at most b"      (Σ c_i x_i − b) / |b|

x_i being frequencies or quantities of the design, such as the mass of the mechanism. Where no
frequency is wanted, the residuals are the rows of what shall have as much room as can be (`aims`),
like those of limits; or else the changes of the design, (y − y_ref)/width.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from eigassign.arrays import Floats
from eigassign.assignment.exact.design_problem import Appraisal, Objective
from eigassign.assignment.requirements.requirement import (
    EdgeRows,
    Frequencies,
    NeighbourPairs,
    Requirement,
    Solved,
    difference,
    joined,
    time_shares,
)

Appraise = Callable[[Floats], Appraisal]


@dataclass(frozen=True, eq=False)
class Ellipsoid:
    """What the ``columns`` (n,) of y may be with a stated probability, about each of some centres.

    With z of n independent normal numbers, p = c + L z, or p = c exp(L z) of those that cannot be
    below 0, ``positive`` (n,): |z|² ≤ r² holds with the probability, r² being its quantile of χ² of
    n degrees of freedom. L Lᵀ is the covariance, of logarithms that divided by the values.
    """

    columns: NDArray[np.intp]
    centres: Floats  # (n_e, n): of several explanations each
    factors: Floats  # (n_e, n, n): L
    positive: NDArray[np.bool_]
    radius: float

    @classmethod
    def of(
        cls,
        columns: Sequence[int],
        centres: Floats,
        covariances: Floats,
        positive: NDArray[np.bool_],
        probability: float,
    ) -> Ellipsoid:
        """That of covariances (n_e, n, n) in SI units."""
        from scipy.special import gammaincinv  # loaded only where something is not known

        unit = np.where(positive, centres, 1.0)
        factors = np.linalg.cholesky(covariances / (unit[:, :, None] * unit[:, None, :]))
        radius = float(np.sqrt(2.0 * gammaincinv(0.5 * len(columns), probability)))
        return cls(np.array(columns, dtype=np.intp), centres, factors, positive, radius)

    def placed(self, y: Floats, z: Floats, e: int = 0) -> tuple[Floats, Floats]:
        """y (n_y,) with what z (n,) stands for about centre e, and ∂p/∂z (n, n)."""
        off, y = self.factors[e] @ z, y.copy()
        p = np.where(self.positive, self.centres[e] * np.exp(off), self.centres[e] + off)
        y[self.columns] = p
        return y, np.where(self.positive, p, 1.0)[:, None] * self.factors[e]


@dataclass(frozen=True, eq=False)
class Tolerances:
    """How far parameters may deviate either way, ``share`` of |y| and ``amount`` (n_y,) in SI.

    ``natural`` (n_y,) are those that cannot be below 0, such as masses. A range need not lie about
    y: ``middle`` (n_y,) is how far from it, in units of ``amount``. What is known by a deviation
    lies on an ``ellipsoid``, and not in the box; its amounts are units of σ alone.
    """

    share: Floats
    amount: Floats
    natural: NDArray[np.bool_]
    middle: Floats | float = 0.0
    ellipsoid: Ellipsoid | None = None

    @property
    def given(self) -> NDArray[np.bool_]:
        """The parameters (n_y,) that have one."""
        return (self.share > 0.0) | (self.amount > 0.0)

    def deviated(self, y: Floats, sigma: Floats) -> tuple[Floats, Floats]:
        """D (n_y,) of a design y (n_y,), and its slopes (n_y,): D_j depends on y_j alone."""
        design = y + sigma * (self.share * np.abs(y) + self.amount)
        slopes = 1.0 + sigma * self.share * np.sign(y)
        floor = np.where(self.natural, np.minimum(y, 0.0), -np.inf)
        below = design < floor
        return np.where(below, floor, design), np.where(below, np.where(y < 0.0, 1.0, 0.0), slopes)

    def box(self, y: Floats) -> tuple[Floats, Floats]:
        """The least and the largest values (n_y,) of the designs about y."""
        ones = np.ones(len(y))
        if self.ellipsoid is not None:
            ones[self.ellipsoid.columns] = 0.0
        return self.deviated(y, self.middle - ones)[0], self.deviated(y, self.middle + ones)[0]

    def scenario(self, y: Floats, design: Floats) -> Floats:
        """σ (n_y,) of a design in the box about y."""
        reach = self.share * np.abs(y) + self.amount
        return np.asarray(np.where(reach > 0.0, (design - y) / np.where(reach > 0.0, reach, 1), 0))


def with_scenarios(
    appraise: Appraise, tolerances: Tolerances, scenarios: Sequence[Floats], of_residuals: bool
) -> Appraise:
    """What sees a design with its excesses in all scenarios; its residuals too, if asked for."""
    if not scenarios:
        return appraise

    def appraised(y: Floats) -> Appraisal:
        each = [(appraise(y), np.ones(len(y)))]
        for sigma in scenarios:
            design, slopes = tolerances.deviated(y, sigma)
            each.append((appraise(design), slopes))
        goals = each if of_residuals else each[:1]
        m, k = len(each[0][0].residual), len(each[0][0].excess)
        pairs: list[NeighbourPairs] = []
        for s, (seen, slopes) in enumerate(each):
            if seen.pairs is not None:
                own = seen.pairs.chosen((seen.pairs.row >= m) | (s < len(goals)))
                row = np.where(own.row < m, own.row + s * m, own.row + (len(goals) - 1) * m + s * k)
                others, mixed = own.others * slopes, own.mixed * slopes
                pairs.append(own._replace(row=row, others=others, mixed=mixed))
        return Appraisal(
            np.concatenate([seen.residual for seen, _ in goals]),
            np.vstack([seen.slopes * slopes for seen, slopes in goals]),
            np.concatenate([seen.excess for seen, _ in each]),
            np.vstack([seen.excess_slopes * slopes for seen, slopes in each]),
            joined(pairs),
        )

    return appraised


@dataclass(frozen=True)
class Requirements:
    """Requirements without a choice left, with the weights ω (n_t,) in s of the time integral."""

    asked: tuple[Requirement, ...]
    time_weights: Floats
    objective: Objective = Objective.LEAST_SQUARES
    least_change: tuple[Floats, Floats] | None = None  # y_ref and width, where nothing is aimed at
    aims: tuple[Requirement, ...] = ()  # of the largest, instead of goals

    @cached_property
    def goals(self) -> tuple[Requirement, ...]:
        """The requirements that the objective is to come near to."""
        return tuple(one for one in self.asked if one.is_goal)

    @cached_property
    def limits(self) -> tuple[Requirement, ...]:
        """The requirements that are to be kept."""
        return tuple(one for one in self.asked if not one.is_goal)

    @property
    def modes(self) -> int:
        """The highest numbered mode that anything is asked of; 1 if nothing is."""
        every = (*self.asked, *self.aims)
        return max((1, *(mode for one in every for mode, _ in one.mode_terms)))

    @property
    def limit_names(self) -> tuple[str, ...]:
        """The names of all limits, each once, in their order."""
        return tuple(dict.fromkeys(one.name for one in self.limits))

    def with_limits(self, names: Collection[str]) -> Requirements:
        """The requirements without the limits that are not named."""
        kept = (one for one in self.asked if one.is_goal or one.name in names)
        return replace(self, asked=tuple(kept))

    def named(self, name: str) -> Requirement:
        """The first limit of this name."""
        return next(one for one in self.limits if one.name == name)

    # --- The rows of all of them

    @cached_property
    def residuals(self) -> tuple[EdgeRows, ...]:
        """The rows of the goals or aims, one after the other."""
        if self.aims:
            return tuple(rows for one in self.aims for rows in one.edge_rows())
        if self.objective is Objective.WORST_CASE:
            factors = [np.array(one.weight) for one in self.goals]
        else:
            factors = [np.sqrt(share) for share in time_shares(self.goals, self.time_weights)]
        each = zip(self.goals, factors, strict=True)
        return tuple(rows for one, factor in each for rows in one.edge_rows(factor))

    @cached_property
    def excesses(self) -> tuple[EdgeRows, ...]:
        """The rows of the limits, one after the other."""
        return tuple(rows for one in self.limits for rows in one.edge_rows())

    def appraise(self, y: Floats, found: Frequencies) -> Appraisal:
        """Residuals and excesses of a design whose frequencies are ``found``, with slopes."""
        residuals = [rows.at(y, found) for rows in self.residuals]
        if self.least_change is not None:
            reference, width = self.least_change
            residuals.append((difference(y, reference) / width, np.diag(1.0 / width)))
        residual, slopes = _stacked(residuals, len(y))
        excess = _stacked([rows.at(y, found) for rows in self.excesses], len(y))
        return Appraisal(residual, slopes, *excess, self._pairs(found, len(residual)))

    def least(
        self, lower: Floats, upper: Floats, lowest: Solved, highest: Solved
    ) -> tuple[float, Floats]:
        """The violation that no design between two (n_y,) is below, and so its residuals (m,).

        Its modes are between ``lowest`` and ``highest``; residuals of goals are in magnitude.
        """
        excess, residual = (
            [rows.least(*rows.of.range_over(lower, upper, lowest, highest)) for rows in some]
            for some in (self.excesses, self.residuals)
        )
        if self.least_change is not None:
            reference, width = self.least_change
            residual.append((np.clip(reference, lower, upper) - reference) / width)
        worst = max((float(one.max()) for one in excess), default=0.0)
        return max(worst, 0.0), np.concatenate([np.zeros(0), *residual])

    def _pairs(self, found: Frequencies, m: int) -> NeighbourPairs | None:
        """Rows of one mode beside its neighbours; None where nothing is known of these."""
        if found.mixed is None:
            return None
        parts: list[NeighbourPairs] = []
        smooth = self.goals if self.objective is Objective.LEAST_SQUARES else ()
        for rows, at in _spans(self.residuals):
            own = rows.of.rows
            met = (o for o in smooth if max(o.rows.start, own.start) < min(o.rows.stop, own.stop))
            parts += rows.beside(found, at.start, [mode for o in met for mode, _ in o.mode_terms])
        for rows, at in _spans(self.excesses, m):
            parts += rows.beside(found, at.start)
        return joined(parts)

    def promised(self, residual: Floats) -> Iterator[Floats]:
        """The frequencies (n,) in Hz of every goal that residuals (m,) stand for."""
        for rows, at in _spans(self.residuals):
            yield rows.curve(residual[at])

    def curves(self, seen: Appraisal) -> Iterator[tuple[Requirement, Floats, Floats]]:
        """Every goal or aim, then limit, of frequencies, its curve (n,) in Hz and slopes (n, n_y).

        They are what ``seen`` was made from: nothing is solved.
        """
        told: set[str] = set()
        for some, values, slopes in (
            (self.residuals, seen.residual, seen.slopes),
            (self.excesses, seen.excess, seen.excess_slopes),
        ):
            for rows, at in _spans(some):
                if rows.of.mode_terms and rows.of.label not in told:
                    told.add(rows.of.label)
                    yield rows.of, rows.curve(values[at]), slopes[at] / rows.scale[:, None]

    def owner(self, index: int) -> tuple[str, str]:
        """Name and side of the limit of an excess (k,); those of scenarios follow one another."""
        index %= sum(len(rows.edge) for rows in self.excesses)
        rows = next(rows for rows, at in _spans(self.excesses) if index < at.stop)
        return rows.of.name, rows.side


def _spans(some: Sequence[EdgeRows], first: int = 0) -> Iterator[tuple[EdgeRows, slice]]:
    """Yield the rows of each edge with their numbers among all, counted from ``first``."""
    for rows in some:
        yield rows, slice(first, first := first + len(rows.edge))


def _stacked(parts: Sequence[tuple[Floats, Floats]], n_y: int) -> tuple[Floats, Floats]:
    values = np.concatenate([np.zeros(0), *(value for value, _ in parts)])
    return values, np.vstack([np.zeros((0, n_y)), *(slopes for _, slopes in parts)])
