"""The interface of all that answers frequencies in place of exact solves."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


class Surrogate(Protocol):
    """Frequencies of ``modes`` without an exact solve.

    Series of λ or of 1/λ, in full or linearised, about one point or several (`expansion`), and
    reduced models (`reduced`). Exact solves (`model`) answer in the same words, but the lowest
    ``count`` modes. q is (n, n_q) or (n_q,) in rad or m, y likewise in SI units.
    """

    @property
    def modes(self) -> tuple[int, ...]:
        """The modes, in the order of the columns."""

    def frequencies(self, q: ArrayLike, y: ArrayLike) -> Floats:
        """(n, n_modes) in Hz."""

    def slopes(self, q: ArrayLike, y: ArrayLike) -> tuple[Floats, Floats]:
        """λ (n, n_modes) in rad²/s² and ∂λ/∂x (n, n_modes, n_x), x = (q, y)."""
