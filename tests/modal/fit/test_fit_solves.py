"""Fits of a given number of solves: no more are asked for, and the estimate covers the error."""

from __future__ import annotations

import numpy as np
import pytest

import eigassign as ea
from eigassign.errors import AccuracyError, UsageError
from eigassign.modal import Model

BOX = ea.Box([0.0, 0.0], [0.25, 0.25])
Y0 = [0.125, 0.125]


@pytest.fixture(scope="module")
def arm() -> tuple[Model, np.ndarray]:
    case = ea.load_case("cases/two_link.yaml")
    return case.model(), case.trajectory.q


def off(model: Model, fit: ea.Fit | ea.PathFit, q: np.ndarray, y: np.ndarray) -> float:
    return float(np.abs(fit.frequencies(q, y) / model.frequencies(q, y, 1) - 1.0).max())


@pytest.mark.parametrize("solves", [3, 5, 8, 12])
def test_along_a_line_the_solves_are_as_many_as_given(
    arm: tuple[Model, np.ndarray], solves: int
) -> None:
    model, q = arm
    fit = ea.fit(model, q, Y0, solves=solves)
    assert (fit.solves, fit.accuracy) == (solves, None)
    hz = model.frequencies(q, Y0, 1)
    assert np.abs(fit.along() / hz - 1.0).max() <= fit.error_estimate
    np.testing.assert_allclose(fit.frequencies(q, Y0), fit.along(), rtol=1e-12)


def test_at_as_many_solves_it_is_better_than_plain_chebyshev_interpolation(
    arm: tuple[Model, np.ndarray],
) -> None:
    model, q = arm
    fit = ea.fit(model, q, Y0, solves=5)
    place = fit.region.place
    ends = q[[place.argmin(), place.argmax()]]
    share = 0.5 - 0.5 * np.cos(np.pi * np.arange(5) / 4.0)
    f = model.frequencies(ends[0] + np.outer(share, ends[1] - ends[0]), Y0, 1)[:, 0]
    plain = np.polynomial.Chebyshev.fit(2.0 * share - 1.0, f, 4)(place)
    hz = model.frequencies(q, Y0, 1)[:, 0]
    assert np.abs(fit.along()[:, 0] - hz).max() < np.abs(plain - hz).max()


@pytest.mark.parametrize("solves", [9, 20, 64, 200])
def test_over_trajectory_and_designs_too(arm: tuple[Model, np.ndarray], solves: int) -> None:
    model, q = arm
    fit = ea.fit(model, q, BOX, solves=solves)
    assert len(fit.indices) < fit.solves == solves  # some are held out for a check
    y = np.random.default_rng(3).uniform(0.0, 0.25, (400, 2))
    y[:4] = [[0.0, 0.0], [0.25, 0.0], [0.0, 0.25], [0.25, 0.25]]
    at = q[np.random.default_rng(5).integers(len(q), size=400)]
    assert off(model, fit, at, y) <= fit.error_estimate


def test_more_solves_leave_less(arm: tuple[Model, np.ndarray]) -> None:
    model, q = arm
    estimates = [ea.fit(model, q, BOX, solves=k).error_estimate for k in (20, 64, 200)]
    assert estimates[0] > 5.0 * estimates[1] > 50.0 * estimates[2]


def test_where_all_samples_are_asked_for_nothing_is_missing() -> None:
    case = ea.load_case("cases/arm_3r.yaml")
    model, q = case.model(), case.trajectory.q
    fit = ea.fit(model, q, case.initial_design, solves=40)
    assert fit.solves == len(q)
    assert fit.error_estimate < 1e-9
    np.testing.assert_allclose(fit.along(), model.frequencies(q, case.initial_design, 1), rtol=1e-9)


def test_too_few_to_tell_an_error_are_refused(arm: tuple[Model, np.ndarray]) -> None:
    model, q = arm
    with pytest.raises(UsageError, match="2 solves for 1 axis: at least 3"):
        ea.fit(model, q, Y0, solves=2)
    with pytest.raises(UsageError, match="8 solves for 3 axes: at least 9"):
        ea.fit(model, q, BOX, solves=8)
    with pytest.raises(UsageError, match="not both"):
        ea.fit(model, q, Y0, solves=5, accuracy=1e-3)
    with pytest.raises(UsageError, match="solves must be a whole number"):
        ea.fit(model, q, Y0, solves=5.0)  # type: ignore[arg-type]


def test_no_estimate_is_given_where_coefficients_do_not_fall() -> None:
    case = ea.load_case("cases/stress/exact_crossing.yaml")
    with pytest.raises(AccuracyError, match="leave an estimated error of"):
        ea.fit(case.model(), [], ea.Box([1e9], [1e12]), (1,), solves=5)


