"""Members to add to a lower set, chosen by what their coefficients are predicted to be."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from eigassign.series.interpolant import Interpolant
from eigassign.series.margin import Border, rows_of

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]


class Adding:
    """What is added to the members of ``border``, which grows with it, and what might be next."""

    def __init__(self, border: Border, found: Interpolant) -> None:
        self.border, self.rates, self.sizes = border, found.rates[None], found.sizes
        self.keys: list[int] = []
        self.expected = 0.0  # Σ |c_γ| of what is added
        self.next: dict[int, float] = {}  # |c_γ| by key
        self._fresh = list(border.next)  # of unknown size as yet

    def take(self, keys: Sequence[int]) -> None:
        """Add some of what is next, predecessors first."""
        taken = [self.next.pop(key) for key in keys]
        self.keys.extend(keys)
        self.expected += sum(taken)
        self.sizes = np.append(self.sizes, taken)
        self._fresh += self.border.grow(keys)

    def ranked(self) -> list[int]:
        """What is next, the largest first."""
        self._predict()
        return sorted(self.next, key=lambda key: (-self.next[key], key))

    @property
    def rows(self) -> Ints:
        """Multi-indices (n, d) of what is added."""
        return rows_of(np.array(self.keys, dtype=np.intp), len(self.border.tops))

    def _predict(self) -> None:
        inside = [key for key in self._fresh if key not in self.border.outside]
        self._fresh = []
        if inside:
            sizes = self.border.margin(inside).predicted(self.sizes[None], self.rates)[0]
            self.next.update(zip(inside, sizes.tolist(), strict=True))
