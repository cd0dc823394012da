"""How far the numbers of a run can be trusted: mesh, reduced links and round-off, side by side.

`study_accuracy` states the errors of mesh, reduced links and round-off. It needs no exact solves
but those at the few poses where mesh and reduced links are judged.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.case.case_file import CaseFile
from eigassign.facts import about
from eigassign.mechanism.kinematics.parameters import link_type
from eigassign.mechanism.trajectory.trajectory import Trajectories
from eigassign.modal.arguments import spread
from eigassign.modal.exact.solver import rounding_error
from eigassign.modal.model import Model
from eigassign.study.checks.weight import WeightStudy, study_weight
from eigassign.study.planning import poses_at
from eigassign.study.results import MeshError
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]
# Of the shipped cases the worst of 5 poses has 97 % of the error of the worst sample at least, of
# all three lowest modes, and of 3 poses 67 %
MESH_POSES = 5
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


def judged_poses(model: Model, q: Floats, most: int = MESH_POSES) -> Floats:
    """The poses of q (n, n_q) at which the mesh, or the weight, is judged: at ``most`` so many."""
    return spread(q, most if model.n_dof <= LARGE else FEW)


def worst_poses(model: Model, q: Floats, y: Floats, highest: int) -> Floats:
    """Few poses of q (n, n_q) at which reduced links are judged.

    Of large whole links the one at which the ``highest`` mode is highest: there these bend most.
    """
    if not model.is_reduced or model.whole.is_dense:
        return spread(q, FEW)
    q = spread(q, MESH_POSES)
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


WEIGHT_POSES = 9  # at which the weight is judged; each costs an exact solve
ROUNDED = 3  # at which round-off is measured by nine solves; of a large model one


@dataclass(frozen=True)
class Accuracy:
    """The errors of a run's numbers: of the mesh, and of all in lines of text."""

    mesh: MeshError | None  # None without beams or solids
    weight: WeightStudy
    notes: tuple[str, ...]


def study_accuracy(
    scene: Scene, optimum: Floats | None = None, more: Collection[int] = ()
) -> Accuracy:
    """Errors of mesh, reduced links and round-off, and what gravity changes, per mode.

    Those of mesh and links at the initial design and at the ``optimum`` (n_y,). ``more`` modes than
    are expanded are asked for by targets.
    """
    y, design = (scene.initial, "initial") if optimum is None else (optimum, "optimal")
    given = scene.model, scene.modes, scene.trajectory, scene.q0
    first = None if optimum is None else judged_mesh(*given, scene.initial, "initial")
    mesh = judged_mesh(*given, y, design)
    weight = weight_at(scene, y, design, more)
    lines = [line for each in (first, mesh) for line in mesh_lines(each, scene.model)]
    lines += weight.lines
    lines += truncation_notes(scene, optimum)
    return Accuracy(mesh, weight, (*lines, _rounding_note(scene, y), *digits_lines(scene.file)))


def weight_at(scene: Scene, y: Floats, design: str, more: Collection[int] = ()) -> WeightStudy:
    """`study_weight` of the expanded and ``more`` modes at the poses where the mesh is judged."""
    q = scene.q0[None]
    if scene.trajectory is not None:
        q = judged_poses(scene.model, poses_at(scene.trajectory, y), WEIGHT_POSES)
    return study_weight(scene.file, scene.model, sorted({*scene.modes, *more}), q, y, design)


def _rounding_note(scene: Scene, y: Floats) -> str:
    """`rounding_line` of some poses of design y, and of the first one of the initial design."""
    pencil, q = scene.model.pencil, scene.q0[None]
    if scene.trajectory is not None:
        q = spread(poses_at(scene.trajectory, y), ROUNDED if pencil.is_dense else 1)
    x = scene.model.x(q, y)
    if pencil.is_dense:
        x = np.unique(np.vstack([x, scene.model.x(q[:1], scene.initial)]), axis=0)
    lost = max(rounding_error(pencil, each, max(scene.modes)) for each in x)
    line = rounding_line(lost)
    return f"{line}, at {len(x)} poses and designs" if len(x) > 1 and np.isfinite(lost) else line


def digits_lines(file: CaseFile) -> tuple[str, ...]:
    """Where it is said what the digits of imported matrices cost; they are nobody's round-off."""
    kinds = {link_type(file, name) for name in file.mechanism.links}
    if "superelement" not in kinds:
        return ()
    return ("not in that: the digits of imported matrices, which eigassign check judges",)


def rounding_line(lost: float) -> str:
    """The largest relative round-off of the exact frequencies, in words."""
    if not np.isfinite(lost):
        return "round-off of the exact frequencies: not known; they may be only round-off"
    return f"round-off of the exact frequencies: below {lost:.1g}, relative"


def truncation_notes(scene: Scene, optimum: Floats | None = None) -> list[str]:
    """`truncation_lines` along the trajectory, at the initial design and the optimum."""
    designs = [scene.initial, *([] if optimum is None else [optimum])]
    return list(truncation_lines(scene.model, scene.modes, scene.trajectory, scene.q0, designs))
