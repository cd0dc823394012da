"""Fits: as accurate as asked and estimated, over trajectories and boxes, or refused."""

from __future__ import annotations

import numpy as np
import pytest

import eigassign as ea
from eigassign.errors import AccuracyError, UsageError
from eigassign.modal import Model, rounding_error

BOX = ea.Box([0.0, 0.0], [0.25, 0.25])
Q0, Y0 = [1.817, 5.312], [0.125, 0.125]


@pytest.fixture(scope="module")
def arm() -> tuple[Model, np.ndarray]:
    case = ea.load_case("cases/two_link.yaml")
    return case.model(), case.trajectory.q


def designs(count: int) -> np.ndarray:
    rng = np.random.default_rng(4)
    y = rng.uniform(0.0, 0.25, (count, 2))
    corners = np.array([[0.0, 0.0], [0.25, 0.0], [0.0, 0.25], [0.25, 0.25]])
    y[:4] = corners[:count]
    return y


def worst(model: Model, fit: ea.Fit, q: np.ndarray, y: np.ndarray) -> float:
    hz = model.frequencies(q, y, max(fit.modes))[:, np.array(fit.modes) - 1]
    return float(np.abs(fit.frequencies(q, y) / hz - 1.0).max())


@pytest.mark.parametrize("accuracy", [1e-2, 1e-4, 1e-6, 1e-8])
def test_along_a_trajectory_a_few_solves_do(arm: tuple[Model, np.ndarray], accuracy: float) -> None:
    model, q = arm
    fit = ea.fit(model, q, Y0, accuracy=accuracy)
    off = float(np.abs(fit.along() / model.frequencies(q, Y0, 1) - 1.0).max())
    assert off <= fit.error_estimate <= accuracy
    assert fit.solves <= 12
    np.testing.assert_allclose(fit.frequencies(q, Y0), fit.along(), rtol=1e-12)


@pytest.mark.parametrize("accuracy", [1e-2, 1e-4, 1e-6])
def test_over_trajectory_and_designs(arm: tuple[Model, np.ndarray], accuracy: float) -> None:
    model, q = arm
    fit = ea.fit(model, q, BOX, accuracy=accuracy)
    y = designs(40)
    assert worst(model, fit, np.repeat(q[::10], 40, axis=0), np.tile(y, (16, 1))) <= accuracy
    along = fit.along(y)
    assert along.shape == (40, len(q), 1)
    np.testing.assert_allclose(along[3], fit.frequencies(q, y[3]), rtol=1e-11)
    np.testing.assert_allclose(fit.along(y[3]), along[3], rtol=1e-11)


def test_over_a_box_of_q_coordinates_that_only_matter_together_are_one(
    arm: tuple[Model, np.ndarray],
) -> None:
    model, _ = arm
    low, high = np.array(Q0) - 0.1, np.array(Q0) + 0.1
    fit = ea.fit(model, ea.Box(low, high), BOX, (1, 2), 1e-4)
    assert fit.region.d == 3  # q2 − q1 and two masses
    q = np.random.default_rng(1).uniform(low, high, (40, 2))
    assert worst(model, fit, q, designs(40)) <= fit.error_estimate <= 1e-4
    with pytest.raises(UsageError, match="no trajectory to go along"):
        fit.along(Y0)


def test_at_one_pose_only_the_design_varies(arm: tuple[Model, np.ndarray]) -> None:
    model, _ = arm
    fit = ea.fit(model, Q0, BOX, accuracy=1e-6)
    assert fit.region.d == 2
    assert worst(model, fit, np.tile(Q0, (20, 1)), designs(20)) <= 1e-6
    assert fit.along(designs(3)).shape == (3, 1, 1)


def test_a_curved_path_is_fitted_at_its_samples() -> None:
    case = ea.load_case("cases/arm_3r.yaml")
    model, q = case.model(), case.trajectory.q
    fit = ea.fit(model, q, case.initial_design, accuracy=1e-6)
    np.testing.assert_allclose(fit.along(), model.frequencies(q, case.initial_design, 1), rtol=1e-6)
    with pytest.raises(UsageError, match="off the path"):
        fit.frequencies(0.5 * (q[0] + q[2]), case.initial_design)


