"""What a design does to the targets: the distance to each, and the verdict over all.

Of a wanted frequency the error is |f/f_d − 1|. Of a limit it is the relative violation, 0 where it
is met: (b − f)/b below "at least b", (f − b)/b above "at most b", the same with a gap's f_j − f_i,
and in a band from a to b the way out of it, relative to the edge that is passed. A band is not
clear either where the number of modes below it changes along a trajectory; the error there is the
way that the wrong modes have to the other edge.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.mechanism.trajectory.trajectory import Trajectories
from eigassign.study.design.followed import Solved
from eigassign.study.results import (
    ErrorRow,
    ErrorSummary,
    FollowedRow,
    OtherModes,
    TargetAlong,
    TargetStudy,
)
from eigassign.study.wanted import Wanted, time_weights

Floats = NDArray[np.float64]
MET = 1e-8  # a violation below it is round-off


@dataclass(frozen=True)
class SolvedDesigns:
    """Exact frequencies of the initial design, the answer and the one shot."""

    initial: Solved
    exact: Solved
    one_shot: Solved | None = None


def study_targets(
    path: Trajectories,
    wanted: Sequence[Wanted],
    solved: SolvedDesigns,
    predicted: Sequence[Floats | None],
    max_error: float,
) -> tuple[TargetStudy, ...]:
    """Each target before and after; ``predicted`` are their curves (n,) or None.

    A wanted frequency is satisfied within ``max_error``, a limit where nothing violates it.
    """
    weights = time_weights(path)
    return tuple(
        _studied(path, one, solved, curve, weights[one.rows], max_error)
        for one, curve in zip(wanted, predicted, strict=True)
    )


def _studied(
    path: Trajectories,
    wanted: Wanted,
    solved: SolvedDesigns,
    predicted: Floats | None,
    weights: Floats,
    max_error: float,
) -> TargetStudy:
    one_shot, kind = solved.one_shot, wanted.requirement.kind
    errors = _Errors(
        initial=errors_of(wanted, solved.initial),
        exact=errors_of(wanted, solved.exact),
        predicted=None if predicted is None else np.asarray(predicted / wanted.hz - 1.0),
        one_shot=None if one_shot is None else errors_of(wanted, one_shot),
    )
    summary = _summary(errors, weights)
    allowed = max_error if kind == "frequency" else MET
    return TargetStudy(
        kind=kind,
        label=wanted.requirement.label,
        modes=() if wanted.mode < 0 else wanted.requirement.modes,
        lower_hz=wanted.lower_hz,
        upper_hz=wanted.upper_hz,
        initial_hz=_curve(wanted, solved.initial),
        exact_hz=_curve(wanted, solved.exact),
        predicted_hz=predicted,
        one_shot_hz=None if one_shot is None else _curve(wanted, one_shot),
        error=summary,
        satisfied=bool(summary.exact.max_relative <= allowed),
        trajectory=wanted.requirement.target.trajectory,
        rows=wanted.rows,
        weight_s=float(weights.sum()),
        weight=wanted.weight,
        along=tuple(_along(path, wanted, errors, weights)),
        followed=_followed(wanted, solved),
        near=_near(wanted, solved) if kind == "keep_out" else None,
    )


def _followed(wanted: Wanted, solved: SolvedDesigns) -> FollowedRow | None:
    mode, rows = wanted.requirement.followed, wanted.rows
    if mode is None:
        return None
    before, after = (s.numbers[rows, wanted.mode] for s in (solved.initial, solved.exact))
    return FollowedRow(mode.name, mode.like, before, after)


NEAR_BAND = 0.5  # of an edge: modes this near to a band are shown with it


def _near(wanted: Wanted, solved: SolvedDesigns) -> OtherModes:
    """The modes near a band before or after, and at least those on either side of it."""
    both = np.stack([solved.initial.hz[wanted.rows], solved.exact.hz[wanted.rows]])
    low, high = wanted.lower_hz.min(), wanted.upper_hz.max()
    inside = (both > low * (1.0 - NEAR_BAND)) & (both < high * (1.0 + NEAR_BAND))
    shown = inside.any(axis=(0, 1))
    below = int((both[1].max(axis=0) < high).sum())  # as many modes are below
    shown[max(below - 1, 0) : below + 1] = True
    columns = np.flatnonzero(shown)
    return OtherModes(tuple((columns + 1).tolist()), *(hz[:, columns] for hz in both))


@dataclass(frozen=True)
class _Errors:
    """The errors (n,) of one target."""

    initial: Floats
    exact: Floats
    predicted: Floats | None
    one_shot: Floats | None

    def part(self, own: slice) -> _Errors:
        predicted, one_shot = (
            None if e is None else e[own] for e in (self.predicted, self.one_shot)
        )
        return _Errors(self.initial[own], self.exact[own], predicted, one_shot)


def errors_of(wanted: Wanted, solved: Solved) -> Floats:
    """The errors (n,) of a target at its rows."""
    if wanted.requirement.kind == "frequency":
        return np.asarray(_curve(wanted, solved) / wanted.hz - 1.0)
    return worst_errors(wanted, solved, solved)


def worst_errors(wanted: Wanted, lowest: Solved, highest: Solved) -> Floats:
    """The largest errors (n,), in magnitude, of frequencies between two."""
    kind = wanted.requirement.kind
    if kind == "keep_out":
        return _inside(wanted, lowest.hz[wanted.rows], highest.hz[wanted.rows])
    low, high = curve_range(wanted, lowest, highest)
    if kind == "frequency":
        return np.maximum(np.abs(low / wanted.hz - 1.0), np.abs(high / wanted.hz - 1.0))
    if kind == "at_most":
        return np.asarray(np.maximum(high / wanted.upper_hz - 1.0, 0.0))
    return np.asarray(np.maximum(1.0 - low / wanted.lower_hz, 0.0))


def least_errors(wanted: Wanted, lowest: Solved, highest: Solved) -> Floats:
    """The errors (n,) that no frequency between two avoids; 0 of a band."""
    kind = wanted.requirement.kind
    if kind == "keep_out":
        return np.zeros(len(wanted.lower_hz))
    low, high = curve_range(wanted, lowest, highest)
    above = np.maximum(low / wanted.upper_hz - 1.0, 0.0)
    return np.asarray(np.maximum(above, 1.0 - high / wanted.lower_hz if kind != "at_most" else 0.0))


def curve_range(wanted: Wanted, lowest: Solved, highest: Solved) -> tuple[Floats, Floats]:
    """The range (n,) of a target's curve where each mode is between two frequencies."""
    if wanted.requirement.kind == "gap":
        low, high = (m - 1 for m in wanted.requirement.modes)
        least, most = lowest.hz[wanted.rows], highest.hz[wanted.rows]
        return least[:, high] - most[:, low], most[:, high] - least[:, low]
    return _curve(wanted, lowest), _curve(wanted, highest)


