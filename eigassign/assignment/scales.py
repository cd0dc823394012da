"""Dimensionless units for a quadratic program, and the program written in them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from eigassign.assignment.checks import Floats, frozen

if TYPE_CHECKING:
    from eigassign.assignment.program import QuadraticProgram


@dataclass(frozen=True)
class Scales:
    """Units in which a program is O(1).

    ``y`` (n_y,): the range of the parameter, but no more than what changes λ by 100 % in the root
    mean square (so that a maximum of 1e12, meant as "none", does not drown the others; with no
    range at all it is that change). ``objective``: with a the largest root mean square change of λ
    that one unit of ``y`` makes and e the rms relative error at the start, a·max(a, e); gradients
    of J/2 are then at most 1 at the start. ``rows`` (n_c,): the norm of a constraint's coefficients
    times ``y``, over the parameters that are free.
    """

    y: Floats
    objective: float
    rows: Floats
    free: tuple[int, ...]


@dataclass(frozen=True)
class ScaledProgram:
    """min ½‖A x + b‖²  with  lower ≤ G x ≤ upper,  x = (y − y_start)/scale of the free parameters.

    A (≤ n, n) is triangular: the rows of the program after a QR decomposition, which keeps AᵀA and
    Aᵀb. The first n rows of G are the identity (the bounds), the others the constraints, of norm 1.
    """

    A: Floats
    b: Floats
    G: Floats
    lower: Floats
    upper: Floats

    @property
    def P(self) -> Floats:
        """The Hessian AᵀA (n, n)."""
        return np.asarray(self.A.T @ self.A)

    @property
    def c(self) -> Floats:
        """The gradient Aᵀb (n,) at x = 0."""
        return np.asarray(self.A.T @ self.b)


def choose_scales(
    A: Floats, b_start: Floats, lower: Floats, upper: Floats, C: Floats, y0: Floats
) -> Scales:
    """The units of a program with error A (y − y_start) + b_start."""
    width = upper - lower
    effect = np.linalg.norm(A, axis=0)
    full = np.where(effect > 0.0, 1.0 / np.where(effect > 0.0, effect, 1.0), np.inf)
    unit = np.where(width > 0.0, np.minimum(width, full), full)
    unit = np.where(np.isfinite(unit), unit, np.where(y0 != 0.0, np.abs(y0), 1.0))
    free = tuple(int(j) for j in np.flatnonzero(width > 0.0))
    strongest = float(np.max((effect * unit)[list(free)], initial=0.0))
    objective = strongest * max(strongest, float(np.linalg.norm(b_start)))
    norms = np.linalg.norm((C * unit)[:, list(free)], axis=1)
    rows = np.where(norms > 0.0, norms, 1.0)
    return Scales(frozen(unit), objective if objective > 0.0 else 1.0, frozen(rows), free)


def scaled_program(program: QuadraticProgram) -> ScaledProgram:
    """The program in its own units, fixed parameters eliminated."""
    scales, free = program.scales, list(program.scales.free)
    unit, start = scales.y[free], program.y_start
    root = np.sqrt(scales.objective)
    q, r = np.linalg.qr(program.A[:, free] * unit / root)
    b = q.T @ (program.A @ (start - program.y0) + program.b) / root
    at_start = program.C @ start
    G = np.vstack([np.eye(len(free)), program.C[:, free] * unit / scales.rows[:, np.newaxis]])
    bounds = [(side[free] - start[free]) / unit for side in (program.lower, program.upper)]
    limits = [(side - at_start) / scales.rows for side in (program.c_lower, program.c_upper)]
    lower, upper = (np.concatenate(pair) for pair in zip(bounds, limits, strict=True))
    return ScaledProgram(frozen(r), frozen(b), frozen(G), frozen(lower), frozen(upper))
