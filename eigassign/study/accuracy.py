"""How far the numbers of a run can be trusted: errors stated side by side.

`study_accuracy` states the errors of mesh, reduced links and round-off. It needs no exact solves
but those at the few poses where mesh and reduced links are judged.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.case.case_file import CaseFile
from eigassign.errors import AccuracyError
from eigassign.facts import at_most
from eigassign.mechanism.kinematics.parameters import link_type
from eigassign.mechanism.trajectory.trajectory import (
    Trajectories,
)
from eigassign.modal.arguments import spread
from eigassign.modal.exact.roundoff import rounding_error
from eigassign.modal.model import Model
from eigassign.study.planning import far_from_buckling, poses_at, travelled
from eigassign.study.results import MeshError
from eigassign.study.scene import Scene
from eigassign.study.weight import WeightStudy, study_weight

Floats = NDArray[np.float64]
POSES = 9  # at which the mesh is judged; each costs an exact solve
POSES_LARGE = 3  # of a model of more than `LARGE` degrees of freedom, where one takes half a second
LARGE = 10_000
ROUNDED = 3  # at which round-off is measured by nine solves; of a large model one
SAMPLES = 20  # at which reduced links are judged


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

    Those of mesh and links at the ``optimum`` (n_y,), of the mesh at the initial design without
    one. ``more`` modes than are expanded are asked for by targets.
    """
    y, design = (scene.initial, "initial") if optimum is None else (optimum, "optimal")
    mesh = judged_mesh(scene.model, scene.modes, scene.trajectory, scene.q0, y, design)
    weight = weight_at(scene, y, design, more)
    lines = [*mesh_lines(mesh, scene.model), *weight.lines]
    lines += truncation_notes(scene, optimum)
    return Accuracy(mesh, weight, (*lines, _rounding_note(scene, y), *digits_lines(scene.file)))


def weight_at(scene: Scene, y: Floats, design: str, more: Collection[int] = ()) -> WeightStudy:
    """`study_weight` of the expanded and ``more`` modes at the poses where the mesh is judged."""
    q = _judged_at(scene.model, scene.trajectory, scene.q0, y)
    return study_weight(scene.file, scene.model, sorted({*scene.modes, *more}), q, y, design)


def model_errors(
    scene: Scene, judged: MeshError | None, y: Floats, modes: Collection[int]
) -> dict[int, float]:
    """By how much mesh and reduced links raise each mode at most at design y (n_y,), relative.

    At `judged_poses`; the mesh's part of some modes was ``judged`` before. Infinite where nothing
    is known.
    """
    known = {} if judged is None else dict(zip(judged.modes, judged.error, strict=True))
    q = judged_poses(scene.model, poses_at(scene.path, y))
    mesh, links = scene.model.discretisation_error, scene.model.truncation_error
    found = {}
    for mode in sorted(modes):
        of_mesh = known.get(mode) or float(mesh(q, y, (mode,)).max())
        found[mode] = (1.0 + of_mesh) * (1.0 + float(links(q, y, (mode,)).max())) - 1.0
    return found


def raised_by(model: Model, share: float) -> str:
    """By how much mesh and reduced links raise a frequency, in words."""
    if not np.isfinite(share):
        return "by an unknown amount"
    return f"by up to {100 * share:.2g} %" + ("" if model.has_bounds else " (estimated)")


def finer(model: Model) -> str:
    """What makes that less."""
    solids = "mesh solids finer, or else " * (model.solids is not None)
    return f"{solids}give the links more elements, raise reduce_to, or write auto for them"


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
    if model.meshed is None and model.solids is None:
        return None
    q = _judged_at(model, trajectory, q0, y)
    error = model.discretisation_error(q, y, modes).max(axis=0)
    return MeshError(tuple(modes), tuple(float(e) for e in error), len(q), design)


def _judged_at(model: Model, trajectory: Trajectories | None, q0: Floats, y: Floats) -> Floats:
    """The poses at which design y is judged: those of its trajectory, or q0."""
    return q0[None] if trajectory is None else judged_poses(model, poses_at(trajectory, y))


def judged_poses(model: Model, q: Floats) -> Floats:
    """The poses of q (n, n_q) at which the mesh is judged."""
    return spread(q, POSES if model.n_dof <= LARGE else POSES_LARGE)


def mesh_lines(found: MeshError | None, model: Model) -> list[str]:
    """`judged_mesh` in words, one line a mode; of solids, and under gravity, no bound."""
    if found is None:
        return []
    where = f"over {found.poses} poses" if found.poses > 1 else "at one pose"
    estimated = "" if model.has_bounds else " (estimated)"
    return [
        f"mode {mode}: the mesh raises its frequency by {at_most(error)}{estimated}, {where} of "
        f"the {found.design} design"
        if np.isfinite(error)
        else f"mode {mode}: the mesh is too coarse for an error, {where} of the {found.design} "
        f"design: {finer(model)}"
        for mode, error in zip(found.modes, found.error, strict=True)
    ]


def truncation_notes(scene: Scene, optimum: Floats | None = None) -> list[str]:
    """`truncation_lines` along the trajectory, at the initial design, both bounds, the optimum."""
    q = scene.q0[None] if scene.trajectory is None else travelled(scene.file, scene.trajectory)
    designs = [scene.initial, *scene.bounds, *([] if optimum is None else [optimum])]
    return truncation_lines(scene.model, scene.modes, q, np.array(designs))


def truncation_lines(model: Model, modes: tuple[int, ...], q: Floats, designs: Floats) -> list[str]:
    """By how much reduced links raise frequencies at most, at poses q (n, n_q) of every design.

    Raises AccuracyError where that cannot be bounded: the links are reduced too far.
    """
    if model.reduced is None:
        return []
    few, different = spread(q, SAMPLES), np.unique(designs, axis=0)
    x = np.array([np.hstack([q, y]) for y in different for q in few])
    x = x[far_from_buckling(model, x, most=1.0)]  # bounds may lie beyond what stands
    n_q = len(model.q_names)
    if not len(x):
        raise AccuracyError("reduced links cannot be judged: all designs buckle or fall")
    error = model.truncation_error(x[:, :n_q], x[:, n_q:], modes).max(axis=0)
    stood = len(np.unique(x[:, n_q:], axis=0))
    where = f"{len(few)} poses" + (f" and {stood} designs" if stood > 1 else "")
    for mode, worst in zip(modes, error, strict=True):
        if not np.isfinite(worst):
            raise AccuracyError(
                f"mode {mode}: the error of the reduced links has no bound over {where}: raise "
                "reduce_to"
            )
    return [
        f"mode {mode}: reduced links raise its frequency by {at_most(worst)}, over {where}"
        for mode, worst in zip(modes, error, strict=True)
    ]
