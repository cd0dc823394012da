"""A polynomial in place of an eigensolve, to a stated accuracy over a stated region.

    f(q, y)^p ≈ Σ_γ c_γ h_γ(v(q, y)),   p ∈ {1, 2, −2}:  f, λ or 1/λ, whichever needs fewest terms

in Newton's basis over a lower set of multi-indices (`interpolation`). A path with corners has one
polynomial for each stretch between them.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.brief import counted, of_modes
from eigassign.errors import UsageError
from eigassign.modal.arguments import whole_within
from eigassign.modal.fit.interpolation import (
    Interpolant,
    basis_at,
    fewest,
    interpolate,
    newton_basis,
)
from eigassign.modal.fit.path import read_path
from eigassign.modal.fit.region import Box, Region, build_region
from eigassign.modal.fit.source import SHARE, FitSource, as_source

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
    floor: float  # the source's own error, part of the estimate

    def __repr__(self) -> str:
        return (
            f"<Fit of {self.quantity} of {of_modes(self.modes)}: "
            f"{counted(len(self.indices), 'term')} in {counted(self.region.d, 'variable')} "
            f"from {counted(self.solves, 'solve')}>"
        )

    @property
    def error_estimate(self) -> float:
        """The error of frequencies anywhere in the region, relative in Hz."""
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
        """The choices and their reasons, as lines of text."""
        found = self.interpolant
        degrees = " x ".join(map(str, found.members.max(axis=0)))
        idle = sum(rate == 0.0 for rate in found.rates)
        lines = [
            f"fitted is {self.quantity}, whose coefficients decrease fastest",
            *(f"{count} terms: error at most {error:.1e}" for count, error in found.rounds),
            f"degrees {degrees}" + (f", {idle} idle" if idle else ""),
        ]
        if self.floor:
            lines.append(f"what is fitted may be off by {self.floor:.1e} itself")
        return tuple(lines)

    @property
    def quantity(self) -> str:
        """The quantity that is a polynomial: "f", "λ" or "1/λ"."""
        return QUANTITIES[self.power]

    def frequencies(self, q: ArrayLike, y: ArrayLike) -> Floats:
        """(n, n_modes) in Hz. Raises UsageError outside the region."""
        return self._values(self.region.v(self.region.samples(q, y)))

    def along(self, y: ArrayLike | None = None) -> Floats:
        """At every sample of the trajectory: (n_t, n_modes) in Hz for one design y (n_y,).

        (n_designs, n_t, n_modes) for many (n_designs, n_y); without y at that of the fit. Raises
        UsageError for a fit over a box of q, for y outside the region, or missing.
        """
        region, n_q = self.region, self.region.n_q
        if region.path is None:
            raise UsageError("the fit is over a box of q: it has no trajectory to go along")
        if y is None and (region.place is None or region.d > 1):
            raise UsageError("the fit is over a box of y: along which design?")
        v = region.v(region.samples(region.centre[:n_q], region.centre[n_q:] if y is None else y))
        if region.place is None:
            hz = np.repeat(self._values(v)[:, None], len(region.path), axis=1)
        else:  # one product of matrices for all designs
            others, curves = self._curves
            right = basis_at(region.nodes[1:], others, v[:, 1:])
            g = np.empty((len(v), curves.shape[2], len(self.modes)))
            for k, each in enumerate(curves):
                np.matmul(right, each, out=g[:, :, k])
            hz = self._hz(g)
        return hz if y is not None and np.ndim(y) == 2 else hz[0]

    @cached_property
    def _curves(self) -> tuple[Ints, Floats]:
        """Members (M, d − 1) on the axes of y, and what each is times along the path.

        These are Σ_k c_kγ h_k at every sample, (n_modes, M, n_t).
        """
        indices, region = self.indices, self.region
        assert region.place is not None  # there is a trajectory
        others, row = np.unique(indices[:, 1:], axis=0, return_inverse=True)
        table = np.zeros((len(self.modes), len(others), int(indices[:, 0].max()) + 1))
        table[:, row.reshape(-1), indices[:, 0]] = self.coefficients
        return others, table @ newton_basis(region.nodes[0].v[: table.shape[2]], region.place)

    def _values(self, v: Floats, block: int = 512) -> Floats:
        """f in Hz (n, n_modes) at v (n, d), in blocks that stay in the processor's cache."""
        parts = [v[i : i + block] for i in range(0, max(len(v), 1), block)]
        g = [
            basis_at(self.region.nodes, self.indices, each) @ self.coefficients.T for each in parts
        ]
        return self._hz(np.vstack(g))

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
    rows: tuple[slice, ...]

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
        """The largest error of all parts, relative in Hz."""
        return max(part.error_estimate for part in self.parts)

    @property
    def solves(self) -> int:
        """Poses at which the source was asked, checks included."""
        return sum(part.solves for part in self.parts)

    @property
    def reasons(self) -> tuple[str, ...]:
        """The choices and their reasons, as lines of text, for each part."""
        return tuple(
            f"samples {rows.start} to {rows.stop - 1}: {line}"
            for part, rows in zip(self.parts, self.rows, strict=True)
            for line in part.reasons
        )

    def frequencies(self, q: ArrayLike, y: ArrayLike) -> Floats:
        """(n, n_modes) in Hz. Raises UsageError outside the region."""
        x, n_q = self.parts[0].region.samples(q, y), self.parts[0].region.n_q
        hz, left = np.empty((len(x), len(self.modes))), np.ones(len(x), dtype=np.bool_)
        for part in self.parts:
            mine = left & part.region.on_path(x)
            if mine.any():
                hz[mine] = part.frequencies(x[mine, :n_q], x[mine, n_q:])
                left &= ~mine
        if left.any():
            raise UsageError(f"q lies off the path that was fitted: sample {int(left.argmax())}")
        return hz

    def along(self, y: ArrayLike | None = None) -> Floats:
        """Frequencies as of `Fit.along`, at the samples of all parts in their order."""
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
    asked = as_source(source, modes)
    of = asked.directions, asked.n_q
    rows, stretches = ((), (q,)) if isinstance(q, Box) else read_path(q, *of)
    regions = [build_region(*of, each, y) for each in stretches]
    if all(region.rests for region in regions):
        raise UsageError("nothing to fit: no coordinate or parameter that matters has room")
    counts = [most] * len(regions)
    if solves is None:
        accuracy = ACCURACY if accuracy is None else accuracy
    else:
        counts = _shares(whole_within(solves, "solves", 1, MOST), regions)
    fits = tuple(
        _fit_region(asked, region, accuracy, count)
        for region, count in zip(regions, counts, strict=True)
    )
    return fits[0] if len(fits) == 1 else PathFit(fits, rows)


