"""Slopes of eigenvalues and of the coefficient functions are what they say."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from calibration import Floats
from redesigned_arms import (
    extrapolated,
    five_bar,
    five_bar_in_joints,
    six_joints,
    slider_crank,
    two_link_lengths,
)
from rungs import derivative, residual
from scenes import SHIPPED, scene_of
from weighed_draws import weighed

from eigassign import Case, load_case
from eigassign.modal import NearestExpansion, eigenvalues, exact_slopes, expand
from eigassign.series import total_degree
from eigassign.study import Scene

CASES = Path(__file__).parents[2] / "cases"


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return scene_of(tmp_path_factory.mktemp("arm"), SHIPPED)


@pytest.mark.parametrize("name", ["two_link", "five_bar", "luffing_boom", "arm_6r", "ball_screw"])
def test_slopes_of_the_coefficient_functions_are_those_of_their_series(name: str) -> None:
    case = load_case(CASES / f"{name}.yaml")
    pencil, q = case.model().pencil, case.trajectory.q[[0, len(case.trajectory.q) // 2]]
    x = np.hstack([q, np.tile(case.initial_design, (2, 1))])
    every = np.arange(x.shape[1])
    found = pencil.theta_slopes(x, every)
    space = total_degree(len(every), 1)
    for k in range(2):
        series = pencil.theta_series(space, x[k], pencil.to_program)[:, space.units]
        np.testing.assert_allclose(found[:, :, k].T, series, atol=1e-12 * np.abs(series).max())


def test_eigenvalue_slopes_are_those_of_finite_differences(arm: Scene) -> None:
    pencil = arm.model.pencil
    x = np.array([[1.8, 5.2, 0.1, 0.2], [1.9, 5.4, 0.01, 0.05]])
    lam, slopes = arm.model.slopes(x[:, :2], x[:, 2:], 2, np.array([1.0, 1.0, 0.25, 0.25]))
    np.testing.assert_allclose(lam, eigenvalues(pencil, x, 2), rtol=1e-10)
    for j in range(4):
        step = np.zeros(4)
        step[j] = 1e-5
        off = (eigenvalues(pencil, x + step, 2) - eigenvalues(pencil, x - step, 2)) / 2e-5
        np.testing.assert_allclose(slopes[:, :, j], off, rtol=1e-5, atol=1e-3)


def test_slopes_of_neighbours_mixture_are_those_of_the_matrices(arm: Scene) -> None:
    """φ_iᵀ (K' − ½ (λ_i + λ_j) M') φ_j by differences of the dense matrices; of a mode more."""
    q, y = np.array([1.8, 5.2]), np.array([0.1, 0.2])
    lam, slopes, mixed = exact_slopes(arm.model.pencil, arm.model.x(q, y), 2, np.ones(4), 1)
    assert lam.shape == (1, 3)
    assert mixed.shape == (1, 2, 4)
    phi = arm.model.modes(q, y, 3)[1][0]
    for j in range(4):
        step = 1e-5 * np.eye(4)[j]
        ends = (arm.model.matrices(q + s * step[:2], y + s * step[2:]) for s in (1.0, -1.0))
        dM, dK = ((a - b) / 2e-5 for a, b in zip(*ends, strict=True))
        for k in range(3):
            slope = phi[:, k] @ (dK - lam[0, k] * dM) @ phi[:, k]
            assert slopes[0, k, j] == pytest.approx(slope, rel=1e-6, abs=1e-3)
        for k in range(2):
            slope = phi[:, k] @ (dK - lam[0, k : k + 2].mean() * dM) @ phi[:, k + 1]
            assert abs(mixed[0, k, j]) == pytest.approx(abs(slope), rel=1e-6, abs=1e-3)


def test_a_parameter_without_room_has_no_slope_and_spoils_none(arm: Scene) -> None:
    x = [1.8, 5.2], [0.1, 0.2]
    both = arm.model.slopes(*x, 1, np.array([0.0, 0.0, 0.25, 0.25]))[1]
    one = arm.model.slopes(*x, 1, np.array([0.0, 0.0, 0.0, 0.25]))[1]
    assert one[0, 0, 2] == 0.0
    np.testing.assert_allclose(one[:, :, 3], both[:, :, 3], rtol=1e-12)


@pytest.mark.parametrize(
    "make",
    [two_link_lengths, six_joints, five_bar, slider_crank, five_bar_in_joints],
)
def test_slopes_where_coordinates_follow_the_design_are_those_of_extrapolated_differences(
    make: Callable[[], Case],
) -> None:
    case = make()
    model, path = case.model(), case.trajectory
    y = case.initial_design * (1.0 + 0.01 * np.cos(np.arange(len(case.initial_design))))
    y = np.where(y == 0.0, 0.1, y)
    q, of_design = path.at(y)
    scales = np.concatenate([np.ones(q.shape[1]), y])
    _, slopes = model.slopes(q, y, 2, scales)
    by_q, by_y = np.split(slopes, [q.shape[1]], axis=2)
    total = by_y + by_q @ of_design  # dλ/dy = ∂λ/∂y + ∂λ/∂q dq/dy

    def lam(v: np.ndarray) -> np.ndarray:
        return eigenvalues(model.pencil, model.x(path.at(v)[0], v), 2)

    beside = extrapolated(lam, y, 1e-3)
    worst = np.abs(total - beside).max(axis=(0, 1)) / np.abs(total).max(axis=(0, 1))
    assert worst.max() <= 1e-7
    missing = np.abs(by_y - beside).max(axis=(0, 1)) / np.abs(total).max(axis=(0, 1))
    assert (missing.max() > 1e-2) == path.follows_design  # it would be wrong without the chain rule


@pytest.mark.parametrize("kind", ["exact", "series", "linearised", "several"])
def test_slopes_of_whatever_answers_frequencies_are_those_of_its_differences(
    arm: Scene, kind: str
) -> None:
    model, q0, y0 = arm.model, np.array([1.8, 5.2]), np.array([0.1, 0.1])
    series = expand(model.pencil, q0, y0, (1, 2), 4)
    made = {
        "exact": model,
        "series": series,
        "linearised": expand(model.pencil, q0, y0, (1, 2), 4, linear_in_y=True),
        "several": NearestExpansion((expand(model.pencil, q0 - 1.0, y0, (1, 2)), series)),
    }[kind]
    x = np.array([[1.85, 5.3, 0.12, 0.07], [1.7, 5.1, 0.05, 0.2]])
    lam, slopes = made.slopes(x[:, :2], x[:, 2:])
    hz = made.frequencies(x[:, :2], x[:, 2:])[:, : lam.shape[1]]
    np.testing.assert_allclose(np.sqrt(lam) / (2.0 * np.pi), hz, rtol=1e-9)
    for j, step in enumerate(1e-4 * np.eye(4)):
        up, down = (made.frequencies(*np.split(x + s * step, [2], axis=1)) for s in (1.0, -1.0))
        off = (2.0 * np.pi) ** 2 * (up**2 - down**2) / 2e-4
        np.testing.assert_allclose(slopes[:, :, j], off, rtol=1e-4, atol=1e-6 * lam.max())


# --- Slopes of eigenvalues and the recursion under weight, up to all but buckling


APART = 1e-3  # of λ: nearer modes have no slopes of their own that differences could tell


@pytest.mark.parametrize("seed", range(60))
def test_slopes_under_weight_are_those_of_finite_differences(seed: int) -> None:
    """Of every coordinate and parameter, with what swings free, loops and springs."""
    drawn = weighed(seed, 1)
    if drawn is None:
        pytest.skip("falls either way")
    pencil, x = drawn.model.pencil, drawn.model.x(drawn.q0, drawn.y0)[0]
    span = 1e-3 * np.where(np.arange(len(x)) < pencil.n_q, 1.0, np.abs(x))
    span[span == 0.0] = 1e-6
    count = min(3, len(pencil.elastic) - 1)
    lam, slopes, _ = exact_slopes(pencil, x[None], count, np.ones(len(x)), 1)
    lam = lam[0]

    def at(w: Floats) -> Floats:
        return np.asarray(eigenvalues(pencil, (x + w * span)[None], count)[0])

    single = [
        k for k in range(count)
        if np.abs(np.delete(lam, k) / lam[k] - 1.0).min(initial=1.0) > APART
    ]  # fmt: skip
    for j in range(len(x)):
        expected = derivative(at, np.eye(len(x))[[j]], lam[:count])[single]
        found = slopes[0, single, j] * span[j]
        np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-9 * lam[single].max())
    assert residual(pencil, x, span, 2, (1,)).max() < 1e-10
