"""The series of 1/λ: the same coefficients as λ's, summed in another way.

Frequencies that fall with added mass have λ = a / (b + m) in the simplest case: 1/λ is linear in m,
while λ's own series ends at m = −b. The reciprocal of a truncated series is exact order by order.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.errors import UsageError
from eigassign.modal.samples import samples
from eigassign.series.evaluation import Polynomials, polynomials
from eigassign.series.power_series import PowerSeries

if TYPE_CHECKING:
    from eigassign.modal.expansion import Expansion

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class InverseExpansion:
    """Taylor expansion of 1/λ about the point of ``expansion``, over the same set; immutable."""

    expansion: Expansion
    coefficients: Floats  # (n_modes, N) over w, s² over units of w

    @property
    def modes(self) -> tuple[int, ...]:
        """The modes expanded, in the order of the columns."""
        return self.expansion.modes

    @cached_property
    def _prepared(self) -> Polynomials:
        return polynomials(self.expansion.space, self.coefficients)

    def frequencies(self, q: ArrayLike, y: ArrayLike) -> Floats:
        """f = 1/(2π √μ) in Hz, μ the polynomial, (n_samples, n_modes); NaN where μ < 0."""
        of = self.expansion
        w = (samples(q, y, len(of.q0), len(of.y0)) - of.x0) @ of.directions.T
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.asarray(0.5 / np.pi / np.sqrt(self._prepared(w)))

    def error_estimate(self, q: ArrayLike, y: ArrayLike) -> Floats:
        """Estimate of the relative error of ``frequencies``, (n_samples, n_modes); no exact solve.

        As for the expansion of λ: beside the reduced model on the same Taylor vectors.
        """
        from eigassign.modal.taylor_estimate import polynomial_error

        beside = self.expansion.reduced
        f = self.frequencies(q, y)
        return polynomial_error(f, beside.frequencies(q, y), beside.error_estimate(q, y))


def inverse(expansion: Expansion) -> InverseExpansion:
    """1/λ of every mode; UsageError for clusters, whose eigenvalues have no series of their own."""
    together = [c.modes for c in expansion.clusters if len(c.modes) > 1]
    if together:
        raise UsageError(f"modes {together[0]} are expanded as a cluster: 1/λ has no series each")
    series = [
        (1.0 / PowerSeries(expansion.space, cluster.coefficients[0, 0])).coefficients
        for cluster in expansion.clusters
    ]
    coefficients = np.array(series)
    coefficients.setflags(write=False)
    return InverseExpansion(expansion, coefficients)
