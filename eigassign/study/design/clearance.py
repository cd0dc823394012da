"""Proof that a band of frequencies stays clear of modes all along a trajectory.

On a connected trajectory a band is clear if and only if the number k of modes below it is the same
at both of its edges everywhere. At every sample k is counted by Sylvester's law of inertia, so that
a mode nobody asked for counts too. Between samples, where the coordinates and the edges are linear
in time, the room that the modes k and k + 1 leave,

    g(t) = min( 1 − f_k / lower ,  f_{k+1} / upper − 1 ),

is followed on points that are made denser until half the second difference of g, twice what a
parabola and as much as a kink can deviate from the chord, is less than the room that is left.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.modal.exact.inertia import count_below
from eigassign.modal.model import Model

Floats = NDArray[np.float64]
DEEPEST = 9  # halvings of an interval between two samples


@dataclass(frozen=True)
class Band:
    """A band to keep out of along one trajectory: q (n, n_q), edges (n,) in Hz, and k.

    ``named`` are the only modes that count, in ascending order; none: all do.
    """

    label: str
    q: Floats
    lower_hz: Floats
    upper_hz: Floats
    below: int
    named: tuple[int, ...] = ()


@dataclass(frozen=True)
class Clearance:
    """Whether a band is clear, and the least room relative to its edges.

    ``room`` is the least g found less what it may deviate between the points looked at: negative
    where the band is not clear. ``counted`` says whether inertia confirmed k at every sample.
    """

    label: str
    below: int
    clear: bool
    room: float
    counted: bool


def prove_clear(model: Model, band: Band, y: Floats) -> Clearance:
    """Judge one band at design y (n_y,); raises what the exact solves raise."""
    counted = _counted(model, band, y)
    room = _least_room(model, band, y)
    return Clearance(band.label, band.below, counted and room > 0.0, room, counted)


def _counted(model: Model, band: Band, y: Floats) -> bool:
    """k modes below both edges at every sample; of named modes only their order is known."""
    if band.named:
        return True
    edges = np.column_stack([band.lower_hz, band.upper_hz])
    return bool((count_below(model.pencil, model.x(band.q, y), edges) == band.below).all())


def _least_room(model: Model, band: Band, y: Floats) -> float:
    """The least g over the trajectory, less its possible deviation where that is not resolved."""
    at = np.arange(len(band.q), dtype=np.float64)
    g = _room(model, band, y, at)
    least = float(g.min())
    if least <= 0.0 or len(at) < 2:
        return least
    start, end, g_start, g_end = at[:-1], at[1:], g[:-1], g[1:]
    for _ in range(DEEPEST):
        middle = 0.5 * (start + end)
        g_middle = _room(model, band, y, middle)
        ends = np.minimum(np.minimum(g_start, g_end), g_middle)
        least = min(least, float(ends.min()))
        bound = ends - 0.5 * np.abs(g_start - 2.0 * g_middle + g_end)
        open_ = bound <= 0.0
        if least <= 0.0:
            return least
        least = min(least, float(bound[~open_].min(initial=np.inf)))
        if not open_.any():
            return least
        halves = ((start, middle, g_start, g_middle), (middle, end, g_middle, g_end))
        start, end, g_start, g_end = (
            np.concatenate([half[k][open_] for half in halves]) for k in range(4)
        )
    return min(0.0, float(bound.min()))


def _room(model: Model, band: Band, y: Floats, at: Floats) -> Floats:
    """g (n,) at places ``at`` along the samples: 1.5 is midway between the second and third."""
    samples = np.arange(len(band.q))
    q = np.column_stack([np.interp(at, samples, column) for column in band.q.T])
    lower, upper = (np.interp(at, samples, edge) for edge in (band.lower_hz, band.upper_hz))
    k, named = band.below, band.named
    available = model.n_dof - model.n_rigid
    low = named[k - 1] if named and k else k
    high = (named[k] if k < len(named) else 0) if named else k + 1
    hz = model.frequencies(q, y, min(max(low, high, 1), available))
    g = np.full(len(at), np.inf)
    if k:
        g = np.minimum(g, 1.0 - hz[:, low - 1] / lower)
    if high and high <= available:
        g = np.minimum(g, hz[:, high - 1] / upper - 1.0)
    return g


def wanting(found: Sequence[Clearance]) -> float:
    """The largest lack of room; 0 where all bands are clear."""
    return max((-c.room if not c.clear else 0.0 for c in found), default=0.0)
