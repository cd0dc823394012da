"""Two modes that meet: where their frequencies are the same, each alone has a kink.

By size, mode i is the smaller of two crossing branches, then the larger: its slope jumps. The small
matrix of both modes φ_i, φ_j stays smooth; to first order in a change δ of the design it is

    [[f_i + f_i'δ,  c·δ        ],         c = φ_iᵀ (∂K/∂y − ½(λ_i + λ_j) ∂M/∂y) φ_j / 4π²(f_i + f_j)
     [c·δ,          f_j + f_j'δ]],

the square root of Λ(x) in Hz (off its diagonal, √Λ changes by Λ' / (√λ_i + √λ_j)), and the modes
are its eigenvalues. What is asked of one mode is a row, affine in its frequency; with the
neighbour's it makes the same matrix in units of the row, which is its larger or smaller eigenvalue.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.program import Floats

MEET = 1e-6  # relative distance in Hz below which two modes are at a kink
TURNED = 0.8  # cosine of twice the angle from where a mode is no longer what it was
ANGLES = np.pi / 4.0 * np.arange(1, 8)  # of the mixtures of two modes that optimality looks at


@dataclass(frozen=True)
class NeighbourPairs:
    """Rows whose mode may meet a neighbour, p of them; the matrix of each is

        [[value + slopes·δ,  mixed·δ          ],
         [mixed·δ,           other + others·δ ]]

    with the row's own value and slopes.
    """

    row: NDArray[np.intp]  # (p,), of the residuals, then of the excesses
    other: Floats  # (p,), the row with the neighbour's frequency
    others: Floats  # (p, n_y), its slopes
    mixed: Floats  # (p, n_y)
    gap: Floats  # (p,), relative distance of both frequencies
    larger: NDArray[np.bool_]  # (p,), whether the row is the larger eigenvalue

    @classmethod
    def none(cls, n: int) -> NeighbourPairs:
        """No pairs, of n parameters."""
        rows, slopes = np.zeros(0), np.zeros((0, n))
        return cls(rows.astype(np.intp), rows, slopes, slopes, rows, rows.astype(bool))

    def scaled(self, free: list[int], width: Floats) -> NeighbourPairs:
        """The same with slopes in units ``width`` of the design parameters ``free``."""
        return replace(self, others=self.others[:, free] * width, mixed=self.mixed[:, free] * width)

    def chosen(self, mask: NDArray[np.bool_]) -> NeighbourPairs:
        """The pairs of a mask."""
        return NeighbourPairs(*(getattr(self, name)[mask] for name in self.__dataclass_fields__))

    def along(
        self, own: Floats, slopes: Floats, d: Floats
    ) -> tuple[Floats, Floats, NDArray[np.bool_]]:
        """The rows' eigenvalues (p,) at a change d, their slopes, and whether the mode has turned.

        ``own`` (p,) are the rows at d, with their ``slopes`` (p, n).
        """
        other = self.other + self.others @ d
        half, off, sign = 0.5 * (own - other), self.mixed @ d, np.where(self.larger, 1.0, -1.0)
        size = np.hypot(half, off)
        cos = np.divide(sign * half, size, out=np.ones_like(size), where=size > 0.0)
        sin = np.divide(sign * off, size, out=np.zeros_like(size), where=size > 0.0)
        return 0.5 * (own + other) + sign * size, self._mixture(slopes, cos, sin), cos < TURNED

    def branches(self, slopes: Floats) -> Floats:
        """Slopes (7 p, n) of mixtures of both modes where they meet, beside the rows' own (p, n).

        Any convex combination of them and the row's own is a generalised slope of the row (Clarke).
        """
        ones = np.ones(len(self.row))
        mixtures = [self._mixture(slopes, np.cos(a) * ones, np.sin(a) * ones) for a in ANGLES]
        return np.concatenate(mixtures)

    def _mixture(self, slopes: Floats, cos: Floats, sin: Floats) -> Floats:
        """Slopes of the form of both modes' mixture at half the angle."""
        a, b = slopes, self.others
        return np.asarray(0.5 * (a + b) + 0.5 * cos[:, None] * (a - b) + sin[:, None] * self.mixed)


def joined(parts: Sequence[NeighbourPairs]) -> NeighbourPairs | None:
    """The rows of all parts as one; None where there are no parts."""
    if not parts:
        return None
    columns = (
        np.concatenate([getattr(part, name) for part in parts])
        for name in NeighbourPairs.__dataclass_fields__
    )
    return NeighbourPairs(*columns)
