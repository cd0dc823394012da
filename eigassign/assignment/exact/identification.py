"""Parameters from measured frequencies: least squares, covariance, profile likelihood.

Frequencies f_i(y) were measured as m_i with standard deviations σ_i, independently and without
bias. The standardised residuals r_i = (f_i(y) − m_i)/σ_i make

    χ²(y) = Σ_i r_i²,

whose minimum ŷ within the bounds is the most likely y (`sequential.minimise`: Gauss–Newton steps on
exact frequencies in a trust region). With J = ∂r/∂y at ŷ of the parameters that no bound holds,

    C = (JᵀJ)⁻¹

is their covariance as far as f is linear in y and those bounds hold. The interval
of y_j assumes neither: it holds every value at which the *others*, fitted anew, explain the
measurements nearly as well,

    min_{y_j = t} χ² − χ²(ŷ) ≤ 3.84,

the 95 % quantile of χ² with one degree of freedom (profile likelihood; Seber, Wild, Nonlinear
Regression, 1989, ch. 5). An interval that reaches a bound ends there, and says so.

Several minima of χ² may explain the measurements: those that no way joins along which χ² rises by
3.84 at most above the higher one are distinct explanations.

A direction v of y is not identified where the measurements hardly change along it: where moving
from bound to bound changes all standardised residuals together by less than 1.96. Parameters that
a bound holds take part in it where v leads away from all these bounds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from eigassign.arrays import Floats
from eigassign.assignment.exact.design_problem import MET, Appraisal, DesignProblem
from eigassign.assignment.exact.sequential import End, Optimum, has_way, minimise
from eigassign.assignment.program import frozen
from eigassign.errors import EigassignError

Bools = np.ndarray[tuple[int, ...], np.dtype[np.bool_]]
Response = Callable[[Floats], tuple[Floats, Floats]]  # y → f (m,) in Hz, ∂f/∂y (m, n_y)

NOTICED = 1.959963984540054  # standard deviations: 95 % of a normal distribution
SINGULAR = 1e-8  # of the largest singular value: what is below it is round-off of slopes
PRECISION = 1e-3  # of the distance from ŷ to the end of an interval
SLIGHT = 1e-2  # entry of a direction, of its largest, that no bound need stop
FAR = 100.0  # standard deviations: what is further, or has no answer, is only known to be outside
POOR = 0.01  # p-value below which the model does not explain the measurements
SAME = 1e-3  # of χ²: minima that explain nothing, and are as bad, count as one
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
    minima: tuple[Optimum, ...]  # distinct ones that explain the measurements, the best first
    covariances: tuple[Floats, ...]  # at each of them
    starts: int
    met: int  # distinct minima that the starts led to

    @property
    def deviation(self) -> Floats:
        """Standard deviations (n_y,), roots of the diagonal, while bounds in ``held`` hold."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def verdict(self) -> str:
        """fitted, poor_fit, not_identified or unfinished."""
        if self.fit.end is End.STEPS:
            return "unfinished"
        if self.p_value is not None and self.p_value < POOR:
            return "poor_fit"
        return "not_identified" if len(self.unidentified) or len(self.minima) > 1 else "fitted"


