"""A design with its rows, and first-order optimality, also where modes meet.

Its rows are m residuals, then k excesses. A row is linear in d until its mode is expected to meet a
neighbour: behind that kink it is the worse of the line and of the eigenvalue of both modes' matrix
(`NeighbourPairs`). A program gets them one-sided: excesses, and residuals if the largest is
what counts, of the worst case either way; first as at the design, then as they are expected behind
the kinks that its own step would pass.

Where modes meet it is that of Clarke: some share of the branches at each kink must balance.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from eigassign.arrays import Bools, Floats, Ints
from eigassign.assignment.exact.design_problem import ON, TINY, Appraisal, DesignProblem, UnitBox
from eigassign.assignment.requirements.requirement import MEET, NeighbourPairs


@dataclass(frozen=True)
class Rows:
    """One-sided rows: value + slopes·d ≤ v of excesses, ≤ t of residuals."""

    owner: Ints  # (q,) which row of the design each stands for
    sign: Floats  # (q,) with which it does
    value: Floats  # (q,)
    slopes: Floats  # (q, n)
    of_excess: Bools  # (q,)

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


class Expected(NamedTuple):
    """The rows expected of a step, which of them lie behind a kink, and those as one-sided rows."""

    values: Floats  # (m + k,)
    behind: Ints  # (p,)
    rows: Rows


class DesignPoint(NamedTuple):
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
        """What is expected with ``by`` (m + k,) added to it."""
        pairs = self.pairs._replace(other=self.pairs.other + by[self.pairs.row])
        return self._replace(values=self.values + by, pairs=pairs)

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

    def _rows_behind(self, d: Floats, behind: Ints, values: Floats, slopes: Floats) -> Rows:
        """The rows expected behind kinks, of slopes (p, n) at d; squares are one row together."""
        there, squares = values[behind], behind[: np.searchsorted(behind, self.m)]
        sign = np.where(self._either(behind), np.sign(there), 1.0)
        if self.squared and (p := len(squares)):
            linear, J = self.lines(d)[squares], self.slopes[squares]
            rise = 0.5 * (there[:p] @ there[:p] - linear @ linear)
            steep = slopes[:p].T @ there[:p] - J.T @ linear
            behind, sign = behind[p - 1 :], np.ones(len(behind) - p + 1)
            there, slopes = np.append(rise, there[p:]), np.vstack([steep, slopes[p:]])
        return self._one_sided(behind, sign, there - slopes @ d, slopes)

    def _either(self, rows: Ints) -> Bools:
        """Whether rows are the worse the farther they are from 0, on either side."""
        return (rows < self.m) & (not self.one_sided)

    @property
    def worse(self) -> Floats:
        """The sign (m + k,) of a change that makes each row worse."""
        return np.where(self._either(np.arange(len(self.values))), np.sign(self.values), 1.0)

    def _one_sided(self, owner: Ints, sign: Floats, value: Floats, slopes: Floats) -> Rows:
        return Rows(owner, sign, sign * value, sign[:, None] * slopes, owner >= self.m)

    # --- Slopes at kinks

    def smooth_slopes(self, behind: Ints) -> Floats:
        """The slopes, but of rows ``behind`` kinks the mean of both branches."""
        on = np.isin(self.pairs.row, behind)
        slopes, rows = self.slopes.copy(), self.pairs.row[on]
        slopes[rows] = 0.5 * (slopes[rows] + self.pairs.others[on])
        return slopes

    def branches(self, on: Ints) -> tuple[Ints, Floats]:
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


_Held = tuple[Floats, str, int, bool]  # a limit that the design lies on: its outward normal, which


@dataclass(frozen=True)
class BindingLimit:
    """A limit that the optimum lies on: what F falls by when it is relaxed by one unit, ≥ 0.

    ``kind`` is bound, constraint or excess; ``index`` counts among them, ``upper`` says which side.
    The unit is the SI one of the parameter or constraint, or 1 (100 % of its limit) of an excess.
    """

    kind: str
    index: int
    upper: bool
    multiplier: float


def first_order(
    problem: DesignProblem, y: Floats, seen: Appraisal
) -> tuple[float, tuple[BindingLimit, ...]]:
    """The stationarity, and the limits that y lies on with what F falls by per unit relaxed.

    It says how far y is from first-order optimality: 0 at a local optimum, 1 where nothing is
    balanced. The part of the slope of F (or of the violation, where inequalities are missed) that
    no limit on which y lies can balance, in units of the bounds, relative to the largest slope that
    the residuals could give: for least squares the largest cosine between Jᵀ's rows and r.
    """
    box = UnitBox.of(problem)
    if box.n == 0:
        return 0.0, ()
    place = DesignPoint.of(problem, box, box.z(y), seen)
    J, r, m = place.slopes[: place.m], seen.residual, place.m
    held = list(_box_normals(box, place.z))
    violated = _unbalanced_violation(held, place) if seen.violation > ON else 0.0
    rows, slopes = _with_branches(place, m + np.flatnonzero(seen.excess >= -ON))
    held += [(one, "excess", int(k) - m, True) for k, one in zip(rows, slopes, strict=True)]
    slope, size = place.cost_slopes, float(np.abs(place.cost_slopes).max())
    if m and not place.squared:
        badness = place.worse[:m] * r
        top = badness.max()
        # rows of one sign are relative, or frequencies in Hz
        near = ON * max(abs(top), 1.0 if place.one_sided else TINY)
        rows, slopes = _with_branches(place, np.flatnonzero(badness >= top - near))
        steepest, kink = place.worse[rows][:, None] * slopes, np.zeros_like(rows)
        size += float(np.abs(steepest).max(initial=0.0))
        unit = size if place.one_sided else 1.0
    else:
        slope = slope + 2.0 * J.T @ r
        largest = float(np.linalg.norm(r)) if np.linalg.norm(r) > TINY else 0.0
        size += 2.0 * float(np.linalg.norm(J, axis=0).max(initial=0.0)) * largest
        rows, slopes = _with_branches(place, np.unique(place.branches(np.arange(m))[0]))
        steepest, unit = 2.0 * r[rows, None] * (slopes - J[rows]), size
        kink = np.unique(rows, return_inverse=True)[1]
    if size == 0.0:
        return violated, ()
    left, mu = _left_over(slope, held, steepest, kink, unit)
    found = tuple(
        BindingLimit(kind, j, upper, float(share / (box.all_width[j] if kind == "bound" else 1.0)))
        for (_, kind, j, upper), share in zip(held, mu, strict=False)
    )
    return max(left / size, violated), found


def _box_normals(box: UnitBox, z: Floats) -> Iterator[_Held]:
    """The bounds and linear constraints that z lies on."""
    sides = ((False, -1.0), (True, 1.0))
    for i, j in enumerate(box.free):
        for upper, sign in sides:
            if (z[i] >= 1.0 - ON) if upper else (z[i] <= ON):
                yield sign * np.eye(box.n)[i], "bound", j, upper
    value, norms = box.rows @ z, np.abs(box.rows).sum(axis=1)
    for k, row in enumerate(box.rows):
        for upper, sign in sides:
            limit = box.row_upper[k] if upper else box.row_lower[k]
            if np.isfinite(limit) and abs(value[k] - limit) <= ON * max(norms[k], 1e-300):
                yield sign * row, "constraint", k, upper


def _unbalanced_violation(held: Sequence[_Held], place: DesignPoint) -> float:
    """What is left of the slope of the largest excess: 0 where no direction lowers it."""
    excess = place.seen.excess
    _, steepest = _with_branches(place, place.m + np.flatnonzero(excess >= excess.max() - ON))
    together = np.zeros(len(steepest), dtype=np.intp)
    left, _ = _left_over(np.zeros(len(place.z)), held, steepest, together, 1.0)
    return left / max(float(np.abs(steepest).max()), 1.0)


def _with_branches(place: DesignPoint, on: Ints) -> tuple[Ints, Floats]:
    """The rows ``on`` and their slopes, then those of their other branches at kinks."""
    rows, slopes = place.branches(on)
    return np.append(on, rows), np.vstack([place.slopes[on], slopes])


def _left_over(
    slope: Floats, held: Sequence[_Held], branches: Floats, kink: Ints, unit: float
) -> tuple[float, Floats]:
    """The largest entry that is left of a slope, and the multipliers ≥ 0 that balance the rest.

    Those of the limits ``held``, then the shares of ``branches``, which are 1 together at each
    ``kink`` (in units of ``unit``).
    """
    kinks = int(kink.max(initial=-1)) + 1
    normals = np.array([one[0] for one in held]).reshape(-1, len(slope))
    shares = unit * np.eye(kinks)[kink]
    system = np.block([[normals, np.zeros((len(normals), kinks))], [branches, shares]]).T
    slope = np.append(slope, -np.full(kinks, unit))
    if not system.size:
        return float(np.abs(slope).max()), np.zeros(0)
    mu = np.asarray(nnls(system, -slope)[0])
    return float(np.abs(slope + system @ mu).max()), mu
