"""From a case's targets and bounds to the optimal design, and what it does to the frequencies.

The linear model of eq. (9) comes from the partially linearised expansion, the design from the
quadratic program of eqs. (13)–(14) (`eigassign.assignment`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

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
    solve_assignment,
)
from eigassign.case import CaseFile
from eigassign.errors import AccuracyError, CaseError, Problem
from eigassign.mechanism.trajectory.trajectory import Trajectories
from eigassign.study.results import (
    DesignRow,
    ErrorRow,
    ErrorSummary,
    SolverRow,
    TargetAlong,
    TargetStudy,
)
from eigassign.study.scene import Scene
from eigassign.study.wanted import Wanted, time_weights

Floats = NDArray[np.float64]
_Curves = tuple[Floats, Floats, Floats, Floats]  # wanted, initial, predicted and exact, (n,) in Hz


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
    if problems := (*problems, *_not_yet(file)):
        raise CaseError(problems)


def _not_yet(file: CaseFile) -> Iterator[Problem]:
    """What the quadratic program cannot take."""
    why = "is not assigned yet: only wanted frequencies of numbered modes are"
    for each in file.requirements:
        if each.kind != "frequency" or each.followed is not None:
            key = each.kind if each.followed is None else "mode"
            yield file.problem(f"{each.place}.{key}", why)
    for catalogue in file.design.catalogues:
        yield file.problem(f"design.{catalogue.name}", "is not assigned yet: only bounds are")
    if file.design.mass is not None:
        yield file.problem("design.mass", "is not assigned yet: only linear constraints are")


def assign_design(scene: Scene, targets: tuple[Wanted, ...]) -> Assignment:
    """Build and solve the quadratic program of eqs. (13)–(14) on the linearised expansion.

    Raises InfeasibleError with the names of the constraints that contradict each other.
    """
    file, path = scene.file, scene.path
    l0, slope = scene.expansions.linear_in_design(path)
    _require_near(scene, l0)
    column = scene.expansions.column
    goals = [
        Goal(
            LinearModel(l0[wanted.rows, k], slope[wanted.rows, k]),
            wanted.hz,
            wanted.weight,
            wanted.rows,
        )
        for wanted in targets
        for k in [column(wanted.mode)]
    ]
    return solve_assignment(
        goals,
        time_weights(path),
        scene.expansions.linear.y0,
        scene.initial,
        Bounds(*scene.bounds),
        linear_constraints(file),
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
            f"{scene.expansions.modes[column]} at {scene.path.where(k)}; "
            "give a pose of the trajectory, or auto",
        )
        raise AccuracyError(str(problem))


def _names(file: CaseFile) -> tuple[str, ...]:
    return tuple(file.design.parameters)


def linear_constraints(file: CaseFile) -> list[LinearConstraint]:
    """The case's linear limits between design parameters."""
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
    targets: tuple[Wanted, ...],
    assignment: Assignment,
    initial_hz: Floats,
    exact_hz: Floats,
) -> tuple[TargetStudy, ...]:
    """Each target before, as predicted, and exactly; ``initial_hz``, ``exact_hz`` (n_t, modes)."""
    weights = time_weights(scene.path)
    studies = []
    for k, wanted in enumerate(targets):
        rows, column = wanted.rows, wanted.mode - 1
        predicted = hz_from_lam(assignment.lam[k])
        hz = (wanted.hz, initial_hz[rows, column], predicted, exact_hz[rows, column])
        studies.append(_studied(scene.path, wanted, hz, weights[rows]))
    return tuple(studies)


def _studied(path: Trajectories, wanted: Wanted, hz: _Curves, weights: Floats) -> TargetStudy:
    """``hz`` and ``weights`` are those at its rows of all samples."""
    error = _errors(hz, weights)
    return TargetStudy(
        wanted.mode,
        target_hz=hz[0],
        initial_hz=hz[1],
        predicted_hz=hz[2],
        exact_hz=hz[3],
        initial=error.initial,
        predicted=error.predicted,
        exact=error.exact,
        trajectory=wanted.requirement.target.trajectory,
        rows=wanted.rows,
        weight_s=float(weights.sum()),
        along=tuple(_along(path, wanted.rows, hz, weights)),
    )


def _along(
    path: Trajectories, wanted: slice, hz: _Curves, weights: Floats
) -> Iterator[TargetAlong]:
    """The errors along each trajectory that the target holds on; ``hz`` and ``weights`` its own."""
    for part, rows in zip(path.parts, path.rows, strict=True):
        first, last = max(wanted.start, rows.start), min(wanted.stop, rows.stop)
        if first < last:
            own = slice(first - wanted.start, last - wanted.start)
            target, initial, predicted, exact = (curve[own] for curve in hz)
            error = _errors((target, initial, predicted, exact), weights[own])
            yield TargetAlong(part.name, own, error)


def _errors(hz: _Curves, weights: Floats) -> ErrorSummary:
    wanted, *curves = hz
    return ErrorSummary(*(_error(curve, wanted, weights) for curve in curves))


def _error(frequency: Floats, wanted: Floats, weights: Floats) -> ErrorRow:
    error = relative_error(frequency, wanted, weights)
    return ErrorRow(error.max_relative, error.rms_relative)


def design_rows(scene: Scene, optimal: Floats) -> tuple[DesignRow, ...]:
    """One row for each design parameter, in the order of the file."""
    parameters, units, initial = (
        scene.file.design.parameters,
        scene.file.design_units,
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


# --- Neighbouring frequencies that nearly meet, where two modes may swap their numbers

NEAR = 0.01  # relative gap in Hz below which two modes may swap numbers between samples


def crossing_warnings(
    hz: Floats, modes: tuple[int, ...], where: Callable[[int], str], design: str
) -> Iterator[str]:
    """A warning for each of ``modes`` whose neighbour comes within 1 % along the trajectory.

    ``hz`` (n_t, at least the highest mode) are exact frequencies at the design named ``design``;
    ``where`` says in words which sample k is.
    Modes are numbered by size at every sample: where two curves cross, their numbers swap.
    """
    pairs = {(low, low + 1) for mode in modes for low in (mode - 1, mode) if low >= 1}
    for low, high in sorted(pairs):
        if high > hz.shape[1]:
            continue
        gap = hz[:, high - 1] / hz[:, low - 1] - 1.0
        k = int(np.argmin(gap))
        if gap[k] < NEAR:
            yield (
                f"modes {low} and {high} come within {100 * gap[k]:.2g} % of each other at "
                f"{where(k)}, near {hz[k, low - 1]:.6g} Hz, with the {design} design; "
                "modes are numbered by size, so if they cross there the curve of a mode changes "
                "from one motion to the other"
            )
