"""A polynomial in place of an eigensolve, to a stated accuracy over a stated region.

    f(q, y)^p ≈ Σ_γ c_γ h_γ(v(q, y)),   p ∈ {1, 2, −2}:  f, λ or 1/λ, whichever needs fewest terms

in Newton's basis over a lower set of multi-indices. The polynomial of a region grows where its
coefficients say so (`interpolation.adaptive`), or has as many terms as solves were given
(`interpolation.given`). A path with corners has one polynomial for each stretch between them; what
all of them ask for in one round is one batch of frequencies.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.brief import counted, of_modes
from eigassign.errors import AccuracyError, UsageError
from eigassign.interpolation.adaptive import MISSED, adaptive
from eigassign.interpolation.given import WORTHLESS, fewest, given
from eigassign.interpolation.margin import keys
from eigassign.interpolation.newton import Asking, Interpolant, newton_polynomials
from eigassign.modal.arguments import whole_within
from eigassign.modal.fit.meeting import cause, missed_between
from eigassign.modal.fit.path import Path, Stretch, stretches
from eigassign.modal.fit.region import Box, Region, build_region, require_path_followed
from eigassign.modal.fit.source import (
    SHARE,
    dependence,
    floor_of,
    known_error,
    modes_of,
    own_error,
    question,
)
from eigassign.modal.model import Model
from eigassign.series.power_series import Polynomials

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]

# --- Fits of one region, and of several stretches of a path

QUANTITIES = {1.0: "f", 2.0: "λ", -2.0: "1/λ"}


@dataclass(frozen=True, eq=False)
class Fit:
    """Frequencies of ``modes`` over ``region`` from one polynomial each; immutable.

    ``along(y)`` (n_t, n_modes) and ``frequencies(q, y)`` (n, n_modes) are in Hz, inside the region
    alone: they raise UsageError outside it. ``error_estimate`` holds anywhere in it, relative in
    Hz; ``solves`` counts the exact solves it took, ``reasons`` says what was chosen and why.
    """

    modes: tuple[int, ...]
    region: Region
    accuracy: float | None  # asked for, relative in Hz; None where the solves were given
    interpolant: Interpolant
    own_error: Callable[[], float]  # of the source, part of the estimate; found when asked for

    def __repr__(self) -> str:
        return (
            f"<Fit of {self.quantity} of {of_modes(self.modes)}: "
            f"{counted(len(self.indices), 'term')} in {counted(self.region.d, 'variable')} "
            f"from {counted(self.solves, 'solve')}>"
        )

    @cached_property
    def floor(self) -> float:
        """Part of the estimate that is the source's own."""
        return self.own_error()

    @property
    def error_estimate(self) -> float:
        """Of frequencies anywhere in the region, relative in Hz."""
        return self.interpolant.error + self.floor

    @property
    def indices(self) -> Ints:
        """Multi-indices (N, d) of the terms."""
        return self.interpolant.members

    @property
    def coefficients(self) -> Floats:
        """(n_modes, N), of Hz^power, in Newton's basis."""
        return self.interpolant.coefficients

    @property
    def power(self) -> float:
        """The power of f that is a polynomial."""
        return self.interpolant.power

    @property
    def solves(self) -> int:
        """Poses at which the source was asked, checks included."""
        return self.interpolant.asked

    @property
    def reasons(self) -> tuple[str, ...]:
        """What was chosen and why, as lines of text."""
        found = self.interpolant
        degrees = " x ".join(map(str, found.members.max(axis=0)))
        idle = sum(rate == 0.0 for rate in found.rates)
        lines = [
            f"{self.quantity} is the polynomial: its coefficients fall fastest",
            *(f"{count} terms: error at most {error:.1e}" for count, error in found.rounds),
            f"degrees {degrees}" + (f", {idle} idle" if idle else ""),
        ]
        if self.floor:
            lines.append(f"the source itself may be off by {self.floor:.1e}")
        return tuple(lines)

    @property
    def quantity(self) -> str:
        """What is a polynomial: "f", "λ" or "1/λ"."""
        return QUANTITIES[self.power]

    def frequencies(self, q: ArrayLike, y: ArrayLike) -> Floats:
        """(n, n_modes) in Hz. Raises UsageError outside the region."""
        return self._hz(self._ready(self.region.v(q, y)))

    def along(self, y: ArrayLike | None = None) -> Floats:
        """At every sample of the trajectory: (n_t, n_modes) in Hz for one design y (n_y,).

        (n_designs, n_t, n_modes) for many (n_designs, n_y); without y at that of the fit. Raises
        UsageError for a fit over a box of q, for y outside the region, or missing.
        """
        path, line = self.region.path, self.region.line
        if path is None:
            raise UsageError("the fit is over a box of q: it has no trajectory to go along")
        if y is None and line is not None and self.region.d == 1:
            return self._hz(line.table[:, : len(self.indices)] @ self.coefficients.T)
        if y is None:
            raise UsageError("the fit is over a box of y: along which design?")
        v = self.region.design(y)
        if line is None:
            g = np.repeat(self._ready(v)[:, None], len(path), axis=1)
        else:  # one product of matrices for all designs
            right = self._ready.second(np.ascontiguousarray(v[:, 1:].T))
            g = np.empty((len(v), len(path), len(self.modes)))
            for k, table in enumerate(self._samples):
                np.matmul(right.T, table, out=g[:, :, k])
        hz = self._hz(g)
        return hz[0] if np.ndim(y) == 1 else hz

    @cached_property
    def _samples(self) -> Floats:
        """The polynomials of y at each sample of the trajectory, (n_modes, N_second, n_t)."""
        assert self.region.line is not None
        return self._ready.table @ self._ready.first(self.region.line.place[None])

    @cached_property
    def _ready(self) -> Polynomials:
        nodes = [axis.nodes for axis in self.region.axes]
        return newton_polynomials(self.indices, nodes, self.coefficients)

    def _hz(self, g: Floats) -> Floats:
        """f of f^p, in its place."""
        if self.power == 1.0:
            return g
        np.sqrt(g, out=g)  # in place: fresh pages cost more than the roots
        return g if self.power == 2.0 else np.divide(1.0, g, out=g)


