"""A reduced model made smaller for a region: as small as the accuracy allows, and honest."""

from __future__ import annotations

import numpy as np
import pytest
from chains import model_of, random_chain

from eigassign import load_case
from eigassign.errors import UsageError
from eigassign.modal import reduce

Q0, Y0 = np.array([1.817, 5.312]), np.array([0.125, 0.125])
SPAN = (np.array([0.3, 0.3]), np.array([0.1, 0.1]))


@pytest.fixture(scope="module")
def arm():
    return load_case("cases/two_link.yaml").model()


@pytest.fixture(scope="module")
def whole(arm):
    return reduce(arm.pencil, Q0, Y0, (1,), 3)


def inside(count: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(77)
    widths = np.concatenate(SPAN)
    x = np.concatenate([Q0, Y0]) + widths * rng.uniform(-1.0, 1.0, (count, 4))
    return x[:, :2], x[:, 2:]


def change(small, whole, q, y) -> float:
    return float(np.abs(small.frequencies(q, y) / whole.frequencies(q, y) - 1.0).max())


@pytest.mark.parametrize("accuracy", [1e-3, 1e-5, 1e-7])
def test_no_frequency_moves_by_more_than_was_allowed(arm, whole, accuracy):
    small = reduce(arm.pencil, Q0, Y0, (1,), 3, span=SPAN, accuracy=accuracy)
    q, y = inside(2000)
    moved = change(small, whole, q, y)
    assert moved <= accuracy
    assert accuracy < 1e-6 or moved > accuracy / 30.0  # so few vectors leave no room
    assert small.error_estimate(q, y).max() < 30.0 * accuracy  # nor is it said to
    assert small.size < whole.size


def test_more_accuracy_takes_more_vectors_and_a_wider_span_as_well(arm):
    def size(widen, accuracy):
        span = (SPAN[0] * widen, SPAN[1])
        return reduce(arm.pencil, Q0, Y0, (1,), 3, span=span, accuracy=accuracy).size

    assert size(1.0, 1e-3) < size(1.0, 1e-8)
    assert size(0.1, 1e-6) < size(2.0, 1e-6)


@pytest.mark.parametrize("seed", [2, 5, 8, 13, 21])
def test_the_estimate_still_covers_the_error(seed):
    """Random chains, two modes: against exact solves, inside the span and a little beyond."""
    tree, q0 = random_chain(seed)
    model = model_of(tree)
    span = (np.full(len(q0), 0.2), [])
    small = reduce(model.pencil, q0, [], (1, 2), 2, span=span, accuracy=1e-3)
    q = q0 + np.random.default_rng(seed).uniform(-0.3, 0.3, (40, len(q0)))
    error = np.abs(small.frequencies(q, []) / model.frequencies(q, [], 2) - 1.0)
    assert (error <= small.error_estimate(q, [])).all()


def test_nothing_is_left_out_that_cannot_be(arm, whole):
    """An accuracy beyond what compression can give brings the whole model, bit for bit."""
    same = reduce(arm.pencil, Q0, Y0, (1,), 3, span=SPAN, accuracy=1e-15)
    q, y = inside(20)
    assert same.frequencies(q, y).tobytes() == whole.frequencies(q, y).tobytes()


def test_twice_the_same(arm):
    first, second = (reduce(arm.pencil, Q0, Y0, (1,), 2, span=SPAN) for _ in range(2))
    q, y = inside(20)
    assert first.frequencies(q, y).tobytes() == second.frequencies(q, y).tobytes()


def test_several_points(arm):
    points = np.array([Q0 - 0.4, Q0 + 0.4])
    whole = reduce(arm.pencil, points, Y0, (1, 2), 2)
    small = reduce(arm.pencil, points, Y0, (1, 2), 2, span=SPAN, accuracy=1e-5)
    q, y = points[0] + 0.2, Y0
    assert change(small, whole, q, y) <= 1e-5


@pytest.mark.parametrize(
    ("span", "accuracy", "why"),
    [
        (([0.3], [0.1, 0.1]), 1e-4, "half-widths"),
        (([0.3, -0.3], [0.1, 0.1]), 1e-4, "not negative"),
        (([0.3, np.nan], [0.1, 0.1]), 1e-4, "finite"),
        (SPAN, 0.0, "accuracy"),
        (SPAN, 1.0, "accuracy"),
    ],
)
def test_an_impossible_region_is_refused(arm, span, accuracy, why):
    with pytest.raises(UsageError, match=why):
        reduce(arm.pencil, Q0, Y0, (1,), 2, span=span, accuracy=accuracy)
