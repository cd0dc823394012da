"""Slopes of the targeted frequencies, and where a missed mode has its energy.

Both are read off the exact slopes that the answer was judged by; nothing is solved. A limit with
multiplier μ = −dF/db, relaxed by δ, lowers F to F − μδ to first order; F is the mean square of the
relative errors, or the largest of them, so that the rms error falls from √F to √(F − μδ).

All properties that the mechanism is made of and that are not 0 become parameters of a model of
their own, whose exact slopes say by how many per cent a frequency rises for a per cent more of
each, the coordinates as they are. Those of the design have slopes already.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.assign import ActiveLimit
from eigassign.assignment.exact.design_problem import Appraisal, DesignProblem, Objective
from eigassign.assignment.exact.requirements import Requirements
from eigassign.case.case_file import CaseFile
from eigassign.case.units import handy
from eigassign.errors import EigassignError
from eigassign.modal.exact.solver import modes
from eigassign.modal.model import Model
from eigassign.study.build import build_model
from eigassign.study.design.search.variants import PosedProblem
from eigassign.study.results import (
    EffectRow,
    ModeAnatomy,
    PartRow,
    RelaxedRow,
    SensitivityRow,
)

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


Ints = NDArray[np.intp]
FEW = 21  # samples of a trajectory that modes are looked at


def anatomies(
    model: Model, q: Floats, y: Floats, numbers: Mapping[str, Ints]
) -> Iterator[ModeAnatomy]:
    """Yield each mode's energies and what properties do to it, at poses q (n, n_q) of a design y.

    ``numbers`` (n,) are by the mode's name those that it has there, 0 where it does not matter.
    Raises EigassignError where the model has no such modes.
    """
    count, x = max(int(own.max()) for own in numbers.values()), model.x(q, y)
    found = modes(model.pencil, x, count)
    strain, kinetic = model.energies.shares(model.pencil, x, found.lam, found.phi)
    effects = dict(_effects(model, q, y, count))
    for name, own in numbers.items():
        there = np.flatnonzero(own)

        def row(values: Floats, k: Ints = there, mode: Ints = own) -> tuple[float, float]:
            along = values[k, mode[k] - 1]
            return float(along.mean()), float(along[np.abs(along).argmax()])

        none = np.zeros_like(found.lam)
        parts = tuple(
            PartRow(name, key, *row(strain.get(key, none)), *row(kinetic.get(key, none)))
            for key in dict.fromkeys((*strain, *kinetic))
        )
        rows = [EffectRow(name, path, *row(values)) for path, values in effects.items()]
        # to six digits, so that round-off does not decide which of two alike stands first
        rows.sort(key=lambda one: -float(f"{abs(one.percent_per_percent):.5e}"))
        yield ModeAnatomy(name, parts, tuple(rows))


def _effects(model: Model, q: Floats, y: Floats, count: int) -> Iterator[tuple[str, Floats]]:
    """Yield (p/f) ∂f/∂p (n, count) of each property p that is no design parameter, by its path.

    Without lengths, places and angles where loops cannot follow them.
    """
    case = model.poses.case
    try:
        every = case.with_design(y).with_every_property()
        made = build_model(every)
    except EigassignError:
        every = case.with_design(y).with_every_property(places=False)
        made = build_model(every)
    p = np.array([every.value_at(path) for path in made.y_names])
    x = made.x(q, p)
    wanted = np.arange(x.shape[1]) >= made.pencil.n_joints
    lam, slopes = made.slopes(q, p, count, wanted)
    names = (*made.q_names, *made.y_names)
    for k in np.flatnonzero(wanted):
        if names[k] not in case.design_paths:
            yield names[k], 0.5 * x[:, k, None] * slopes[:, :, k] / lam
