"""A polynomial in place of an eigensolve, to a stated accuracy over a stated region.

    f(q, y)^p ≈ Σ_γ c_γ h_γ(v(q, y)),   p ∈ {1, 2, −2}:  f, λ or 1/λ, whichever needs fewest terms

with Newton's basis at Leja points over a lower set of multi-indices that grows where coefficients
say so (`series.adaptive_newton`). It asks a source for frequencies: the model's exact solves, a
reduced model, or an expansion.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.errors import AccuracyError, UsageError
from eigassign.modal.adaptive import shown
from eigassign.modal.exact import DENSE_LIMIT, eigenvalues
from eigassign.modal.expansion import Expansion
from eigassign.modal.inverse import InverseExpansion
from eigassign.modal.model import Model
from eigassign.modal.region import Box, Region, build_region
from eigassign.modal.roundoff import rounding_error
from eigassign.series.adaptive_newton import interpolate
from eigassign.series.evaluation import Polynomials
from eigassign.series.interpolant import Interpolant
from eigassign.series.newton import newton_polynomials

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
MOST = 2000  # frequencies asked for in one fit
LEAST_ACCURACY = 1e-13
FINE, FINE_LARGE = 1e-8, 1e-6  # accuracies below which round-off is looked at
SHARE = 0.5  # of the accuracy that the source itself may use
FEW_AXES = 3  # up to which all corners are looked at
CLOSE = 1e-2  # relative gap in Hz below which neighbouring modes are named as a cause
QUANTITIES = {1.0: "f", 2.0: "λ", -2.0: "1/λ"}


@dataclass(frozen=True, eq=False)
class Fit:
    """Frequencies of ``modes`` over ``region`` from one polynomial each; immutable."""

    modes: tuple[int, ...]
    region: Region
    accuracy: float  # asked for, relative in Hz
    error_estimate: float  # of frequencies anywhere in the region, relative in Hz
    interpolant: Interpolant
    floor: float  # part of the estimate that is the source's own

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
        return tuple(_reasons(self.interpolant, self.floor))

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
        hz = self._hz(self._on_path(v, len(path)))
        return hz[0] if np.ndim(y) == 1 else hz

    def _on_path(self, v: Floats, n_t: int) -> Floats:
        """f^p (n_designs, n_t, n_modes): one product of matrices for all designs."""
        if self.region.line is None:
            return np.repeat(self._ready(v)[:, None], n_t, axis=1)
        right = self._ready.second(np.ascontiguousarray(v[:, 1:].T))
        g = np.empty((len(v), n_t, len(self.modes)))
        for k, table in enumerate(self._samples):
            np.matmul(right.T, table, out=g[:, :, k])
        return g

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
        if self.power == 1.0:
            return g
        root = np.sqrt(g)
        return root if self.power == 2.0 else 1.0 / root


def fit(
    source: Any,
    q: ArrayLike | Box,
    y: ArrayLike | Box,
    modes: Sequence[int] | None = None,
    accuracy: float = 1e-4,
    most: int = MOST,
) -> Fit:
    """Fit ``modes`` of ``source`` over a trajectory or a box of q and a design or a box of y.

    ``source`` is a Model (exact solves), a ReducedModel or an Expansion, whose own error estimates
    count. ``q`` are samples of a trajectory (n_t, n_q), one pose (n_q,) or a `Box`; ``y`` (n_y,) or
    a `Box`; ``accuracy`` is relative in Hz. Raises AccuracyError where ``most`` frequencies do not
    suffice, as where modes cross, UsageError for arguments that cannot be meant.
    """
    if not LEAST_ACCURACY <= accuracy < 1.0:
        raise UsageError(f"accuracy {accuracy} is not within {LEAST_ACCURACY} to 1")
    directions, n_q = _dependence(source)
    region, wanted = build_region(directions, n_q, q, y), _modes(source, modes)
    ask = _question(source, wanted)
    floor = _floor(source, region, wanted, accuracy)
    try:
        found = interpolate(
            lambda members: ask(region.x(members)),
            [axis.table for axis in region.axes],
            accuracy - floor,
            most,
            [axis.points.whole for axis in region.axes],
        )
    except AccuracyError as error:
        raise AccuracyError(f"{error}{_cause(source, region, wanted)}") from None
    if not floor and isinstance(source, Model) and found.error < _fine(source):
        floor = rounding_error(source.pencil, region.centre, wanted[-1])
    return Fit(wanted, region, accuracy, found.error + floor, found, floor)


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
    return source.to_program[source.program.dependence.any(axis=0)], source.n_q


def _modes(source: Any, modes: Sequence[int] | None) -> tuple[int, ...]:
    """The modes to fit. Raises UsageError for one that the source does not have."""
    own = getattr(source, "modes", None) if not isinstance(source, Model) else None
    wanted = tuple(sorted({int(m) for m in (modes or own or (1,))}))
    if wanted[0] < 1 or (own is not None and not set(wanted) <= set(own)):
        raise UsageError(f"modes {wanted} asked for; the source has {own or 'those from 1 on'}")
    return wanted


def _question(source: Any, modes: tuple[int, ...]) -> Callable[[Floats], Floats]:
    """x (n, n_x) → f (n, n_modes) in Hz. AccuracyError where the source gives no number."""
    if isinstance(source, Model):
        pick, pencil = np.array(modes) - 1, source.pencil
        return lambda x: np.sqrt(eigenvalues(pencil, x, modes[-1])[:, pick]) / (2.0 * np.pi)
    columns, n_q = [source.modes.index(m) for m in modes], _dependence(source)[1]

    def ask(x: Floats) -> Floats:
        hz = np.asarray(source.frequencies(x[:, :n_q], x[:, n_q:]))[:, columns]
        if not np.isfinite(hz).all():
            k = int(np.argmin(np.isfinite(hz).all(axis=1)))
            raise AccuracyError(f"the source has no frequency at (q, y) = {shown(x[k])}")
        return hz

    return ask


def _floor(source: Any, region: Region, modes: tuple[int, ...], accuracy: float) -> float:
    """Relative error in Hz of what the source answers, at the region's ends and centre.

    Of exact solves this is round-off, looked at only where it may matter. Raises AccuracyError
    where it leaves nothing of the accuracy asked for.
    """
    if isinstance(source, Model):
        if accuracy >= _fine(source):
            return 0.0
        floor = rounding_error(source.pencil, region.centre, modes[-1])
    else:
        x = region.x(_ends(region))
        n_q = _dependence(source)[1]
        columns = [source.modes.index(m) for m in modes]
        floor = float(source.error_estimate(x[:, :n_q], x[:, n_q:])[:, columns].max())
    if floor > SHARE * accuracy:
        what = "round-off" if isinstance(source, Model) else "the source itself"
        raise AccuracyError(f"{what} may cost {floor:.1e}, which leaves nothing of {accuracy:.1e}")
    return floor


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


def _reasons(found: Interpolant, floor: float) -> Iterator[str]:
    yield f"{QUANTITIES[found.power]} is the polynomial: its coefficients fall fastest"
    for count, error in found.rounds:
        yield f"{count} terms: error at most {error:.1e}"
    degrees = found.members.max(axis=0)
    idle = sum(rate == 0.0 for rate in found.rates)
    yield f"degrees {' x '.join(map(str, degrees))}" + (f", {idle} idle" if idle else "")
    if floor:
        yield f"the source itself may be off by {floor:.1e}"