def identify(
    response: Response,
    measured: MeasuredFrequencies,
    lower: Floats,
    upper: Floats,
    start: Floats,
    others: Iterable[Floats] = (),
    enough: Callable[[int, int], bool] = lambda starts, found: False,
) -> Identified:
    """The parameters between ``lower`` and ``upper`` (n_y,) that explain ``measured`` best.

    ``start`` (n_y,) is put within the bounds. The ``others`` are tried until so many starts that
    found so many distinct minima are ``enough``. A minimum explains the measurements where the
    chance of so large a χ² is at least `POOR`. Where a profile comes upon a better explanation than
    the best fit, the fit starts anew from there. Raises what ``response`` raises at the start.
    """
    from scipy.special import gammaincc  # loaded only where something is identified

    def appraise(y: Floats) -> Appraisal:
        hz, slopes = response(y)
        slopes = slopes / measured.deviation[:, None]
        nothing = np.zeros(0), np.zeros((0, len(y)))
        return Appraisal(measured.standardised(hz), slopes, *nothing)

    problem = DesignProblem(appraise, lower, upper)
    start = np.clip(start, lower, upper)
    initial_hz = response(start)[0]
    minima, starts = [minimise(problem, start)], 1
    room = max(len(initial_hz) - len(start), 1)

    def explains(found: Optimum) -> bool:
        return bool(gammaincc(room / 2.0, found.objective / 2.0) >= POOR)

    def joined(found: Optimum) -> list[Optimum]:
        """The minima with one more, if it is one; the better of two that are the same.

        A way joins these; of such as explain nothing, χ² is equal.
        """
        for k, known in enumerate(minima):
            most = max(known.objective, found.objective)
            same = abs(known.objective - found.objective) <= SAME * most
            if explains(known) and explains(found):
                same = has_way(problem, known.y, found.y, (MET, most + NOTICED**2), 1)
            if same:
                better = min(known, found, key=lambda each: each.objective)
                return [*minima[:k], better, *minima[k + 1 :]]
        return [*minima, found]

    for other in others:
        if enough(starts, len(minima)):
            break
        with suppress(EigassignError):
            minima = joined(minimise(problem, other))
            starts += 1
    for rounds in range(1, ROUNDS + 1):
        fit = min(minima, key=lambda found: found.objective)
        loose = len(_unidentified(problem, fit, _held(fit, len(start)))) > 0
        profile = _Profile(problem, fit, loose or len(minima) > 1)
        intervals = profile.intervals()
        if profile.best is fit or rounds == ROUNDS:
            break
        minima = joined(minimise(problem, profile.best.y))
    held = _held(fit, len(start))
    covariance, rank = _covariance(problem, fit, held)
    known = tuple(sorted(filter(explains, minima), key=lambda found: found.objective))
    hz, chi_squared = response(fit.y)[0], fit.objective
    degrees = len(hz) - rank
    return Identified(
        y=fit.y,
        fit=fit,
        residual=frozen(measured.standardised(hz)),
        initial_chi_squared=float(np.sum(measured.standardised(initial_hz) ** 2)),
        chi_squared=chi_squared,
        degrees=degrees,
        p_value=float(gammaincc(degrees / 2.0, chi_squared / 2.0)) if degrees > 0 else None,
        covariance=frozen(covariance),
        intervals=intervals,
        held=held,
        unidentified=frozen(_unidentified(problem, fit, held)),
        rounds=rounds,
        minima=known,
        covariances=tuple(_covariance(problem, m, _held(m, len(start)))[0] for m in known),
        starts=starts,
        met=len(minima),
    )


# --- Covariance, and what cannot be told


def _covariance(problem: DesignProblem, fit: Optimum, held: tuple[str, ...]) -> tuple[Floats, int]:
    """C (n_y, n_y) while the bounds in ``held`` hold, and the rank of J.

    In units of the bounds: J = U diag(s) Vᵀ, C = V diag(s)⁻² Vᵀ, without directions of round-off
    size, which make infinite the parameters that take part in them.
    """
    width = problem.upper - problem.lower
    free = np.flatnonzero([w > 0.0 and not side for w, side in zip(width, held, strict=True)])
    covariance = np.zeros((len(width), len(width)))
    if not len(free):
        return covariance, 0
    s, V = _directions(fit.seen.slopes[:, free] * width[free])
    known = s > SINGULAR * max(s.max(), NOTICED)
    scaled = (V[known].T / s[known] ** 2) @ V[known]
    lost = np.abs(V[~known]).max(axis=0, initial=0.0) > SINGULAR**0.5
    scaled[lost], scaled[:, lost] = np.nan, np.nan
    scaled[lost, lost] = np.inf
    covariance[np.ix_(free, free)] = scaled * np.outer(width[free], width[free])
    return covariance, int(known.sum())


