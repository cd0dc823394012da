"""The reduced model: Ritz on the Taylor vectors, with the exact affine pencil.

The pencil is projected on span{φ_γ : |γ| ≤ m} ⊕ [0; I]: K̂(x) = Σ θ_j(x) VᵀK_jV and likewise M̂.
Its eigenvalues share every derivative the Taylor vectors give, but stay accurate far beyond the
radius of convergence. Rigid-body motion is projected out exactly, as in the exact solve.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.errors import UsageError
from eigassign.modal.arguments import chunks, samples
from eigassign.modal.exact.condensation import condense_blocks
from eigassign.modal.reduced.error_estimate import ErrorTerms, relative_error
from eigassign.modal.reduced.ritz import SymmetricTerms, ritz_values, symmetric_terms
from eigassign.series.algebra import Samples
from eigassign.series.compiler import Program

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class ReducedModel:
    """Frequencies of ``modes`` from k + f unknowns; needs neither mesh nor mechanism. Immutable."""

    modes: tuple[int, ...]
    n_q: int
    n_y: int
    half_order: int
    points: Floats  # (n_points, n_x): the expansion points
    program: Program
    to_program: Floats
    shift: Floats
    stiffness_terms: Ints  # indices of θ with a stiffness term
    stiffness: Floats  # (n_terms, k, k)
    mass_terms: Ints
    mass: Floats  # (n_terms, k + f, k + f)
    certified: ErrorTerms | Callable[[], ErrorTerms]  # as they are, or how to make them

    @property
    def size(self) -> int:
        """Number k of basis vectors."""
        return int(self.stiffness.shape[1])

    @cached_property
    def error_terms(self) -> ErrorTerms:
        """What the error estimate needs, made when it is first asked for."""
        return self.certified() if callable(self.certified) else self.certified

    def frequencies(self, q: ArrayLike, y: ArrayLike) -> Floats:
        """(n_samples, n_modes) in Hz; ``error_estimate`` says how far to trust them.

        Raises UsageError outside the domain of a section or length, MechanismError where K̂ is not
        positive definite.
        """
        wanted = np.array(self.modes) - 1
        x = samples(q, y, self.n_q, self.n_y)
        parts = [ritz_values(*m[:2]) for m in self.matrices(x)]
        mu = np.concatenate(parts)[:, wanted]
        return np.asarray(1.0 / (2.0 * np.pi * np.sqrt(mu)))

    def error_estimate(self, q: ArrayLike, y: ArrayLike) -> Floats:
        """Estimate of the relative error in frequency, (n_samples, n_modes); no exact solve.

        Infinite where it is refused: a neighbouring mode is not represented, so that not even the
        identity of the mode is certain.
        """
        x = samples(q, y, self.n_q, self.n_y)
        largest = self.error_terms.residual.mass[0].size
        return np.concatenate([relative_error(self, part) for part in chunks(x, largest)])

    def matrices(self, x: Floats) -> Iterator[tuple[Floats, Floats, Floats]]:
        """K̂, M̂_c (n, k, k) and the coupling M̂_FF⁻¹ M̂_FE (n, f, k), some samples at a time."""
        for outer in chunks(x, 1):
            theta = self.theta(outer)
            for part in chunks(np.arange(len(outer)), self.mass[0].size):
                yield self.at(theta[:, part])

    def theta(self, x: Floats) -> Floats:
        """θ (n_theta, n) at samples x (n, n_x)."""
        z = self.to_program @ x.T + self.shift[:, None]
        theta = np.vstack([np.ones((1, len(x))), self.program.run(Samples(), z)])
        if not np.isfinite(theta).all():
            raise UsageError("q or y is outside the domain of a section or length")
        return theta

    def at(self, theta: Floats) -> tuple[Floats, Floats, Floats]:
        """K̂, M̂_c (n, k, k) and the coupling (n, f, k) at θ (n_theta, n)."""
        stiff, heavy = self._terms
        E, F = slice(0, self.size), slice(self.size, None)
        K, M = stiff(theta), heavy(theta)
        blocks = [heavy.block(M, rows, columns) for rows, columns in ((E, E), (F, E), (F, F))]
        coupling, M_c = condense_blocks(*blocks)
        return stiff.block(K, E, E), M_c, coupling

    def uncondensed(self, theta: Floats) -> tuple[Floats, Floats]:
        """K̂ (n, k, k) and M̂ (n, k + f, k + f)."""
        stiff, heavy = self._terms
        every = slice(None)
        return stiff.block(stiff(theta), every, every), heavy.block(heavy(theta), every, every)

    @cached_property
    def _terms(self) -> tuple[SymmetricTerms, SymmetricTerms]:
        """K̂'s and M̂'s terms."""
        return (
            symmetric_terms(self.stiffness_terms, self.stiffness),
            symmetric_terms(self.mass_terms, self.mass),
        )
