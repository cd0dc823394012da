"""Frequencies along the trajectory and their slopes in the design, as the assignment asks for them.

All come from exact solves at every sample: ∂f/∂y = (∂λ/∂y + ∂λ/∂q dq/dy) / (8π² f).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.assignment.requirements import Frequencies
from eigassign.mechanism.trajectory.trajectory import Trajectories
from eigassign.modal.model import Model
from eigassign.modal.slopes import eigenvalue_slopes
from eigassign.study.scene import AT_LEAST, BLOCK, Scene

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class ExactResponse:
    """The lowest ``count`` frequencies at every sample, each by an exact solve."""

    model: Model
    path: Trajectories
    wanted: NDArray[np.bool_]  # (n_x,): where slopes are wanted
    count: int

    def __call__(self, y: Floats) -> Frequencies:
        """Raises EigassignError where the mechanism has no modes, or no pose, at this design."""
        q, of_design = self.path.at(y)
        x, n_q = self.model.x(q, y), q.shape[1]
        hz, slopes = exact_slopes(self.model, x, self.count, self.wanted)
        by_y = slopes[..., n_q:]
        if self.path.follows_design:
            by_y = by_y + slopes[..., :n_q] @ of_design
        return Frequencies(hz, by_y)


def exact_slopes(model: Model, x: Floats, count: int, wanted: ArrayLike) -> tuple[Floats, Floats]:
    """The lowest frequencies (n, count) in Hz at x (n, n_x), and their slopes (n, count, n_x).

    ``wanted`` and what is raised are those of `eigenvalue_slopes`.
    """
    block = max(AT_LEAST, BLOCK // model.n_dof**2)
    parts = [
        eigenvalue_slopes(model.pencil, x[at : at + block], count, wanted)
        for at in range(0, len(x), block)
    ]
    lam, slopes = (np.concatenate(both) for both in zip(*parts, strict=True))
    hz = np.sqrt(lam) / (2.0 * np.pi)
    return hz, slopes / (8.0 * np.pi**2 * hz[..., None])


def exact_response(scene: Scene, count: int) -> ExactResponse:
    """Of all samples of the scene's trajectory."""
    lower, upper = scene.bounds
    moving = np.full(scene.path.q.shape[1], scene.path.follows_design)
    moving[scene.model.pencil.n_joints :] = False  # loads do not follow the design
    return ExactResponse(scene.model, scene.path, np.append(moving, upper > lower), count)
