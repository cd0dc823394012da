"""What is linear in the design: the paper's model of λ along the trajectory, and limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from eigassign.assignment.targets import Floats, finite, limit, same_length
from eigassign.errors import UsageError


@dataclass(frozen=True)
class LinearModel:
    """λ along the trajectory, λ = l0 + l @ (y − y0).

    ``l0`` (n_t,) in rad²/s²; ``l`` (n_t, n_y) in rad²/s² per SI unit of y.
    """

    l0: Floats
    l: Floats  # noqa: E741 - the paper's symbol

    def __post_init__(self) -> None:
        object.__setattr__(self, "l0", finite("l0", self.l0, 1))
        object.__setattr__(self, "l", finite("l", self.l, 2))
        same_length("l", self.l.shape[0], self.l0.size, "samples in l0")

    def __call__(self, dy: Floats) -> Floats:
        """λ (n_t,) at y = y0 + dy."""
        return np.asarray(self.l0 + self.l @ dy)


@dataclass(frozen=True)
class LinearConstraint:
    """lower ≤ coefficients @ y ≤ upper, on y itself (not on y − y0); (n_y,), SI units."""

    name: str
    coefficients: Floats
    lower: float = -np.inf
    upper: float = np.inf

    def __post_init__(self) -> None:
        what = f"constraint {self.name!r}"
        object.__setattr__(self, "coefficients", finite(what, self.coefficients, 1))
        low, high = limit(what, self.lower, 0), limit(what, self.upper, 0)
        if low > high or low == np.inf or high == -np.inf:
            raise UsageError(f"{what}: no number is between {self.lower} and {self.upper}")

    def __call__(self, y: Floats) -> tuple[float, Floats]:
        """Its value at a design y (n_y,), and the slopes (n_y,)."""
        return float(self.coefficients @ y), self.coefficients
