"""How far the numbers of a run can be trusted, stated side by side: mesh, approximation, round-off.

None of it needs an exact solve beyond those of the mesh comparison at a few poses.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import AccuracyError
from eigassign.modal.model import Model
from eigassign.modal.roundoff import rounding_error
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]
POSES = 3  # at which the mesh is compared with one twice as fine
SAMPLES = 20  # at which the expansion's own estimate is evaluated
Discretisation = Callable[[Floats, tuple[int, ...]], Floats | None]


def accuracy_notes(
    scene: Scene, discretisation: Discretisation, optimum: Floats | None = None
) -> list[str]:
    """Lines on discretisation, truncation, estimated approximation error and round-off, per mode.

    ``optimum`` (n_y,) is one more design at which the truncation is looked at.
    """
    modes = scene.expansions.modes
    q = scene.q0[None] if scene.trajectory is None else scene.path.q
    x = scene.model.x(_spread(q, POSES), scene.initial)
    lines = _mesh_lines(discretisation(x, modes), modes)
    few = _spread(q, SAMPLES)
    lines += truncation_notes(scene, optimum)
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


def truncation_notes(scene: Scene, optimum: Floats | None = None) -> list[str]:
    """`truncation_lines` along the trajectory, at the initial design, both bounds, the optimum."""
    q = scene.q0[None] if scene.trajectory is None else scene.path.q
    designs = [scene.initial, *scene.bounds, *([] if optimum is None else [optimum])]
    return truncation_lines(scene.model, scene.expansions.modes, q, np.array(designs))


def truncation_lines(model: Model, modes: tuple[int, ...], q: Floats, designs: Floats) -> list[str]:
    """By how much reduced links raise frequencies at most, at poses q (n, n_q) of every design.

    Raises AccuracyError where that cannot be bounded: the links are reduced too far.
    """
    if model.reduced is None:
        return []
    few, different = _spread(q, SAMPLES), np.unique(designs, axis=0)
    error = np.array([model.truncation_error(few, y, modes) for y in different]).max(axis=(0, 1))
    where = f"{len(few)} poses" + (f" and {len(different)} designs" if len(different) > 1 else "")
    for mode, worst in zip(modes, error, strict=True):
        if not np.isfinite(worst):
            raise AccuracyError(
                f"mode {mode}: what the reduced links leave out cannot be bounded over {where}: "
                "raise reduce_to"
            )
    return [
        f"mode {mode}: truncation error of the reduced links at most {100 * worst:.2g} % (too "
        f"high), over {where}"
        for mode, worst in zip(modes, error, strict=True)
    ]


def _spread(q: Floats, count: int) -> Floats:
    keep = np.unique(np.linspace(0, len(q) - 1, min(count, len(q))).round().astype(int))
    return np.asarray(q[keep])