def test_another_source_brings_its_own_error(arm: tuple[Model, np.ndarray]) -> None:
    model, q = arm
    poor = ea.expand(model, [1.817, 5.312], Y0, order=4)
    fit = ea.fit(poor, q[60:100], Y0, solves=7)
    assert fit.error_estimate >= float(poor.error_estimate(q[60], Y0).max())
    assert off(model, fit, q[60:100], np.tile(Y0, (40, 1))) <= fit.error_estimate


# Corners, and several trajectories


@pytest.fixture(scope="module")
def cornered() -> tuple[Model, np.ndarray, np.ndarray]:
    case = ea.load_case("cases/arm_6r.yaml")
    return case.model(), case.trajectory.q, np.asarray(case.initial_design)


def test_a_path_with_corners_is_fitted_from_one_to_the_next(
    cornered: tuple[Model, np.ndarray, np.ndarray],
) -> None:
    model, q, y = cornered
    hz = model.frequencies(q, y, 1)
    fit = ea.fit(model, q, y, accuracy=1e-6)  # in one piece 48 solves leave 1 %
    assert len(fit.parts) == 4
    assert all(part.region.straight for part in fit.parts)
    assert np.abs(fit.along() / hz - 1.0).max() <= fit.error_estimate <= 1e-6
    assert fit.solves == sum(part.solves for part in fit.parts) <= 40
    back = np.arange(len(q))[::-1]
    np.testing.assert_allclose(fit.frequencies(q[back], y), fit.along()[back], rtol=1e-9)
    with pytest.raises(UsageError, match="off the path"):
        fit.frequencies(q[0] + 0.01, y)


@pytest.mark.parametrize("degrees", [0.3, 4.0])
def test_a_slight_corner_is_none_to_overlook(degrees: float) -> None:
    case = ea.load_case("cases/arm_3r.yaml")
    model, y = case.model(), case.initial_design
    turn, along = np.radians(degrees), np.linspace(0.0, 1.0, 81)[:, None]
    first, aside = np.array([0.0, 0.4, 0.2]), np.array([0.0, -0.2, 0.4])
    second = np.cos(turn) * first + np.sin(turn) * aside
    bent = np.where(along < 0.503, along * first, 0.503 * first + (along - 0.503) * second)
    q = case.trajectory.q[3] + bent
    fit = ea.fit(model, q, y, accuracy=1e-8)  # in one piece 48 solves leave 1e-5 and more
    assert len(fit.parts) == 2
    hz = model.frequencies(q, y, 1)
    assert np.abs(fit.along() / hz - 1.0).max() <= fit.error_estimate <= 1e-8


def test_given_solves_are_shared_among_the_stretches(
    cornered: tuple[Model, np.ndarray, np.ndarray],
) -> None:
    model, q, y = cornered
    fit = ea.fit(model, q, y, solves=13)
    assert [part.solves for part in fit.parts] == [4, 3, 3, 3]  # one more on the longest
    assert np.abs(fit.along() / model.frequencies(q, y, 1) - 1.0).max() <= fit.error_estimate
    with pytest.raises(UsageError, match="11 solves for 4 stretches between corners: at least 12"):
        ea.fit(model, q, y, solves=11)
    box = ea.Box(0.9 * y, 1.1 * y)
    with pytest.raises(UsageError, match="43 solves for 4 stretches between corners: at least 44"):
        ea.fit(model, q, box, solves=43)
    assert [part.solves for part in ea.fit(model, q, box, solves=44).parts] == [11] * 4


def test_a_corner_within_a_step_leaves_both_its_ends_on_their_lines() -> None:
    model = ea.load_case("cases/arm_6r.yaml").model()
    turn = np.array([0.3, 0.8, -1.0, 0.1, -0.7, 0.2])
    first, second = (
        np.array([0.2, 0.3, -0.1, 0.0, 0.1, 0.0]),
        np.array([0.1, -0.3, 0.2, 0.1, 0.0, 0.0]),
    )
    for gap in (1e-4, 0.04, 0.0399999, 0.02):
        before = turn - np.outer(np.arange(8)[::-1] * 0.04 + gap, first)
        q = np.vstack([before, turn + np.outer(np.arange(8) * 0.04 + 0.04 - gap, second)])
        fit = ea.fit(model, q, [1.5e5, 8.0e4, 0.005], solves=8)
        assert [part.region.straight for part in fit.parts] == [True, True]


