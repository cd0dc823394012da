"""Many samples at once give what few give, for single modes and for clusters."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import eigassign as ea
from eigassign.modal.expansion import MANY, expand

ARM = Path(__file__).parents[2] / "cases" / "two_link.yaml"


@pytest.mark.parametrize("gap", [0.02, 0.9], ids=["single modes", "one cluster"])
def test_many_samples_give_what_few_give(gap: float) -> None:
    pencil = ea.load_case(ARM).model().pencil
    made = expand(pencil, [1.817, 5.312], [0.125, 0.125], (1, 2), order=5, cluster_gap=gap)
    random = np.random.default_rng(3)
    q = made.q0 + random.uniform(-0.1, 0.1, (MANY, 2))
    y = random.uniform(0.0, 0.25, (MANY, 2))
    few = np.vstack([made.eigenvalues(q[i : i + 100], y[i : i + 100]) for i in range(0, MANY, 100)])
    # a sum's round-off is relative to its largest term, which the largest eigenvalue is near
    np.testing.assert_allclose(made.eigenvalues(q, y), few, rtol=1e-12, atol=1e-12 * few.max())
