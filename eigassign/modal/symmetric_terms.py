"""Sums Σ θ_j A_j of small symmetric matrices, formed from their lower triangles: half the work."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class SymmetricTerms:
    """The lower triangles (n_terms, k(k + 1)/2) of A_j, and where in them each entry (k, k) is."""

    terms: Ints  # indices j of θ
    triangles: Floats
    place: Ints

    def __call__(self, theta: Floats) -> Floats:
        """Triangles (n, k(k + 1)/2) of the sums at θ (n_theta, n)."""
        return np.asarray(theta[self.terms].T @ self.triangles)

    def block(self, triangles: Floats, rows: slice, columns: slice) -> Floats:
        """Rows and columns of whole matrices, (n, …, …), from their triangles."""
        place = self.place[rows, columns]
        return triangles.take(place.ravel(), axis=1).reshape(len(triangles), *place.shape)


def symmetric_terms(terms: Ints, matrices: Floats) -> SymmetricTerms:
    """From whole matrices (n_terms, k, k), of which the lower triangle is read."""
    k = matrices.shape[1]
    i, j = np.tril_indices(k)
    place = np.empty((k, k), dtype=np.intp)
    place[i, j] = place[j, i] = np.arange(len(i))
    return SymmetricTerms(terms, np.ascontiguousarray(matrices[:, i, j]), place)