def _inside(wanted: Wanted, lowest: Floats, highest: Floats) -> Floats:
    """The way that the modes lack to be clear, with the best constant number of them below."""
    named = [m - 1 for m in sorted(wanted.requirement.modes)]
    lowest, highest = (hz[:, named] if named else hz for hz in (lowest, highest))
    low, high = wanted.lower_hz[:, None], wanted.upper_hz[:, None]
    down, up = np.maximum(highest / low - 1.0, 0.0), np.maximum(1.0 - lowest / high, 0.0)
    choices = [
        np.maximum(down[:, :k].max(axis=1, initial=0.0), up[:, k:].max(axis=1, initial=0.0))
        for k in range(lowest.shape[1] + 1)
    ]
    return np.asarray(min(choices, key=lambda errors: float(errors.max())))


def _curve(wanted: Wanted, solved: Solved) -> Floats:
    """The curve (n,) that stands for a target."""
    own, modes = solved.hz[wanted.rows], wanted.requirement.modes
    if wanted.requirement.kind == "gap":
        low, high = modes
        return np.asarray(own[:, high - 1] - own[:, low - 1])
    if wanted.requirement.kind == "keep_out":
        own = own[:, [m - 1 for m in modes]] if modes else own
        middle = 0.5 * (wanted.lower_hz + wanted.upper_hz)
        nearest = np.abs(own - middle[:, None]).argmin(axis=1)
        return np.asarray(own[np.arange(len(own)), nearest])
    return solved.curve(wanted.mode)[wanted.rows]


def _summary(errors: _Errors, weights: Floats) -> ErrorSummary:
    return ErrorSummary(
        initial=_row(errors.initial, weights),
        exact=_row(errors.exact, weights),
        predicted=None if errors.predicted is None else _row(errors.predicted, weights),
        one_shot=None if errors.one_shot is None else _row(errors.one_shot, weights),
    )


