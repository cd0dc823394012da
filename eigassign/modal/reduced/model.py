"""The reduced model: Ritz on the Taylor vectors, with the exact affine pencil.

The pencil is projected on span{φ_γ : |γ| ≤ m} ⊕ [0; I]. Its eigenvalues share every derivative that
the Taylor vectors give, but stay accurate far beyond the radius of convergence.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.brief import counted, of_modes
from eigassign.errors import EigassignError
from eigassign.mechanism.assembly.pencil import theta_slopes
from eigassign.modal.arguments import chunks, samples
from eigassign.modal.reduced.error_estimate import (
    REFUSED,
    ErrorTerms,
    error_beside,
    relative_error,
)
from eigassign.modal.reduced.pencil import ReducedPencil, ritz_pairs, ritz_values

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ReducedModel(ReducedPencil):
    """Frequencies of ``modes`` from k + f unknowns; needs neither mesh nor mechanism. Immutable.

        K̂(q, y) = Vᵀ K(q, y) V = Σ_j θ_j(q, y) Vᵀ K_j V,  M̂ likewise, V of Taylor vectors

    ``frequencies(q, y)`` (n, n_modes) in Hz, ``error_estimate(q, y)`` relative and infinite where
    it is refused; k is ``size``, ``points`` (n_points, n_q + n_y) are what V was expanded about.
    """

    modes: tuple[int, ...]
    half_order: int
    certified: Callable[[], ErrorTerms]  # how to make them
    widened: Callable[[], ReducedModel | None] | None  # on more vectors

    def __repr__(self) -> str:
        return (
            f"<ReducedModel of {of_modes(self.modes)}: {self.size} elastic unknowns, Taylor "
            f"vectors to order {self.half_order} at {counted(len(self.points), 'point')}; "
            f"{self.n_q} q, {self.n_y} y>"
        )

    @cached_property
    def error_terms(self) -> ErrorTerms:
        """The arrays of the error estimate, made when they are first asked for."""
        return self.certified()

    @cached_property
    def wider(self) -> ReducedModel | None:
        """The model with more modes that answers are compared with where they are refused.

        Beside a basis that holds those modes, fewer can have come down unseen.
        """
        return self.widened() if self.widened else None

    def frequencies(self, q: ArrayLike, y: ArrayLike) -> Floats:
        """(n_samples, n_modes) in Hz; ``error_estimate`` says how far to trust them.

        Raises UsageError outside the domain of a section or length, MechanismError where K̂ is not
        positive definite.
        """
        wanted = np.array(self.modes) - 1
        x = samples(q, y, self.n_q, self.n_y)
        parts = [ritz_values(K, M_c) for K, M_c, _ in self.matrices(x)]
        mu = np.concatenate(parts)[:, wanted]
        return np.asarray(1.0 / (2.0 * np.pi * np.sqrt(mu)))

    def slopes(
        self, q: ArrayLike, y: ArrayLike, wanted: ArrayLike | None = None
    ) -> tuple[Floats, Floats]:
        """λ (n_samples, n_modes) in rad²/s² and ∂λ/∂x (n_samples, n_modes, n_x), x = (q, y).

        ∂λ/∂x_i = Σ_j (φᵀK̂_jφ − λ φᵀM̂_jφ) ∂θ_j/∂x_i, where ``wanted`` (n_x,) is not 0, everywhere
        without it; else they are 0. Raises what `frequencies` raises.
        """
        x, columns = samples(q, y, self.n_q, self.n_y), np.array(self.modes) - 1
        along = np.flatnonzero(np.ones(x.shape[1]) if wanted is None else wanted)
        rates = theta_slopes(self.program, self.to_program, self.shift, x, along)
        moving = np.abs(rates).max(axis=(0, 2), initial=0.0) > 0.0
        stiff, heavy = (terms.chosen(moving[terms.terms]) for terms in self.terms)
        theta = self.theta(x)
        lam, slopes = [], []
        for part in chunks(np.arange(len(x)), self.mass[0].size):
            K, M_c, coupling = self.at(theta[:, part])
            mu, z = (a[..., columns] for a in ritz_pairs(K, M_c))
            phi = z / np.sqrt(mu)[:, None, :]
            whole = np.concatenate([phi, -coupling @ phi], axis=1)
            forms = stiff.forms(phi, rates[:, :, part])
            forms = forms - heavy.forms(whole, rates[:, :, part]) / mu[..., None]
            lam.append(1.0 / mu)
            whole_slopes = np.zeros((*forms.shape[:2], x.shape[1]))
            whole_slopes[..., along] = forms
            slopes.append(whole_slopes)
        return np.concatenate(lam), np.concatenate(slopes)

    def error_estimate(self, q: ArrayLike, y: ArrayLike) -> Floats:
        """Estimate of the relative error in frequency, (n_samples, n_modes); no exact solve.

        Infinite where it is refused: a neighbouring mode is not represented, so that not even the
        identity of the mode is certain. Before that, answers are compared with those of the
        `wider` model.
        """
        x, terms = samples(q, y, self.n_q, self.n_y), self.error_terms
        wanted = np.array(self.modes) - 1
        parts = chunks(x, terms.residual.mass[0].size)
        error = np.concatenate([relative_error(self, terms, part)[:, wanted] for part in parts])
        refused = ~np.isfinite(error).all(axis=1)
        if refused.any() and self.wider is not None:
            q, y = x[refused, : self.n_q], x[refused, self.n_q :]
            with suppress(EigassignError):  # of more vectors, which may not be evaluated there
                better, estimate = self.wider.frequencies(q, y), self.wider.error_estimate(q, y)
                beside = error_beside(self.frequencies(q, y), better, estimate)
                beside[beside > REFUSED] = np.inf
                error[refused] = np.minimum(error[refused], beside)
        return error
