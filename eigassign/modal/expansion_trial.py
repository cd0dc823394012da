"""One candidate of `expansion_choice` after the other: made, judged, and what is said of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from eigassign.mechanism.pencil import Pencil
from eigassign.modal.adaptive import AdaptiveReduction, shown
from eigassign.modal.convergence import radius_share
from eigassign.modal.expansion import Expansion, expand
from eigassign.modal.nearest import picked
from eigassign.modal.taylor_estimate import polynomial_error

Floats = NDArray[np.float64]
LOOKED_FAR = 32  # samples at which the radius of convergence is looked at
Found = tuple[tuple[Expansion, ...], float, Floats]  # with cluster gap and estimate


@dataclass
class Trial:
    """What all candidates are judged by, and what was said of them."""

    pencil: Pencil
    x: Floats
    accuracy: float
    modes: tuple[int, ...]
    linear_in_y: bool
    beside: AdaptiveReduction
    reasons: list[str]
    place: Callable[[int], str]
    least: float = np.inf  # of the largest errors of all candidates
    least_at: int = 0  # the sample where that is

    def expand(self, point: Floats, order: int, gap: float) -> Expansion:
        """About ``point`` (n_x,), modes closer than ``gap`` (relative in λ) together."""
        n_q = self.pencil.n_q
        return expand(
            self.pencil,
            point[:n_q],
            point[n_q:],
            self.modes,
            order,
            self.linear_in_y,
            cluster_gap=gap,
        )

    @cached_property
    def reduced_hz(self) -> Floats:
        """(n, n_modes) of the reduced model that all are compared with."""
        n_q = self.pencil.n_q
        return self.beside.reduced.frequencies(self.x[:, :n_q], self.x[:, n_q:])

    def values(self, part: Expansion) -> Floats:
        """(n, n_modes) in Hz at all samples."""
        n_q = self.pencil.n_q
        return part.frequencies(self.x[:, :n_q], self.x[:, n_q:])

    def errors(self, parts: Sequence[Expansion], values: Sequence[Floats]) -> Floats:
        """(n, n_modes), each sample by the nearest of ``parts``, with their ``values``."""
        hz = picked(parts, self.x[:, : self.pencil.n_q], values)
        return polynomial_error(hz, self.reduced_hz, self.beside.estimate)

    def share(self, part: Expansion, errors: Floats) -> float:
        """Of the radius of convergence, at the samples that are farthest off."""
        n_q = self.pencil.n_q
        far = self.x[np.argsort(-errors.max(axis=1), kind="stable")[:LOOKED_FAR]]
        return float(radius_share(part, far[:, :n_q], far[:, n_q:]).max())

    def note(self, what: str, worst: Floats, share: float = np.nan) -> None:
        """Keep what is said of a candidate of ``worst`` errors (n,)."""
        k = int(np.argmax(worst))
        if worst[k] <= self.least:
            self.least, self.least_at = float(worst[k]), k
        error = f"error at most {worst[k]:.1e}" if np.isfinite(worst[k]) else "no number"
        reach = f", {share:.2f} of the radius of convergence" if np.isfinite(share) else ""
        self.reasons.append(f"{what}: {error} ({self.place(k)}{reach})")

    @property
    def nearest(self) -> str:
        """How near all candidates came, in words."""
        at = f"at {self.place(self.least_at)}, (q, y) = {shown(self.x[self.least_at])}"
        if np.isfinite(self.least):
            return f"the nearest left {self.least:.1e} {at}"
        return f"none has a number that it vouches for {at}"


def size(parts: Sequence[Expansion]) -> int:
    """How many coefficients they have."""
    return sum(c.coefficients.size for part in parts for c in part.clusters)
