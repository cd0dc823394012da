"""Where two neighbouring modes come close along a path: do they cross, or veer, and how closely."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.mechanism.pencil import Pencil
from eigassign.modal.condensation import Modes
from eigassign.modal.exact import eigenvalues

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
NEAR = 0.15  # relative distance in frequency above which two modes do not meet
EXCHANGED = 0.1  # share of identity given away from which a veering is reported
CROSSES = 1e-9  # least relative distance in frequency that is taken for zero
SECTIONS = 60  # of the golden-section search for the least distance


@dataclass(frozen=True)
class Encounter:
    """Modes ``lower`` and ``lower + 1`` (by order) meet at path position ``sample``.

    ``gap`` is their least relative distance in frequency; ``swapped`` says that the tracked curves
    change places; ``exchanged`` is the share of their shapes that changed places instead (0 to 1).
    """

    sample: float
    lower: int
    gap: float
    swapped: bool
    exchanged: float

    @property
    def line(self) -> str:
        """One sentence for logs and reports."""
        pair = f"modes {self.lower} and {self.lower + 1}"
        where = f"at sample {self.sample:.2f}"
        if self.gap < CROSSES:
            return f"{pair} cross {where}: their order swaps, each curve keeps its shape"
        if self.swapped:
            return (
                f"{pair} veer {where} with a gap of {self.gap:.1e}, closer than the samples "
                "resolve: followed as a crossing"
            )
        return (
            f"{pair} veer {where} with a gap of {self.gap:.1e}: each stays on its branch and "
            f"{self.exchanged:.0%} of their shapes change places"
        )


def find_encounters(
    pencil: Pencil, x: Floats, found: Modes, ordinals: Ints
) -> tuple[Encounter, ...]:
    """All encounters of tracked modes (``ordinals`` (n, m), 0-based) with their neighbours."""
    if len(x) < 2:
        return ()
    met: list[Encounter] = []
    f = np.sqrt(found.lam)
    for lower in range(f.shape[1] - 1):
        tracked = ((ordinals == lower) | (ordinals == lower + 1)).any(axis=1)
        gap = (f[:, lower + 1] - f[:, lower]) / f[:, lower + 1]
        for k in _swaps(ordinals, lower):
            at, least = _closest(pencil, x, k - 1, k, lower)
            met.append(Encounter(at, lower + 1, least, True, 0.0))
        for k in _minima(gap, tracked):
            if not any(e.lower == lower + 1 and abs(e.sample - k) <= 1.0 for e in met):
                met += _veering(pencil, x, found, gap, k, lower)
    return tuple(sorted(met, key=lambda e: (e.sample, e.lower)))


def _swaps(ordinals: Ints, lower: int) -> list[int]:
    """Samples k at which a curve has moved between ``lower`` and ``lower + 1`` since k − 1."""
    before, after = ordinals[:-1], ordinals[1:]
    up = (before <= lower) & (after > lower)
    down = (before > lower) & (after <= lower)
    return (np.flatnonzero((up | down).any(axis=1)) + 1).tolist()


def _minima(gap: Floats, tracked: NDArray[np.bool_]) -> list[int]:
    """Interior samples where two modes are nearest, near enough, and one of them is tracked."""
    inner = (gap[1:-1] <= gap[:-2]) & (gap[1:-1] < gap[2:]) & (gap[1:-1] < NEAR) & tracked[1:-1]
    return (np.flatnonzero(inner) + 1).tolist()


def _veering(
    pencil: Pencil, x: Floats, found: Modes, gap: Floats, k: int, lower: int
) -> list[Encounter]:
    at, least = _closest(pencil, x, k - 1, k + 1, lower)
    far = np.flatnonzero(gap > 3.0 * gap[k])
    left = int(far[far < k].max(initial=0))
    right = int(far[far > k].min(initial=len(gap) - 1))
    pair = slice(lower, lower + 2)
    M = pencil.sparse(pencil.mass @ pencil.theta(x[right : right + 1])[:, 0])
    squares = (found.phi[left][:, pair].T @ (M @ found.phi[right][:, pair])) ** 2
    exchanged = float((squares[0, 1] + squares[1, 0]) / max(squares.sum(), 1e-300))
    if exchanged < EXCHANGED:
        return []
    return [Encounter(at, lower + 1, least, False, exchanged)]


def _closest(pencil: Pencil, x: Floats, left: int, right: int, lower: int) -> tuple[float, float]:
    """Path position and value of the least relative distance in frequency between two samples."""

    def distance(t: float) -> float:
        k = min(int(t), len(x) - 2)
        point = x[k] + (t - k) * (x[k + 1] - x[k])
        lam = eigenvalues(pencil, point[None], lower + 2)[0]
        below, above = np.sqrt(lam[lower : lower + 2])
        return float((above - below) / above)

    a, b = float(left), float(right)
    ratio = (np.sqrt(5.0) - 1.0) / 2.0
    c, d = b - ratio * (b - a), a + ratio * (b - a)
    at_c, at_d = distance(c), distance(d)
    for _ in range(SECTIONS):
        if at_c < at_d:
            b, d, at_d = d, c, at_c
            c = b - ratio * (b - a)
            at_c = distance(c)
        else:
            a, c, at_c = c, d, at_d
            d = a + ratio * (b - a)
            at_d = distance(d)
    return (c, at_c) if at_c < at_d else (d, at_d)
