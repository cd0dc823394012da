"""What the answer means: what it hangs on, what its limits cost, what can be reached at all.

Both are read off the exact slopes that the answer was judged by; nothing is solved. A limit with
multiplier μ = −dF/db, relaxed by δ, lowers F to F − μδ to first order; F is the mean square of the
relative errors, or the largest of them, so that the rms error falls from √F to √(F − μδ).

How much is studied is the user's choice and changes no answer. What follows from slopes already
known, or from two exact solves a pose of a small model, is cheap; `all` adds those of a large one.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.exact.design_problem import MET, Appraisal, DesignProblem, Objective
from eigassign.assignment.exact.requirements import Requirements
from eigassign.assignment.one_shot import ActiveLimit
from eigassign.assignment.requirements.requirement import Requirement, Solved
from eigassign.case.case_file import CaseFile
from eigassign.case.units import handy
from eigassign.study.design.account import active_rows
from eigassign.study.design.answer import Answer
from eigassign.study.design.search.variants import PosedProblem, Task, variant_of
from eigassign.study.meaning.reach import (
    misses,
    proved_ranges,
    reach_rows,
    unreachable,
)
from eigassign.study.results import (
    Meaning,
    RelaxedRow,
    SensitivityRow,
)
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]
STEP = 0.04  # of the range of a bound, or of a limit: how far it is relaxed, to one digit
MOST = 0.3  # of F: a larger fall is beyond what first order can tell


def sensitivities(
    file: CaseFile, asked: Requirements, y: Floats, seen: Appraisal
) -> Iterator[SensitivityRow]:
    """One row for each parameter and curve that a target or limit is about."""
    curves = list(asked.curves(seen))
    for k, name in enumerate(file.design.parameters):
        for own, hz, slopes in curves:
            of_f = slopes[:, k]
            share = y[k] * of_f / np.where(hz == 0.0, np.inf, hz)
            yield SensitivityRow(
                parameter=name,
                unit=file.design_units[k],
                label=own.label,
                hz_per_unit=float(of_f.mean()),
                hz_per_unit_largest=_largest(of_f),
                percent_per_percent=float(share.mean()),
                percent_per_percent_largest=_largest(share),
            )


def deviations(scene: Scene, asked: Requirements, y: Floats, seen: Appraisal) -> Iterator[str]:
    """Say how far frequencies move within the tolerances δ to first order, Σ_k |∂f/∂y_k| δ_k."""
    lower, upper = scene.tolerances.box(y)
    for own, _, slopes in asked.curves(seen):
        most = float((np.abs(slopes) @ (0.5 * (upper - lower))).max())
        if most > 0.0:
            yield f"{own.label}: within the tolerances it moves by up to {most:.3g} Hz, about"


def _largest(values: Floats) -> float:
    return float(values[np.abs(values).argmax()])


# --- Limits


def error_kind(problem: DesignProblem, asked: Requirements) -> str:
    """The objective F in words: an error, room or a frequency only where nothing has a price."""
    if asked.aims and problem.cost is None:
        return "room" if asked.aims[0].kind != "highest" else "frequency"
    if problem.cost is not None and not asked.goals and not asked.aims:
        return "price" if problem.cost.free or not problem.cost.of_mass else "mass"
    if not asked.goals or problem.cost is not None:
        return "objective"
    return "worst error" if problem.objective is Objective.WORST_CASE else "rms error"


def as_error(kind: str, F: float) -> float:
    """F as the quantity of `error_kind`."""
    if kind in ("room", "frequency"):
        return -F
    return float(np.sqrt(max(F, 0.0))) if kind == "rms error" else F


def relaxed_limits(
    file: CaseFile, variant: PosedProblem, F: float, active: Sequence[ActiveLimit]
) -> Iterator[RelaxedRow]:
    """The gain of a little more room at each active limit, if there is any."""
    problem, kind = variant.problem, error_kind(variant.problem, variant.requirements)
    for row in active:
        if row.multiplier <= 0.0 or _is_natural(file, problem, row):
            continue
        amount, unit = _amount(file, problem, row)
        while row.multiplier * amount > MOST * abs(F) > 0.0:
            amount = _rounded(0.5 * amount)
        before, after = as_error(kind, F), as_error(kind, F - row.multiplier * amount)
        change = f"{before:.4g} → {after:.4g}{' kg' * (kind == 'mass')}"
        if kind.endswith("error") or kind == "room":
            change = f"{100 * before:#.3g} → {100 * after:#.3g} %"
        yield RelaxedRow(
            row.name, row.kind, row.side, amount, unit, kind, before, after,
            f"{_room(variant, row, amount, unit)}: {kind} {change}",
        )  # fmt: skip


def _is_natural(file: CaseFile, problem: DesignProblem, row: ActiveLimit) -> bool:
    """True if nature sets the bound: no mass, inertia or stiffness is below zero."""
    if row.kind != "bound" or row.side != "lower":
        return False
    k = list(file.design.parameters).index(row.name)
    return problem.lower[k] == 0.0 and file.design_units[k].startswith(("kg", "N"))


def _amount(file: CaseFile, problem: DesignProblem, row: ActiveLimit) -> tuple[float, str]:
    if row.kind == "bound":
        k = list(file.design.parameters).index(row.name)
        return _rounded(STEP * float(problem.upper[k] - problem.lower[k])), file.design_units[k]
    if row.kind == "constraint":
        (terms,) = (one.coefficients for one in problem.constraints if one.name == row.name)
        span = float(np.abs(terms) @ (problem.upper - problem.lower))
        units = {file.design_units[k] for k in np.flatnonzero(terms)}
        return _rounded(STEP * span), units.pop() if len(units) == 1 else "(SI)"
    return 0.01, ""


def _rounded(value: float) -> float:
    """``value`` to one digit; 1 where there is nothing to round."""
    return float(f"{value:.0e}") if value > 0.0 else 1.0


def _room(variant: PosedProblem, row: ActiveLimit, amount: float, unit: str) -> str:
    if row.kind == "target":
        return variant.requirements.named(row.name).relaxed(row.side, amount)
    more = "more" if row.side == "upper" else "less"
    named = f"{'bound' if row.kind == 'bound' else 'limit'} of {row.name}"
    return f"{handy(amount, unit)} {more} at the {row.side} {named}"


class Studies(StrEnum):
    """The studies of an answer that the user asks for."""

    NONE = "none"
    CHEAP = "cheap"
    ALL = "all"


def study_meaning(
    scene: Scene,
    answer: Answer,
    wanted: Sequence[Requirement],
    exact: Solved,
    max_error: float,
    studies: Studies,
) -> Meaning:
    """What the answer, of frequencies ``exact``, means; as far as ``studies`` asks for it.

    Whether a target that is missed by more than ``max_error`` can be reached is always studied.
    """
    missed = any(misses(w, exact, max_error) for w in wanted)
    # two exact solves a pose are cheap for small models, even where nothing is missed
    small = scene.model.pencil.is_dense
    asked_for = studies is Studies.ALL or (studies is Studies.CHEAP and small)
    ranges = proved_ranges(scene) if missed or asked_for else None
    beyond = tuple(unreachable(scene, wanted, answer.y, exact, max_error, ranges))
    reach = () if ranges is None else tuple(reach_rows(wanted, ranges))
    if studies is Studies.NONE:
        return Meaning(unreachable=beyond)
    found = answer.found
    variant = variant_of(Task(scene, tuple(wanted)), ()) if found is None else found.variant
    seen = variant.problem.appraise(answer.y) if found is None else found.best.seen
    relaxed: Iterator[RelaxedRow] = iter(())
    if found is not None and found.best.seen.violation <= MET:  # else limits are no price
        active = tuple(active_rows(scene, answer))
        relaxed = relaxed_limits(scene.file, variant, found.best.objective, active)
    return Meaning(
        sensitivity=tuple(sensitivities(scene.file, variant.requirements, answer.y, seen)),
        relaxed=tuple(relaxed),
        reach=reach,
        unreachable=beyond,
        notes=tuple(deviations(scene, variant.requirements, answer.y, seen)),
    )
