"""An elbow that unfolds over 150°: no one series of mode 2 reaches from end to end."""

from __future__ import annotations

import numpy as np
import pytest
from stress import case, judged, stated

from eigassign.errors import AccuracyError
from eigassign.modal import expand, raise_order, reduce

ELBOW = np.deg2rad(np.linspace(20.0, 170.0, 61))
Q = np.column_stack([np.zeros(61), ELBOW])
X = np.column_stack([Q, np.full(61, 0.1)])
POINT = ([0.0, np.deg2rad(40.0)], [0.1])


@pytest.mark.parametrize("order", [4, 8, 14, 20])
def test_a_polynomial_beyond_its_radius_is_not_believed(order):
    model = case("wide_motion").model()
    expansion = expand(model.pencil, *POINT, (1, 2), order=order)
    error = judged(model, expansion, Q, [0.1])
    assert stated(model, expansion, Q, [0.1]).max() > 0.05
    near = np.abs(ELBOW - POINT[0][1]) < 0.25
    assert error[near].max() < 1e-3


def test_several_points_reach_over_it():
    model = case("wide_motion").model()
    chosen = raise_order(model.pencil, X, X[30], 1e-3, (1, 2))
    exact = model.frequencies(Q, [0.1], 2)
    assert np.abs(chosen.frequencies(Q, [0.1]) / exact - 1.0).max() <= 1e-3
    assert len(chosen.parts) > 1
    with pytest.raises(AccuracyError, match="at sample"):
        raise_order(model.pencil, X, X[30], 1e-7, (1, 2), orders=(2,))


def test_one_reduced_model_reaches_over_it():
    model = case("wide_motion").model()
    points = Q[[10, 30, 50]]
    found = reduce(model.pencil, points, np.full((3, 1), 0.1), (1, 2), 2)
    assert judged(model, found, Q, [0.1]).max() <= 1e-6
