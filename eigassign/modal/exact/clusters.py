"""Neighbouring modes that are expanded together, because each alone has a branch point nearby."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.exact.dense import Modes
from eigassign.modal.exact.solver import lowest_modes

Floats = NDArray[np.float64]
LEAST_GAP = 1e-10  # modes that round-off hardly tells apart have no series of their own
CLUSTER_GAP = 0.02  # modes closer than this (relative in λ) are expanded together


def clusters(lam: Floats, wanted: Sequence[int], gap: float) -> tuple[tuple[int, ...], ...]:
    """Modes (1-based) grouped where neighbours are closer than ``gap`` (relative in λ).

    Never less than LEAST_GAP: of modes that coincide any mixture is a mode.
    """
    gap = max(gap, LEAST_GAP)
    groups = [[1]]
    for k, (below, above) in enumerate(itertools.pairwise(lam.tolist()), 2):
        if above - below < gap * above:
            groups[-1].append(k)
        else:
            groups.append([k])
    return tuple(tuple(g) for g in groups if not set(wanted).isdisjoint(g))


def whole_clusters(
    pencil: Pencil, theta0: Floats, wanted: Sequence[int], gap: float
) -> tuple[Modes, tuple[tuple[int, ...], ...]]:
    """The wanted modes' clusters, and modes up to above the last: a cluster cut short is wrong."""
    elastic = len(pencil.elastic)
    count = min(max(wanted) + 1, elastic) if max(wanted) <= elastic else max(wanted)
    while True:
        found = lowest_modes(pencil, theta0, max(wanted), count - max(wanted))
        there = found.lam.shape[1]  # fewer than asked for where no more have mass
        groups = clusters(found.lam[0], wanted, gap)
        if there < count or count == elastic or groups[-1][-1] < count:
            return found, groups
        count = min(2 * count, elastic)
