"""Frequencies along the trajectory and their slopes in the design, as the assignment asks for them.

Exact ones come from the model at every sample. For models of many unknowns a reduced model does the
work between, and says how far it is to be trusted.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.requirements import Frequencies
from eigassign.mechanism.trajectory.trajectory import Trajectories
from eigassign.modal.model import Model
from eigassign.modal.slopes import eigenvalue_slopes
from eigassign.study.scene import BLOCK, Scene

Floats = NDArray[np.float64]
TRAVEL = (0.1, 1.0)  # rad or m: least and largest scale of a coordinate; steps are 5e-4 of it


@dataclass(frozen=True)
class ExactResponse:
    """The lowest ``count`` frequencies at every sample, each by an exact solve."""

    model: Model
    path: Trajectories
    scales: Floats  # (n_x,): the ranges of q and y; 0 where no slope is wanted
    count: int

    def __call__(self, y: Floats) -> Frequencies:
        """Raises EigassignError where the mechanism has no modes, or no pose, at this design."""
        q, of_design = self.path.at(y)
        x, n_q = self.model.x(q, y), q.shape[1]
        hz, slopes = exact_slopes(self.model, x, self.count, self.scales)
        by_y = slopes[..., n_q:]
        if self.path.follows_design:
            by_y = by_y + slopes[..., :n_q] @ of_design
        return Frequencies(hz, by_y)


def exact_slopes(model: Model, x: Floats, count: int, scales: Floats) -> tuple[Floats, Floats]:
    """The lowest frequencies (n, count) in Hz at x (n, n_x), and their slopes (n, count, n_x).

    ``scales`` and what is raised are those of `eigenvalue_slopes`.
    """
    block = max(1, BLOCK // model.n_dof**2)
    parts = [
        eigenvalue_slopes(model.pencil, x[at : at + block], count, scales)
        for at in range(0, len(x), block)
    ]
    lam, slopes = (np.concatenate(both) for both in zip(*parts, strict=True))
    hz = np.sqrt(lam) / (2.0 * np.pi)
    return hz, slopes / (8.0 * np.pi**2 * hz[..., None])


def exact_response(scene: Scene, count: int) -> ExactResponse:
    """Of all samples of the scene's trajectory."""
    lower, upper = scene.bounds
    q = scene.path.q
    # A coordinate that rests at the initial design, but for round-off, may move with another.
    travel = np.clip(np.ptp(q, axis=0), *TRAVEL) if scene.path.follows_design else 0.0 * q[0]
    return ExactResponse(scene.model, scene.path, np.append(travel, upper - lower), count)
