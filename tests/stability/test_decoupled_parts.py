"""Parts that know nothing of each other: a mode without a vector in the basis comes down."""

from __future__ import annotations

import numpy as np
import pytest
from decoupled import comb
from stress import judged, stated

from eigassign.modal import expand, reduce

TIP = np.linspace(0.0, 0.1, 21)[:, None]  # kg


@pytest.mark.parametrize("start", [0.0, 0.005])
def test_a_cantilever_that_a_mass_brings_down_is_not_overlooked(start):
    """Of twelve the last one is the stiffest; with 100 g on its tip it has the lowest mode."""
    model = comb(12)
    exact = model.frequencies([], TIP, 1)[:, 0]
    assert exact[0] == pytest.approx(52.65, abs=0.01)
    assert exact[-1] == pytest.approx(48.25, abs=0.01)
    for approximation in (
        reduce(model.pencil, [], [start], (1,), 2),
        expand(model.pencil, [], [start], (1,), 4),
    ):
        error = judged(model, approximation, [], TIP)
        assert error[exact > 0.999 * exact[0]].max() < 1e-9
        assert error.max() > 0.05
        assert stated(model, approximation, [], TIP)[0] > 0.05


def test_a_second_point_brings_it_into_the_basis():
    model = comb(12)
    reduced = reduce(model.pencil, np.zeros((2, 0)), TIP[[0, -1]], (1,), 2)
    assert judged(model, reduced, [], TIP).max() < 1e-9