@dataclass(frozen=True, eq=False)
class PathFit:
    """One `Fit` for each stretch between corners, or for each of several trajectories.

    ``along(y)`` (n_t, n_modes) in Hz over the samples of all; ``error_estimate`` and ``solves`` as
    of a `Fit`, the largest and the sum; ``parts`` are the fits, ``rows`` whose samples are whose.
    """

    parts: tuple[Fit, ...]
    rows: tuple[slice, ...]  # which of all samples are whose

    def __repr__(self) -> str:
        pieces = f"{len(self.parts)} stretches from {self.solves} solves"
        return f"<PathFit of {of_modes(self.modes)}: {pieces}>"

    @property
    def modes(self) -> tuple[int, ...]:
        """The modes fitted."""
        return self.parts[0].modes

    @property
    def accuracy(self) -> float | None:
        """Asked for, relative in Hz; None where the solves were given."""
        return self.parts[0].accuracy

    @property
    def error_estimate(self) -> float:
        """Of frequencies anywhere in the region, relative in Hz: the largest of all parts."""
        return max(part.error_estimate for part in self.parts)

    @property
    def solves(self) -> int:
        """Poses at which the source was asked, checks included."""
        return sum(part.solves for part in self.parts)

    @property
    def reasons(self) -> tuple[str, ...]:
        """What was chosen and why, as lines of text, for each part."""
        return tuple(
            f"samples {rows.start} to {rows.stop - 1}: {line}"
            for part, rows in zip(self.parts, self.rows, strict=True)
            for line in part.reasons
        )

    def frequencies(self, q: ArrayLike, y: ArrayLike) -> Floats:
        """(n, n_modes) in Hz. Raises UsageError outside the region."""
        x = self.parts[0].region.samples(q, y)
        hz, left = np.empty((len(x), len(self.modes))), np.ones(len(x), dtype=np.bool_)
        for part in self.parts:
            mine = left & part.region.on_path(x)
            if mine.any():
                n_q = part.region.n_q
                hz[mine] = part.frequencies(x[mine, :n_q], x[mine, n_q:])
                left &= ~mine
        if left.any():
            raise UsageError(f"q lies off the path that was fitted: sample {int(left.argmax())}")
        return hz

    def along(self, y: ArrayLike | None = None) -> Floats:
        """As `Fit.along`, at the samples of all parts in their order."""
        return np.concatenate([part.along(y) for part in self.parts], axis=-2)