def _shares(solves: int, regions: Sequence[Region]) -> list[int]:
    """The solves of each stretch: as it is long, and as many as an error estimate needs."""
    n, least = len(regions), fewest(max(region.d for region in regions))
    counts = [solves]
    if n > 1:
        if solves < least * n:
            raise UsageError(
                f"{solves} solves for {n} stretches between corners: at least {least * n} are "
                "needed to tell an error"
            )
        counts, lengths = [least] * n, [region.length for region in regions]
        for _ in range(solves - least * n):
            counts[int(np.argmax(np.divide(lengths, counts)))] += 1
    for region, count in zip(regions, counts, strict=True):
        region.require_followed(count)
    return counts


def _fit_region(source: FitSource, region: Region, accuracy: float | None, most: int) -> Fit:
    """One polynomial for each mode, to an accuracy or of ``most`` frequencies."""
    floors, left, centre = [0.0], accuracy, region.centre[None]
    if accuracy is not None and source.fine is None:
        left = (1.0 - SHARE) * accuracy
    elif accuracy is not None and source.fine is not None and accuracy < source.fine:
        floors.append(source.own_error(centre, accuracy))
        left = accuracy - floors[-1]

    def ask(points: Ints) -> Floats:
        x = region.x(points)
        if source.fine is None:
            floors.append(source.own_error(x, accuracy))
        return source.ask(x)

    found = interpolate(region.nodes, ask, source.modes, left, most)
    if source.fine is not None and len(floors) == 1 and found.error < source.fine:
        floors.append(source.error(centre))
    return Fit(source.modes, region, accuracy, found, max(floors))


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
