"""What ``auto`` chooses meets what was asked for, by exact solves, and is not more than that."""

import numpy as np
import pytest
from chains import model_of, two_link

from eigassign import load_case
from eigassign.errors import AccuracyError
from eigassign.modal import MARGIN, Model, raise_order


def build(elements) -> Model:
    return model_of(two_link(elements=(elements["upper"], elements["fore"])))


@pytest.fixture(scope="module")
def x() -> np.ndarray:
    """Every fourth pose of the paper's trajectory with random masses of its design box."""
    q = load_case("cases/two_link.yaml").trajectory.q[::4]
    return np.hstack([q, np.random.default_rng(5).uniform(0.0, 0.25, (len(q), 2))])


def exact(model: Model, x: np.ndarray, modes) -> np.ndarray:
    return model.frequencies(x[:, :2], x[:, 2:], max(modes))[:, np.array(modes) - 1]


def middle(x: np.ndarray) -> np.ndarray:
    return x[len(x) // 2]


def meshed(x: np.ndarray, accuracy: float, modes: tuple[int, ...]) -> Model:
    """The arm of the fewest elements, a power of two, that are within the accuracy."""
    models = (build({"upper": n, "fore": n}) for n in (2, 4, 8, 16))
    errors = ((m, m.discretisation_error(x[:, :2], x[:, 2:], modes).max()) for m in models)
    return next(model for model, error in errors if error <= accuracy)


@pytest.mark.parametrize(
    ("accuracy", "modes"), [(a, m) for a in (1e-2, 1e-3, 1e-4) for m in ((1,), (1, 2))][:-1]
)
def test_mesh_and_expansion_together_meet_the_accuracy(x, accuracy, modes):
    expansion = raise_order(
        meshed(x, 0.5 * accuracy, modes).pencil, x, middle(x), 0.5 * accuracy, modes
    )
    true = exact(build({"upper": 40, "fore": 40}), x, modes)
    f = expansion.frequencies(x[:, :2], x[:, 2:])
    assert np.abs(f / true - 1.0).max() <= accuracy


def test_it_says_what_it_chose_and_why(x):
    expansion = raise_order(meshed(x, 5e-4, (1,)).pencil, x, middle(x), 5e-4)
    assert expansion.order == 8
    assert expansion.reasons[0] == f"compared with exact solves at {len(x)} poses and designs"
    assert any(line.startswith("order 4: about") for line in expansion.reasons)


def test_what_is_fixed_stays(x):
    model = build({"upper": 4, "fore": 3})
    expansion = raise_order(model.pencil, x, x[0], 2.5e-3, orders=(4,))
    assert expansion.order == 4
    np.testing.assert_array_equal(expansion.parts[0].x0, x[0])


def test_what_only_several_designs_could_reach_is_refused(x):
    """All points share a design, as an assignment needs it: mode 2 leaves 2e-4 over the box."""
    model = build({"upper": 4, "fore": 3})
    with pytest.raises(AccuracyError, match=r"up to 8 at up to 32 points reaches 5\.0e-05"):
        raise_order(model.pencil, x, middle(x), 5e-5, (1, 2), orders=(4, 8))


def test_several_points_do_where_one_does_not(x):
    """Two modes to 1e-4 over the whole trajectory: no single series of order up to 4 reaches it."""
    model = build({"upper": 4, "fore": 3})
    x = np.hstack([x[:, :2], np.full((len(x), 2), 0.125)])
    chosen = raise_order(model.pencil, x, middle(x), 1e-4, (1, 2), orders=(3, 4))
    assert len(chosen.parts) > 1
    assert {part.y0.tobytes() for part in chosen.parts} == {x[0, 2:].tobytes()}
    f = chosen.frequencies(x[:, :2], x[:, 2:])
    error = np.abs(f / exact(model, x, (1, 2)) - 1.0)
    np.testing.assert_allclose(chosen.error, error, atol=1e-12)
    assert chosen.stated == MARGIN * chosen.error.max() <= 1e-4


def test_many_points_do_while_more_of_them_help(x):
    """An order of 2 to 1e-4 at one design: more than 8 points, which once were the most."""
    model = build({"upper": 4, "fore": 3})
    x = np.hstack([x[:, :2], np.full((len(x), 2), 0.125)])
    chosen = raise_order(model.pencil, x, middle(x), 2e-6, orders=(2,))
    assert 8 < len(chosen.parts) <= 32
    f = chosen.frequencies(x[:, :2], x[:, 2:])
    assert np.abs(f / exact(model, x, (1,)) - 1.0).max() <= 2e-6
