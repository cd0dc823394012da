"""From a case's targets and bounds to the optimal design, and what it does to the frequencies."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment import (
    Assignment,
    Bounds,
    Goal,
    LinearConstraint,
    LinearModel,
    hz_from_lam,
    relative_error,
    sample_target,
    solve_assignment,
    trapezoidal_weights,
)
from eigassign.case import CaseFile, Target
from eigassign.errors import AccuracyError, CaseError, UsageError
from eigassign.study.findings import DesignRow, ErrorRow, SolverRow, TargetStudy
from eigassign.study.scene import Scene
from eigassign.study.units import design_units

Floats = NDArray[np.float64]


def require_assignable(file: CaseFile) -> None:
    """Raise CaseError naming every key that an assignment needs and the case lacks."""
    needs = {
        "trajectory": (file.trajectory is not None, "along which the frequencies are assigned"),
        "design": (bool(file.design.parameters), "at least one parameter that may change"),
        "targets": (bool(file.targets), "at least one wanted frequency"),
    }
    problems = tuple(
        file.problem(key, f"is missing, and optimize needs it: {why}")
        for key, (given, why) in needs.items()
        if not given
    )
    if problems:
        raise CaseError(problems)


def target_frequencies(file: CaseFile, time_s: Floats) -> tuple[Floats, ...]:
    """The wanted frequency (n_t,) in Hz of each target; CaseError where one ends too early."""
    sampled = []
    for k, target in enumerate(file.targets):
        try:
            sampled.append(_sampled(target, time_s))
        except UsageError as error:
            path = f"targets[{k}].frequency"
            raise CaseError((file.problem(path, str(error)),)) from error
    return tuple(sampled)


def _sampled(target: Target, time_s: Floats) -> Floats:
    wanted = target.frequency
    if isinstance(wanted, float | int):
        return sample_target(time_s, float(wanted))
    return sample_target(time_s, wanted.frequency, wanted.time)


def assign_design(scene: Scene, target_hz: tuple[Floats, ...]) -> Assignment:
    """Build and solve the quadratic program of eqs. (13)–(14) on the linearised expansion.

    Raises InfeasibleError with the names of the constraints that contradict each other.
    """
    file, path = scene.file, scene.path
    l0, slope = scene.expansions.linear_in_design(path.q)
    _require_near(scene, l0)
    column = scene.expansions.column
    goals = [
        Goal(
            LinearModel(l0[:, column(target.mode)], slope[:, column(target.mode)]),
            wanted,
            target.weight,
        )
        for target, wanted in zip(file.targets, target_hz, strict=True)
    ]
    return solve_assignment(
        goals,
        path.time_s,
        scene.expansions.linear.y0,
        scene.initial,
        Bounds(*scene.bounds),
        _constraints(file),
        _names(file),
    )


def _require_near(scene: Scene, l0: Floats) -> None:
    """Raise AccuracyError where the expansion is so far from a pose that it predicts λ ≤ 0."""
    bad = np.argwhere(~(l0 > 0.0))
    if len(bad):
        k, column = (int(i) for i in bad[0])
        problem = scene.file.problem(
            "expansion.q",
            f"too far from the motion: the expansion predicts a negative λ of mode "
            f"{scene.expansions.modes[column]} at sample {k} (t = {scene.path.time_s[k]:.4g} s); "
            "give a pose of the trajectory, or auto",
        )
        raise AccuracyError(str(problem))


def _names(file: CaseFile) -> tuple[str, ...]:
    return tuple(file.design.parameters)


def _constraints(file: CaseFile) -> list[LinearConstraint]:
    return [
        LinearConstraint(
            name,
            np.array([constraint.terms.get(parameter, 0.0) for parameter in _names(file)]),
            -np.inf if constraint.min is None else constraint.min,
            np.inf if constraint.max is None else constraint.max,
        )
        for name, constraint in file.design.constraints.items()
    ]


def study_targets(
    scene: Scene,
    target_hz: tuple[Floats, ...],
    assignment: Assignment,
    initial_hz: Floats,
    exact_hz: Floats,
) -> tuple[TargetStudy, ...]:
    """Each target before, as predicted, and exactly; ``initial_hz``, ``exact_hz`` (n_t, modes)."""
    weights = trapezoidal_weights(scene.path.time_s)
    studies = []
    for k, (target, wanted) in enumerate(zip(scene.file.targets, target_hz, strict=True)):
        curves = (
            initial_hz[:, target.mode - 1],
            hz_from_lam(assignment.lam[k]),
            exact_hz[:, target.mode - 1],
        )
        errors = (_error(curve, wanted, weights) for curve in curves)
        studies.append(TargetStudy(target.mode, wanted, *curves, *errors))
    return tuple(studies)


def _error(frequency: Floats, wanted: Floats, weights: Floats) -> ErrorRow:
    error = relative_error(frequency, wanted, weights)
    return ErrorRow(error.max_relative, error.rms_relative)


def design_rows(scene: Scene, optimal: Floats) -> tuple[DesignRow, ...]:
    """One row for each design parameter, in the order of the file."""
    parameters, units, initial = (
        scene.file.design.parameters,
        design_units(scene.file),
        scene.initial,
    )
    return tuple(
        DesignRow(name, p.parameter, units[k], float(initial[k]), float(optimal[k]), p.min, p.max)
        for k, (name, p) in enumerate(parameters.items())
    )


def solver_row(assignment: Assignment) -> SolverRow:
    """What the solver reached, as plain numbers."""
    return SolverRow(
        assignment.status,
        assignment.iterations,
        assignment.primal_residual,
        assignment.dual_residual,
        assignment.gap,
    )


def limit_notes(assignment: Assignment) -> list[str]:
    """What holds the optimum back, and what no frequency depends on."""
    grouped: dict[str, list[str]] = {}
    for limit in assignment.active:
        grouped.setdefault(f"{limit.side} {limit.kind}", []).append(limit.name)
    notes = [f"on its {side} of {', '.join(names)}" for side, names in grouped.items()]
    notes = [f"the optimum lies {note}" for note in notes]
    if assignment.undetermined:
        notes.append(
            f"{assignment.undetermined} direction(s) of the design change no target: there the "
            "initial design is kept as nearly as the limits allow"
        )
    return notes
