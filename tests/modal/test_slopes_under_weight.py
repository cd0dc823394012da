"""Slopes of eigenvalues and the recursion under weight, up to all but buckling."""

from __future__ import annotations

import numpy as np
import pytest
from calibration import Floats
from rungs import derivative, residual
from weighed_draws import weighed

from eigassign.modal import eigenvalues, exact_slopes

APART = 1e-3  # of λ: nearer modes have no slopes of their own that differences could tell


@pytest.mark.parametrize("seed", range(60))
def test_slopes_under_weight_are_those_of_finite_differences(seed: int) -> None:
    """Of every coordinate and parameter, with what swings free, loops and springs."""
    drawn = weighed(seed, 1)
    if drawn is None:
        pytest.skip("falls either way")
    pencil, x = drawn.model.pencil, drawn.model.x(drawn.q0, drawn.y0)[0]
    span = 1e-3 * np.where(np.arange(len(x)) < pencil.n_q, 1.0, np.abs(x))
    span[span == 0.0] = 1e-6
    count = min(3, len(pencil.elastic) - 1)
    lam, slopes, _ = exact_slopes(pencil, x[None], count, np.ones(len(x)), 1)
    lam = lam[0]

    def at(w: Floats) -> Floats:
        return np.asarray(eigenvalues(pencil, (x + w * span)[None], count)[0])

    single = [
        k for k in range(count)
        if np.abs(np.delete(lam, k) / lam[k] - 1.0).min(initial=1.0) > APART
    ]  # fmt: skip
    for j in range(len(x)):
        expected = derivative(at, np.eye(len(x))[[j]], lam[:count])[single]
        found = slopes[0, single, j] * span[j]
        np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-9 * lam[single].max())
    assert residual(pencil, x, span, 2, (1,)).max() < 1e-10