@pytest.mark.parametrize("source", ["reduced", "expansion", "inverse"])
def test_other_sources_and_their_own_errors_count(
    arm: tuple[Model, np.ndarray], source: str
) -> None:
    model, q = arm
    expansion = ea.expand(model, Q0, Y0, order=8)
    reduced = ea.reduce(model, Q0, Y0, half_order=2)
    of = {"reduced": reduced, "expansion": expansion, "inverse": expansion.inverse}[source]
    near = ea.Box([0.1, 0.1], [0.15, 0.15])
    fit = ea.fit(of, q[60:100], near, accuracy=1e-3)
    own = float(of.error_estimate(q[60], [0.1, 0.1]).max())
    assert own <= fit.error_estimate <= 1e-3
    y = np.random.default_rng(0).uniform(0.1, 0.15, (40, 2))
    assert worst(model, fit, q[60:100], y) <= fit.error_estimate


def test_a_source_that_is_worse_than_asked_is_refused(arm: tuple[Model, np.ndarray]) -> None:
    model, q = arm
    poor = ea.expand(model, Q0, Y0, order=2)
    with pytest.raises(AccuracyError, match="what is fitted leaves an error of"):
        ea.fit(poor, q, BOX, accuracy=1e-4)


def test_an_accuracy_below_round_off_is_refused(arm: tuple[Model, np.ndarray]) -> None:
    model, q = arm
    with pytest.raises(AccuracyError, match="round-off leaves an error of"):
        ea.fit(model, q, Y0, accuracy=1e-13)


def test_modes_that_cross_are_refused_and_fitted_where_they_do_not() -> None:
    case = ea.load_case("cases/stress/exact_crossing.yaml")
    model = case.model()
    with pytest.raises(AccuracyError, match="leave an estimated error"):
        ea.fit(model, [], ea.Box([60e9], [80e9]), (1,), 1e-6)
    fit = ea.fit(model, [], ea.Box([60e9], [69e9]), (1, 2), 1e-6)
    y = np.linspace(60e9, 69e9, 9)[:, None]
    hz = model.frequencies(np.zeros((9, 0)), y, 2)
    np.testing.assert_allclose(fit.frequencies(np.zeros((9, 0)), y), hz, rtol=1e-6)


def test_modes_that_touch_are_named() -> None:
    case = ea.load_case("cases/stress/exact_crossing.yaml")
    with pytest.raises(AccuracyError, match="modes 1 and 2 come close"):
        ea.fit(case.model(), [], ea.Box([60e9], [70e9 * 1.0001]), (1,), 1e-6)


def test_between_the_samples_of_a_straight_path_it_is_as_accurate(
    arm: tuple[Model, np.ndarray],
) -> None:
    model, q = arm
    elbow = q[:, 1] - q[:, 0]
    few = q[[elbow.argmin(), 40, 76, elbow.argmax()]]
    fit = ea.fit(model, few, Y0, accuracy=1e-5)
    assert worst(model, fit, q, np.tile(Y0, (len(q), 1))) <= fit.error_estimate


def test_outside_the_region_there_is_no_answer(arm: tuple[Model, np.ndarray]) -> None:
    model, q = arm
    fit = ea.fit(model, q, BOX, accuracy=1e-2)
    with pytest.raises(UsageError, match="outside the region"):
        fit.frequencies(q, [0.3, 0.1])
    with pytest.raises(UsageError, match="outside the region"):
        fit.frequencies([1.8, 1.0], Y0)
    with pytest.raises(UsageError, match="along which design"):
        fit.along()
    fixed = ea.fit(model, q, Y0, accuracy=1e-2)
    with pytest.raises(UsageError, match="differs from what"):
        fixed.frequencies(q, [0.1, 0.1])


def test_calls_that_cannot_be_meant_are_refused(arm: tuple[Model, np.ndarray]) -> None:
    model, q = arm
    with pytest.raises(UsageError, match="nothing to fit"):
        ea.fit(model, Q0, Y0)
    with pytest.raises(UsageError, match="accuracy"):
        ea.fit(model, q, Y0, accuracy=2.0)
    with pytest.raises(UsageError, match="y has 3 values"):
        ea.fit(model, q, [0.1, 0.1, 0.1])
    with pytest.raises(UsageError, match="over its upper"):
        ea.Box([1.0], [0.0])
    with pytest.raises(UsageError, match=r"modes \(3,\) asked for"):
        ea.fit(ea.reduce(model, Q0, Y0), q, Y0, (3,))
    with pytest.raises(UsageError, match=r"mode 99 cannot be fitted: the model has 1 to \d+ elas"):
        ea.fit(model, q, Y0, (1, 99))


