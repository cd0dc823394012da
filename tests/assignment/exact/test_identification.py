"""Parameters from measured frequencies: against formulas of linear models, and brute force."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import brentq, least_squares
from scipy.stats import chi2

from eigassign.assignment import Identified, MeasuredFrequencies, identify
from eigassign.errors import MechanismError

Response = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
J = np.array([[3.0, 1.0, 0.2], [1.0, 2.0, 1.0], [0.0, 1.0, 2.0], [1.0, -1.0, 0.3], [2.0, 0.1, 1.0]])
NOISE = np.array([0.4, -0.3, 0.2, 0.5, -0.6])
DEVIATION = np.array([0.1, 0.2, 0.1, 0.3, 0.2])
TRUTH = np.array([0.3, -0.2, 0.5])
WIDE = 10.0 * np.ones(3)


def linear(y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return 50.0 + J @ y, J


def curved(y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """f = 50 + J y + (y_1 + y_2)², strongly bent within the noise below."""
    both = y[0] + y[1]
    return 50.0 + J @ y + both**2, J + 2.0 * both * np.array([1.0, 1.0, 0.0])


def measured(response: Response, share: float = 1.0) -> MeasuredFrequencies:
    return MeasuredFrequencies(response(TRUTH)[0] + share * NOISE * DEVIATION, DEVIATION)


def fitted(response: Response, share: float = 1.0, **limits: np.ndarray) -> Identified:
    lower, upper = limits.get("lower", -WIDE), limits.get("upper", WIDE)
    return identify(response, measured(response, share), lower, upper, np.zeros(3))


def test_a_linear_model_has_the_estimate_and_covariance_of_the_formulas() -> None:
    found, data = fitted(linear), measured(linear)
    A = J / DEVIATION[:, None]
    y = np.linalg.solve(A.T @ A, A.T @ ((data.hz - 50.0) / DEVIATION))
    C = np.linalg.inv(A.T @ A)
    np.testing.assert_allclose(found.y, y, atol=1e-7)
    np.testing.assert_allclose(found.covariance, C, rtol=1e-6)
    np.testing.assert_allclose(found.deviation, np.sqrt(np.diag(C)), rtol=1e-6)
    rest = (50.0 + J @ y - data.hz) / DEVIATION
    np.testing.assert_allclose(found.residual, rest, atol=1e-6)
    assert found.chi_squared == pytest.approx(rest @ rest, rel=1e-9)
    assert found.degrees == 2
    assert found.p_value == pytest.approx(chi2.sf(rest @ rest, 2), rel=1e-9)
    assert found.held == ("", "", "")
    assert found.unidentified.shape == (0, 3)


def test_intervals_of_a_linear_model_are_those_of_its_covariance() -> None:
    """And not of (JᵀJ)_jj alone, which is where the others are kept instead of fitted anew."""
    found = fitted(linear)
    half = 1.959963984540054 * found.deviation
    kept = 1.96 / np.sqrt(np.diag(np.linalg.inv(found.covariance)))
    assert (half > 1.2 * kept).any()
    for interval, y, h in zip(found.intervals, found.y, half, strict=True):
        assert interval.low == pytest.approx(y - h, abs=2e-3 * h)
        assert interval.high == pytest.approx(y + h, abs=2e-3 * h)
        assert (interval.at_lower, interval.at_upper) == (False, False)


def brute_force_end(response: Response, data: MeasuredFrequencies, j: int, side: float) -> float:
    """The end of a profile interval by SciPy alone, wide bounds."""

    def residual(y: np.ndarray) -> np.ndarray:
        return (response(y)[0] - data.hz) / data.deviation

    best = least_squares(residual, TRUTH, xtol=1e-14, ftol=1e-14, gtol=1e-14)

    def over(t: float) -> float:
        def kept(z: np.ndarray) -> np.ndarray:
            return residual(np.insert(z, j, t))

        found = least_squares(kept, np.delete(best.x, j), xtol=1e-14, ftol=1e-14, gtol=1e-14)
        return 2.0 * (found.cost - best.cost) - chi2.ppf(0.95, 1)

    return float(brentq(over, best.x[j], best.x[j] + side, xtol=1e-9))


@pytest.mark.parametrize("j", [0, 1, 2])
def test_intervals_of_a_curved_model_are_the_profile_likelihood_s(j: int) -> None:
    found, data = fitted(curved), measured(curved)
    low, high = (brute_force_end(curved, data, j, side) for side in (-1.5, 1.5))
    half = 0.5 * (high - low)
    assert found.intervals[j].low == pytest.approx(low, abs=3e-3 * half)
    assert found.intervals[j].high == pytest.approx(high, abs=3e-3 * half)


def test_a_parameter_at_its_bound_has_a_one_sided_interval() -> None:
    free = fitted(linear)
    lower = np.array([free.y[0] + 3.0 * free.deviation[0], -10.0, -10.0])
    found = fitted(linear, lower=lower)
    assert found.held == ("lower", "", "")
    assert found.y[0] == lower[0]
    assert found.intervals[0].low == lower[0]
    assert found.intervals[0].at_lower
    assert not found.intervals[0].at_upper
    assert found.intervals[0].high > lower[0]
    assert found.deviation[0] == 0.0
    A = (J / DEVIATION[:, None])[:, 1:]
    np.testing.assert_allclose(found.covariance[1:, 1:], np.linalg.inv(A.T @ A), rtol=1e-6)
    assert found.degrees == 3


def test_an_interval_that_the_bounds_cut_ends_at_them() -> None:
    free = fitted(linear)
    upper = np.array([free.y[0] + 0.5 * free.deviation[0], 10.0, 10.0])
    found = fitted(linear, upper=upper)
    np.testing.assert_allclose(found.y, free.y, atol=1e-7)
    assert (found.intervals[0].high, found.intervals[0].at_upper) == (upper[0], True)
    assert found.held == ("", "", "")


def scaled(y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ratios of all three, which alone tell, and of ``y_1`` to a fixed part, which hardly does."""
    k, e, m = y
    f = 50.0 * np.sqrt(np.array([k / m, e / m, (k + e) / (m + k), (k + 2.0 * e) / m]))
    f[0] *= 1.0 + 1e-5 * k
    slopes = np.empty((4, 3))
    slopes[0] = f[0] / 2.0 * np.array([1.0 / k, 0.0, -1.0 / m])
    slopes[0, 0] += 1e-5 * f[0] / (1.0 + 1e-5 * k)
    slopes[1] = f[1] / 2.0 * np.array([0.0, 1.0 / e, -1.0 / m])
    slopes[2] = (
        f[2] / 2.0 * np.array([1.0 / (k + e) - 1.0 / (m + k), 1.0 / (k + e), -1.0 / (m + k)])
    )
    slopes[3] = f[3] / 2.0 * np.array([1.0 / (k + 2 * e), 2.0 / (k + 2 * e), -1.0 / m])
    return f, slopes


