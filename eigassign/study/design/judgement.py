"""What a design does to the targets: the distance to each, as it says itself; modes that meet."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.requirements.requirement import Requirement, Solved
from eigassign.assignment.requirements.sampling import time_weights
from eigassign.case.case_file import CaseFile
from eigassign.case.schema.targets import StaticTarget
from eigassign.mechanism.trajectory.trajectory import Trajectories
from eigassign.study.results import (
    ErrorRow,
    ErrorSummary,
    FollowedRow,
    OtherModes,
    TargetAlong,
    TargetStudy,
)

Floats = NDArray[np.float64]
MET = 1e-8  # a violation below it is round-off


@dataclass(frozen=True)
class SolvedDesigns:
    """Exact frequencies of the initial design, the answer and the one shot."""

    initial: Solved
    exact: Solved
    one_shot: Solved | None = None
    notes: tuple[str, ...] = ()  # why there are none of the one shot


def judged_modes(file: CaseFile, targets: Sequence[TargetStudy]) -> set[int]:
    """The modes whose error under weight counts: of statics what it does to the lowest."""
    static = any(isinstance(target, StaticTarget) for target in file.targets)
    return {mode for target in targets for mode in target.judged} | ({1} if static else set())


def study_targets(
    path: Trajectories,
    wanted: Sequence[Requirement],
    solved: SolvedDesigns,
    predicted: Sequence[Floats | None],
    max_error: float,
) -> tuple[TargetStudy, ...]:
    """Each target before and after; ``predicted`` are their curves (n,) or None.

    A wanted frequency is satisfied within ``max_error``, a limit where nothing violates it.
    """
    weights = time_weights(path)
    return tuple(
        _studied(one, solved, curve, weights[one.rows], max_error)
        for one, curve in zip(wanted, predicted, strict=True)
    )


def _studied(
    asked: Requirement,
    solved: SolvedDesigns,
    predicted: Floats | None,
    weights: Floats,
    max_error: float,
) -> TargetStudy:
    before, after, one_shot = solved.initial, solved.exact, solved.one_shot
    errors = {
        "initial": asked.errors(before),
        "exact": asked.errors(after),
        "predicted": None if predicted is None else predicted / asked.hz - 1.0,
        "one_shot": None if one_shot is None else asked.errors(one_shot),
    }
    summary = _summary(errors, weights)
    return TargetStudy(
        asked=asked,
        initial_hz=asked.curve(before),
        exact_hz=asked.curve(after),
        predicted_hz=predicted,
        one_shot_hz=None if one_shot is None else asked.curve(one_shot),
        error=summary,
        satisfied=bool(summary.exact.max_relative <= (max_error if asked.is_goal else MET)),
        weight_s=float(weights.sum()),
        along=tuple(
            TargetAlong(name, own, _summary(errors, weights, own)) for name, own in asked.along
        ),
        followed=tuple(_followed(asked, before, after)),
        near=_near(asked, before, after),
    )


def _followed(asked: Requirement, before: Solved, after: Solved) -> Iterator[FollowedRow]:
    for mode, k in zip(asked.followed, asked.followed_numbers, strict=True):
        numbers = (solved.numbers[asked.rows, k] for solved in (before, after))
        yield FollowedRow(mode.name, mode.like, *numbers)


def _near(asked: Requirement, before: Solved, after: Solved) -> OtherModes | None:
    modes = asked.near(before, after)
    if modes is None:
        return None
    columns = [mode - 1 for mode in modes]
    return OtherModes(modes, *(solved.hz[asked.rows][:, columns] for solved in (before, after)))


def _summary(
    errors: Mapping[str, Floats | None], weights: Floats, own: slice = slice(None)
) -> ErrorSummary:
    """The errors (n,) of one target, at some ``own`` of its samples, by the names of the rows."""
    rows: dict[str, Any] = {
        name: None if one is None else _row(one[own], weights[own]) for name, one in errors.items()
    }
    return ErrorSummary(**rows)


def _row(errors: Floats, weights: Floats) -> ErrorRow:
    """Largest magnitude and root of the weighted mean square."""
    rms = float(np.sqrt(weights @ errors**2 / weights.sum()))
    return ErrorRow(float(np.abs(errors).max()), rms)


# --- Followed modes that change their numbers

SHOWN = 8  # changes that a note lists


def swap_notes(path: Trajectories, targets: Sequence[TargetStudy]) -> tuple[str, ...]:
    """Say which mode each followed one is and where it swaps, if it is not always the named."""
    return tuple(
        dict.fromkeys(
            f"with the {design} design {row.name} {_runs(path, target, numbers)}"
            for target in targets
            for row in target.followed
            for design, numbers in (
                ("initial", row.initial_numbers),
                ("optimal", row.exact_numbers),
            )
            if (numbers != row.like).any()
        )
    )


def _runs(path: Trajectories, target: TargetStudy, numbers: NDArray[np.intp]) -> str:
    """Write ``swaps its number: mode 2 from sample 0 (t = 0 s), mode 3 from sample 4 …``."""
    if (numbers == numbers[0]).all():
        return f"is mode {numbers[0]} throughout"
    start = target.asked.rows.start
    first = {rows.start for rows in path.rows} | {start}
    changes = [
        k
        for k, number in enumerate(numbers)
        if k == 0 or number != numbers[k - 1] or start + k in first
    ]
    listed = [f"mode {numbers[k]} from {path.where(start + k)}" for k in changes]
    more = f" and {len(changes) - SHOWN} more changes" if len(changes) > SHOWN else ""
    return f"swaps its number: {', '.join(listed[:SHOWN])}{more}"


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
