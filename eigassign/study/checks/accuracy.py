"""How far the numbers of a run can be trusted: errors stated side by side.

`study_accuracy` states the errors of mesh, reduced links and round-off. It needs no exact solves
but those at the few poses where mesh and reduced links are judged.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.case.case_file import CaseFile
from eigassign.mechanism.kinematics.parameters import link_type
from eigassign.mechanism.trajectory.trajectory import (
    Trajectories,
)
from eigassign.modal.arguments import spread
from eigassign.modal.exact.roundoff import rounding_error
from eigassign.modal.model import Model
from eigassign.study.checks.mesh import judged_mesh, mesh_lines, truncation_lines
from eigassign.study.checks.weight import WeightStudy, study_weight
from eigassign.study.planning import poses_at
from eigassign.study.results import MeshError
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]
POSES = 9  # at which the weight is judged; each costs an exact solve
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
    q = _judged_at(scene.model, scene.trajectory, scene.q0, y)
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


def _judged_at(model: Model, trajectory: Trajectories | None, q0: Floats, y: Floats) -> Floats:
    """The poses at which design y is judged: those of its trajectory, or q0."""
    return q0[None] if trajectory is None else judged_poses(model, poses_at(trajectory, y))


def judged_poses(model: Model, q: Floats) -> Floats:
    """The poses of q (n, n_q) at which the weight is judged."""
    return spread(q, POSES if model.n_dof <= LARGE else POSES_LARGE)


def truncation_notes(scene: Scene, optimum: Floats | None = None) -> list[str]:
    """`truncation_lines` along the trajectory, at the initial design and the optimum."""
    designs = [scene.initial, *([] if optimum is None else [optimum])]
    return list(truncation_lines(scene.model, scene.modes, scene.trajectory, scene.q0, designs))
