"""The bordered system: dense and sparse solve it alike, a singular one is refused, and memory."""

import tracemalloc
from typing import Any

import numpy as np
import pytest
from large import DRIVES, Q0, Y0, arm
from pencils import crossing
from scipy.sparse.linalg import splu

from eigassign.errors import AccuracyError
from eigassign.mechanism import Pencil, factorise
from eigassign.modal import expand, factor_dense, factor_sparse, modes


def mode_system(pencil: Pencil, x0: np.ndarray, mode: int) -> tuple[np.ndarray, ...]:
    """Non-zeros of K0 − λM0, the border M0 φ0 and φ0 as rows."""
    theta = pencil.theta(x0[None])
    found = modes(pencil, x0[None], mode)
    lam, phi = found.lam[0, -1], found.phi[0][:, -1]
    data = (pencil.stiffness - lam * pencil.mass) @ theta[:, 0]
    border = pencil.sparse(pencil.mass @ theta[:, 0]) @ phi
    return data, border[None], phi[None]


@pytest.mark.parametrize("drives", DRIVES, ids=str)
@pytest.mark.parametrize("mode", [1, 4])
def test_the_bordered_system_is_solved_without_its_dense_rows(
    drives: tuple[Any, Any], mode: int
) -> None:
    pencil = arm(drives).pencil
    data, border, phi = mode_system(pencil, np.concatenate([Q0, Y0]), mode)
    rows = np.random.default_rng(1).standard_normal((5, pencil.n_dof))
    A = pencil.sparse(data).toarray()
    x, values = factor_sparse(pencil, data, border, phi)(rows)
    right, right_values = factor_dense(A, border)(rows)
    np.testing.assert_allclose(x, right, atol=1e-8 * np.abs(right).max())
    np.testing.assert_allclose(values, right_values, rtol=1e-7)
    rest = x @ A - values @ border - rows
    assert np.abs(rest).max() < 1e-12 * (np.abs(x) @ np.abs(A)).max()
    assert np.abs(x @ border.T).max() < 1e-9 * np.abs(x).max() * np.abs(border).sum()


def test_pivots_that_fail_are_replaced_by_safe_ones() -> None:
    pencil = arm().pencil
    data, border, phi = mode_system(pencil, np.concatenate([Q0, Y0]), 1)
    rows = np.random.default_rng(1).standard_normal((2, pencil.n_dof))
    right, _ = factor_sparse(pencil, data, border, phi)(rows)

    class Spoiled:
        def __init__(self, matrix: Any) -> None:
            self.inner = factorise(matrix)

        def solve(self, rhs: np.ndarray) -> np.ndarray:
            return np.asarray(self.inner.solve(rhs) * (1.0 + 1e-4))

    spoiled: Any = Spoiled
    x, _ = factor_sparse(pencil, data, border, phi, (spoiled, splu))(rows)
    np.testing.assert_allclose(x, right, atol=1e-8 * np.abs(right).max())
    with pytest.raises(AccuracyError, match="singular"):
        factor_sparse(pencil, data, border, phi, (spoiled, spoiled))


def test_a_double_mode_with_half_its_border_is_refused() -> None:
    pencil = crossing(0.0)
    x0 = np.zeros(2)
    theta = pencil.theta(x0[None])
    found = modes(pencil, x0[None], 2)
    assert found.lam[0, 1] == pytest.approx(found.lam[0, 0], rel=1e-12)
    data = (pencil.stiffness - found.lam[0, 0] * pencil.mass) @ theta[:, 0]
    M = pencil.sparse(pencil.mass @ theta[:, 0])
    phi = found.phi[0].T
    rows = np.random.default_rng(1).standard_normal((1, 6))
    whole, _ = factor_sparse(pencil, data, phi @ M, phi)(rows)
    assert np.abs(whole).max() < 1e3
    try:  # singular to round-off: refused, or an answer that shows it by its size
        half, _ = factor_sparse(pencil, data, phi[:1] @ M, phi[:1])(rows)
    except AccuracyError:
        return
    assert np.abs(half).max() > 1e10


def test_of_a_model_of_one_mode_nothing_is_left_but_the_border() -> None:
    solve = factor_dense(np.zeros((1, 1)), np.array([[2.0]]))
    x, multiplier = solve(np.array([[3.0]]))
    np.testing.assert_allclose([x[0, 0], multiplier[0, 0]], [0.0, -1.5], atol=1e-15)


def test_no_array_of_unknowns_times_coefficients_is_ever_stored() -> None:
    pencil = arm(elements=(500, 400)).pencil
    expand(pencil, Q0, Y0, (1,), 2)
    tracemalloc.start()
    found = expand(pencil, Q0, Y0, (1,), 9)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    vectors = found.clusters[0].vectors.nbytes
    assert len(found.space) > 6 * len(found.vector_space)
    assert peak < 6 * vectors
    assert peak < pencil.n_dof * len(found.space) * 8
