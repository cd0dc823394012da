"""Ordinary Kriging: a Gaussian process, one length scale a variable, by maximum likelihood.

    R_ij = exp(−½ Σ_k ((u_ik − u_jk)/ℓ_k)²) + ν δ_ij,   f̂(u) = μ + r(u)ᵀ R⁻¹ (f − μ)

with μ and σ² in closed form and ℓ from maximising the concentrated likelihood
−½ (n log σ² + log |R|) over log ℓ, with its analytic gradient, from several starts. The nugget ν is
the least that R needs to be factored.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve
from scipy.optimize import minimize
from scipy.spatial.distance import cdist

from eigassign.errors import AccuracyError
from eigassign.study.surrogates_lines import Lines

Floats = NDArray[np.float64]
NUGGETS = tuple(10.0**k for k in range(-13, -5))
LENGTHS = (0.03, 30.0)  # of length scales, on the unit box
CHUNK = 512  # points predicted at once: the correlations (512, n) then stay in the cache


@dataclass(frozen=True, eq=False)
class Kriging:
    """A fitted process for one output."""

    u: Floats
    lengths: Floats
    nugget: float
    mean: float
    variance: float
    weights: Floats  # R⁻¹ (f − μ)
    factor: Floats  # lower Cholesky factor of R

    def __call__(self, at: Floats) -> Floats:
        """f̂ (k,) at points (k, d)."""
        parts = [self._correlation(at[i : i + CHUNK]) for i in range(0, len(at), CHUNK)]
        return self.mean + np.concatenate([r @ self.weights for r in parts])

    def deviation(self, at: Floats) -> Floats:
        """Standard deviation (k,) of the prediction."""
        r = self._correlation(at)
        half = np.linalg.solve(self.factor, r.T)
        left = np.maximum(1.0 - np.square(half).sum(axis=0), 0.0)
        return np.asarray(np.sqrt(self.variance * left))

    def _correlation(self, at: Floats) -> Floats:
        a, b = at / self.lengths, self.u / self.lengths
        squares = np.square(a).sum(1)[:, None] + np.square(b).sum(1) - 2.0 * a @ b.T
        return np.asarray(np.exp(-0.5 * np.maximum(squares, 0.0)))


def kriging_lines(fitted: Sequence[Kriging]) -> Lines:
    """The correlation is a product over the variables, so that the place stands apart."""
    return Lines(
        lambda place: np.array([_places(one, place) for one in fitted]),
        lambda design: np.array([_designs(one, design) for one in fitted]),
    )


def _places(one: Kriging, place: Floats) -> Floats:
    """Weights times correlations in u_0, and the mean, (n + 1, n_t)."""
    off = (place - one.u[:, :1]) / one.lengths[0]
    return np.vstack([one.weights[:, None] * np.exp(-0.5 * off**2), np.full(len(place), one.mean)])


def _designs(one: Kriging, design: Floats) -> Floats:
    """Correlations in the other variables, and 1, (n_designs, n + 1)."""
    squares = cdist(design / one.lengths[1:], one.u[:, 1:] / one.lengths[1:], "sqeuclidean")
    return np.hstack([np.exp(-0.5 * squares), np.ones((len(design), 1))])


def fit_kriging(u: Floats, f: Floats, starts: int = 2) -> Kriging:
    """Fit u (n, d), f (n,). Raises AccuracyError where no nugget makes R definite."""
    squares = np.square(u[:, None, :] - u[None, :, :])
    size = float(np.std(f)) or 1.0
    scaled = (f - f.mean()) / size
    best = min(
        (_ascend(squares, scaled, length) for length in np.geomspace(0.4, 2.0, starts)),
        key=lambda found: found[0],
    )
    state = _factored(squares, scaled, best[1])
    return Kriging(
        u,
        np.exp(best[1]),
        state.nugget,
        f.mean() + size * state.mean,
        size**2 * state.variance,
        size * state.weights,
        state.factor,
    )


def _ascend(squares: Floats, f: Floats, length: float) -> tuple[float, Floats]:
    """Least negative log likelihood and log ℓ from one start."""
    d = squares.shape[2]
    limits = [(float(np.log(LENGTHS[0])), float(np.log(LENGTHS[1])))] * d
    start: Floats = np.full(d, float(np.log(length)))

    def negative(log_l: Floats) -> tuple[float, Floats]:
        return _likelihood(squares, f, log_l)

    found = minimize(
        negative,
        start,
        jac=True,
        method="L-BFGS-B",
        bounds=limits,
        options={"maxiter": 40},
    )
    return float(found.fun), np.asarray(found.x)


@dataclass(frozen=True, eq=False)
class _State:
    R: Floats
    factor: Floats
    nugget: float
    mean: float
    variance: float
    weights: Floats


def _factored(squares: Floats, f: Floats, log_l: Floats) -> _State:
    R = np.exp(-0.5 * squares @ np.exp(-2.0 * log_l))
    factor, nugget = _cholesky(R)
    ones = cho_solve((factor, True), np.ones(len(f)))
    mean = float(ones @ f / ones.sum())
    weights = cho_solve((factor, True), f - mean)
    variance = max(float((f - mean) @ weights) / len(f), 1e-300)
    return _State(R, factor, nugget, mean, variance, weights)


def _cholesky(R: Floats) -> tuple[Floats, float]:
    for nugget in NUGGETS:
        try:
            return np.asarray(
                np.linalg.cholesky(R + nugget * np.eye(len(R))), dtype=np.float64
            ), nugget
        except np.linalg.LinAlgError:
            continue
    raise AccuracyError("Kriging: the correlation matrix is not definite")


def _likelihood(squares: Floats, f: Floats, log_l: Floats) -> tuple[float, Floats]:
    """½ (n log σ² + log |R|) and its gradient over log ℓ."""
    s = _factored(squares, f, log_l)
    value = 0.5 * len(f) * np.log(s.variance) + np.log(np.diag(s.factor)).sum()
    inverse = cho_solve((s.factor, True), np.eye(len(f)))
    W = (inverse - np.outer(s.weights, s.weights) / s.variance) * s.R
    slope = 0.5 * np.tensordot(W, squares, axes=2) * np.exp(-2.0 * log_l)
    return float(value), slope