def test_a_case_is_no_source_but_has_one(arm: tuple[Model, np.ndarray]) -> None:
    _, q = arm
    with pytest.raises(UsageError, match=r"not Case: case\.model\(\) is one"):
        ea.fit(ea.load_case("cases/two_link.yaml"), q, Y0)


def test_round_off_is_part_of_a_small_estimate(arm: tuple[Model, np.ndarray]) -> None:
    model, q = arm
    fit = ea.fit(model, q, Y0, solves=12)
    assert fit.interpolant.error < 1e-8
    assert fit.floor == rounding_error(model.pencil, np.append(q[0], Y0), 1)
    assert fit.error_estimate == fit.interpolant.error + fit.floor
    assert ea.fit(model, q, Y0, solves=5).floor == 0.0  # it would not matter


def test_reasons_say_what_was_chosen(arm: tuple[Model, np.ndarray]) -> None:
    model, q = arm
    fit = ea.fit(model, q, BOX, accuracy=1e-4)
    assert fit.quantity == "1/λ"
    assert fit.reasons[0].startswith("fitted is 1/λ")
    assert f"{len(fit.indices)} terms: error at most {fit.error_estimate:.1e}" in fit.reasons


def test_the_inverse_series_has_the_same_derivatives(arm: tuple[Model, np.ndarray]) -> None:
    model, _ = arm
    made = ea.expand(model, Q0, Y0, order=4).inverse
    off = []
    for h in (0.02, 0.01):
        q, y = np.array(Q0) + np.array([0.0, h]), np.array(Y0) + h
        off.append(float(np.abs(made.frequencies(q, y) - model.frequencies(q, y, 1))[0, 0]))
        assert abs(off[-1] / model.frequencies(q, y, 1)[0, 0]) <= 1.1 * made.error_estimate(q, y)
    assert np.log2(off[0] / off[1]) == pytest.approx(5.0, abs=0.5)  # order p + 1


def test_a_cluster_has_no_inverse_series_of_each_mode() -> None:
    case = ea.load_case("cases/stress/repeated_modes.yaml")
    q = case.trajectory.q[0] if case.file.trajectory else np.zeros(len(case.model().q_names))
    made = ea.expand(case.model(), q, case.initial_design, (1, 2), 2)
    assert len(made.clusters[0].modes) > 1
    with pytest.raises(UsageError, match="expanded as a cluster"):
        _ = made.inverse


@pytest.mark.parametrize("kind", ["expansion", "inverse"])
@pytest.mark.parametrize(("asked", "radius"), [({"accuracy": 1e-2}, 0.5), ({"solves": 17}, 0.15)])
def test_a_source_that_fails_between_the_ends_is_refused(
    kind: str, asked: dict[str, float], radius: float
) -> None:
    case = ea.load_case("cases/arm_3r.yaml")
    start, t = case.trajectory.q[0], 4.0 * np.pi * np.linspace(0.0, 1.0, 201)
    expansion = ea.expand(case.model(), start, case.initial_design, order=4)
    source = {"expansion": expansion, "inverse": expansion.inverse}[kind]
    twice = start + radius * np.stack([0.0 * t, np.cos(t) - 1.0, np.sin(t)], axis=1)
    with pytest.raises(AccuracyError, match=r"the error of .* is not known"):
        ea.fit(source, twice, case.initial_design, **asked)  # starts, turns and ends where it holds


def test_arguments_of_wrong_kinds_are_refused(arm: tuple[Model, np.ndarray]) -> None:
    model, q = arm
    with pytest.raises(UsageError, match="accuracy '1e-3' is not a number"):
        ea.fit(model, q, Y0, accuracy="1e-3")  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="without samples"):
        ea.fit(model, np.zeros((0, 2)), Y0)
    with pytest.raises(UsageError, match="a mode must be a whole number"):
        ea.fit(model, q, Y0, modes=[1.7])  # type: ignore[list-item]
    with pytest.raises(UsageError, match="most -1 is not within"):
        ea.fit(model, q, Y0, most=-1)
