"""What a design does to the targets: the distance to each, as it says itself; modes that meet."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.requirements.requirement import Requirement, Solved
from eigassign.assignment.requirements.sampling import time_weights
from eigassign.case.case_file import CaseFile
from eigassign.case.schema.targets import StaticTarget
from eigassign.mechanism.kinematics.parameters import initial_design
from eigassign.mechanism.trajectory.trajectory import Trajectories
from eigassign.modal.exact.solver import modes
from eigassign.modal.model import Model
from eigassign.study.results import (
    MET,
    ErrorRow,
    ErrorSummary,
    FollowedRow,
    ModeRow,
    TargetAlong,
    TargetStudy,
)

Floats = NDArray[np.float64]


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
        _studied(one, solved, curve, one.time_weights(weights), max_error, path.time_s[one.rows])
        for one, curve in zip(wanted, predicted, strict=True)
    )


def _studied(
    asked: Requirement,
    solved: SolvedDesigns,
    predicted: Floats | None,
    weights: Floats,
    max_error: float,
    time_s: Floats,
) -> TargetStudy:
    before, after, one_shot = solved.initial, solved.exact, solved.one_shot
    errors = {
        "initial": asked.errors(before),
        "exact": asked.errors(after),
        "predicted": None if predicted is None else predicted / asked.hz - 1.0,
        "one_shot": None if one_shot is None else asked.errors(one_shot),
    }
    summary, near = _summary(errors, weights), asked.near(before, after)
    return TargetStudy(
        asked=asked,
        time_s=time_s,
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
        near=None if near is None else mode_rows(near, before, after, asked.rows),
    )


def _followed(asked: Requirement, before: Solved, after: Solved) -> Iterator[FollowedRow]:
    for mode, k in zip(asked.followed, asked.followed_numbers, strict=True):
        numbers = (solved.numbers[asked.rows, k] for solved in (before, after))
        yield FollowedRow(mode.name, mode.like, *numbers)


def mode_rows(
    modes: Iterable[int], before: Solved, after: Solved, rows: slice = slice(None)
) -> tuple[ModeRow, ...]:
    """Some of the modes that were solved, before and after."""
    return tuple(ModeRow(k, before.hz[rows, k - 1], after.hz[rows, k - 1]) for k in modes)


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


# --- What a colleague would ask of the initial design

# f goes with √(stiffness / mass): a tenth, or ten times, is a hundredfold of either. Targets of the
# shipped cases are 0.80 to 2.6 times what their files have.
FAR = 10.0
# The share of its strain that mode 1 has outside of drives. In series with links a thousand times
# as stiff it is 0.001 of a static load, and up to 0.003 where a motor's mass stands between a soft
# drive and the links. In the shipped cases it is 0.1 at least.
STIFF = 5e-3
RIGID = 1e-9  # the same of links that cannot bend: round-off


def far_off(asked: Requirement, hz: Floats) -> Iterator[str]:
    """Doubt a frequency, or limit, that is a decade away from all that the initial design has."""
    low, high = asked.lower.min(), asked.upper.max()
    if len(asked.mode_terms) == 1 and (hz.max() < low / FAR or hz.min() > FAR * high):
        near, edge = (hz.max(), low) if hz.max() < low else (hz.min(), high)
        off = max(near / edge, edge / near)
        yield (
            f"{asked.label}: the initial design has {near:.4g} Hz, a factor of {off:,.0f} off. "
            "Check the unit (60 rpm are 1 Hz), the mode, stiffnesses and masses"
        )


def soft_drives(file: CaseFile, model: Model, q: Floats) -> Iterator[tuple[str, str]]:
    """Doubt drives beside which links hardly bend in mode 1 at a pose q (1, n_q): place, words."""
    found = modes(model.pencil, model.x(q, initial_design(file)), 1)
    lam, phi = found.lam[0, 0], found.phi[0, :, 0]
    motion, shares = phi[len(phi) - len(model.motion.columns) :], dict[str, float]()
    rates = model.motion.coordinates.rates[: len(file.coordinates)]
    for rate, (name, one) in zip(rates, file.coordinates.items(), strict=True):
        k = getattr(one.drive, "stiffness", None) or 0.0
        shares[name] = float(k * (rate @ motion) ** 2 / lam)
    if RIGID < 1.0 - sum(shares.values()) < STIFF:
        name = max(shares, key=lambda each: shares[each])
        sliding = file.coordinate_units[list(shares).index(name)] == "m"
        yield (
            f"coordinates.{name}.drive.stiffness",
            f"mode 1 has {100 * shares[name]:.2f} % of its strain in this drive, the links hardly "
            f"bend: check the stiffness (a bare number is in {'N/m' if sliding else 'N m/rad'})",
        )


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
                f"{where(k)}, near {hz[k, low - 1]:.6g} Hz, with the {design} design. If they "
                "cross, each number goes on with the motion of the other: name a mode by its shape"
            )
