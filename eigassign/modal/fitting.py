"""Fits made: to a stated accuracy, or of a given number of solves; all stretches of a path at once.

A source is asked for frequencies: the model's exact solves, a reduced model, or an expansion. The
polynomial of a region grows where its coefficients say so (`series.adaptive_newton`), or has as
many members as solves were given (`series.given_newton`).
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.errors import AccuracyError, UsageError
from eigassign.modal.adaptive import shown
from eigassign.modal.arguments import mode_numbers, whole_within
from eigassign.modal.exact import DENSE_LIMIT, eigenvalues
from eigassign.modal.expansion import Expansion
from eigassign.modal.fit import Fit
from eigassign.modal.inverse import InverseExpansion
from eigassign.modal.model import Model, as_model
from eigassign.modal.path_fit import PathFit
from eigassign.modal.reduced_model import ReducedModel
from eigassign.modal.region import Box, Region, build_region
from eigassign.modal.roundoff import rounding_error
from eigassign.modal.stretches import followed, stretches
from eigassign.series.adaptive_newton import adaptive
from eigassign.series.given_newton import fewest, given
from eigassign.series.interpolant import Asking, Interpolant

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
HZ = 0.5 / np.pi  # in a rad/s
ACCURACY = 1e-4  # where neither accuracy nor solves are given
MOST = 2000  # frequencies asked for in one fit
LEAST_ACCURACY = 1e-13
FINE, FINE_LARGE = 1e-8, 1e-6  # accuracies below which round-off is looked at
SHARE = 0.5  # of the accuracy that the source itself may use
FEW_AXES = 3  # up to which all corners are looked at
CLOSE = 1e-2  # relative gap in Hz below which neighbouring modes are named as a cause


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
    is relative in Hz, 1e-4 unless given; or ``solves`` are that many frequencies and no more, and
    the estimate is what they leave. A trajectory with corners is fitted from one to the next.

    Raises AccuracyError where ``most`` frequencies do not suffice, as where modes cross, or where
    those of given ``solves`` show no error; UsageError for arguments that cannot be meant.
    """
    if solves is not None and accuracy is not None:
        raise UsageError("a fit has an accuracy or a number of solves, not both")
    _meant(accuracy, most)
    directions, n_q = _dependence(source)
    path = None if isinstance(q, Box) else stretches(q, directions, n_q)
    parts: tuple[Any, ...] = (q,) if path is None else path.parts
    wanted = _modes(source, modes)
    if solves is None:
        accuracy = ACCURACY if accuracy is None else accuracy
        regions = [build_region(directions, n_q, part, y) for part in parts]
        floors = [_floor(source, region, wanted, accuracy) for region in regions]
        pairs = zip(regions, floors, strict=True)
        runs = [
            adaptive(region.nodes, _left(source, accuracy, floor), most) for region, floor in pairs
        ]
    else:
        count = whole_within(solves, "solves", 1, MOST)
        counts = [count]
        if path is not None and len(path.parts) > 1:
            d = build_region(directions, n_q, parts[0], y).d
            counts = path.shares(count, fewest(d))
        regions, floors = _best_nodes(source, parts, y, wanted, counts)
        followed(regions)
        runs = [given(region.nodes, own) for region, own in zip(regions, counts, strict=True)]
    found, seen = _driven(source, wanted, regions, runs)
    if not isinstance(source, Model):
        each_ = zip(floors, seen, strict=True)
        floors = [max(floor, _known_error(source, x, wanted, accuracy)) for floor, x in each_]
    made = zip(regions, found, floors, strict=True)
    fits = tuple(_fit(source, wanted, accuracy, *each) for each in made)
    return fits[0] if path is None or len(fits) == 1 else PathFit(fits, path.rows)


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
    directions, n_q = _dependence(source)
    pairs = zip(parts, counts, strict=True)
    regions = [build_region(directions, n_q, part, y, count) for part, count in pairs]
    if isinstance(source, Model):
        return regions, [0.0] * len(regions)
    nested = (build_region(directions, n_q, part, y) for part in parts)
    return regions, [_floor(source, region, modes, None) for region in nested]


def _driven(
    source: Any, modes: tuple[int, ...], regions: Sequence[Region], runs: Sequence[Asking]
) -> tuple[list[Interpolant], list[Floats]]:
    """What all runs end with, and the x (n, n_x) that each asked for.

    What they ask for in one round is one batch of frequencies.
    """
    ask = _question(source, modes)
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
                raise AccuracyError(f"{error}{_cause(source, regions[k], modes)}") from None
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
    own = partial(_own_error, source, region, modes, found.error, floor)
    return Fit(modes, region, accuracy, found, own)


def _own_error(
    source: Any, region: Region, modes: tuple[int, ...], error: float, floor: float
) -> float:
    """The floor, or round-off where that was not looked at and may matter beside the error."""
    if floor or not isinstance(source, Model) or error >= _fine(source):
        return floor
    return rounding_error(source.pencil, region.centre, modes[-1])


