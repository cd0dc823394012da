"""Surrogates: exact where they must be, and converging as they should."""

from __future__ import annotations

import math
import sys
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import RegularGridInterpolator

from eigassign.chart.surrogates import (
    KINDS,
    Kind,
    Separable,
    grid_points,
    has_kriging,
    kriging,
    nodes,
    radial_basis,
    response_surface,
    spread_points,
    tensor_interpolation,
)
from eigassign.errors import UsageError

Floats = NDArray[np.float64]
AT = np.random.default_rng(5).random((300, 3))


def cubic(u: Floats) -> Floats:
    x, y, z = u.T
    return np.column_stack([1.0 + x - 2 * y * z + x**2 * y, z**3 - x * y * z])


def smooth(u: Floats) -> Floats:
    return np.exp(-u[:, :1]) * np.cos(2.0 * u[:, 1:2]) + 1.0 / (2.0 + u[:, 2:])


def test_a_response_surface_of_the_right_degree_is_exact() -> None:
    u = spread_points(40, 3)
    np.testing.assert_allclose(response_surface(u, cubic(u), 3)(AT), cubic(AT), atol=1e-12)
    assert np.abs(response_surface(u, cubic(u), 2)(AT) - cubic(AT)).max() > 1e-3


def test_a_response_surface_needs_as_many_points_as_coefficients() -> None:
    u = spread_points(9, 3)
    with pytest.raises(UsageError, match="10 coefficients from 9"):
        response_surface(u, cubic(u), 2)


def test_a_chebyshev_polynomial_of_the_right_degree_is_exact() -> None:
    u = grid_points(nodes("Chebyshev", 4), 3)
    found = tensor_interpolation("Chebyshev", 4, 3, cubic(u))(AT)
    np.testing.assert_allclose(found, cubic(AT), atol=1e-13)


@pytest.mark.parametrize(("kind", "rate"), [("linear", 2.0), ("cubic", 4.0)])
def test_grid_interpolation_converges_as_it_should(kind: Kind, rate: float) -> None:
    off = []
    for k in (9, 17):
        f = smooth(grid_points(nodes(kind, k), 3))
        off.append(np.abs(tensor_interpolation(kind, k, 3, f)(AT) - smooth(AT)).max())
    assert math.log2(off[0] / off[1]) == pytest.approx(rate, abs=0.5)


@pytest.mark.parametrize(("kind", "rate"), [("linear", 2.0), ("cubic", 4.0)])
def test_interpolation_along_one_variable_converges_as_it_should(kind: Kind, rate: float) -> None:
    off = []
    for k in (17, 33):
        t = nodes(kind, k)
        f = np.column_stack([np.sin(3.0 * t), np.exp(t)])
        made = tensor_interpolation(kind, k, 1, f)
        exact = np.column_stack([np.sin(3.0 * AT[:, 0]), np.exp(AT[:, 0])])
        off.append(np.abs(made(AT[:, :1]) - exact).max())
    assert math.log2(off[0] / off[1]) == pytest.approx(rate, abs=0.6)


@pytest.mark.parametrize("kernel", ["thin_plate_spline", "quintic"])
def test_radial_basis_functions_interpolate(kernel: str) -> None:
    u = spread_points(60, 3)
    made = radial_basis(u, smooth(u), kernel)  # type: ignore[arg-type]
    np.testing.assert_allclose(made(u), smooth(u), atol=1e-9)
    assert np.abs(made(AT) - smooth(AT)).max() < 0.06


def test_radial_basis_functions_refuse_too_few_points() -> None:
    u = spread_points(5, 3)
    with pytest.raises(UsageError, match="radial"):
        radial_basis(u, smooth(u), "quintic")


def test_kriging_interpolates() -> None:
    pytest.importorskip("sklearn")
    u = spread_points(60, 3)
    made = kriging(u, cubic(u))
    np.testing.assert_allclose(made(u), cubic(u), atol=1e-4)
    assert np.abs(made(AT) - cubic(AT)).max() < 2e-3


