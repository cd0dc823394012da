"""Round-off of an exact eigenvalue: how many digits the matrices and the solver leave.

In a fine mesh the strain energy is a small difference of large terms, and a stiff spring beside a
soft beam drowns it. How much of that an eigenvalue feels is measured: θ → c θ scales K and M alike,
and would change no eigenvalue if numbers were exact. But every product, sum and pivot is rounded
anew, unless c is a power of two; what eigenvalues then differ by is their round-off.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import AccuracyError, MechanismError
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.exact.solver import lowest_modes

Floats = NDArray[np.float64]
# No powers of two, beside 1; so many, for some models spread widely at one in ten of them only.
SCALES = np.array([1.0837, 0.8391, 1.2943, 0.7213, 1.613, 0.9127, 1.4711, 0.6173])
# Times the spread in frequency: in some 300 chains of fine beams and stiff springs
# (`tests/stability/test_roundoff.py`) the true round-off was at most 8.2 times that.
SAFETY = 10.0


def rounding_error(pencil: Pencil, x: Floats, count: int) -> float:
    """Relative round-off in frequency of the lowest ``count`` modes at x (n_x,), the largest.

    Infinite where other roundings of the same matrices have no such modes.
    """
    theta = pencil.theta(x[None])
    plain = lowest_modes(pencil, theta, count, 0).lam
    try:
        lam = lowest_modes(pencil, theta * SCALES, count, 0).lam
    except (AccuracyError, MechanismError):
        return np.inf
    spread = float(np.abs(lam / plain - 1.0).max())
    return 0.5 * SAFETY * max(spread, float(np.finfo(float).eps))