def test_several_trajectories_have_a_polynomial_each() -> None:
    case = ea.load_case("cases/five_bar.yaml")
    model, path, y = case.model(), case.trajectory, case.initial_design
    assert len(path.parts) > 1
    hz = model.frequencies(path.q, y, 1)
    for q in (path, [part.trajectory.q for part in path.parts]):
        fit = ea.fit(model, q, y, accuracy=1e-5)
        assert [rows.stop - rows.start for rows in fit.rows] == [7, 7]
        assert np.abs(fit.along() / hz - 1.0).max() <= fit.error_estimate <= 1e-5


def test_solves_that_do_not_follow_the_path_are_refused_whatever_they_show() -> None:
    case = ea.load_case("cases/arm_3r.yaml")
    t = 2.0 * np.pi * np.linspace(0.0, 1.0, 201)
    ring = case.trajectory.q[0] + 0.3 * np.stack([0.0 * t, np.cos(t), np.sin(t)], axis=1)
    with pytest.raises(AccuracyError, match="4 solves do not follow the path"):
        ea.fit(case.model(), ring, case.initial_design, solves=4)
    fit = ea.fit(case.model(), ring, case.initial_design, solves=13)  # followed, but no more
    hz = case.model().frequencies(ring, case.initial_design, 1)
    assert 0.01 < np.abs(fit.along() / hz - 1.0).max() <= fit.error_estimate


@pytest.mark.parametrize("solves", [128, 400, 2000])
def test_more_solves_than_a_polynomial_bears_are_not_asked_for(solves: int) -> None:
    # With 500 nodes on an axis round-off grew to 7e-3, beside an estimate of 2e-10.
    model = ea.load_case("cases/two_link.yaml").model()
    q = np.linspace([0.0, 0.6], [0.0, 2.4], 3000)
    fit = ea.fit(model, q, [0.1, 0.1], solves=solves)
    assert fit.solves == 128
    error = np.abs(fit.along() / model.frequencies(q, [0.1, 0.1], 1) - 1.0).max()
    assert error <= min(fit.error_estimate, 1e-9)


@pytest.mark.parametrize("how", [{"solves": 12}, {"accuracy": 1e-6}])
def test_a_trajectory_that_rests_among_others_is_a_constant(
    arm: tuple[Model, np.ndarray], how: dict[str, float]
) -> None:
    """The shoulder alone turns in one of them, on which no frequency depends."""
    model, q = arm
    spin = np.column_stack([np.linspace(0.0, 1.0, 9), np.full(9, 5.3) + np.linspace(0.0, 1.0, 9)])
    fit = ea.fit(model, [q, spin], Y0, **how)  # type: ignore[arg-type]
    hz = np.concatenate([model.frequencies(part, Y0, 1) for part in (q, spin)])
    assert np.abs(fit.along() / hz - 1.0).max() <= fit.error_estimate
    np.testing.assert_array_equal(np.ptp(fit.along()[len(q) :]), 0.0)
    np.testing.assert_array_equal(fit.frequencies(spin[3], Y0)[0], fit.along()[len(q)])
    with pytest.raises(UsageError, match="nothing to fit"):
        ea.fit(model, [spin, spin], Y0, **how)  # type: ignore[arg-type]


def test_of_modes_that_meet_between_few_solves_the_error_is_covered() -> None:
    """Of two cantilevers with nothing between them, a mass on one takes mode 1 from the other."""
    mechanism = {
        "space": "planar",
        "materials": {"al": {"youngs_modulus": 70e9, "density": 2700.0}},
        "sections": {
            name: {"shape": "circle", "diameter": diameter}
            for name, diameter in (("a", 0.0132036), ("b", 0.0138914))
        },
        "links": {
            name: {"length": length, "material": "al", "section": name, "elements": 2}
            for name, length in (("a", 1.0874180), ("b", 0.9496104))
        },
        "joints": {
            f"j{name}": {"type": "fixed", "base": "ground", "follower": f"{name}.start"}
            for name in "ab"
        },
        "bodies": {name: {"at": f"{name[1]}.end", "mass": 0.2} for name in ("ma", "mb")},
    }
    design = {"y": {"parameter": "bodies.ma.mass", "min": 0.0, "max": 1.0}}
    tree = {"title": "t", "mechanism": mechanism, "coordinates": {}, "design": design}
    model = ea.load_case(
        {**tree, "expansion": {"order": 2}, "targets": [{"mode": 1, "frequency": 20.0}]}
    ).model()
    fit = ea.fit(model, np.zeros(0), ea.Box([0.0], [1.0]), solves=6)
    y = np.linspace(0.0, 1.0, 201)[:, None]
    error = off(model, fit, np.zeros((len(y), 0)), y)
    assert 0.02 < error <= fit.error_estimate
