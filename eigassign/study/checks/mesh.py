"""By how much mesh and reduced links raise frequencies, at few poses of the trajectory."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from eigassign.facts import about
from eigassign.mechanism.trajectory.trajectory import Trajectories
from eigassign.modal.arguments import spread
from eigassign.modal.model import Model
from eigassign.study.planning import poses_at
from eigassign.study.results import MeshError
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]
# Of the shipped cases the worst of 5 poses has 97 % of the error of the worst sample at least, of
# all three lowest modes, and of 3 poses 67 %
POSES = 5
FEW = 3  # of a model of more than `LARGE` degrees of freedom, and against whole links
LARGE = 10_000


def judged_mesh(
    model: Model,
    modes: Sequence[int],
    trajectory: Trajectories | None,
    q0: Floats,
    y: Floats,
    design: str,
) -> MeshError | None:
    """What the mesh leaves out at poses of the trajectory, or at q0, for one design y (n_y,).

    ``design`` is what it is called. None without beams or solids.
    """
    if not model.is_meshed and model.solids is None:
        return None
    q = q0[None] if trajectory is None else judged_poses(model, poses_at(trajectory, y))
    worst = q if model.solids is not None else q[model.coarsest(q, y, modes)]
    error = model.discretisation_error(worst, y, modes).max(axis=0)
    return MeshError(tuple(modes), tuple(float(e) for e in error), len(q), design)


def judged_poses(model: Model, q: Floats) -> Floats:
    """The poses of q (n, n_q) at which the mesh is judged."""
    return spread(q, POSES if model.n_dof <= LARGE else FEW)


def worst_poses(model: Model, q: Floats, y: Floats, highest: int) -> Floats:
    """Few poses of q (n, n_q) at which reduced links are judged.

    Of large whole links the one at which the ``highest`` mode is highest: there these bend most.
    """
    if not model.is_reduced or model.whole.is_dense:
        return spread(q, FEW)
    q = spread(q, POSES)
    return q[[model.frequencies(q, y, highest)[:, -1].argmax()]]


def mesh_lines(found: MeshError | None, model: Model) -> list[str]:
    """`judged_mesh` in words, one line a mode."""
    if found is None:
        return []
    where = f"over {found.poses} poses" if found.poses > 1 else "at one pose"
    return [
        f"mode {mode}: the mesh raises its frequency by {about(error)}, {where} of the "
        f"{found.design} design"
        if np.isfinite(error)
        else f"mode {mode}: the mesh is too coarse for an error, {where} of the {found.design} "
        f"design: {finer(model)}"
        for mode, error in zip(found.modes, found.error, strict=True)
    ]


def model_errors(
    scene: Scene, judged: MeshError | None, y: Floats, modes: Collection[int]
) -> dict[int, float]:
    """By how much mesh and reduced links raise each mode at design y (n_y,), about, relative.

    The mesh's part of some modes was ``judged`` before. Infinite where nothing is known.
    """
    if not modes:
        return {}
    wanted, q = sorted(modes), poses_at(scene.path, y)
    known = {} if judged is None else dict(zip(judged.modes, judged.error, strict=True))
    if unknown := [mode for mode in wanted if mode not in known]:
        mesh = scene.model.discretisation_error(judged_poses(scene.model, q), y, unknown)
        known |= dict(zip(unknown, mesh.max(axis=0).tolist(), strict=True))
    worst = worst_poses(scene.model, q, y, wanted[-1])
    links = scene.model.truncation_error(worst, y, wanted).max(axis=0)
    return {
        mode: (1.0 + known[mode]) * (1.0 + float(share)) - 1.0
        for mode, share in zip(wanted, links, strict=True)
    }


def raised_by(share: float) -> str:
    """By how much mesh and reduced links raise a frequency, in words."""
    return f"by about {100 * share:.2g} %" if np.isfinite(share) else "by an unknown amount"


def finer(model: Model) -> str:
    """What makes that less."""
    solids = "mesh solids finer, or else " * (model.solids is not None)
    return f"{solids}give the links more elements, raise reduce_to, or write auto for them"


def truncation_lines(
    model: Model,
    modes: Sequence[int],
    trajectory: Trajectories | None,
    q0: Floats,
    designs: Sequence[Floats],
) -> Iterator[str]:
    """By how much reduced links raise frequencies at the worst poses, or q0, of designs."""
    if not model.is_reduced:
        return
    found = []
    for y in np.unique(designs, axis=0):
        q = q0[None] if trajectory is None else poses_at(trajectory, y)
        found.append(model.truncation_error(worst_poses(model, q, y, max(modes)), y, modes))
    error = np.concatenate(found)
    where = f"over {len(error)} poses and designs" if len(error) > 1 else "at one pose"
    for mode, worst in zip(modes, error.max(axis=0), strict=True):
        yield f"mode {mode}: reduced links raise its frequency by {about(worst)}, {where}"