def _directions(slopes: Floats) -> tuple[Floats, Floats]:
    """Return all n singular values, 0 where there are fewer rows, and Vᵀ (n, n)."""
    _, sizes, V = np.linalg.svd(slopes, full_matrices=len(slopes) < slopes.shape[1])
    s = np.zeros(slopes.shape[1])
    s[: len(sizes)] = sizes
    return s, V


def _unidentified(problem: DesignProblem, fit: Optimum, held: tuple[str, ...]) -> Floats:
    """Directions (k, n_y) that measurements do not notice, without parameters that bounds hold."""
    width = problem.upper - problem.lower
    inwards = np.array([{"lower": 1.0, "upper": -1.0, "": 0.0}[side] for side in held])
    slopes = fit.seen.slopes * width
    pull = 2.0 * fit.seen.residual @ slopes  # ∂χ²/∂y, 0 of free parameters
    moving = width > 0.0
    while moving.any():
        s, V = _directions(slopes[:, moving])
        basis = np.zeros((len(s), len(width)))
        basis[:, moving] = V
        basis = _apart(basis[s < NOTICED * np.abs(V).max(axis=1)], inwards != 0.0)
        stopped = None
        for k, v in enumerate(basis):
            along = np.where(np.abs(v) > SLIGHT, v * inwards, 0.0)
            if along.min() < 0.0 < along.max():
                stopped = int(np.where(along == 0.0, np.inf, np.abs(v)).argmin())
            elif np.abs(along * pull).sum() > NOTICED**2:
                stopped = int(np.abs(along * pull).argmax())
            elif along.min() < 0.0:
                basis[k] = -v
        if stopped is None:
            return basis * width
        moving[stopped] = False
    return np.zeros((0, len(width)))


def _held(fit: Optimum, n: int) -> tuple[str, ...]:
    sides = [""] * n
    for limit in fit.limits:
        if limit.kind == "bound" and limit.multiplier > 0.0:
            sides[limit.index] = "upper" if limit.upper else "lower"
    return tuple(sides)


def _apart(directions: Floats, first: Bools) -> Floats:
    """A basis (k, n) of the same space whose vectors share as few parameters as can be."""
    basis = directions.copy()
    for row in range(len(basis)):
        sizes = np.abs(basis[row:]).max(axis=0)
        preferred = np.where(first & (sizes > SLIGHT), sizes + 1.0 + sizes.max(), sizes)
        pivot = int(preferred.argmax())
        best = row + int(np.abs(basis[row:, pivot]).argmax())
        basis[[row, best]] = basis[[best, row]]
        basis[row] /= basis[row, pivot]
        others = np.arange(len(basis)) != row
        basis[others] -= np.outer(basis[others, pivot], basis[row])
    return np.asarray(basis / np.abs(basis).max(axis=1, initial=1e-300, keepdims=True))


# --- Profile likelihood


