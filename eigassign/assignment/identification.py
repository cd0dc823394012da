"""Parameters from measured frequencies: least squares, covariance, profile likelihood.

Frequencies f_i(y) were measured as m_i with standard deviations σ_i, independently and without
bias. The standardised residuals r_i = (f_i(y) − m_i)/σ_i make

    χ²(y) = Σ_i r_i²,

whose minimum ŷ within the bounds is the most likely y (`sequential.minimise`: Gauss–Newton steps on
exact frequencies in a trust region). With J = ∂r/∂y at ŷ of the parameters that no bound holds,

    C = (JᵀJ)⁻¹

is their covariance as far as f is linear in y. The interval of y_j does not assume that: it holds
every value at which the *others*, fitted anew, explain the measurements nearly as well,

    min_{y_j = t} χ² − χ²(ŷ) ≤ 3.84,

the 95 % quantile of χ² with one degree of freedom (profile likelihood; Seber, Wild, Nonlinear
Regression, 1989, ch. 5). An interval that reaches a bound ends there, and says so.

A direction v of y is not identified where the measurements hardly change along it: where moving
from bound to bound changes all standardised residuals together by less than 1.96.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from eigassign.assignment.checks import Floats, frozen
from eigassign.assignment.design_problem import Appraisal, DesignProblem
from eigassign.assignment.sequential import End, Optimum, minimise
from eigassign.errors import EigassignError

Bools = np.ndarray[tuple[int, ...], np.dtype[np.bool_]]
Response = Callable[[Floats], tuple[Floats, Floats]]  # y → f (m,) in Hz, ∂f/∂y (m, n_y)

NOTICED = 1.959963984540054  # standard deviations: 95 % of a normal distribution
SINGULAR = 1e-8  # of the largest singular value: what is below it is round-off of slopes
PRECISION = 1e-3  # of the distance from ŷ to the end of an interval
STEPS = 40  # to the end of an interval; three or four suffice but for wild models
FAR = 100.0  # standard deviations: what is further, or has no answer, is only known to be outside
BETTER = 1e-3  # of χ²: so much lower is another minimum, not round-off
ROUNDS = 5  # of fitting anew from a better minimum that a profile has come upon


@dataclass(frozen=True)
class MeasuredFrequencies:
    """Measured frequencies (m,) and their standard deviations (m,) > 0, both in Hz."""

    hz: Floats
    deviation: Floats

    def standardised(self, hz: Floats) -> Floats:
        """r (m,) of the model's frequencies (m,)."""
        return np.asarray((hz - self.hz) / self.deviation)


@dataclass(frozen=True)
class Interval:
    """All values of one parameter that the measurements allow at 95 %, in SI units.

    ``at_lower`` and ``at_upper`` say where it ends at a bound that the measurements do not exclude.
    """

    low: float
    high: float
    at_lower: bool
    at_upper: bool


