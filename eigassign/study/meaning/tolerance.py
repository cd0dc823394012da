"""What deviations of the parameters do to an answer: each within its tolerance, independently.

Where all frequencies are monotone in every parameter that has a tolerance (`monotone`), two
corners bound them exactly. The other parameters are drawn from their ranges by a Sobol sequence,
and taken at corners of these, each time with the monotone ones at both corners. Models of many
unknowns are evaluated by a reduced model about the answer then; what it is off by at the worst
deviations that it names, solved exactly, widens the ranges. Modes followed by their shape are
monotone too as long as they only cross others, which is not proved.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.requirements.requirement import Requirement, Solved
from eigassign.errors import AccuracyError
from eigassign.facts import positive_percent
from eigassign.modal.adaptive_order import MARGIN
from eigassign.modal.reduced import reduce
from eigassign.study.design.followed import Follower, followers, solve_design
from eigassign.study.monotone import box_corners, corners, effects
from eigassign.study.results import RangeRow, ToleranceRows
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]
DRAWS = 64  # a power of two, as Sobol's points want
AT = 5  # samples about which a reduced model is made, and at which it is compared
DOUBTFUL = 0.01  # error of it, relative, with which nothing can be said

Ranges = Callable[[Floats], tuple[Solved, Solved]]  # of a design: between what each mode is


def study_tolerance(
    scene: Scene, wanted: Sequence[Requirement], y: Floats, exact: Solved
) -> ToleranceRows | None:
    """The spread of every target about the answer ``y``; None where no tolerance is stated.

    Raises EigassignError where a design within the tolerances has no frequencies, AccuracyError
    where the reduced model cannot be trusted.
    """
    lower, upper = scene.tolerances.box(y)
    if not (upper > lower).any() or not wanted:
        return None
    own = followers(scene, wanted)
    drawn = np.flatnonzero((upper > lower) & (effects(scene.file) == 0.0))
    designs, ranges = y[None], _exact(scene, own, exact.hz.shape[1])
    how = "followed" if own else "proved"
    if len(drawn):
        from scipy.stats import qmc  # half a second, and most runs draw nothing

        points = qmc.Sobol(len(drawn), seed=0).random_base2(DRAWS.bit_length() - 1)
        points = np.concatenate([points, box_corners(len(drawn))])
        designs, how = np.repeat(y[None], len(points), axis=0), "sampled"
        designs[:, drawn] = lower[drawn] + points * (upper - lower)[drawn]
        pencil = scene.model.pencil
        if not pencil.is_dense:
            if own:
                raise AccuracyError(
                    f"modes followed by their shape need at most {pencil.dense_limit} unknowns"
                )
            both = (corners(scene.file, design, lower, upper) for design in designs)
            ranges = reduced_ranges(scene, y, exact.hz.shape[1], np.vstack([*both]))
    lowest, highest = exact, exact
    for design in designs:
        softest, stiffest = corners(scene.file, design, lower, upper)
        lowest = _combined(np.minimum, lowest, ranges(softest)[0])
        highest = _combined(np.maximum, highest, ranges(stiffest)[1])
    return _rows(wanted, exact, lowest, highest, how)


def _combined(pick: Callable[[Floats, Floats], Floats], a: Solved, b: Solved) -> Solved:
    return Solved(pick(a.hz, b.hz), pick(a.followed, b.followed), a.numbers)


def _rows(
    wanted: Sequence[Requirement], exact: Solved, lowest: Solved, highest: Solved, how: str
) -> ToleranceRows:
    errors = [float(w.worst_errors(lowest, highest).max()) for w in wanted]
    rows = tuple(
        RangeRow(w.label, *w.curve_range(lowest, highest), _how(w, how), error)
        for w, error in zip(wanted, errors, strict=True)
    )
    pairs = list(zip(wanted, errors, strict=True))
    missed = [pair for pair in pairs if not pair[0].is_aim]
    own = [pair for pair in pairs if pair[0].is_goal] or missed
    before = max((float(np.abs(w.errors(exact)).max()) for w, _ in own), default=0.0)
    after = max((error for _, error in own), default=0.0)
    said = "bounded" if any(row.how == "bounded" for row in rows) else how
    tried = {
        "proved": "proved",
        "bounded": "at most",
        "followed": "the worst of both corners",
    }.get(said, f"the worst of {DRAWS} draws and of corners")
    changes = [f"worst error {positive_percent(before)} → {positive_percent(after)}"] if own else []
    for aim, row in zip(wanted, rows, strict=True):
        if aim.is_aim:
            least = aim.curve(exact).min(), row.lowest_hz.min()
            changes.insert(0, "mode {} at least {:.4g} → {:.4g} Hz".format(aim.mode, *least))
    words = f"with all tolerances at their worst: {', '.join(changes)} ({tried})"
    return ToleranceRows(rows, before, after, words)


def _how(wanted: Requirement, how: str) -> str:
    """Corners bound each of several modes: their distance, or the nearest, need not reach that."""
    return "bounded" if how == "proved" and len(wanted.terms) != 1 else how


def _exact(scene: Scene, own: Sequence[Follower], count: int) -> Ranges:
    def ranges(y: Floats) -> tuple[Solved, Solved]:
        found = solve_design(scene, own, y, count)
        return found, found

    return ranges


def reduced_ranges(scene: Scene, y: Floats, count: int, designs: Floats) -> Ranges:
    """Frequencies by a reduced model about a design, less and plus what it is off at ``designs``.

    That is measured at some samples, of each mode where the model has its lowest and highest value;
    raises AccuracyError where it is over `DOUBTFUL`.
    """
    n, few = len(scene.path.q), scene.path.spread(AT)
    about = np.repeat(y[None], len(few), axis=0)
    modes = tuple(range(1, count + 1))
    reduced = reduce(scene.model.pencil, scene.path.at(y)[0][few], about, modes)
    q = np.array([scene.path.at(design)[0][few] for design in designs])
    hz = np.array([reduced.frequencies(*own) for own in zip(q, designs, strict=True)])
    worst = np.concatenate([hz.argmin(axis=0), hz.argmax(axis=0)])  # (2k, count) designs
    sample, mode = np.indices(worst.shape).reshape(2, -1) % [[len(few)], [count]]
    which = worst.ravel()
    exact = scene.model.frequencies(q[which, sample], designs[which], count)
    off = np.abs(hz[which, sample, mode] / exact[np.arange(len(which)), mode] - 1.0)
    error = MARGIN * float(off.max())
    if not error <= DOUBTFUL:
        raise AccuracyError(
            "they are too wide for the reduced model that judges them, which is about "
            f"{100 * error:.3g} % off: state smaller ones"
        )
    nothing, numbers = np.zeros((n, 0)), np.zeros((n, 0), dtype=np.intp)

    def ranges(y: Floats) -> tuple[Solved, Solved]:
        hz = reduced.frequencies(scene.path.at(y)[0], y)
        low, high = hz * (1.0 - error), hz * (1.0 + error)
        return Solved(low, nothing, numbers), Solved(high, nothing, numbers)

    return ranges
