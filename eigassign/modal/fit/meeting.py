"""What an interpolant of one mode misses where it meets its neighbour between the nodes.

Where two modes cross, neither is smooth, however little of that the nodes show: with all of them on
one side of the crossing both interpolants are right there, and wrong beyond. What stays smooth are
the symmetric functions of the two, their mean s and their squared distance d²:

    g_k , g_{k+1} = s ∓ ½ √(d²) ,   g = f^power .

Interpolants of d and of d² at the same nodes agree unless the modes meet; what they differ by is
what the interpolant of g_k misses, |√(d²) − d| / 2, the error of s being the same in both.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

Floats = NDArray[np.float64]
CLOSE = 1e-2  # relative gap in Hz below which neighbouring modes are named as a cause, or
CLOSER = 0.2  # this part of the largest
FAR = 0.5  # part of the largest distance at the nodes over which modes nowhere come near


def missed_between(
    at_nodes: Floats, between: Callable[[], Floats], hz: Floats, own: Sequence[int], power: float
) -> float:
    """|δf/f| of the modes in columns ``own`` of ``hz`` (N, n), the lowest modes at the nodes.

    ``at_nodes`` (N, N) and ``between`` (n, N) are the basis there and all over the region. Zero
    where they come near no neighbour, as one without mass, whose f is infinite.
    """
    g, missed = hz**power, 0.0
    for k in sorted({k for mode in own for k in (mode - 1, mode) if 0 <= k < hz.shape[1] - 1}):
        d = np.abs(g[:, k + 1] - g[:, k])
        if not np.isfinite(hz[:, k + 1]).all() or d.min() >= FAR * d.max():
            continue
        here = g[:, [j for j in (k, k + 1) if j in own]]
        c = solve_triangular(at_nodes, np.column_stack([d, d * d, here]), lower=True)
        found = between() @ c
        off = np.abs(np.sqrt(np.maximum(found[:, 1], 0.0)) - found[:, 0])
        missed = max(missed, float((off[:, None] / np.abs(found[:, 2:])).max()))
    return 0.5 * missed / abs(power)


def cause(hz: Floats, modes: Sequence[int]) -> str:
    """Neighbouring modes that come close, the usual cause of a large error, to end a message.

    ``hz`` (n, modes[-1] + 1) are all modes up to those, and one more.
    """
    gap = 1.0 - hz[:, :-1] / hz[:, 1:]
    if not len(gap):
        return ""
    close = gap.min(axis=0) < np.maximum(CLOSE, CLOSER * gap.max(axis=0))
    near = [k + 1 for k in np.flatnonzero(close) if {k + 1, k + 2} & set(modes)]
    named = ", ".join(f"{k} and {k + 1}" for k in near)
    return f"; modes {named} come close, and where they meet none is smooth" if near else ""
