"""Surrogates: exact where they must be, and converging as they should."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from eigassign.chart import grid_interpolation, grid_points, spread_points, surrogate_families

Floats = NDArray[np.float64]
AT = np.random.default_rng(5).random((300, 3))
FITS = {family: fit for family, fit, _ in surrogate_families()}


def cubic(u: Floats) -> Floats:
    x, y, z = u.T
    return np.column_stack([1.0 + x - 2 * y * z + x**2 * y, z**3 - x * y * z])


def smooth(u: Floats) -> Floats:
    return np.exp(-u[:, :1]) * np.cos(2.0 * u[:, 1:2]) + 1.0 / (2.0 + u[:, 2:])


def test_a_response_surface_of_the_right_degree_is_exact_and_needs_as_many_points() -> None:
    u = spread_points(40, 3)
    exact, rough = (FITS[f"response surface, {name}"] for name in ("cubic", "quadratic"))
    np.testing.assert_allclose(exact(u, cubic(u))(AT), cubic(AT), atol=1e-12)
    assert np.abs(rough(u, cubic(u))(AT) - cubic(AT)).max() > 1e-3
    with pytest.raises(ValueError, match="10 coefficients from 9"):
        rough(u[:9], cubic(u[:9]))


@pytest.mark.parametrize("kind", ["cubic", "Chebyshev"])
def test_a_grid_of_four_nodes_is_exact_for_cubic_polynomials(kind: str) -> None:
    u = np.random.default_rng(1).permutation(grid_points(kind, 4, 3))  # in any order
    np.testing.assert_allclose(grid_interpolation(kind, u, cubic(u))(AT), cubic(AT), atol=1e-12)


@pytest.mark.parametrize(("kind", "rate"), [("linear", 2.0), ("cubic", 4.0)])
def test_grid_interpolation_converges_as_it_should(kind: str, rate: float) -> None:
    off = []
    for k in (9, 17):
        u = grid_points(kind, k, 3)
        off.append(np.abs(grid_interpolation(kind, u, smooth(u))(AT) - smooth(AT)).max())
    assert math.log2(off[0] / off[1]) == pytest.approx(rate, abs=0.5)


@pytest.mark.parametrize("d", [1, 2])
@pytest.mark.parametrize("kind", ["linear", "cubic", "Chebyshev"])
def test_what_is_interpolated_is_met_at_the_nodes(kind: str, d: int) -> None:
    u = grid_points(kind, 5, d)
    assert u.min() == 0.0
    assert u.max() == 1.0
    f = np.random.default_rng(2).random((5**d, 2))
    np.testing.assert_allclose(grid_interpolation(kind, u, f)(u), f, atol=1e-12)


@pytest.mark.parametrize("family", ["RBF, thin plate spline", "RBF, quintic"])
def test_radial_basis_functions_interpolate(family: str) -> None:
    u = spread_points(60, 3)
    made = FITS[family](u, smooth(u))
    np.testing.assert_allclose(made(u), smooth(u), atol=1e-9)
    assert np.abs(made(AT) - smooth(AT)).max() < 0.06


def test_kriging_interpolates() -> None:
    pytest.importorskip("sklearn")
    u = spread_points(60, 3)
    made = FITS["Kriging"](u, cubic(u))
    np.testing.assert_allclose(made(u), cubic(u), atol=1e-4)
    assert np.abs(made(AT) - cubic(AT)).max() < 5e-3


def test_training_points_fill_the_box_evenly_and_hold_its_corners() -> None:
    u = spread_points(200, 3)
    assert u.shape == (200, 3)
    assert u.min() >= 0.0
    assert u.max() <= 1.0
    assert {tuple(corner) for corner in grid_points("linear", 2, 3)} <= {tuple(row) for row in u}
    counts = np.histogramdd(u[8:], bins=2, range=[(0, 1)] * 3)[0]
    assert counts.min() >= 20  # of 192 in 8 octants
