"""A polynomial in place of an eigensolve, to a stated accuracy over a stated region.

    f(q, y)^p ≈ Σ_γ c_γ h_γ(v(q, y)),   p ∈ {1, 2, −2}:  f, λ or 1/λ, whichever needs fewest terms

in Newton's basis over a lower set of multi-indices. How it is made is in `modal.fitting`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.errors import UsageError
from eigassign.modal.region import Region
from eigassign.series.evaluation import Polynomials
from eigassign.series.interpolant import Interpolant
from eigassign.series.newton import newton_polynomials

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
QUANTITIES = {1.0: "f", 2.0: "λ", -2.0: "1/λ"}


@dataclass(frozen=True, eq=False)
class Fit:
    """Frequencies of ``modes`` over ``region`` from one polynomial each; immutable."""

    modes: tuple[int, ...]
    region: Region
    accuracy: float | None  # asked for, relative in Hz; None where the solves were given
    interpolant: Interpolant
    own_error: Callable[[], float]  # of the source, part of the estimate; found when asked for

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
        """f of f^p, in its place."""
        if self.power == 1.0:
            return g
        np.sqrt(g, out=g)  # in place: fresh pages cost more than the roots
        return g if self.power == 2.0 else np.divide(1.0, g, out=g)


def _reasons(found: Interpolant, floor: float) -> Iterator[str]:
    yield f"{QUANTITIES[found.power]} is the polynomial: its coefficients fall fastest"
    for count, error in found.rounds:
        yield f"{count} terms: error at most {error:.1e}"
    degrees = found.members.max(axis=0)
    idle = sum(rate == 0.0 for rate in found.rates)
    yield f"degrees {' x '.join(map(str, degrees))}" + (f", {idle} idle" if idle else "")
    if floor:
        yield f"the source itself may be off by {floor:.1e}"
