"""Fits made: to a stated accuracy, or of a given number of solves; all stretches of a path at once.

A source is asked for frequencies: the model's exact solves, a reduced model, or an expansion. The
polynomial of a region grows where its coefficients say so (`series.adaptive_newton`), or has as
many members as solves were given (`series.given_newton`).
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.errors import AccuracyError, UsageError
from eigassign.modal.arguments import whole_within
from eigassign.modal.fit import Fit
from eigassign.modal.fit_source import (
    SHARE,
    cause,
    dependence,
    floor_of,
    known_error,
    modes_of,
    own_error,
    question,
)
from eigassign.modal.line import Stretch
from eigassign.modal.model import Model
from eigassign.modal.path_fit import PathFit
from eigassign.modal.region import Box, Region, build_region
from eigassign.modal.stretches import Path, followed, stretches
from eigassign.series.adaptive_newton import adaptive
from eigassign.series.given_newton import fewest, given
from eigassign.series.interpolant import Asking, Interpolant

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
ACCURACY = 1e-4  # where neither accuracy nor solves are given
MOST = 2000  # frequencies asked for in one fit
LEAST_ACCURACY = 1e-13


def fit(
    source: Any,
    q: Any,
    y: ArrayLike | Box,
    modes: Sequence[int] | None = None,
    accuracy: float | None = None,
    most: int = MOST,
    solves: int | None = None,
) -> Fit | PathFit:
    """Fit ``modes`` of ``source`` over a trajectory or a box of q and a design or a box of y.

    ``source`` is a Model (exact solves), a ReducedModel or an Expansion, whose own error estimates
    count. ``q`` are samples of a trajectory (n_t, n_q), one pose (n_q,), a `Box`, or several
    trajectories: ``case.trajectory`` or a list of samples; ``y`` (n_y,) or a `Box`. ``accuracy``
    is relative in Hz, 1e-4 unless given; or ``solves`` are that many frequencies and no more, of
    one axis 128 at most, and the estimate is what they leave. A trajectory with corners is fitted
    from one to the next.

    Raises AccuracyError where ``most`` frequencies do not suffice, as where modes cross, or where
    those of given ``solves`` show no error; UsageError for arguments that cannot be meant.
    """
    if solves is not None and accuracy is not None:
        raise UsageError("a fit has an accuracy or a number of solves, not both")
    _meant(accuracy, most)
    directions, n_q = dependence(source)
    path = None if isinstance(q, Box) else stretches(q, directions, n_q)
    parts: tuple[Any, ...] = (q,) if path is None else path.parts
    wanted = modes_of(source, modes)
    if solves is None:
        accuracy = ACCURACY if accuracy is None else accuracy
        regions, floors, runs = _to_accuracy(source, parts, y, wanted, accuracy, most)
    else:
        count = whole_within(solves, "solves", 1, MOST)
        regions, floors, runs = _by_solves(source, path, parts, y, wanted, count)
    found, seen = _driven(source, wanted, regions, runs)
    if not isinstance(source, Model):
        each_ = zip(floors, seen, strict=True)
        floors = [max(floor, known_error(source, x, wanted, accuracy)) for floor, x in each_]
    made = zip(regions, found, floors, strict=True)
    fits = tuple(_fit(source, wanted, accuracy, *each) for each in made)
    return fits[0] if path is None or len(fits) == 1 else PathFit(fits, path.rows)


_Plan = tuple[list[Region], list[float], list[Asking]]  # of each part: with the source's own error


def _to_accuracy(
    source: Any,
    parts: Sequence[Any],
    y: ArrayLike | Box,
    modes: tuple[int, ...],
    accuracy: float,
    most: int,
) -> _Plan:
    """Runs that ask until their estimate meets the accuracy."""
    directions, n_q = dependence(source)
    rests = _some_move(parts)
    regions = [build_region(directions, n_q, part, y, rests=rests) for part in parts]
    floors = [floor_of(source, region, modes, accuracy) for region in regions]
    pairs = zip(regions, floors, strict=True)
    runs = [adaptive(region.nodes, _left(source, accuracy, floor), most) for region, floor in pairs]
    return regions, floors, runs


def _by_solves(
    source: Any,
    path: Path | None,
    parts: Sequence[Any],
    y: ArrayLike | Box,
    modes: tuple[int, ...],
    count: int,
) -> _Plan:
    """Runs that ask for ``count`` frequencies in all."""
    directions, n_q = dependence(source)
    counts = [count]
    if path is not None and len(path.parts) > 1:
        d = max(build_region(directions, n_q, each, y, rests=True).d for each in parts)
        counts = path.shares(count, fewest(d))
    regions, floors = _best_nodes(source, parts, y, modes, counts)
    followed(regions)
    pairs = zip(regions, counts, strict=True)
    return regions, floors, [given(region.nodes, own) for region, own in pairs]


def _some_move(parts: Sequence[Any]) -> bool:
    """Whether stretches that stand still are part of something that does not."""
    return any(isinstance(part, Stretch) and part.line(None) is not None for part in parts)


def _meant(accuracy: object, most: object) -> None:
    """Raise UsageError for an accuracy or a number of solves that cannot be meant."""
    whole_within(most, "most", 1, sys.maxsize)
    if accuracy is None:
        return
    number = isinstance(accuracy, int | float | np.number) and not isinstance(accuracy, bool)
    if not number or not LEAST_ACCURACY <= accuracy < 1.0:  # type: ignore[operator]
        raise UsageError(
            f"accuracy {accuracy!r} is not a number within {LEAST_ACCURACY} to 1, as 1e-4"
        )


def _left(source: Any, accuracy: float, floor: float) -> float:
    """What the polynomial may cost; that of another source is only known where it was asked."""
    return accuracy - (floor if isinstance(source, Model) else SHARE * accuracy)


def _best_nodes(
    source: Any,
    parts: Sequence[Any],
    y: ArrayLike | Box,
    modes: tuple[int, ...],
    counts: Sequence[int],
) -> tuple[list[Region], list[float]]:
    """Regions with the best nodes for the counts, and the source's own error in each.

    That is looked at on nested nodes, which hold both ends of every axis.
    """
    directions, n_q = dependence(source)
    pairs, rests = zip(parts, counts, strict=True), _some_move(parts)
    regions = [build_region(directions, n_q, part, y, count, rests) for part, count in pairs]
    if isinstance(source, Model):
        return regions, [0.0] * len(regions)
    nested = (build_region(directions, n_q, part, y, rests=rests) for part in parts)
    return regions, [floor_of(source, region, modes, None) for region in nested]


def _driven(
    source: Any, modes: tuple[int, ...], regions: Sequence[Region], runs: Sequence[Asking]
) -> tuple[list[Interpolant], list[Floats]]:
    """What all runs end with, and the x (n, n_x) that each asked for.

    What they ask for in one round is one batch of frequencies.
    """
    ask = question(source, modes)
    found: dict[int, Interpolant] = {}
    seen: list[list[Floats]] = [[] for _ in runs]
    hz: dict[int, Floats | None] = dict.fromkeys(range(len(runs)))
    while hz:
        wanted: dict[int, Floats] = {}
        for k, values in hz.items():
            try:
                wanted[k] = regions[k].x(runs[k].send(values))  # type: ignore[arg-type]
                seen[k].append(wanted[k])
            except StopIteration as end:
                found[k] = end.value
            except AccuracyError as error:
                raise AccuracyError(f"{error}{cause(source, regions[k], modes)}") from None
        hz = _batch(ask, wanted)
    return [found[k] for k in range(len(runs))], [np.vstack(each) for each in seen]


def _batch(ask: Callable[[Floats], Floats], wanted: dict[int, Floats]) -> dict[int, Floats | None]:
    """Frequencies at x (n, n_x) for each, asked for at once."""
    if len(wanted) < 2:
        return {k: ask(x) for k, x in wanted.items()}
    hz = ask(np.vstack(list(wanted.values())))
    ends = np.cumsum([len(x) for x in wanted.values()])[:-1]
    return dict(zip(wanted, np.split(hz, ends), strict=True))


def _fit(
    source: Any,
    modes: tuple[int, ...],
    accuracy: float | None,
    region: Region,
    found: Interpolant,
    floor: float,
) -> Fit:
    own = partial(own_error, source, region, modes, found.error, floor)
    return Fit(modes, region, accuracy, found, own)
