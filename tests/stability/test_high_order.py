"""Order up to 20: the coefficients keep their digits, and the sum is known to lose them outside."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from chains import model_of, two_link
from stress import judged, stated

from eigassign.modal import expand

Q0, Y0 = np.array([1.817, 5.312]), np.array([0.125, 0.125])


@pytest.mark.parametrize("order", [12, 16, 20])
def test_near_the_point_a_high_order_is_right_to_round_off(order):
    model = model_of(two_link())
    expansion = expand(model.pencil, Q0, Y0, (1, 2), order=order)
    q = Q0 + np.column_stack([np.zeros(21), np.linspace(-0.1, 0.1, 21)])
    assert judged(model, expansion, q, Y0).max() < 1e-11


def test_the_error_falls_with_the_order_until_round_off():
    """Half-way to the nearest singularity two orders win a digit, down to 1e-11."""
    model = model_of(two_link())
    q = Q0 + np.array([[0.0, 0.2], [0.0, -0.2]])
    errors = [
        judged(model, expand(model.pencil, Q0, Y0, (1,), order=p), q, Y0).max()
        for p in (4, 8, 12, 16, 20)
    ]
    assert all(b < a for a, b in itertools.pairwise(errors[:4]))
    assert errors[-1] < 1e-9


def test_far_away_a_high_order_is_wild_and_says_so():
    model = model_of(two_link())
    expansion = expand(model.pencil, Q0, Y0, (1,), order=20)
    q = Q0 + np.column_stack([np.zeros(41), np.linspace(-1.5, 1.5, 41)])
    assert judged(model, expansion, q, [0.0, 0.0]).max() > 1.0
    assert stated(model, expansion, q, [0.0, 0.0])[0] > 1.0
