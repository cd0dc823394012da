"""What an interpolant of one mode misses where it meets its neighbour between the nodes.

Where two modes cross, neither is smooth, however little of that the nodes show: with all of them on
one side of the crossing both interpolants are right there, and wrong beyond. What stays smooth are
the symmetric functions of the two, their mean s and their squared distance d²:

    g_k , g_{k+1} = s ∓ ½ √(d²) ,   g = f^power .

Interpolants of d and of d² at the same nodes agree unless the modes meet; what they differ by is
what the interpolant of g_k misses, |√(d²) − d| / 2, the error of s being the same in both.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dtrtrs

from eigassign.interpolation.newton import Nodes, products, spread_steps

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
CLOSE = 1e-2  # relative gap in Hz below which neighbouring modes are named as a cause, or
CLOSER = 0.2  # this part of the largest
FAR = 0.5  # part of the largest distance at the nodes over which modes nowhere come near
PLACES = 1000  # of a box, at which both interpolants are compared


def missed_between(
    axes: Sequence[Nodes], members: Ints, hz: Floats, own: Sequence[int], power: float
) -> float:
    """|δf/f| of the modes in columns ``own`` of ``hz`` (N, n), the lowest modes at ``members``.

    Zero where they come near no neighbour. A mode without mass has f = ∞.
    """
    lower = sorted({k for mode in own for k in (mode - 1, mode) if 0 <= k < hz.shape[1] - 1})
    g = hz**power
    missed = 0.0
    where: tuple[Floats, Floats] | None = None
    for k in lower:
        d = np.abs(g[:, k + 1] - g[:, k])
        if not np.isfinite(d).all() or d.min() >= FAR * d.max():
            continue
        if where is None:
            where = _tables(axes, members)
        here = [j for j in (k, k + 1) if j in own]
        at_nodes, between = where
        c = dtrtrs(at_nodes, np.column_stack([d, d * d, g[:, here]]), lower=1, unitdiag=1)[0]
        found = between @ c
        off = np.abs(np.sqrt(np.maximum(found[:, 1], 0.0)) - found[:, 0])
        missed = max(missed, float((off[:, None] / np.abs(found[:, 2:])).max()))
    return 0.5 * missed / abs(power)


def _tables(axes: Sequence[Nodes], members: Ints) -> tuple[Floats, Floats]:
    """Newton's basis at the members (N, N), and all over the region (n, N)."""
    everywhere = [axis.all_over for axis in axes]
    at_nodes = products([axis.table for axis in axes], members, members)
    return at_nodes, products(everywhere, _places([len(t) for t in everywhere]), members)


def _places(counts: Sequence[int]) -> Ints:
    """Rows of each axis: all of one; of several some all over the box, and as many on its faces."""
    d = len(counts)
    if d == 1:
        return np.arange(counts[0])[:, None]
    spread = np.arange(1, PLACES + 1)[:, None] * spread_steps(2 * d) % 1.0
    at, face = np.hsplit(spread, [d])
    at[::2] = np.where(face[::2] < 0.5, at[::2], np.round(at[::2]))
    return np.asarray(np.minimum(at * counts, np.array(counts) - 1.0), dtype=np.intp)


def cause(hz: Sequence[Floats], modes: Sequence[int]) -> str:
    """Neighbouring modes that come close, the usual cause, as the end of a message.

    ``hz`` are batches (n, modes[-1] + 1) of all modes up to those, and of one more.
    """
    if not len(hz):
        return ""
    f = np.vstack(hz)
    gap = 1.0 - f[:, :-1] / f[:, 1:]
    close = gap.min(axis=0) < np.maximum(CLOSE, CLOSER * gap.max(axis=0))
    near = [k + 1 for k in np.flatnonzero(close) if {k + 1, k + 2} & set(modes)]
    named = ", ".join(f"{k} and {k + 1}" for k in near)
    return f"; modes {named} come close, and where they meet none is smooth" if near else ""
