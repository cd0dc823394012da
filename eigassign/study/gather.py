"""Everything that a run found, put together for the output layer to show."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign._version import __version__
from eigassign.assignment import Assignment
from eigassign.study.assignment_study import design_rows, limit_notes, solver_row
from eigassign.study.crossings import crossing_warnings
from eigassign.study.drawing import draw_poses, rest_pose
from eigassign.study.findings import Findings, ModeStudy, OtherModes, Poses, TargetStudy
from eigassign.study.scene import Scene
from eigassign.study.units import coordinate_units

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Assigned:
    """An assignment with its proof: exact frequencies (n_t, shown modes) before and after."""

    assignment: Assignment
    targets: tuple[TargetStudy, ...]
    initial_hz: Floats
    exact_hz: Floats


def gather(
    scene: Scene,
    studies: tuple[ModeStudy, ...],
    assigned: Assigned | None,
    timing_s: Mapping[str, float],
) -> Findings:
    """The findings of a run; without ``assigned`` those of an expansion only."""
    file, trajectory = scene.file, scene.trajectory
    n_q = len(scene.model.q_names)
    return Findings(
        title=file.title,
        reference=file.reference,
        case_name=file.path.stem,
        case_sha256=file.sha256,
        version=__version__,
        q_names=scene.model.q_names,
        q_units=coordinate_units(file),
        time_s=np.zeros(0) if trajectory is None else trajectory.time_s,
        q=np.zeros((0, n_q)) if trajectory is None else trajectory.q,
        poses=_poses(scene),
        studies=studies,
        design=() if assigned is None else design_rows(scene, assigned.assignment.y),
        targets=() if assigned is None else assigned.targets,
        others=None if assigned is None else _others(scene, assigned),
        solver=None if assigned is None else solver_row(assigned.assignment),
        warnings=(*scene.warnings, *_warnings(scene, assigned)),
        notes=(*scene.notes, *(limit_notes(assigned.assignment) if assigned else ())),
        timing_s=dict(timing_s),
        tolerance=file.validation.max_error,
    )


def _poses(scene: Scene) -> Poses:
    if scene.trajectory is None:
        return rest_pose(scene.file, scene.model, scene.q0, scene.initial)
    return draw_poses(scene.file, scene.model, scene.trajectory, scene.initial)


def _others(scene: Scene, assigned: Assigned) -> OtherModes | None:
    """Up to three modes above the lowest assigned one that have no target themselves."""
    targets = {target.mode for target in assigned.targets}
    rest = [m for m in scene.shown_modes if m > min(targets) and m not in targets][:3]
    if not rest:
        return None
    columns = [mode - 1 for mode in rest]
    before, after = assigned.initial_hz[:, columns], assigned.exact_hz[:, columns]
    return OtherModes(tuple(rest), before, after)


def _warnings(scene: Scene, assigned: Assigned | None) -> Iterator[str]:
    """What keeps the numbers from meaning what they seem to."""
    if assigned is None:
        return
    modes = tuple(sorted({target.mode for target in assigned.targets}))
    for hz, design in ((assigned.initial_hz, "initial"), (assigned.exact_hz, "optimal")):
        yield from crossing_warnings(hz, modes, scene.path.time_s, design)
    limit = scene.file.validation.max_error
    for target in assigned.targets:
        if target.approximation_error > limit:
            yield (
                f"mode {target.mode}: the linearised frequency that the optimum rests on is up to "
                f"{100 * target.approximation_error:.3g} % off the exact one, over the "
                f"{100 * limit:g} % of validation.max_error; the exact frequencies hold, but a "
                "better design may exist: expand nearer to it (expansion.y), narrow the bounds, or "
                "raise expansion.order"
            )
