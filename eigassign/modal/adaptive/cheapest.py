"""The one loop of ``auto``: of what a ladder tries, the cheapest that is within the accuracy.

A ladder yields its rungs from the cheapest on, each made and judged when it is asked for, and
raises AccuracyError where there are no more.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Rung:
    """A choice: its error, relative in Hz, and all that was tried so far in words."""

    error: NDArray[np.float64]  # (n, n_modes) at the samples, or (n_modes,) the largest of them
    reasons: tuple[str, ...]
    looks: int = 0  # at samples, and coefficients, that it took to come so far, where counted

    @property
    def worst(self) -> float:
        """The largest error."""
        return float(self.error.max())


R = TypeVar("R", bound=Rung)


def cheapest(ladder: Iterable[R], accuracy: float) -> R:
    """The first rung within the accuracy; raises AccuracyError where there is none."""
    return next(rung for rung in ladder if rung.worst <= accuracy)