def _row(errors: Floats, weights: Floats) -> ErrorRow:
    """Largest magnitude and root of the weighted mean square."""
    rms = float(np.sqrt(weights @ errors**2 / weights.sum()))
    return ErrorRow(float(np.abs(errors).max()), rms)


def _along(
    path: Trajectories, wanted: Wanted, errors: _Errors, weights: Floats
) -> Iterator[TargetAlong]:
    """The errors along each trajectory that the target holds on."""
    for part, rows in zip(path.parts, path.rows, strict=True):
        first, last = max(wanted.rows.start, rows.start), min(wanted.rows.stop, rows.stop)
        if first < last:
            own = slice(first - wanted.rows.start, last - wanted.rows.start)
            yield TargetAlong(part.name, own, _summary(errors.part(own), weights[own]))


# --- The verdict

IMPROVED = 0.01  # of the merit of the start


def verdict(
    targets: Sequence[TargetStudy],
    merits: tuple[tuple[float, float], tuple[float, float]],
    trusted: bool,
    unreachable: Sequence[str] = (),
    conflict: str = "",
) -> tuple[str, str]:
    """The verdict, and why in a sentence.

    ``merits`` are (violation, objective) of the initial design and of the answer; ``unreachable``
    names targets outside the range that their mode can take within the bounds; ``conflict`` says
    which limits contradict each other.
    """
    if not trusted:
        return "do_not_use", "the numbers that the answer rests on cannot be vouched for"
    missed = [target for target in targets if not target.satisfied]
    if not missed:
        return ("infeasible", conflict) if conflict else ("reached", "every target is met")
    worst = max(missed, key=lambda target: target.error.exact.max_relative)
    far = _far(worst)
    if unreachable:
        return "unreachable", f"{'; '.join(unreachable)}; the nearest design: {far}"
    if conflict:
        return "infeasible", f"{conflict} ({far})"
    (before_violation, before), (violation, after) = merits
    if violation > MET:
        if violation < (1.0 - IMPROVED) * before_violation:
            return "improved", f"nearer to what is asked, which is not met: {far}"
        return "do_not_use", f"no design was found that meets what is asked: {far}"
    if before_violation > MET or after < (1.0 - IMPROVED) * before:
        return "improved", f"better than the initial design; {far}{_though(worst)}"
    return "do_not_use", f"no better than the initial design: {far}"


def _far(target: TargetStudy) -> str:
    """The target and how far it is missed: ``mode 1 at 48 Hz: 6.02 % off at worst``."""
    worst = f"{100 * target.error.exact.max_relative:.3g} %"
    if target.kind == "frequency":
        return f"{target.label}: {worst} off at worst"
    return f"{target.label}: violated by {worst} at worst"


def _though(target: TargetStudy) -> str:
    """Say that the largest error has grown, where the mean one is what has fallen."""
    before, after = target.error.initial, target.error.exact
    if target.kind != "frequency" or after.max_relative <= before.max_relative:
        return ""
    fell = "" if after.rms_relative >= before.rms_relative else (
        f", while the rms error fell from {100 * before.rms_relative:.3g} to "
        f"{100 * after.rms_relative:.3g} %"
    )  # fmt: skip
    return f" (before: {100 * before.max_relative:.3g} %){fell}"


# --- Followed modes that change their numbers

SHOWN = 8  # changes that a note lists


def swap_notes(path: Trajectories, targets: Sequence[TargetStudy]) -> tuple[str, ...]:
    """Say which mode each followed one is and where it swaps, if it is not always the named."""
    return tuple(
        dict.fromkeys(
            f"with the {design} design {target.followed.name} {_runs(path, target, numbers)}"
            for target in targets
            if target.followed is not None
            for design, numbers in (
                ("initial", target.followed.initial_numbers),
                ("optimal", target.followed.exact_numbers),
            )
            if (numbers != target.followed.like).any()
        )
    )


def _runs(path: Trajectories, target: TargetStudy, numbers: NDArray[np.intp]) -> str:
    """Write ``swaps its number: mode 2 from sample 0 (t = 0 s), mode 3 from sample 4 …``."""
    if (numbers == numbers[0]).all():
        return f"is mode {numbers[0]} throughout"
    first = {rows.start for rows in path.rows} | {target.rows.start}
    changes = [
        k
        for k, number in enumerate(numbers)
        if k == 0 or number != numbers[k - 1] or target.rows.start + k in first
    ]
    listed = [f"mode {numbers[k]} from {path.where(target.rows.start + k)}" for k in changes]
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
