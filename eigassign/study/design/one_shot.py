"""The paper's answer: one quadratic program about one expansion point.

The linear model of eq. (9) comes from the partially linearised expansion, the design from the
quadratic program of eqs. (13)–(14) (`eigassign.assignment`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.assign import Assignment, solve_assignment
from eigassign.assignment.inputs import LinearModel
from eigassign.assignment.listed import ListedValues
from eigassign.assignment.program import Bounds
from eigassign.assignment.requirements.requirement import Requirement
from eigassign.assignment.requirements.sampling import time_weights
from eigassign.case.case_file import CaseFile
from eigassign.errors import AccuracyError
from eigassign.study.results import DesignRow, SolverRow
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]


def assign_design(scene: Scene, targets: Sequence[Requirement]) -> Assignment:
    """Build and solve the quadratic program of eqs. (13)–(14) on the linearised expansion.

    Raises InfeasibleError with the names of the constraints that contradict each other.
    """
    file, path = scene.file, scene.path
    l0, slope = scene.expansions.linear_in_design(path)
    _require_near(scene, l0)
    column = scene.expansions.column
    goals = [
        (own, LinearModel(l0[own.rows, k], slope[own.rows, k]))
        for own in targets
        for k in [column(own.mode)]
    ]
    return solve_assignment(
        goals,
        time_weights(path),
        scene.expansions.linear.y0,
        scene.initial,
        Bounds(*scene.bounds),
        scene.constraints,
        tuple(file.design.parameters),
    )


def catalogues(file: CaseFile) -> tuple[ListedValues, ...]:
    """The case's catalogues, as the assignment takes them: prices are of F."""
    unit = price_of_one(file)
    return tuple(
        ListedValues(
            own.name,
            own.columns,
            np.array(own.rows),
            own.choices,
            tuple(price / unit for price in own.prices),
        )
        for own in file.design.catalogues
    )


def price_of_one(file: CaseFile) -> float:
    """The price that is F = 1: beside errors prices are in %² of them, in the worst case in %.

    Beside room they are in % of it too, beside a highest frequency in Hz.
    """
    aim = file.assignment.objective
    if aim == "widest":
        return 1e2
    if not any(target.is_goal for target in file.targets):
        return 1.0
    return 1e2 if aim == "worst_case" else 1e4


def _require_near(scene: Scene, l0: Floats) -> None:
    """Raise AccuracyError where the expansion is so far from a pose that it predicts λ ≤ 0."""
    bad = np.argwhere(~(l0 > 0.0))
    if len(bad):
        k, column = (int(i) for i in bad[0])
        problem = scene.file.problem(
            "expansion.q",
            f"gives mode {scene.expansions.modes[column]} a negative λ at {scene.path.where(k)}, "
            "too far from the motion: give a pose of the trajectory, or auto",
        )
        raise AccuracyError(str(problem))


def design_rows(scene: Scene, optimal: Floats) -> tuple[DesignRow, ...]:
    """One row for each design parameter, in the order of the file."""
    parameters, units, initial = (
        scene.file.design.parameters,
        scene.file.design_units,
        scene.initial,
    )
    listed = catalogues(scene.file)
    chosen = {k: choice for own in listed for k, choice in _chosen(own, optimal)}
    unit = price_of_one(scene.file)
    whole = {own.columns[0]: unit * float(own.price(optimal)) for own in listed if own.prices}
    return tuple(
        DesignRow(
            name,
            p.said,
            units[k],
            float(initial[k]),
            float(optimal[k]),
            p.min,
            p.max,
            chosen.get(k),
            p.price,
            whole.get(k),
            scene.file.in_degrees,
        )
        for k, (name, p) in enumerate(parameters.items())
    )


def cost(scene: Scene, y: Floats) -> float | None:
    """The price of a design (n_y,), of choices and of its change; None where nothing has one."""
    costs = [row.cost for row in design_rows(scene, y) if row.is_priced]
    if (limits := scene.file.design.mass) is not None and limits.price is not None:
        costs.append(limits.price * (scene.model.mass(y) - scene.model.mass(scene.initial)))
    return sum(costs) if costs else None


def _chosen(catalogue: ListedValues, y: Floats) -> Iterator[tuple[int, str]]:
    """Yield each column of a catalogue with the name of the choice that y holds."""
    own = y[list(catalogue.columns)]
    row = next((k for k, row in enumerate(catalogue.rows) if np.array_equal(row, own)), None)
    if row is not None:
        for column in catalogue.columns:
            yield column, catalogue.labels[row]


def solver_row(assignment: Assignment) -> SolverRow:
    """The solver's status and residuals, as plain numbers."""
    return SolverRow(
        assignment.status,
        assignment.iterations,
        assignment.primal_residual,
        assignment.dual_residual,
        assignment.gap,
    )
