"""Everything that a run found, put together for the output layer to show."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from typing import Any

import numpy as np

from eigassign.arrays import Floats
from eigassign.assignment.requirements.sampling import time_weights
from eigassign.case.case_file import CaseFile
from eigassign.case.units import SI, handy_unit
from eigassign.errors import EigassignError, TrajectoryError
from eigassign.mechanism.trajectory.trajectory import Trajectories
from eigassign.study import results
from eigassign.study.checks import Accuracy, MotionStudy, study_motion
from eigassign.study.design.account import VerifiedAssignment, assignment_row, limit_notes
from eigassign.study.design.answer import solver_row
from eigassign.study.design.judgement import far_off, judged_modes, mode_rows
from eigassign.study.design.lists import cost, design_rows
from eigassign.study.given import given
from eigassign.study.pictures import draw_poses, rest_pose
from eigassign.study.scene import ModeStudies, Scene, reach_warnings

ROUND_OFF = 1e-13  # of the weight, or of the largest load: what a level direction leaves of it


def collect_results(
    scene: Scene,
    studies: ModeStudies,
    accuracy: Accuracy,
    assigned: VerifiedAssignment | None,
    moving: tuple[results.Motion, ...],
    timing_s: Mapping[str, float],
    responses: tuple[results.ResponseRow, ...] = (),
) -> results.RunResults:
    """The results of a run; without ``assigned`` those of an expansion only."""
    file, trajectory = scene.file, scene.trajectory
    along = [(s.over_time.worst["taylor"], s.mode) for s in studies.rows if s.over_time is not None]
    reach, n, weight = reach_warnings(scene, along), len(file.coordinates), accuracy.weight
    warnings = [*scene.warnings, *reach, *weight.warnings]
    notes = [*scene.notes, *studies.notes, *accuracy.notes]
    answer, targets = dict[str, Any](), tuple[results.TargetStudy, ...]()
    if trajectory is None:
        poses = rest_pose(file, scene.model, scene.q0, scene.initial)
    else:
        poses = draw_poses(file, scene.model, trajectory, scene.initial)
    if responses and not any(np.any(each) for row in responses for each in row.ratios):
        warnings.append("no damping is stated: responses are infinite at resonances")
    if assigned is not None:
        solved, targets = assigned.solved, assigned.targets
        judged = judged_modes(file, targets)
        motion = study_motion(scene, assigned.answer.y, solved.exact.hz, judged)
        answer = _answer(scene, assigned, accuracy, motion)
        # the reach of expansions matters to an answer that they gave
        reach = reach if assigned.answer.found is None else ()
        warnings = [*scene.warnings, *_warnings(scene, assigned), *reach, *weight.warnings]
        notes += [*solved.notes, *assigned.answer.notes]
        notes += limit_notes(assigned.answer, answer["assignment"], targets)
        if motion is not None:
            warnings += filter(None, [motion.warning])
            notes += filter(None, [motion.note])
        notes += assigned.meaning.notes
    return results.RunResults(
        case=results.CaseRow.of(file),
        given=given(file, trajectory),
        reduced=scene.model.is_reduced,
        q_names=tuple(file.coordinates),
        q_units=file.coordinate_units,
        time_s=np.zeros(0) if trajectory is None else trajectory.time_s,
        q=np.zeros((0, n)) if trajectory is None else trajectory.q[:, :n],
        trajectories=tuple(_trajectories(file, trajectory, targets)),
        poses=poses,
        studies=studies.rows,
        warnings=tuple(warnings),
        notes=tuple(notes),
        timing_s=dict(timing_s),
        discretisation=accuracy.mesh,
        weight=weight.row,
        moving=moving,
        responses=responses,
        **answer,
    )


SMOOTH = 100  # samples of a trajectory: a curve through more has no kinks to be seen


def between_samples(
    scene: Scene, y: Floats, count: int
) -> dict[str, tuple[Floats, tuple[results.ModeRow, ...]]]:
    """The lowest ``count`` modes at many instants, by trajectory, for pictures; none if dear."""
    if not scene.model.pencil.is_dense or len(scene.path.time_s) > SMOOTH * len(scene.path.parts):
        return {}
    try:
        fine = scene.path.finely
        both = [scene.model.frequencies(fine.at(one)[0], one, count) for one in (scene.initial, y)]
    except EigassignError:  # between samples the tip may leave its path
        return {}
    return {
        part.name: (
            fine.time_s[rows],
            tuple(results.ModeRow(k + 1, *(hz[rows, k] for hz in both)) for k in range(count)),
        )
        for part, rows in zip(fine.parts, fine.rows, strict=True)
    }


def _answer(
    scene: Scene, assigned: VerifiedAssignment, accuracy: Accuracy, motion: MotionStudy | None
) -> dict[str, Any]:
    """The fields of results that an answer has."""
    answer, targets, solved = assigned.answer, assigned.targets, assigned.solved
    row = assignment_row(scene, assigned, accuracy, motion)
    limits, mass = scene.file.design.mass, scene.model.mass
    rows = design_rows(scene, answer.y)[: len(scene.file.design.chosen)]  # not what is uncertain
    asked = (None,) * 3 if limits is None else (limits.min, limits.max, limits.price)
    name = "total mass" if any(one.name == "mass" for one in rows) else "mass"
    on = {limit.name: limit.side for limit in row.active if limit.kind == "bound"}
    return {
        "design": tuple(replace(one, lies_on=on.get(one.name, "")) for one in rows),
        "targets": tuple(_checked(one, row.clearances) for one in targets),
        "other_modes": mode_rows(_others(scene, assigned), solved.initial, solved.exact),
        "spectrum": mode_rows(range(1, solved.exact.hz.shape[1] + 1), solved.initial, solved.exact),
        "price": cost(scene, answer.y),
        "solver": None if answer.one_shot is None else solver_row(answer.one_shot),
        "assignment": row,
        "meaning": assigned.meaning,
        "mass": results.MassRow(
            *(mass(scene.initial), mass(answer.y), *asked, name), handy_unit(scene.file.mass_unit)
        ),
        "orders": tuple(dict.fromkeys(_orders(scene.file))),
        "drives": _drives(scene, answer.y),
        "statics": tuple(_statics(scene, answer.y)),
    }


def _orders(file: CaseFile) -> Iterator[tuple[float, float, float]]:
    """The multiples that targets name, of what in Hz, ± what; once of what they write in rpm."""
    for target in file.targets:
        band = getattr(target, "keep_out", None)
        times, margin = (getattr(band, key, 0.0) for key in ("harmonic", "margin"))
        each: list[Any] = []
        for _, curve in target.frequencies:
            each += getattr(curve, "frequency", (curve,))
        yield from ((times or 1, f, margin) for f in each if times or SI("Hz", f).answered == "rpm")


def _checked(
    target: results.TargetStudy, found: Sequence[results.ClearanceRow]
) -> results.TargetStudy:
    """A target with the room of its band as it was checked, between the samples too."""
    own = [one.room for one in found if one.clear and one.label.startswith(target.label)]
    if not own or target.room is None or not target.satisfied:
        return target
    return replace(target, room=min(target.room, *own))


def _drives(scene: Scene, y: Floats) -> tuple[results.DriveRow, ...]:
    """What every drive exerts before and after; none where there is no weight and no motion."""
    file, path, g = scene.file, scene.path, scene.file.mechanism.gravity
    fine, curves = path.finely, [scene.model.drives.curves(path, one) for one in (scene.initial, y)]
    try:  # peaks are between samples too
        along = [scene.model.drives.curves(fine, one) for one in (scene.initial, y)]
    except TrajectoryError:  # a design that the tip follows its path with at samples only
        fine, along = path, curves
    pull = scene.model.mass(y) * float(np.linalg.norm(g)) if isinstance(g, tuple) else 0.0
    small = ROUND_OFF * max(pull, *(np.abs(curve).max(initial=0.0) for curve in along))
    curves, along = (
        [np.where(np.abs(curve) > small, curve, 0.0) for curve in each] for each in (curves, along)
    )
    weights = time_weights(fine)
    weights = weights / weights.sum()
    of = results.WEIGHED if isinstance(g, tuple) else "the motion alone (gravity: none)"
    if g is None:
        of = "the motion alone (gravity is not stated)"
    if not isinstance(g, tuple) and not any(curve.any() for curve in along):
        return ()

    def load(tau: Floats) -> results.DriveLoad:
        k = int(np.abs(tau).argmax())
        where = fine.where(k) if tau[k] else ""
        return results.DriveLoad(abs(float(tau[k])), float(np.sqrt(weights @ tau**2)), where)

    def limit(name: str) -> float | None:
        return file.design.torque[name].max if name in file.design.torque else None

    return tuple(
        results.DriveRow(name, unit, limit(name), before, after, of, load(tau), load(tau_y))
        for name, unit, tau, tau_y, before, after in zip(
            *(file.coordinates, file.drive_units), *(c.T for c in (*along, *curves)), strict=True
        )
    )


def _statics(scene: Scene, y: Floats) -> Iterator[results.StaticRow]:
    for one in scene.statics:
        curves = np.full((2, len(scene.path.time_s)), np.nan)
        curves[:, one.rows] = [one.curve_of(each) for each in (scene.initial, y)]
        limit = next(edge for edge in one.allowed if np.isfinite(edge))
        yield results.StaticRow(one.label, one.unit, limit, *curves)


def _trajectories(
    file: CaseFile, path: Trajectories | None, targets: tuple[results.TargetStudy, ...]
) -> Iterator[results.TrajectoryRow]:
    parts = () if path is None else zip(path.parts, path.rows, strict=True)
    for k, (part, rows) in enumerate(parts):
        places = getattr(file.trajectories[k][2], "waypoints", ())
        along = [one for target in results.counted_of(targets) for one in target.along]
        errors = [(one.error, 1.0) for one in along if one.name == part.name]
        yield results.TrajectoryRow(
            name=part.name,
            rows=rows,
            duration_s=float(np.ptp(part.trajectory.time_s)),
            weight=part.weight,
            tip=part.trajectory.tip,
            tip_unit=SI("m", *chain.from_iterable(places)),
            loads={path: load.along[k] for path, load in file.loads.items()} or None,
            error=results.over_all(errors) if errors else None,
        )


def _others(scene: Scene, assigned: VerifiedAssignment) -> list[int]:
    """Modes without a target: the expanded ones, and three above the lowest assigned one."""
    targets = {mode for target in assigned.targets for mode in target.numbers}
    count = assigned.solved.initial.hz.shape[1]
    free = [mode for mode in range(1, count + 1) if mode not in targets]
    above = [mode for mode in free if mode > min(targets, default=0)][:3]
    return [mode for mode in free if mode in above or mode in scene.modes]


def _warnings(scene: Scene, assigned: VerifiedAssignment) -> Iterator[str]:
    """Warnings of results that may mislead: doubts, crossing modes, a poor or worse design."""
    for target in assigned.targets:
        yield from () if target.asked.is_aim else far_off(target.asked, target.initial_hz)
    limit = scene.file.validation.max_error
    point = ", ".join(f"{value:.4g}" for value in assigned.answer.y)
    one_shot = assigned.targets if assigned.answer.found is None else ()
    for target in (each for each in one_shot if not each.approximation_error <= limit):
        yield (
            f"{target.label}: the predicted frequency is up to "
            f"{100 * target.approximation_error:.3g} % off the exact one, over the {100 * limit:g} "
            f"% of validation.max_error: try expansion.y: [{point}], or method: sequential"
        )