def _fine(model: Model) -> float:
    """Accuracy below which the round-off of exact solves is looked at."""
    return FINE if model.n_dof <= DENSE_LIMIT else FINE_LARGE


def _dependence(source: Any) -> tuple[Floats, int]:
    """Combinations of x on which the source's frequencies depend (n_w, n_x), and n_q."""
    if isinstance(source, Model):
        return source.pencil.local_directions[1], source.pencil.n_q
    if isinstance(source, InverseExpansion):
        source = source.expansion
    if isinstance(source, Expansion):
        return source.directions, len(source.q0)
    if not isinstance(source, ReducedModel):
        as_model(source)
    return source.to_program[source.program.dependence.any(axis=0)], source.n_q


def _modes(source: Any, modes: Sequence[int] | None) -> tuple[int, ...]:
    """The modes to fit. Raises UsageError for one that the source does not have."""
    own = getattr(source, "modes", None) if not isinstance(source, Model) else None
    wanted = mode_numbers((own or (1,)) if modes is None else modes)
    if own is not None and not set(wanted) <= set(own):
        raise UsageError(f"modes {wanted} asked for; the source has {own}")
    return wanted


def _question(source: Any, modes: tuple[int, ...]) -> Callable[[Floats], Floats]:
    """x (n, n_x) → f (n, n_modes) in Hz. AccuracyError where the source gives no number."""
    if isinstance(source, Model):
        pencil = source.pencil
        own: Any = slice(None) if modes[-1] == len(modes) else [m - 1 for m in modes]
        return lambda x: np.sqrt(eigenvalues(pencil, x, modes[-1])[:, own]) * HZ
    columns, n_q = [source.modes.index(m) for m in modes], _dependence(source)[1]

    def ask(x: Floats) -> Floats:
        hz = np.asarray(source.frequencies(x[:, :n_q], x[:, n_q:]))[:, columns]
        if not np.isfinite(hz).all():
            k = int(np.argmin(np.isfinite(hz).all(axis=1)))
            raise AccuracyError(f"the source has no frequency at (q, y) = {shown(x[k])}")
        return hz

    return ask


def _floor(source: Any, region: Region, modes: tuple[int, ...], accuracy: float | None) -> float:
    """Relative error in Hz of what the source answers, at the region's ends and centre.

    Of exact solves this is round-off, looked at only where it may matter. Raises AccuracyError
    where it leaves nothing of the accuracy asked for.
    """
    if isinstance(source, Model):
        if accuracy is None or accuracy >= _fine(source):
            return 0.0
        floor = rounding_error(source.pencil, region.centre, modes[-1])
    else:
        return _known_error(source, region.x(_ends(region)), modes, accuracy)
    return _borne("round-off", floor, accuracy)


def _known_error(source: Any, x: Floats, modes: tuple[int, ...], accuracy: float | None) -> float:
    """The largest of the source's own error estimates at x (n, n_x); see `_borne`."""
    n_q = _dependence(source)[1]
    columns = [source.modes.index(m) for m in modes]
    estimates = source.error_estimate(x[:, :n_q], x[:, n_q:])[:, columns]
    return _borne("the source itself", float(estimates.max()), accuracy)


def _borne(what: str, error: float, accuracy: float | None) -> float:
    """The error, unless it is unknown or leaves nothing of an accuracy: then AccuracyError."""
    if not error < np.inf:
        raise AccuracyError(f"{what} may cost any amount: it vouches for no number in the region")
    if accuracy is not None and error > SHARE * accuracy:
        raise AccuracyError(f"{what} may cost {error:.1e}, which leaves nothing of {accuracy:.1e}")
    return error


def _ends(region: Region) -> Ints:
    """Multi-indices of the centre and both ends of each axis: in all combinations, if few."""
    d = region.d
    if d <= FEW_AXES:
        signs = np.array(list(itertools.product((1, 2), repeat=d)))
    else:
        signs = 1 + np.vstack([np.zeros((1, d)), np.eye(d), 1 - np.eye(d), np.ones((1, d))])
    tops = [len(axis.nodes) - 1 for axis in region.axes]
    return np.asarray(np.minimum(np.vstack([np.zeros((1, d)), signs]), tops), dtype=np.intp)


def _cause(source: Any, region: Region, modes: tuple[int, ...]) -> str:
    """Neighbouring modes that come close, the usual cause, as the end of a message."""
    if not isinstance(source, Model):
        return ""
    count = min(modes[-1] + 1, len(source.pencil.elastic))
    lam = eigenvalues(source.pencil, region.x(_ends(region)), count)
    gap = 0.5 * (1.0 - lam[:, :-1] / lam[:, 1:]).min(axis=0)
    near = [k + 1 for k in np.flatnonzero(gap < CLOSE) if {k + 1, k + 2} & set(modes)]
    named = ", ".join(f"{k} and {k + 1}" for k in near)
    return f"; modes {named} come close, and where they meet none is smooth" if near else ""