# --- Fits made: to an accuracy, or of a given number of solves

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

    f_i(q, y)^p ≈ Σ_γ c_γ h_γ(q, y) with p = 1, 2 or −2, a polynomial through frequencies that are
    asked of ``source`` where they are needed. The `Fit` answers ``.frequencies(q, y)`` (n, n_modes)
    in Hz, and has their ``.error_estimate``, relative in Hz. ``modes`` count from 1; unless given
    they are all of the source, of a Model the first.

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
    _check_numbers(accuracy, most)
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
    ended = list(zip(regions, _run(source, wanted, regions, runs), strict=True))
    if not isinstance(source, Model):
        xs = (region.x(each.asked) for region, each in ended)
        each_ = zip(floors, xs, strict=True)
        floors = [max(floor, known_error(source, x, wanted, accuracy)) for floor, x in each_]
    found = [_with_meetings(wanted, region, each, accuracy) for region, each in ended]
    fits = tuple(
        Fit(wanted, region, accuracy, made, partial(own_error, source, region, wanted, made, floor))
        for region, made, floor in zip(regions, found, floors, strict=True)
    )
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
    runs = []
    for region, floor in zip(regions, floors, strict=True):
        # what another source than a model costs is only known where it was asked
        cost = floor if isinstance(source, Model) else SHARE * accuracy
        runs.append(adaptive(region.nodes, accuracy - cost, most))
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
    require_path_followed(regions)
    pairs = zip(regions, counts, strict=True)
    return regions, floors, [given(region.nodes, own) for region, own in pairs]


def _some_move(parts: Sequence[Any]) -> bool:
    """Whether stretches that stand still are part of something that does not."""
    return any(isinstance(part, Stretch) and part.line(None) is not None for part in parts)


def _check_numbers(accuracy: object, most: object) -> None:
    """Raise UsageError for an accuracy or a number of solves that cannot be meant."""
    whole_within(most, "most", 1, sys.maxsize)
    if accuracy is None:
        return
    number = isinstance(accuracy, int | float | np.number) and not isinstance(accuracy, bool)
    if not number or not LEAST_ACCURACY <= accuracy < 1.0:  # type: ignore[operator]
        raise UsageError(
            f"accuracy {accuracy!r} is not a number within {LEAST_ACCURACY} to 1, as 1e-4"
        )


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


def _run(
    source: Any, modes: tuple[int, ...], regions: Sequence[Region], runs: Sequence[Asking]
) -> list[_Found]:
    """What all runs end with.

    What they ask for in one round is one batch of frequencies.
    """
    ask, own = question(source, modes), [mode - 1 for mode in modes]
    found: dict[int, Interpolant] = {}
    asked: list[list[Ints]] = [[] for _ in runs]
    answers: list[list[Floats]] = [[] for _ in runs]
    hz: dict[int, Floats | None] = dict.fromkeys(range(len(runs)))
    while hz:
        wanted: dict[int, Floats] = {}
        for k, values in hz.items():
            try:
                members = runs[k].send(values)  # type: ignore[arg-type]
                asked[k].append(members)
                wanted[k] = regions[k].x(members)
            except StopIteration as end:
                found[k] = end.value
            except AccuracyError as error:
                raise AccuracyError(f"{error}{cause(answers[k], modes)}") from None
        if not wanted:
            break
        every, start = ask(np.vstack(list(wanted.values()))), 0
        hz = {}
        for k, x in wanted.items():
            answers[k].append(every[start : start + len(x)])
            hz[k] = answers[k][-1][:, own]
            start += len(x)
    return [_Found(found[k], np.vstack(asked[k]), np.vstack(answers[k])) for k in range(len(runs))]


class _Found(NamedTuple):
    """An interpolant, all members that its run asked for, and f in Hz there."""

    interpolant: Interpolant
    asked: Ints  # (n, d)
    hz: Floats  # (n, modes[-1] + 1): of all modes up to those fitted, and of one more

    def missed(self, region: Region, modes: tuple[int, ...]) -> float:
        """|δf/f| that modes may cost which meet between the nodes, with a margin."""
        at, members = keys(self.asked), self.interpolant.members
        order = np.argsort(at, kind="stable")
        rows = order[np.searchsorted(at, keys(members), sorter=order)]
        own = [mode - 1 for mode in modes]
        missed = missed_between(region.nodes, members, self.hz[rows], own, self.interpolant.power)
        return MISSED * missed


def _with_meetings(
    modes: tuple[int, ...],
    region: Region,
    each: _Found,
    accuracy: float | None,
) -> Interpolant:
    """The interpolant, its error that where modes meet, if more; AccuracyError if too large."""
    missed = each.missed(region, modes)
    if missed <= each.interpolant.error:
        return each.interpolant
    if missed > (WORTHLESS if accuracy is None else accuracy):
        raise AccuracyError(
            f"{each.interpolant.asked} values may miss {missed:.1e} between them"
            f"{cause([each.hz], modes)}"
        )
    return each.interpolant._replace(error=missed)