def test_kriging_is_left_out_without_scikit_learn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "sklearn.gaussian_process", None)
    assert not has_kriging()


def test_training_points_fill_the_box_evenly_and_hold_its_corners() -> None:
    u = spread_points(200, 3)
    assert u.shape == (200, 3)
    assert u.min() >= 0.0
    assert u.max() <= 1.0
    assert {tuple(c) for c in grid_points(np.array([0.0, 1.0]), 3)} <= {tuple(row) for row in u}
    counts = np.histogramdd(u[8:], bins=2, range=[(0, 1)] * 3)[0]
    assert counts.min() >= 20  # of 192 in 8 octants


def test_chebyshev_nodes_include_both_ends() -> None:
    assert nodes("Chebyshev", 5)[[0, 2, 4]] == pytest.approx([0.0, 0.5, 1.0])


def wavy(u: Floats) -> Floats:
    """Two functions that differ in what they need, of any number of variables."""
    return np.column_stack([np.cos(u @ np.arange(1.0, 1 + u.shape[1])), np.exp(-u[:, 0] * u[:, 1])])


def _grid(k: int, d: int, kind: Kind) -> Separable:
    return tensor_interpolation(kind, k, d, wavy(grid_points(nodes(kind, k), d)))


@pytest.mark.parametrize("d", [1, 2, 3])
@pytest.mark.parametrize("kind", KINDS)
def test_what_is_interpolated_is_met_at_the_nodes(kind: Kind, d: int) -> None:
    u = grid_points(nodes(kind, 5), d)
    f = np.random.default_rng(2).random((5**d, 2))
    np.testing.assert_allclose(tensor_interpolation(kind, 5, d, f)(u), f, atol=1e-12)


def test_a_cubic_spline_is_exact_for_cubic_polynomials() -> None:
    u = grid_points(nodes("cubic", 6), 3)
    found = tensor_interpolation("cubic", 6, 3, cubic(u))(AT)
    np.testing.assert_allclose(found, cubic(AT), atol=1e-13)


def test_linear_interpolation_is_scipy_s() -> None:
    axis = nodes("linear", 6)
    f = np.random.default_rng(2).random((6**3, 2))
    oracle = RegularGridInterpolator((axis,) * 3, f.reshape(6, 6, 6, 2))
    np.testing.assert_allclose(tensor_interpolation("linear", 6, 3, f)(AT), oracle(AT), atol=1e-13)


@pytest.mark.parametrize("d", [2, 3, 4])
@pytest.mark.parametrize("kind", [*KINDS, "surface"])
def test_whole_trajectories_are_answered_as_single_points_are(kind: Any, d: int) -> None:
    u = spread_points(90, d)
    made = response_surface(u, wavy(u), 3) if kind == "surface" else _grid(5, d, kind)
    place = np.array([0.0, 0.31, 0.32, 0.9, 1.0])
    designs = np.vstack([np.zeros(d - 1), np.ones(d - 1), AT[:, :1].repeat(d - 1, 1) ** 2])
    points = np.column_stack([np.tile(place, len(designs)), designs.repeat(len(place), 0)])
    found = made.along(place)(designs)
    assert found.shape == (len(designs), 5, 2)
    np.testing.assert_allclose(found.reshape(-1, 2), made(points), atol=1e-9)


def test_splines_on_many_nodes_are_multiplied_sparsely_and_the_same() -> None:
    made = _grid(11, 4, "linear")
    assert not isinstance(made.rest(AT), np.ndarray)
    found = made.along(np.array([0.2, 0.7]))(AT)
    points = np.column_stack([np.tile([0.2, 0.7], len(AT)), AT.repeat(2, 0)])
    np.testing.assert_allclose(found.reshape(-1, 2), made(points), atol=1e-12)
