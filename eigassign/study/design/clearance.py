"""Proof that a band of frequencies stays clear of modes all along a trajectory.

On a connected trajectory a band is clear if and only if the number k of modes below it is the same
at both of its edges everywhere. At every sample k is counted by Sylvester's law of inertia, so that
a mode nobody asked for counts too. Between samples, where the coordinates and the edges are linear
in time, the room that the modes k and k + 1 leave,

    g(t) = min( 1 − f_k / lower ,  f_{k+1} / ((1 + e) upper) − 1 ),

is followed on points that are made denser until half the second difference of g, twice what a
parabola and as much as a kink can deviate from the chord, is less than the room that is left.

Mesh and reduced links raise frequencies, by e at most, relative: mode k is below the band with more
right than its number says, and mode k + 1 has to stay above it without e. Where e has no bound, or
the model has no mode k + 1, which the beams themselves have, nothing is proved.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import MissingMassError
from eigassign.modal.exact.inertia import count_below
from eigassign.modal.model import Model
from eigassign.study.accuracy import judged_poses

Floats = NDArray[np.float64]


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
    where the band is not clear. ``counted`` says whether inertia confirmed k at every sample;
    ``raised`` is e: infinite where nothing is known of it.
    """

    label: str
    below: int
    clear: bool
    room: float
    counted: bool
    raised: float


def prove_clear(model: Model, band: Band, y: Floats) -> Clearance:
    """Judge one band at design y (n_y,); raises what the exact solves raise."""
    counted = _counted(model, band, y)
    above = mode_above(model, band.below, band.named, band.q, y)
    raised = _raised(model, band, y, above)
    room = _least_room(model, band, y, above, raised)
    return Clearance(band.label, band.below, counted and room > 0.0, room, counted, raised)


def mode_above(model: Model, below: int, named: Sequence[int], q: Floats, y: Floats) -> int | None:
    """The mode that has to stay above a band: 0 for none, None for one that the model lacks.

    It lacks one that has no mass, as at the first of the poses q (n, n_q).
    """
    if named:
        return named[below] if below < len(named) else 0
    if below == model.n_dof - model.n_rigid:
        return None
    try:
        model.frequencies(q[:1], y, below + 1)
    except MissingMassError:
        return None
    return below + 1


def _raised(model: Model, band: Band, y: Floats, above: int | None) -> float:
    """e: by how much mesh and reduced links raise the mode above the band at most, relative."""
    exact = model.meshed is None and model.reduced is None
    if above == 0 or exact:
        return 0.0
    if above is None:
        return float(np.inf)
    q = judged_poses(model, band.q)
    mesh, truncation = (
        float(error(q, y, (above,)).max())
        for error in (model.discretisation_error, model.truncation_error)
    )
    return (1.0 + mesh) * (1.0 + truncation) - 1.0


def _counted(model: Model, band: Band, y: Floats) -> bool:
    """k modes below both edges at every sample; of named modes only their order is known."""
    if band.named:
        return True
    edges = np.column_stack([band.lower_hz, band.upper_hz])
    return bool((count_below(model.pencil, model.x(band.q, y), edges) == band.below).all())


def _least_room(model: Model, band: Band, y: Floats, above: int | None, raised: float) -> float:
    """The least g over the trajectory, less its possible deviation where that is not resolved."""
    at = np.arange(len(band.q), dtype=np.float64)
    room = partial(_room, model, band, y, above, raised)
    g = room(at)
    least = float(g.min())
    if least <= 0.0 or len(at) < 2:
        return least
    start, end, g_start, g_end = at[:-1], at[1:], g[:-1], g[1:]
    for _ in range(9):  # halvings: 512 points between two samples
        middle = 0.5 * (start + end)
        g_middle = room(middle)
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


def _room(
    model: Model, band: Band, y: Floats, above: int | None, raised: float, at: Floats
) -> Floats:
    """g (n,) at places ``at`` along the samples: 1.5 is midway between the second and third."""
    samples = np.arange(len(band.q))
    q = np.reshape([np.interp(at, samples, column) for column in band.q.T], (-1, len(at))).T
    lower, upper = (np.interp(at, samples, edge) for edge in (band.lower_hz, band.upper_hz))
    k = band.below
    low = band.named[k - 1] if band.named and k else k
    hz = model.frequencies(q, y, max(low, above or 0, 1))
    g = np.full(len(at), np.inf)
    if k:
        g = np.minimum(g, 1.0 - hz[:, low - 1] / lower)
    if above:
        g = np.minimum(g, hz[:, above - 1] / (1.0 + raised) / upper - 1.0)
    return g if np.isfinite(raised) else np.minimum(g, 0.0)


def wanting(found: Sequence[Clearance]) -> float:
    """The largest lack of room that another design may have; 0 where all bands are clear."""
    open_ = (c for c in found if not c.clear and np.isfinite(c.raised))
    return max((-c.room for c in open_), default=0.0)