def test_a_direction_away_from_a_bound_that_holds_is_named_and_followed() -> None:
    """All three scale together, 40 % down at hardly any cost; noise holds m at its bound."""
    truth = np.array([2.0, 3.0, 4.0])
    lower, upper = np.array([0.1, 0.1, 2.5]), np.array([20.0, 20.0, 5.0])
    clean = scaled(truth)[0]
    data = MeasuredFrequencies(clean * np.array([0.999, 1.001, 1.0, 0.9995]), 2e-3 * clean)
    found = identify(scaled, data, lower, upper, np.array([5.0, 2.0, 3.0]))
    assert found.held == ("", "", "upper")
    (direction,) = found.unidentified
    np.testing.assert_allclose(direction / found.y, direction[2] / found.y[2], rtol=1e-2)
    assert direction[2] == pytest.approx(-2.5)  # from bound to bound, inwards
    for interval, true in zip(found.intervals, truth, strict=True):
        assert interval.low < true < interval.high
    assert (found.intervals[2].low, found.intervals[2].at_lower) == (2.5, True)


def test_a_bound_that_the_measurements_press_against_is_no_direction() -> None:
    """What the bound keeps from the measurements far exceeds their noise: nothing is unknown."""
    K = np.column_stack([J[:, 0], J[:, 0] + 2e-3 * J[:, 1]])
    data = MeasuredFrequencies(50.0 + K @ np.array([0.0, 1.0]) + 5.0 * J[:, 1], DEVIATION)
    found = identify(lambda y: (50.0 + K @ y, K), data, -WIDE[:2], WIDE[:2], np.zeros(2))
    assert any(found.held)
    assert len(found.unidentified) == 0


