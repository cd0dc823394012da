"""How far a rider on a beam may bring down modes that the basis does not hold.

A carriage or nut divides its beam in two spans, l and L − l. As it travels, one becomes longer, and
bending of a span of length l has μ = 1/λ ∝ l⁴ (its stretch and twist l²): modes that were high up
at an expansion point, and are neither in the basis nor like anything in it, come down by up to

    (l / l_p)⁴ ,  the longest span l against the same at the point p.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.reduced.pencil import ReducedPencil
from eigassign.series.compiler import CompiledArrays

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Spans:
    """Station and length (n_riders, 2) of all riders over z, and their spans at the points."""

    table: CompiledArrays
    at_points: Floats  # (n_points, n_riders, 2)

    def growth(self, reduced: ReducedPencil, x: Floats) -> Floats:
        """(l / l_p)⁴ ≥ 1 at x (n, n_x), (n_points, n)."""
        z = reduced.to_program @ x.T + reduced.shift[:, None]
        longer = _both(self.table, z) / self.at_points[:, None]
        return np.asarray(longer.max(axis=(2, 3), initial=1.0) ** 4)


def spans(pencil: Pencil, points: Floats) -> Spans | None:
    """The spans of a mechanism's riders at ``points`` (n_points, n_x); None where nothing rides."""
    if pencil.rails is None:
        return None
    table = pencil.rails.table
    z = pencil.to_program @ points.T + pencil.shift[:, None]
    return Spans(table, _both(table, z))


def _both(table: CompiledArrays, z: Floats) -> Floats:
    """The two spans of every rider at z (n_z, n), (n, n_riders, 2)."""
    station, length = np.moveaxis(table(z)[0], -1, 0)
    return np.stack([station, length - station], axis=-1)
