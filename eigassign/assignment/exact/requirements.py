"""What is asked of the frequencies: targets to be near to, limits to keep, also of quantities.

A response gives the lowest frequencies f at all samples in time and their slopes in the design; of
it `appraise` makes what the sequential method works on:

    residual of a target        √(w ω_k / Σ w ω) (f / f_d − 1)     least squares, ω in s
                                w (f / f_d − 1)                    worst case
    excess of "at least b"      (b − Σ c_i f_i) / b
    excess of "at most b"       (Σ c_i f_i − b) / b

with coefficients c that pick one mode, or the gap between two. Modes are numbered from 1, and those
followed by their shape −1, −2, …, from the last column. A quantity of the design, such as the mass
of the mechanism, is limited likewise. Where no frequency is wanted, the residuals are the changes
of the design, (y − y_ref)/width.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.checks import Floats
from eigassign.assignment.exact.crossing import NeighbourPairs, joined
from eigassign.assignment.exact.design_problem import Appraisal, Objective


@dataclass(frozen=True)
class Frequencies:
    """Frequencies ``hz`` (n_t, n_modes) of a design: the lowest, ascending, then followed ones.

    ``slopes`` (n_t, n_modes, n_y) in Hz per SI unit of y; where the trajectory follows the design,
    they hold its part too. ``mixed`` (n_t, n_lowest − 1, n_y) are the slopes off the diagonal of
    the matrices that neighbours among the lowest make (`crossing`), if known.
    """

    hz: Floats
    slopes: Floats
    mixed: Floats | None = None


Response = Callable[[Floats], Frequencies]


@dataclass(frozen=True)
class FrequencyGoal:
    """A mode is to be near ``hz`` (n,) at ``rows`` of all samples."""

    mode: int
    hz: Floats
    rows: slice
    weight: float = 1.0


@dataclass(frozen=True)
class FrequencyLimit:
    """Σ c_i f_i ≥ ``hz`` (n,), or ≤, at ``rows`` of all samples; ``terms`` are (mode, c) pairs.

    ``curve`` is that sum in words, where the limit's ``name`` does not say it.
    """

    name: str
    terms: tuple[tuple[int, float], ...]
    hz: Floats
    rows: slice
    at_least: bool
    curve: str = ""


@dataclass(frozen=True)
class QuantityLimit:
    """low ≤ quantity(y) ≤ high; ``quantity`` gives the value and its slope (n_y,)."""

    name: str
    quantity: Callable[[Floats], tuple[float, Floats]]
    low: float = -np.inf
    high: float = np.inf


@dataclass(frozen=True)
class Requirements:
    """Targets and limits, with the weights ω (n_t,) in s of the integral over time."""

    targets: tuple[FrequencyGoal, ...]
    limits: tuple[FrequencyLimit, ...]
    quantities: tuple[QuantityLimit, ...]
    time_weights: Floats
    objective: Objective = Objective.LEAST_SQUARES
    least_change: tuple[Floats, Floats] | None = None  # y_ref and width, where no target is

    @property
    def modes(self) -> int:
        """The highest numbered mode that anything is asked of; 1 if nothing is."""
        asked = [target.mode for target in self.targets]
        asked += [mode for limit in self.limits for mode, _ in limit.terms]
        return max(1, *asked)

    @property
    def limit_names(self) -> tuple[str, ...]:
        """The names of all limits, each once, in their order."""
        names = [limit.name for limit in self.limits] + [own.name for own in self.quantities]
        return tuple(dict.fromkeys(names))

    def with_limits(self, names: Collection[str]) -> Requirements:
        """The same with those limits only that are named."""
        limits = tuple(one for one in self.limits if one.name in names)
        quantities = tuple(one for one in self.quantities if one.name in names)
        return replace(self, limits=limits, quantities=quantities)

    def appraise(self, y: Floats, found: Frequencies) -> Appraisal:
        """Residuals and excesses of a design whose frequencies are ``found``, with slopes."""
        residuals = []
        for target in self.targets:
            factor, column = self._factor(target), _column(target.mode)
            hz, slopes = found.hz[target.rows, column], found.slopes[target.rows, column]
            error = factor * (hz / target.hz - 1.0)
            residuals.append((error, (factor / target.hz)[:, None] * slopes))
        if self.least_change is not None:
            reference, width = self.least_change
            residuals.append(((y - reference) / width, np.diag(1.0 / width)))
        excesses = [_excess(limit, found) for limit in self.limits]
        excesses += [part for limit in self.quantities for part in _of_quantity(limit, y)]
        return Appraisal(
            *_stacked(residuals, len(y)), *_stacked(excesses, len(y)), self._pairs(found)
        )

    def _pairs(self, found: Frequencies) -> NeighbourPairs | None:
        """Rows of one mode beside its neighbours; None where nothing is known of these.

        Squares of errors of neighbours that are both wanted are smooth together where they meet at
        the frequency that is wanted of both: they make no pair.
        """
        if found.mixed is None:
            return None
        parts: list[NeighbourPairs] = []
        start = 0
        for target in self.targets:
            scale, at = self._factor(target) / target.hz, np.arange(start, start + len(target.hz))
            start += len(target.hz)
            asked = {
                other.mode
                for other in self.targets
                if self.objective is Objective.LEAST_SQUARES
                and max(other.rows.start, target.rows.start)
                < min(other.rows.stop, target.rows.stop)
            }
            parts += _beside(found, target.mode, asked, target.rows, at, scale, target.hz)
        start += 0 if self.least_change is None else len(self.least_change[0])
        for limit in self.limits:
            scale, at = 1.0 / limit.hz, np.arange(start, start + len(limit.hz))
            start += len(limit.hz)
            if len(limit.terms) == 1:
                scale = -scale if limit.at_least else scale
                parts += _beside(found, limit.terms[0][0], set(), limit.rows, at, scale, limit.hz)
        return joined(parts)

    def promised(self, residual: Floats) -> Iterator[Floats]:
        """The frequencies (n,) in Hz of every target that residuals (m,) stand for."""
        start = 0
        for target in self.targets:
            own = residual[start : start + len(target.hz)]
            start += len(target.hz)
            yield (own / self._factor(target) + 1.0) * target.hz

    def curves(self, seen: Appraisal) -> Iterator[tuple[Floats, Floats]]:
        """Σ c_i f_i (n,) in Hz and its slopes (n, n_y) of every target, then of every limit.

        They are what ``seen`` was made from: nothing is solved.
        """
        start = 0
        for target in self.targets:
            rows = slice(start, start := start + len(target.hz))
            scale = target.hz / self._factor(target)
            yield scale * seen.residual[rows] + target.hz, scale[:, None] * seen.slopes[rows]
        start = 0
        for limit in self.limits:
            rows = slice(start, start := start + len(limit.hz))
            scale = limit.hz * (-1.0 if limit.at_least else 1.0)
            slopes = scale[:, None] * seen.excess_slopes[rows]
            yield scale * seen.excess[rows] + limit.hz, slopes

    def owner(self, index: int) -> tuple[str, str]:
        """The name of the limit that an excess (k,) belongs to, and its side, lower or upper."""
        for limit in self.limits:
            if index < len(limit.hz):
                return limit.name, "lower" if limit.at_least else "upper"
            index -= len(limit.hz)
        bounds = [
            (q.name, side)
            for q in self.quantities
            for bound, side in ((q.low, "lower"), (q.high, "upper"))
            if np.isfinite(bound)
        ]
        return bounds[index]

    def _factor(self, target: FrequencyGoal) -> Floats:
        """The factors (n,) of f / f_d − 1."""
        if self.objective is Objective.WORST_CASE:
            return np.full(len(target.hz), target.weight)
        total = float(sum(t.weight * self.time_weights[t.rows].sum() for t in self.targets))
        return np.sqrt(target.weight * self.time_weights[target.rows] / total)


def _column(mode: int) -> int:
    return mode - 1 if mode > 0 else mode


def _beside(
    found: Frequencies,
    mode: int,
    asked: Collection[int],
    rows: slice,
    at: NDArray[np.intp],
    scale: Floats,
    wanted: Floats,
) -> Iterator[NeighbourPairs]:
    """Rows ``at``, scale (f − wanted), each with the modes below and above that are not asked."""
    assert found.mixed is not None
    lowest = found.mixed.shape[1] + 1
    own = found.hz[rows, _column(mode)]
    for neighbour in (mode - 1, mode + 1) if mode > 0 else ():
        if neighbour in asked or not 1 <= neighbour <= lowest:
            continue
        hz = found.hz[rows, neighbour - 1]
        yield NeighbourPairs(
            row=at,
            other=scale * (hz - wanted),
            others=scale[:, None] * found.slopes[rows, neighbour - 1],
            mixed=scale[:, None] * found.mixed[rows, min(mode, neighbour) - 1],
            gap=np.abs(hz / own - 1.0),
            larger=np.equal(neighbour < mode, scale > 0.0),
        )


def _excess(limit: FrequencyLimit, found: Frequencies) -> tuple[Floats, Floats]:
    value = sum(c * found.hz[limit.rows, _column(mode)] for mode, c in limit.terms)
    slopes = sum(c * found.slopes[limit.rows, _column(mode)] for mode, c in limit.terms)
    sign = -1.0 if limit.at_least else 1.0
    return sign * (value - limit.hz) / limit.hz, np.asarray(sign * slopes / limit.hz[:, None])


def _of_quantity(limit: QuantityLimit, y: Floats) -> list[tuple[Floats, Floats]]:
    value, slope = limit.quantity(y)
    parts = []
    for sign, bound in ((-1.0, limit.low), (1.0, limit.high)):
        if np.isfinite(bound):
            size = abs(bound) or 1.0
            parts.append((np.array([sign * (value - bound) / size]), sign * slope[None] / size))
    return parts


def _stacked(parts: Sequence[tuple[Floats, Floats]], n_y: int) -> tuple[Floats, Floats]:
    values = np.concatenate([np.zeros(0), *(value for value, _ in parts)])
    return values, np.vstack([np.zeros((0, n_y)), *(slopes for _, slopes in parts)])
