"""Carriages and nuts stand on their beam, between its ends."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from eigassign.mechanism.geometry import length, station
from eigassign.mechanism.poses import Poses

Floats = NDArray[np.float64]


def off_track(poses: Poses, x: Floats) -> str | None:
    """Which carriage or nut has left its beam at the samples x, in words; None where none has."""
    numbers = poses.parameters.with_passive(poses.motion.passive)
    tree = poses.motion.tree
    for link in poses.links:
        for joint in tree.riders(link):
            at, total = station(numbers, tree, joint), length(poses.case, numbers, link)
            (values,) = poses.values(x, [np.array([at, total], dtype=object)])
            outside = np.flatnonzero(~((values[:, 0] > 0.0) & (values[:, 0] < values[:, 1])))
            if len(outside):
                place, most = values[outside[0]]
                return (
                    f"{joint} stands {place:.6g} m from the start of {link}, which is "
                    f"{most:.6g} m long: it has to stay between its ends"
                )
    return None
