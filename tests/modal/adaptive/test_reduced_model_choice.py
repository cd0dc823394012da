"""The reduced model that meets an accuracy: small, and refused at the worst sample."""

from __future__ import annotations

import numpy as np
import pytest
from paper_arm import build, exact, samples

from eigassign.errors import AccuracyError
from eigassign.modal import reduce_adaptively


@pytest.fixture(scope="module")
def x() -> np.ndarray:
    return samples()


@pytest.mark.parametrize("accuracy", [1e-3, 1e-6, 1e-9])
def test_the_reduced_model_is_as_small_as_the_accuracy_allows(x, accuracy):
    model = build({"upper": 4, "fore": 3})
    found = reduce_adaptively(model.pencil, x, accuracy, (1,))
    f = found.reduced.frequencies(x[:, :2], x[:, 2:])
    error = np.abs(f / exact(model, x, (1,)) - 1.0)
    assert (error <= found.error).all()
    assert found.error.max() <= accuracy
    assert found.reduced.size <= 15


def test_a_reduced_model_that_may_not_grow_is_refused_at_the_worst_sample(x):
    model = build({"upper": 4, "fore": 3})
    with pytest.raises(AccuracyError, match=r"up to 8 vectors .* at sample \d+, \(q, y\) = \("):
        reduce_adaptively(model.pencil, x, 1e-9, (1, 2), max_size=8)


def test_the_first_point_is_the_sample_nearest_to_the_middle_in_every_coordinate():
    model = build({"upper": 4, "fore": 3})
    x = np.array([[0.0, 0.0], [1.0, 0.1], [0.5, 0.01], [0.4, 0.05]])
    x = np.hstack([np.zeros((4, 1)), x, np.full((4, 1), 0.1)])
    found = reduce_adaptively(model.pencil, x, 1e-3)
    np.testing.assert_array_equal(found.reduced.points[0], x[3])
