"""A design that the steps have come to, and what is expected of a step d from there.

Its rows are m residuals, then k excesses. A row is linear in d until its mode is expected to meet a
neighbour: behind that kink it is the worse of the line and of the eigenvalue of both modes' matrix
(`crossing`). A program gets them one-sided: excesses, and residuals if the largest is
what counts, of the worst case either way; first as at the design, then as they are expected behind
the kinks that its own step would pass.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.exact.design_problem import Appraisal, DesignProblem, UnitBox
from eigassign.assignment.requirements.crossing import MEET, NeighbourPairs
from eigassign.assignment.targets import Floats

Indices = NDArray[np.intp]


@dataclass(frozen=True)
class Rows:
    """One-sided rows: value + slopes·d ≤ v of excesses, ≤ t of residuals."""

    owner: Indices  # (q,) which row of the design each stands for
    sign: Floats  # (q,) with which it does
    value: Floats  # (q,)
    slopes: Floats  # (q, n)
    of_excess: NDArray[np.bool_]  # (q,)

    def __len__(self) -> int:
        return len(self.owner)

    def levels(self, d: Floats, least: float) -> tuple[float, float]:
        """The least v, 0 at least, and t, ``least`` at least, that a step d allows."""
        values = self.value + self.slopes @ d
        v = np.max(values[self.of_excess], initial=0.0)
        return float(v), float(np.max(values[~self.of_excess], initial=least))

    def and_more(self, others: Rows) -> Rows:
        """The rows of both, these first."""
        names = self.__dataclass_fields__
        return Rows(*(np.concatenate([getattr(self, n), getattr(others, n)]) for n in names))


@dataclass(frozen=True)
class Expected:
    """The rows expected of a step, which of them lie behind a kink, and those as one-sided rows."""

    values: Floats  # (m + k,)
    behind: Indices  # (p,)
    rows: Rows


@dataclass(frozen=True)
class DesignPoint:
    """A design in units of the bounds, what was seen of it, and its rows."""

    z: Floats  # (n,)
    seen: Appraisal
    value: float  # F
    values: Floats  # (m + k,)
    slopes: Floats  # (m + k, n)
    pairs: NeighbourPairs
    cost_slopes: Floats  # (n,)
    squared: bool  # least squares: the program has the residuals' squares already
    one_sided: bool  # residuals are the better the less they are

    @classmethod
    def of(cls, problem: DesignProblem, box: UnitBox, z: Floats, seen: Appraisal) -> DesignPoint:
        """The design at z with what was ``seen`` of it."""
        slopes = np.vstack([seen.slopes, seen.excess_slopes])
        pairs = NeighbourPairs.none(slopes.shape[1]) if seen.pairs is None else seen.pairs
        return cls(
            z=z,
            seen=seen,
            value=problem(box.y(z), seen),
            values=np.append(seen.residual, seen.excess),
            slopes=slopes[:, box.free] * box.width,
            pairs=pairs.scaled(box.free, box.width),
            cost_slopes=problem.cost_slopes(box.y(z))[box.free] * box.width,
            squared=problem.is_squared,
            one_sided=problem.is_one_sided,
        )

    @property
    def m(self) -> int:
        """The number of residuals."""
        return len(self.seen.residual)

    def shifted(self, by: Floats) -> DesignPoint:
        """The same with ``by`` (m + k,) added to what is expected."""
        pairs = replace(self.pairs, other=self.pairs.other + by[self.pairs.row])
        return replace(self, values=self.values + by, pairs=pairs)

    # --- What is expected

    def lines(self, d: Floats) -> Floats:
        """The rows (m + k,) at a step d, past no kinks."""
        return np.asarray(self.values + self.slopes @ d)

    def first_rows(self) -> Rows:
        """The one-sided rows that hold at the design."""
        residuals, excesses = np.split(np.arange(len(self.values)), [self.m])
        above = residuals[:0] if self.squared else residuals
        below = above[:0] if self.one_sided else above
        owner = np.concatenate([excesses, above, below])
        sign = np.concatenate([np.ones(len(excesses) + len(above)), -np.ones(len(below))])
        return self._one_sided(owner, sign, self.values[owner], self.slopes[owner])

    def at(self, d: Floats) -> Expected:
        """The rows expected of a step d (n,)."""
        pairs, values = self.pairs, self.lines(d)
        own, either = values[pairs.row], self._either(pairs.row)
        found, slopes, turned = pairs.along(own, self.slopes[pairs.row], d)
        badness, before = (np.where(either, np.abs(one), one) for one in (found, own))
        worse = np.flatnonzero(turned & (badness > before))
        worse = worse[np.argsort(-badness[worse], kind="stable")]
        behind, first = np.unique(pairs.row[worse], return_index=True)  # the worst of two pairs
        values[behind] = found[worse[first]]
        return Expected(values, behind, self._rows_behind(d, behind, values, slopes[worse[first]]))

    def _rows_behind(self, d: Floats, behind: Indices, values: Floats, slopes: Floats) -> Rows:
        """The rows expected behind kinks, of slopes (p, n) at d.

        Squares are one row together: t is what they are more than those of the lines.
        """
        there, squares = values[behind], behind[: np.searchsorted(behind, self.m)]
        sign = np.where(self._either(behind), np.sign(there), 1.0)
        if self.squared and (p := len(squares)):
            linear, J = self.lines(d)[squares], self.slopes[squares]
            rise = 0.5 * (there[:p] @ there[:p] - linear @ linear)
            steep = slopes[:p].T @ there[:p] - J.T @ linear
            behind, sign = behind[p - 1 :], np.ones(len(behind) - p + 1)
            there, slopes = np.append(rise, there[p:]), np.vstack([steep, slopes[p:]])
        return self._one_sided(behind, sign, there - slopes @ d, slopes)

    def _either(self, rows: Indices) -> NDArray[np.bool_]:
        """Whether rows are the worse the farther they are from 0, on either side."""
        return (rows < self.m) & (not self.one_sided)

    @property
    def worse(self) -> Floats:
        """The sign (m + k,) of a change that makes each row worse."""
        return np.where(self._either(np.arange(len(self.values))), np.sign(self.values), 1.0)

    def _one_sided(self, owner: Indices, sign: Floats, value: Floats, slopes: Floats) -> Rows:
        return Rows(owner, sign, sign * value, sign[:, None] * slopes, owner >= self.m)

    # --- Slopes at kinks

    def smooth_slopes(self, behind: Indices) -> Floats:
        """The slopes, but of rows ``behind`` kinks the mean of both branches."""
        on = np.isin(self.pairs.row, behind)
        slopes, rows = self.slopes.copy(), self.pairs.row[on]
        slopes[rows] = 0.5 * (slopes[rows] + self.pairs.others[on])
        return slopes

    def branches(self, on: Indices) -> tuple[Indices, Floats]:
        """Slopes (b, n) of other branches of the rows ``on``, and whose they are (b,).

        Those at kinks that the design may lie in: behind others the row is better than its own
        branch says, and no optimum lies there.
        """
        worse = self.worse
        here = self.pairs.gap <= MEET
        here &= np.isin(self.pairs.row, on)
        here &= np.where(self.pairs.larger, 1.0, -1.0) * worse[self.pairs.row] > 0.0
        pairs = self.pairs.chosen(here)
        slopes = pairs.branches(self.slopes[pairs.row])
        return np.tile(pairs.row, len(slopes) // max(len(pairs.row), 1)), slopes
