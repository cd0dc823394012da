"""What the answer means: what it hangs on, what its limits cost, what can be reached at all.

How much is studied is the user's choice and changes no answer. What follows from slopes already
known, or from two exact solves a pose of a small model, is cheap; `all` adds those of a large one.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.exact.design_problem import MET, Appraisal
from eigassign.assignment.exact.requirements import Requirements
from eigassign.assignment.requirements.requirement import Requirement, Solved
from eigassign.errors import EigassignError
from eigassign.study.design.account import active_rows
from eigassign.study.design.answer import Answer
from eigassign.study.design.search.optimum import Found
from eigassign.study.design.search.variants import Task, variant_of
from eigassign.study.meaning.reach import (
    misses,
    proved_ranges,
    reach_rows,
    study_tolerance,
    unreachable,
)
from eigassign.study.meaning.sensitivity import FEW, anatomies, relaxed_limits, sensitivities
from eigassign.study.results import Meaning, ModeAnatomy, RelaxedRow, ToleranceRows
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]


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
    found, (asked, seen) = answer.found, _judged(scene, answer, wanted)
    notes: list[str] = []
    return Meaning(
        sensitivity=tuple(sensitivities(scene.file, asked, answer.y, seen)),
        relaxed=() if found is None else tuple(_relaxed(scene, answer, found)),
        reach=reach,
        tolerance=_tolerance(scene, answer, wanted, exact, notes),
        unreachable=beyond,
        anatomies=_anatomies(scene, answer.y, wanted, exact, max_error, notes),
        notes=tuple(notes),
    )


def _anatomies(
    scene: Scene,
    y: Floats,
    wanted: Sequence[Requirement],
    exact: Solved,
    max_error: float,
    notes: list[str],
) -> tuple[ModeAnatomy, ...]:
    """The modes of the targets that are missed, where they are asked for, at some samples."""
    samples = scene.path.spread(FEW)
    numbers: dict[str, NDArray[np.intp]] = {}
    for one in (w for w in wanted if misses(w, exact, max_error)):
        worst = one.rows.start + int(np.abs(one.errors(exact)).argmax())
        samples = np.union1d(samples, [worst])
        named = {
            f"mode {k}": np.full(len(exact.hz), k) for k in one.near(exact, exact) or one.modes
        }
        if one.followed:
            shapes = zip(one.followed, one.followed_numbers, strict=True)
            named = {mode.name: exact.numbers[:, k] for mode, k in shapes}
        for name, own in named.items():
            known = numbers.setdefault(name, np.zeros(len(exact.hz), dtype=np.intp))
            known[one.rows] = own[one.rows]
    if not numbers:
        return ()
    of_samples = {name: own[samples] for name, own in numbers.items()}
    q = scene.path.at(y)[0][samples]
    try:
        found = tuple(anatomies(scene.model, q, y, of_samples))
    except EigassignError as error:
        notes.append(f"missed modes are not explained: {error}")
        return ()
    notes += (one.words for one in found)
    return found


def _tolerance(
    scene: Scene, answer: Answer, wanted: Sequence[Requirement], exact: Solved, notes: list[str]
) -> ToleranceRows | None:
    """The spread within the tolerances; where it cannot be had, why not among the notes."""
    try:
        found = study_tolerance(scene, wanted, answer.y, exact)
    except EigassignError as error:
        notes.append(f"tolerances are not studied: {error}")
        return None
    if found is not None:
        notes.append(found.words)
    return found


def _relaxed(scene: Scene, answer: Answer, found: Found) -> Iterator[RelaxedRow]:
    if found.best.seen.violation > MET:  # a limit that is missed is no price of the objective
        return
    active = tuple(active_rows(scene, answer))
    yield from relaxed_limits(scene.file, found.variant, found.best.objective, active)


def _judged(
    scene: Scene, answer: Answer, wanted: Sequence[Requirement]
) -> tuple[Requirements, Appraisal]:
    """The studies asked for, with their results; solved only where they were not before."""
    if answer.found is not None:
        variant = answer.found.variant
        return variant.requirements, answer.found.best.seen
    variant = variant_of(Task(scene, tuple(wanted)), ())
    return variant.requirements, variant.problem.appraise(answer.y)
