"""Frequencies along the trajectory and their slopes in the design, as the assignment asks for them.

Exact ones come from the model at every sample. For models of many unknowns a reduced model does the
work between, and says how far it is to be trusted.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.requirements import Frequencies
from eigassign.modal.model import Model
from eigassign.modal.slopes import eigenvalue_slopes
from eigassign.study.scene import BLOCK, Scene

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class ExactResponse:
    """The lowest ``count`` frequencies at every sample, each by an exact solve."""

    model: Model
    q: Floats  # (n_t, n_q)
    scales: Floats  # (n_x,): the ranges of q and y; 0 where no slope is wanted
    count: int
    progress: Callable[[int, int], None] = lambda _done, _of: None

    def __call__(self, y: Floats) -> Frequencies:
        """Raises EigassignError where the mechanism has no modes at this design."""
        x, n_q = self.model.x(self.q, y), self.q.shape[1]
        block = max(1, BLOCK // self.model.n_dof**2)
        parts = []
        for start in range(0, len(x), block):
            part = x[start : start + block]
            parts.append(eigenvalue_slopes(self.model.pencil, part, self.count, self.scales))
            if start + block < len(x):
                self.progress(start + block, len(x))
        lam, slopes = (np.concatenate(both) for both in zip(*parts, strict=True))
        hz = np.sqrt(lam) / (2.0 * np.pi)
        return Frequencies(hz, slopes[..., n_q:] / (8.0 * np.pi**2 * hz[..., None]))


def exact_response(
    scene: Scene, count: int, progress: Callable[[int, int], None] = lambda _done, _of: None
) -> ExactResponse:
    """Of all samples of the scene's trajectory."""
    lower, upper = scene.bounds
    scales = np.append(np.zeros(scene.path.q.shape[1]), upper - lower)
    return ExactResponse(scene.model, scene.path.q, scales, count, progress)