class _Profile:
    """χ² along each parameter, the others fitted anew; remembers the best fit that it meets."""

    def __init__(self, problem: DesignProblem, fit: Optimum, doubtful: bool) -> None:
        self.problem, self.fit, self.best, self.doubtful = problem, fit, fit, doubtful
        self.allowed = [fit]
        self.width = problem.upper - problem.lower

    def intervals(self) -> tuple[Interval, ...]:
        """Intervals from the last value below ŷ_j that χ² allows to the last above it."""
        sides = (self.problem.lower, self.problem.upper)
        ends: dict[tuple[int, int], tuple[float, bool]] = {}

        def passed(j: int, side: int) -> bool:
            """True where a fit that χ² allows lies beyond the end."""
            sign, end = 2 * side - 1, ends[j, side][0]
            margin = PRECISION * abs(end - float(self.fit.y[j]))
            return any(sign * (found.y[j] - end) > margin for found in self.allowed)

        for _ in range(ROUNDS):
            open_ends = [
                (j, side)
                for j in range(len(self.width))
                for side in range(2)
                if (j, side) not in ends or passed(j, side)
            ]
            if not open_ends:
                break
            for j, side in open_ends:
                ends[j, side] = self._end(j, float(sides[side][j]))
        pairs = [(ends[j, 0], ends[j, 1]) for j in range(len(self.width))]
        return tuple(Interval(low, high, a, b) for (low, a), (high, b) in pairs)

    def _end(self, j: int, bound: float) -> tuple[float, bool]:
        """The end of the interval towards ``bound``, and whether it is the bound.

        √(χ² − χ²(ŷ)) − 1.96 is nearly linear in y_j. Its zero is sought from the last value that is
        known to be inside, and behind it, for χ² may jump to another minimum there.
        """
        centre = float(self.fit.y[j])
        room = bound - centre
        if room == 0.0:
            return bound, True

        def share_of(found: Optimum) -> float:
            return float(found.y[j] - centre) / room

        near = max(self.allowed, key=share_of)
        inside, known = share_of(near), {share_of(near): self._over(near)}

        def over(share: float, everywhere: bool = False) -> float:
            if share not in known or everywhere:
                at, near = centre + share * room, max(self.allowed, key=share_of)
                found = self._refitted(j, bound if share == 1.0 else at, near, everywhere)
                known[share] = self._over(found)
            return known[share]

        share = min(1.0, max(self._first(j) / abs(room), 1.1 * inside))
        while share < 1.0 and over(share) <= 0.0:
            inside, share = share, min(1.0, 2.0 * share)
        if inside >= 1.0 or over(share) <= 0.0:
            return bound, True
        end = float(brentq(over, inside, share, xtol=PRECISION * share, rtol=PRECISION))
        # a fit that is allowed behind it is noted, and then the end sought anew
        over(min((1.0 + 2.0 * PRECISION) * end, 1.0), self.doubtful)
        return centre + end * room, False

    def _over(self, found: Optimum | None) -> float:
        rise = np.inf if found is None else max(found.objective - self.fit.objective, 0.0)
        return min(float(np.sqrt(rise)) - NOTICED, FAR)

    def _first(self, j: int) -> float:
        """The distance from ŷ_j to the interval's end by the linear model without bounds."""
        slopes = self.fit.seen.slopes * self.width
        others = np.delete(slopes, j, axis=1)
        rest = slopes[:, j] - others @ np.linalg.lstsq(others, slopes[:, j], rcond=SINGULAR)[0]
        return NOTICED * float(self.width[j] / max(float(np.linalg.norm(rest)), 1e-300))

    def _refitted(self, j: int, at: float, near: Optimum, everywhere: bool) -> Optimum | None:
        """The best fit with y_j ``at`` a value; None where the model has no answer there.

        It starts from ŷ; where χ² does not allow what that leads to, on the line from ŷ through
        ``near``, and ``everywhere`` from both corners of the bounds, too.
        """
        centre, best = self.fit.y, None
        along = near.y - centre
        line = centre + along * ((at - centre[j]) / along[j] if along[j] else 1.0)
        lower, upper = corners = self.problem.lower.copy(), self.problem.upper.copy()
        lower[j] = upper[j] = at
        held = self.problem._replace(lower=lower, upper=upper)
        for start in (centre, line, *(corners if everywhere else ())):
            if self._over(best) > 0.0:
                with suppress(EigassignError):
                    found = minimise(held, np.clip(start, lower, upper))
                    if best is None or found.objective < best.objective:
                        best = found
        if best is not None and self._over(best) <= 0.0:
            self.allowed.append(best)
            # another minimum, not round-off: lower by more than a thousandth of χ²
            if best.objective < self.best.objective - 1e-3 * max(self.fit.objective, 1.0):
                self.best = best
        return best
