"""How far the numbers of a run can be trusted, stated side by side: mesh, approximation, round-off.

None of it needs an exact solve beyond those of the mesh comparison at a few poses.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from eigassign.modal.roundoff import rounding_error
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]
POSES = 3  # at which the mesh is compared with one twice as fine
SAMPLES = 20  # at which the expansion's own estimate is evaluated
Discretisation = Callable[[Floats, tuple[int, ...]], Floats | None]


def accuracy_notes(scene: Scene, discretisation: Discretisation) -> list[str]:
    """Lines on discretisation error, estimated approximation error and round-off, per mode."""
    modes = scene.expansions.modes
    q = scene.q0[None] if scene.trajectory is None else scene.path.q
    x = scene.model.x(_spread(q, POSES), scene.initial)
    lines = _mesh_lines(discretisation(x, modes), modes)
    few = _spread(q, SAMPLES)
    estimate = scene.expansions.estimate(few, scene.initial).max(axis=0)
    several = scene.trajectory is not None and scene.trajectory.several
    where = "at the expansion point" if scene.trajectory is None else "along the trajectory"
    where = "along all trajectories" if several else where
    for mode, error in zip(modes, estimate, strict=True):
        stated = (
            "cannot be vouched for" if not np.isfinite(error) else f"{100 * error:.2g} % at most"
        )
        lines.append(
            f"mode {mode}: approximation error of the full expansion {where}, initial design, "
            f"estimated without exact solves: {stated}"
        )
    lost = rounding_error(scene.model.pencil, x[0], max(modes))
    lines.append(f"round-off of the exact frequencies: below {lost:.1g} relative")
    return lines


def _mesh_lines(error: Floats | None, modes: tuple[int, ...]) -> list[str]:
    if error is None:
        return []
    return [
        f"mode {mode}: discretisation error about {100 * worst:.2g} %, from twice as many elements"
        for mode, worst in zip(modes, error.max(axis=0), strict=True)
    ]


def _spread(q: Floats, count: int) -> Floats:
    keep = np.unique(np.linspace(0, len(q) - 1, min(count, len(q))).round().astype(int))
    return np.asarray(q[keep])
