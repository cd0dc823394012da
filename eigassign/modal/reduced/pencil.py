"""The pencil projected on a basis V, and its Ritz pairs.

With [u; q̇] ≈ [V c; I_F] on the elastic unknowns E and the free coordinates F,

    K̂(x) = Σ_j θ_j(x) VᵀK_jV,   M̂(x) = Σ_j θ_j(x) [V 0; 0 I]ᵀ M_j [V 0; 0 I] ,

rigid-body motion is projected out exactly, M̂_c = M̂_EE − M̂_EF M̂_FF⁻¹ M̂_FE, and the Ritz pairs are
those of the inverse form M̂_c z = μ K̂ z: with K̂ = L Lᵀ those of L⁻¹ M̂_c L⁻ᵀ.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import UsageError
from eigassign.mechanism.assembly.pencil import theta_at
from eigassign.modal.arguments import chunks
from eigassign.modal.exact.condensation import condense_blocks
from eigassign.modal.exact.dense import inverse_factor
from eigassign.series.compiler import Program

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class ReducedPencil:
    """K̂ and M̂ as functions of x; needs neither mesh nor mechanism. Immutable."""

    n_q: int
    n_loads: int  # of q: its last entries
    n_y: int
    points: Floats  # (n_points, n_x): the expansion points
    program: Program
    to_program: Floats
    shift: Floats
    stiffness_terms: Ints  # indices of θ with a stiffness term
    stiffness: Floats  # (n_terms, k, k)
    mass_terms: Ints
    mass: Floats  # (n_terms, k + f, k + f)

    @property
    def size(self) -> int:
        """Number k of basis vectors."""
        return int(self.stiffness.shape[1])

    def theta(self, x: Floats) -> Floats:
        """θ (n_theta, n) at samples x (n, n_x)."""
        theta = theta_at(self.program, self.to_program @ x.T + self.shift[:, None])
        if not np.isfinite(theta).all():
            raise UsageError("q or y is outside the domain of a section or length")
        return theta

    def at(self, theta: Floats) -> tuple[Floats, Floats, Floats]:
        """K̂, M̂_c (n, k, k) and the coupling M̂_FF⁻¹ M̂_FE (n, f, k) at θ (n_theta, n)."""
        stiff, heavy = self.terms
        E, F = slice(0, self.size), slice(self.size, None)
        K, M = stiff(theta), heavy(theta)
        blocks = [heavy.block(M, rows, columns) for rows, columns in ((E, E), (F, E), (F, F))]
        coupling, M_c = condense_blocks(*blocks)
        return stiff.block(K, E, E), M_c, coupling

    def matrices(self, x: Floats) -> Iterator[tuple[Floats, Floats, Floats]]:
        """The same at x (n, n_x), some samples at a time."""
        for outer in chunks(x, 1):
            theta = self.theta(outer)
            for part in chunks(np.arange(len(outer)), self.mass[0].size):
                yield self.at(theta[:, part])

    def magnitudes(self, theta: Floats) -> tuple[Floats, Floats]:
        """Σ_j |θ_j K̂_j| (n, k, k) and Σ_j |θ_j M̂_j| (n, k + f, k + f): what cancels in the sums."""
        stiff, heavy = self.terms
        every = slice(None)
        size = np.abs(theta)
        return (
            stiff.block(size[stiff.terms].T @ np.abs(stiff.triangles), every, every),
            heavy.block(size[heavy.terms].T @ np.abs(heavy.triangles), every, every),
        )

    @cached_property
    def terms(self) -> tuple[SymmetricTerms, SymmetricTerms]:
        """K̂'s and M̂'s terms."""
        return (
            symmetric_terms(self.stiffness_terms, self.stiffness),
            symmetric_terms(self.mass_terms, self.mass),
        )


@dataclass(frozen=True, eq=False)
class SymmetricTerms:
    """Sums Σ θ_j A_j of small symmetric matrices from their lower triangles: half the work.

    ``triangles`` (n_terms, k(k + 1)/2) are those of A_j; ``place`` (k, k) is where in them each
    entry is.
    """

    terms: Ints  # indices j of θ
    triangles: Floats
    place: Ints

    def __call__(self, theta: Floats) -> Floats:
        """Triangles (n, k(k + 1)/2) of the sums at θ (n_theta, n)."""
        return np.asarray(theta[self.terms].T @ self.triangles)

    def chosen(self, terms: NDArray[np.bool_]) -> SymmetricTerms:
        """The marked terms alone."""
        return SymmetricTerms(self.terms[terms], self.triangles[terms], self.place)

    def forms(self, phi: Floats, rates: Floats) -> Floats:
        """Σ_j (φᵀA_jφ) r_ij (n, m, n_x) of modes φ (n, k, m) with ``rates`` r (n_x, n_theta, n)."""
        i, j = np.tril_indices(len(self.place))
        twice = np.where(i == j, 1.0, 2.0)[None, :, None]
        products = phi[:, i] * phi[:, j] * twice
        each = np.einsum("npm,tp->nmt", products, self.triangles, optimize=True)
        return np.asarray(np.einsum("nmt,xtn->nmx", each, rates[:, self.terms], optimize=True))

    def block(self, triangles: Floats, rows: slice, columns: slice) -> Floats:
        """Rows and columns of whole matrices, (n, …, …), from their triangles."""
        place = self.place[rows, columns]
        return triangles.take(place.ravel(), axis=1).reshape(len(triangles), *place.shape)


def symmetric_terms(terms: Ints, matrices: Floats) -> SymmetricTerms:
    """Terms from whole matrices (n_terms, k, k), of which the lower triangle is read."""
    k = matrices.shape[1]
    i, j = np.tril_indices(k)
    place = np.empty((k, k), dtype=np.intp)
    place[i, j] = place[j, i] = np.arange(len(i))
    return SymmetricTerms(terms, np.ascontiguousarray(matrices[:, i, j]), place)


def ritz_values(K: Floats, M_c: Floats) -> Floats:
    """μ descending (n, k); of K (n, k, k) only the lower triangle is read."""
    return np.asarray(np.linalg.eigvalsh(_standard(K, M_c)[0])[:, ::-1])


def ritz_pairs(K: Floats, M_c: Floats) -> tuple[Floats, Floats]:
    """μ descending (n, k) and z (n, k, k) with zᵀKz = 1."""
    A, inverse = _standard(K, M_c)
    mu, v = np.linalg.eigh(A)
    return mu[:, ::-1], (np.swapaxes(inverse, 1, 2) @ v)[:, :, ::-1]


def _standard(K: Floats, M_c: Floats) -> tuple[Floats, Floats]:
    """L⁻¹ M_c L⁻ᵀ and L⁻¹; MechanismError where K is not positive definite."""
    inverse = inverse_factor(K)
    return inverse @ M_c @ np.swapaxes(inverse, 1, 2), inverse