@dataclass(frozen=True)
class Identified:
    """The most likely parameters, and what the measurements say of them. SI units."""

    y: Floats  # (n_y,)
    fit: Optimum
    initial_hz: Floats  # (m,) at the start
    hz: Floats  # (m,) at y
    residual: Floats  # (m,) standardised
    initial_chi_squared: float
    chi_squared: float
    degrees: int  # of freedom: measurements less identified directions
    p_value: float | None  # chance of so large a χ² if model and σ are right; None without freedom
    covariance: Floats  # (n_y, n_y); 0 of parameters that a bound holds, inf where not identified
    intervals: tuple[Interval, ...]
    held: tuple[str, ...]  # of each parameter: the bound that holds it, lower or upper; or ""
    unidentified: Floats  # (k, n_y) directions, the largest entry 1 of its range of bounds
    rounds: int  # fits from better and better starts

    @property
    def deviation(self) -> Floats:
        """Standard deviations (n_y,), the roots of the covariance's diagonal."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))


def identify(
    response: Response,
    measured: MeasuredFrequencies,
    lower: Floats,
    upper: Floats,
    start: Floats,
) -> Identified:
    """The parameters between ``lower`` and ``upper`` (n_y,) that explain ``measured`` best.

    ``start`` (n_y,) is put within the bounds. Where a profile comes upon a better explanation than
    the fit, the fit starts anew from there. Raises what ``response`` raises at the start.
    """
    problem = _problem(response, measured, lower, upper)
    start = np.clip(start, lower, upper)
    initial_hz = response(start)[0]
    fit = _fitted(problem, start)
    for rounds in range(1, ROUNDS + 1):
        profile = _Profile(problem, fit, *_covariance(problem, fit)[:2])
        intervals = tuple(profile.interval(j) for j in range(len(start)))
        if profile.best is fit or rounds == ROUNDS:
            break
        fit = _fitted(problem, profile.best.y)
    covariance, held, unidentified, rank = _covariance(problem, fit)
    hz, chi_squared = response(fit.y)[0], fit.objective
    degrees = len(hz) - rank
    return Identified(
        y=fit.y,
        fit=fit,
        initial_hz=frozen(initial_hz),
        hz=frozen(hz),
        residual=frozen(measured.standardised(hz)),
        initial_chi_squared=float(np.sum(measured.standardised(initial_hz) ** 2)),
        chi_squared=chi_squared,
        degrees=degrees,
        p_value=_p_value(chi_squared, degrees),
        covariance=frozen(covariance),
        intervals=intervals,
        held=held,
        unidentified=frozen(unidentified),
        rounds=rounds,
    )


def _problem(
    response: Response, measured: MeasuredFrequencies, lower: Floats, upper: Floats
) -> DesignProblem:
    def appraise(y: Floats) -> Appraisal:
        hz, slopes = response(y)
        return Appraisal(
            residual=measured.standardised(hz),
            slopes=slopes / measured.deviation[:, None],
            excess=np.zeros(0),
            excess_slopes=np.zeros((0, len(y))),
        )

    return DesignProblem(appraise, lower, upper)


def _fitted(problem: DesignProblem, start: Floats) -> Optimum:
    """A fit; Ctrl-C ends the whole work, for no part of it is an answer."""
    found = minimise(problem, start)
    if found.end is End.INTERRUPTED:
        raise KeyboardInterrupt
    return found


def _p_value(chi_squared: float, degrees: int) -> float | None:
    from scipy.special import gammaincc

    return float(gammaincc(degrees / 2.0, chi_squared / 2.0)) if degrees > 0 else None


# --- Covariance, and what cannot be told


def _covariance(
    problem: DesignProblem, fit: Optimum
) -> tuple[Floats, tuple[str, ...], Floats, int]:
    """C (n_y, n_y), bounds that hold parameters, unidentified directions, and the rank of J.

    In units of the bounds: J = U diag(s) Vᵀ, C = V diag(s)⁻² Vᵀ, without directions of round-off
    size, which make infinite the parameters that take part in them.
    """
    width = problem.upper - problem.lower
    held = _held(fit, len(width))
    free = np.flatnonzero([w > 0.0 and not side for w, side in zip(width, held, strict=True)])
    n = len(width)
    covariance, directions = np.zeros((n, n)), np.zeros((0, n))
    if not len(free):
        return covariance, held, directions, 0
    _, sizes, V = np.linalg.svd(fit.seen.slopes[:, free] * width[free])
    s = np.zeros(len(free))
    s[: len(sizes)] = sizes
    known = s > SINGULAR * max(s.max(), NOTICED)
    scaled = (V[known].T / s[known] ** 2) @ V[known]
    lost = np.abs(V[~known]).max(axis=0, initial=0.0) > SINGULAR**0.5
    scaled[lost], scaled[:, lost] = np.nan, np.nan
    scaled[lost, lost] = np.inf
    covariance[np.ix_(free, free)] = scaled * np.outer(width[free], width[free])
    vague = s < NOTICED * np.abs(V).max(axis=1)
    directions = np.zeros((int(vague.sum()), n))
    directions[:, free] = _apart(V[vague]) * width[free]
    return covariance, held, directions, int(known.sum())


def _held(fit: Optimum, n: int) -> tuple[str, ...]:
    sides = [""] * n
    for limit in fit.limits:
        if limit.kind == "bound" and limit.multiplier > 0.0:
            sides[limit.index] = "upper" if limit.upper else "lower"
    return tuple(sides)


def _apart(directions: Floats) -> Floats:
    """A basis (k, n) of the same space whose vectors share as few parameters as can be.

    Each vector has a parameter, its entry 1, that no other has (Gauss–Jordan, largest pivots).
    """
    basis = directions.copy()
    for row in range(len(basis)):
        pivot = int(np.abs(basis[row:]).max(axis=0).argmax())
        best = row + int(np.abs(basis[row:, pivot]).argmax())
        basis[[row, best]] = basis[[best, row]]
        basis[row] /= basis[row, pivot]
        others = np.arange(len(basis)) != row
        basis[others] -= np.outer(basis[others, pivot], basis[row])
    return np.asarray(basis / np.abs(basis).max(axis=1, initial=1e-300, keepdims=True))


# --- Profile likelihood


class _Profile:
    """χ² along one parameter, the others fitted anew; remembers the best fit that it meets."""

    def __init__(
        self, problem: DesignProblem, fit: Optimum, covariance: Floats, held: tuple[str, ...]
    ) -> None:
        self.problem, self.fit, self.best = problem, fit, fit
        self.covariance, self.held = covariance, held

    def interval(self, j: int) -> Interval:
        """From the last value below ŷ_j that χ² allows to the last above it."""
        low, at_lower = self._end(j, float(self.problem.lower[j]))
        high, at_upper = self._end(j, float(self.problem.upper[j]))
        return Interval(low, high, at_lower, at_upper)

    def _end(self, j: int, bound: float) -> tuple[float, bool]:
        """The end of the interval towards ``bound``, and whether it is the bound.

        √(χ² − χ²(ŷ)) − 1.96 is nearly linear in y_j: secants from the linear model's end on, kept
        between the last value inside and the first one outside.
        """
        centre = float(self.fit.y[j])
        room, y = bound - centre, self.fit.y
        if room == 0.0:
            return bound, True
        deviation = float(np.sqrt(self.covariance[j, j])) or np.inf  # 0 where a bound holds it
        share, last = min(1.0, NOTICED * deviation / abs(room)), (0.0, -NOTICED)
        inside, outside = 0.0, np.inf
        for _ in range(STEPS):
            found = self._refitted(j, bound if share == 1.0 else centre + share * room, y)
            rise = np.inf if found is None else max(found.objective - self.fit.objective, 0.0)
            y = y if found is None else found.y
            over = min(float(np.sqrt(rise)) - NOTICED, FAR)
            if over <= 0.0 and share == 1.0:
                return bound, True
            if abs(over) <= PRECISION * NOTICED:
                break
            inside, outside = (share, outside) if over < 0.0 else (inside, share)
            slope = (over - last[1]) / (share - last[0])
            last, share = (share, over), share - over / slope if slope > 0.0 else np.inf
            if np.isinf(outside):
                share = min(1.0, max(1.1 * inside, min(share, 4.0 * inside)))
            elif not inside < share < outside:
                share = 0.5 * (inside + outside)
        return centre + share * room, False

    def _refitted(self, j: int, at: float, last: Floats) -> Optimum | None:
        """The best fit with y_j ``at`` a value; None where the model has no answer there.

        It starts where the linear model of the measurements sends the others, else at the ``last``.
        """
        start, own = last.copy(), self.covariance[j, j]
        if 0.0 < own < np.inf and np.isfinite(self.covariance[:, j]).all():
            start += self.covariance[:, j] / own * (at - last[j])
        start[j] = at
        lower, upper = self.problem.lower.copy(), self.problem.upper.copy()
        lower[j] = upper[j] = at
        held = replace(self.problem, lower=lower, upper=upper)
        try:
            found = _fitted(held, np.clip(start, lower, upper))
        except EigassignError:
            return None
        if found.objective < self.best.objective - BETTER * max(self.fit.objective, 1.0):
            self.best = found
        return found