def test_an_end_is_not_another_minimum_s() -> None:
    """y_2 = sin(2 y_1) explains all, but χ² has worse minima about it; y_1 is held by its bound."""

    def wound(y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        rest = y[1] - np.sin(2.0 * y[0])
        hz = np.array([50.0 + rest, 50.0 + 4.0 * np.sin(3.0 * rest), 60.0 + 0.1 * y[0]])
        by_rest = np.array([1.0, 12.0 * np.cos(3.0 * rest), 0.0])
        slopes = np.outer(by_rest, [-2.0 * np.cos(2.0 * y[0]), 1.0])
        slopes[2, 0] = 0.1
        return hz, slopes

    data = MeasuredFrequencies(np.array([50.0, 50.0, 60.001]), 0.1 * np.ones(3))
    ends = np.array([0.0, 4.0])
    found = identify(wound, data, np.array([-4.0, -4.0]), ends, np.array([-0.1, -0.1]))
    assert found.held == ("upper", "")
    assert found.intervals[0].low == pytest.approx(-1.95, abs=5e-3)


def test_two_parameters_that_act_alike_are_named() -> None:
    """f depends on y_1 + 2 y_2 and y_3: the direction (2, −1, 0) is not identified."""

    def summed(y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        K = np.column_stack([J[:, 0], 2.0 * J[:, 0], J[:, 2]])
        return 50.0 + K @ y, K

    found = fitted(summed)
    assert len(found.unidentified) == 1
    direction = found.unidentified[0] / found.unidentified[0, 0]
    np.testing.assert_allclose(direction, [1.0, -0.5, 0.0], atol=1e-12)
    assert found.degrees == 3
    assert np.isinf(found.deviation[:2]).all()
    assert np.isfinite(found.deviation[2])
    assert (found.intervals[0].at_lower, found.intervals[0].at_upper) == (True, True)
    assert found.intervals[1].low == pytest.approx(-5.0, abs=0.2)  # y_1 at its upper bound
    assert not found.intervals[2].at_lower
    assert found.y[0] + 2.0 * found.y[1] == pytest.approx(TRUTH[0] + 2.0 * TRUTH[1], abs=0.2)


def test_parameters_without_effect_are_told_apart() -> None:
    def one(y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        K = J * np.array([0.0, 1.0, 0.0])
        return 50.0 + K @ y, K

    found = fitted(one)
    assert sorted(map(tuple, np.abs(found.unidentified) > 0)) == [
        (False, False, True),
        (True, False, False),
    ]
    np.testing.assert_array_equal(found.y[[0, 2]], [0.0, 0.0])  # where they started


def test_what_is_too_small_to_be_noticed_is_not_identified() -> None:
    """From bound to bound a parameter moves all residuals together by less than 1.96."""
    for effect, noticed in ((1.9, False), (2.1, True)):
        K = J[:, 2:] * effect / np.linalg.norm(J[:, 2] / DEVIATION) / 20.0

        def weak(y: np.ndarray, K: np.ndarray = K) -> tuple[np.ndarray, np.ndarray]:
            return 50.0 + K @ y, K

        data = MeasuredFrequencies(weak(np.ones(1))[0], DEVIATION)
        found = identify(weak, data, -WIDE[:1], WIDE[:1], np.zeros(1))
        assert (len(found.unidentified) == 0) is noticed


def test_a_parameter_whose_bounds_meet_is_known() -> None:
    lower, upper = -WIDE.copy(), WIDE.copy()
    lower[1] = upper[1] = TRUTH[1]
    found = fitted(linear, lower=lower, upper=upper)
    assert found.y[1] == TRUTH[1]
    assert found.unidentified.shape == (0, 3)
    assert found.covariance[1, 1] == 0.0


def test_without_degrees_of_freedom_there_is_no_p_value() -> None:
    data = MeasuredFrequencies(measured(linear).hz[:3], DEVIATION[:3])
    found = identify(lambda y: (50.0 + J[:3] @ y, J[:3]), data, -WIDE, WIDE, np.zeros(3))
    assert (found.degrees, found.p_value) == (0, None)
    np.testing.assert_allclose(found.residual, 0.0, atol=1e-6)


def test_a_better_explanation_that_a_profile_comes_upon_is_taken() -> None:
    """Two minima of χ² over y_1: the start is in the basin of the worse one, at y_1 = −1."""

    def waves(y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        a = y[0]
        hz = np.array([50.0 + a**2, 60.0 + 0.1 * a, 70.0 + y[1]])
        return hz, np.array([[2.0 * a, 0.0], [0.1, 0.0], [0.0, 1.0]])

    data = MeasuredFrequencies(waves(np.array([1.0, 0.0]))[0], np.array([0.7, 0.2, 1.0]))
    ends = np.array([3.0, 3.0])
    found = identify(waves, data, -ends, ends, np.array([-1.5, 1.0]))
    assert found.rounds > 1
    np.testing.assert_allclose(found.y, [1.0, 0.0], atol=1e-6)


def several(response: Response, hz: list[float], n: int) -> Identified:
    """The fit to exact frequencies within ±2 about 3, from nine spread starts."""
    data = MeasuredFrequencies(np.array(hz), np.full(len(hz), 0.05))
    starts = 3.0 + np.random.default_rng(1).uniform(-2.0, 2.0, (9, n))
    ends = np.full(n, 2.0)
    return identify(response, data, 3.0 - ends, 3.0 + ends, starts[0], starts[1:])


def test_two_minima_that_explain_the_measurements_are_told_though_one_parameter_is_idle() -> None:
    """(y_1 − 3)² = 1 at 2 and at 4, whatever y_2 is."""

    def twice(y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        a = y[0] - 3.0
        return np.array([9.0 + a**2, 4.0 + a**2]), np.array([[2.0 * a, 0.0], [2.0 * a, 0.0]])

    found = several(twice, [10.0, 5.0], 2)
    assert (found.verdict, found.starts, found.met) == ("not_identified", 9, 2)
    assert sorted(one.y[0] for one in found.minima) == pytest.approx([2.0, 4.0], abs=1e-6)


def test_a_bent_valley_is_one_minimum() -> None:
    """Only y_1 y_2 = 4 is known: the starts lead to as many points of it."""

    def product(y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.array([y[0] * y[1]]), np.array([[y[1], y[0]]])

    found = several(product, [4.0], 2)
    assert len(found.minima) == found.met == 1
    assert found.verdict == "not_identified"
    assert len(found.unidentified) == 1


def test_no_more_starts_are_made_than_are_enough() -> None:
    asked: list[tuple[int, int]] = []

    def enough(starts: int, found: int) -> bool:
        asked.append((starts, found))
        return starts == 4

    others = np.zeros((9, 3))
    found = identify(linear, measured(linear), -WIDE, WIDE, np.zeros(3), others, enough)
    assert asked == [(1, 1), (2, 1), (3, 1), (4, 1)]
    assert found.verdict == "fitted"


def test_where_the_model_has_no_answer_no_interval_goes() -> None:
    def stopping(y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if y[0] > 0.35:
            raise MechanismError("links.a", "cannot be")
        return linear(y)

    found = fitted(stopping, 0.0)
    assert found.intervals[0].high == pytest.approx(0.35, abs=2e-3)
    assert not found.intervals[0].at_upper
