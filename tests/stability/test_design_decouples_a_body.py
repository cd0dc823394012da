"""A drive made ever softer: its mode goes to zero frequency, and the forearm hangs free."""

from __future__ import annotations

import numpy as np
import pytest
from stress import case, judged

from eigassign.errors import UsageError
from eigassign.modal import expand, reduce

POSE = [0.0, 1.0]
K = np.concatenate([np.geomspace(1e-6, 100.0, 17), np.linspace(200.0, 1000.0, 9)])[:, None]


def test_far_from_its_point_a_polynomial_is_refused_or_covered():
    model = case("decoupled_body").model()
    for order in (2, 4, 8):
        judged(model, expand(model.pencil, POSE, [500.0], (1, 2), order=order), POSE, K)


def test_the_reduced_model_follows_the_mode_down_or_refuses():
    model = case("decoupled_body").model()
    reduced = reduce(model.pencil, POSE, [500.0], (1, 2), 3)
    judged(model, reduced, POSE, K)


def test_the_exact_frequency_falls_as_the_root_of_the_stiffness():
    """λ = k/J once the links are stiff beside the drive: a slope of 1/2 over six decades."""
    model = case("decoupled_body").model()
    k = np.geomspace(1e-6, 1.0, 7)
    f = model.frequencies(POSE, k[:, None], 1)[:, 0]
    slopes = np.diff(np.log(f)) / np.diff(np.log(k))
    np.testing.assert_allclose(slopes, 0.5, atol=5e-4)


def test_no_stiffness_at_all_is_refused_by_name():
    model = case("decoupled_body").model()
    with pytest.raises(UsageError, match=r"drive\.stiffness must be > 0"):
        model.frequencies(POSE, [0.0], 1)
