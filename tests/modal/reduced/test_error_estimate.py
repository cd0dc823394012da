"""The error estimate: its parts by independent computation, and its coverage."""

from __future__ import annotations

import numpy as np
import pytest
from calibration import draw
from chains import model_of, random_chain, two_link
from scipy import sparse
from wide_draws import planar_loop, spatial_loop, spatial_tree

from eigassign.errors import AccuracyError, SingularityError
from eigassign.mechanism import factorise
from eigassign.modal import (
    frequency_error,
    half_solve,
    largest_outside,
    mode_missing,
    reduce,
    residual_gram,
    ritz_basis,
    ritz_pairs,
    rounding_error,
    rounding_weights,
)

Q0, Y0 = np.array([1.817, 5.312]), np.array([0.125, 0.125])


def symmetric_pencil(seed: int, gap: float) -> tuple[np.ndarray, np.ndarray]:
    """μ of a random matrix diag(H1, H2) + coupling, with two Ritz values ``gap`` apart."""
    rng = np.random.default_rng(seed)
    H = np.diag([1.0, 1.0 - gap, 0.4, 0.2, 0.1])
    H[:2, 2:] = rng.uniform(-0.02, 0.02, (2, 3))
    H[2:, :2] = H[:2, 2:].T
    return H, H[:2, 2:]


@pytest.mark.parametrize("gap", [0.3, 1e-2, 1e-4, 1e-8, 0.0])
@pytest.mark.parametrize("seed", range(20))
def test_the_bound_holds_for_pairs_that_cross_inside_the_basis(gap, seed):
    H, coupling = symmetric_pencil(seed, gap)
    mu = np.diag(H)[None, :2]
    exact = np.linalg.eigvalsh(H)[::-1][:2]
    error = frequency_error(mu, (coupling @ coupling.T)[None], np.array([0.41]), mu)
    true = np.sqrt(exact / mu[0]) - 1.0
    assert (error[0] >= true - 1e-15).all()
    assert error.max() < 100.0 * true.max()  # quadratic in the residual, however close they are


def test_a_mode_outside_the_basis_that_may_lie_below_is_refused():
    mu, gram = np.array([[1.0, 0.5]]), 1e-8 * np.eye(2)[None]
    assert np.isfinite(frequency_error(mu, gram, np.array([0.1]), mu)).all()
    assert np.isinf(frequency_error(mu, gram, np.array([0.6]), mu)).tolist() == [[False, True]]


def test_a_mode_that_has_left_the_basis_is_missed():
    """Three modes lay close together at the expansion point; now there are two, and one is lost."""
    anchors = np.array([[1.0, 0.95, 0.5, 0.01]])
    mu, gram = np.array([[1.0, 0.5, 0.02]]), np.diag([1e-10, 1e-10, 1e-2])[None]
    refused = np.isinf(frequency_error(mu, gram, np.array([0.01]), anchors))
    assert refused.all()
    whole = np.diag([1e-10, 1e-10, 1e-10])[None]
    assert np.isfinite(frequency_error(mu, whole, np.array([0.01]), anchors)).all()


@pytest.mark.parametrize("seed", [2, 33, 46, 44, 9])
def test_the_residual_is_measured_in_the_stiffness_of_the_pose_at_hand(seed):
    """Against K_E(q)⁻¹ applied to the full residual; no design parameter, so it is exact."""
    tree, q0 = random_chain(seed)
    pencil = model_of(tree).pencil
    reduced = reduce(pencil, q0, [], (1,), 1)
    q = q0 + np.random.default_rng(seed).uniform(-1.0, 1.0, (3, len(q0)))
    theta = reduced.theta(q)
    K, M_c, coupling = reduced.at(theta)
    mu, z = ritz_pairs(K, M_c)
    count = reduced.error_terms.anchors.shape[1] - 1
    wide = np.concatenate([z, -coupling @ z], axis=1)[:, :, :count]
    terms = reduced.error_terms
    gram = residual_gram(terms.residual, terms.joints, theta, theta, mu[:, :count], wide)
    expected = full_gram(pencil, q, q0, mu[:, :count], count)
    # A residual below 1e-10 of μ is round-off and may differ.
    scale = np.maximum(np.sqrt(np.einsum("nii->ni", expected)), 1e-5 * mu[:, :count])
    pairs = scale[:, :, None] * scale[:, None, :]
    np.testing.assert_allclose(gram / pairs, expected / pairs, atol=1e-5)


def full_gram(pencil, q, q0, mu, count):
    """ρᵀ K_E(q)⁻¹ ρ with full matrices and an own Ritz step on the same vectors."""
    V = ritz_basis(pencil, q0[None], (1,), 1, True, None).V
    E, F = pencil.elastic, pencil.rigid
    grams = []
    for row in q:
        K, M = (a[0] for a in pencil.matrices(pencil.theta(row[None])))
        M_c = M[np.ix_(E, E)]
        if len(F):
            M_c = M_c - M[np.ix_(E, F)] @ np.linalg.solve(M[np.ix_(F, F)], M[np.ix_(F, E)])
        K_E = K[np.ix_(E, E)]
        L = np.linalg.inv(np.linalg.cholesky(V.T @ K_E @ V))
        values, v = np.linalg.eigh(L @ (V.T @ M_c @ V) @ L.T)
        z = V @ (L.T @ v)[:, ::-1][:, :count]
        rho = M_c @ z - K_E @ z * values[::-1][:count]
        gram = rho.T @ np.linalg.solve(K_E, rho)
        grams.append(gram)
    return np.array(grams)


def test_the_weights_bound_the_round_off_of_a_mode():
    model = model_of(two_link())
    x = np.concatenate([Q0, Y0])
    theta = model.pencil.theta(x[None])[:, 0]
    d_K, d_M = rounding_weights(model.pencil, theta)
    K, M = (a[0] for a in model.pencil.matrices(theta[:, None]))
    z = np.abs(model.modes(Q0, Y0, 3)[1][0])
    for column in z.T:
        assert column @ np.abs(K) @ column <= d_K @ column**2 * (1.0 + 1e-12)
        assert column @ np.abs(M) @ column <= d_M @ column**2 * (1.0 + 1e-12)


def test_a_fine_mesh_has_a_larger_round_off_and_states_it():
    x = np.concatenate([Q0, Y0])
    coarse, fine = (
        rounding_error(model_of(two_link(elements=(n, n))).pencil, x, 1) for n in (4, 100)
    )
    assert fine > 1e3 * coarse
    model = model_of(two_link(elements=(100, 100)))
    assert reduce(model.pencil, Q0, Y0).error_estimate(Q0, Y0)[0, 0] > fine


def test_pairs_that_coincide_may_move_by_what_both_miss_together():
    """Two equal μ̂ with the same coupling c to one mode move by 2c²/gap, not by c²/gap each."""
    c = 1e-3
    H = np.array([[1.0, 0.0, c], [0.0, 1.0, c], [c, c, 0.5]])
    mu, gram = np.ones((1, 2)), np.full((1, 2, 2), c * c)
    error = frequency_error(mu, gram / 4.0, np.array([0.5]), mu)  # ‖ρ‖² is taken four times
    true = np.sqrt(np.linalg.eigvalsh(H)[-1]) - 1.0
    assert error[0, 0] >= true * (1.0 - 1e-4)


def test_modes_outside_the_basis_are_taken_to_grow_as_those_inside_or_as_the_softest_link():
    terms = reduce(model_of(two_link()).pencil, Q0, Y0, (1,), 1).error_terms
    count = terms.anchors.shape[1] - 1
    mu, last = terms.anchors[:, :count].copy(), terms.anchors[0, -1]
    one, soft = np.ones(1), np.array([0.25])
    assert largest_outside(terms, mu, one) == pytest.approx(last)
    assert largest_outside(terms, mu, soft) == pytest.approx(4.0 * last)
    mu[0, -1] *= 3.0
    assert largest_outside(terms, mu, one) == pytest.approx(3.0 * last)
    assert largest_outside(terms, mu, soft) == pytest.approx(4.0 * last)


def test_half_a_solve_measures_in_the_inverse():
    pencil = model_of(two_link(elements=(20, 15))).pencil
    x = np.concatenate([Q0, Y0])
    K = pencil.sparse(pencil.stiffness @ pencil.theta(x[None])[:, 0])
    K_E = K[pencil.elastic][:, pencil.elastic].tocsc()
    A = np.random.default_rng(3).standard_normal((K_E.shape[0], 4))
    half = half_solve(factorise(K_E), A)
    expected = A.T @ np.linalg.solve(K_E.toarray(), A)
    # The condition number of K_E, 1e11, leaves five digits of its inverse.
    np.testing.assert_allclose(half.T @ half, expected, rtol=1e-4, atol=1e-4 * expected.max())


def test_half_a_solve_refuses_what_is_not_definite():
    K = sparse.csc_array(np.diag([1.0, -1.0, 2.0]))
    with pytest.raises(AccuracyError, match="not positive definite"):
        half_solve(factorise(K), np.eye(3))


def test_a_mode_is_gone_when_its_shape_and_one_frequency_are_missing():
    """Modes at 1, 4, 9 and 35; the second is no longer there, the others moved little."""
    anchors = 1.0 / np.array([[1.0, 4.0, 9.0, 35.0]]) ** 2
    present = 1.0 / np.array([[1.1, 8.8, 30.0, 90.0, 400.0]]) ** 2
    gram = np.zeros((1, 3, 3))
    shares = np.zeros((1, 1, 3, 5))
    shares[0, 0, [0, 1, 2], [0, 4, 1]] = 1.0  # the second shape is in a pair that is far too stiff
    assert mode_missing(present, gram, shares, anchors).tolist() == [[False, True, False]]
    kept = shares[:, :, :, [0, 4, 1, 2, 3]]  # now it is in the second pair: merely faster
    assert not mode_missing(present, gram, kept, anchors).any()
    whole = 1.0 / np.array([[1.1, 4.2, 8.8, 30.0, 90.0]]) ** 2  # none is missing, shapes changed
    assert not mode_missing(whole, gram, shares, anchors).any()


def test_a_shape_that_grew_heavy_is_looked_for_further_down():
    """Modes at 1 and 4; the second shape is gone, and now it moves 30 times its mass."""
    anchors = 1.0 / np.array([[1.0, 4.0, 35.0]]) ** 2
    present = 1.0 / np.array([[1.0, 30.0, 90.0]]) ** 2
    shares = np.zeros((1, 1, 2, 3))
    shares[0, 0, 0, 0] = 1.0
    gram, light, heavy = np.zeros((1, 2, 2)), np.ones((1, 1, 2)), np.array([[[1.0, 30.0]]])
    assert mode_missing(present, gram, shares, anchors, light).tolist() == [[False, False]]
    assert mode_missing(present, gram, shares, anchors, heavy).tolist() == [[True, False]]


def test_a_pair_whose_residual_is_not_known_stands_for_a_shape_only_nearby():
    """The third shape, at 9, is found in a pair at 27; nothing but that pair's residual says
    whether it became faster or is no mode any more."""
    anchors = 1.0 / np.array([[1.0, 4.0, 9.0, 25.0, 100.0]]) ** 2
    present = 1.0 / np.array([[1.1, 5.0, 20.0, 27.0, 400.0]]) ** 2
    shares = np.zeros((1, 1, 4, 5))
    shares[0, 0, [0, 1, 2, 3], [0, 1, 3, 2]] = 1.0
    assert not mode_missing(present, np.zeros((1, 4, 4)), shares, anchors).any()
    unknown = mode_missing(present, np.zeros((1, 3, 3)), shares[:, :, :3], anchors[:, [0, 1, 2, 4]])
    assert unknown.tolist() == [[False, True, False]]


@pytest.mark.parametrize("seed", [832, 1172, 2531])
def test_links_that_know_nothing_of_each_other_hide_no_mode(seed):
    """Here the residuals are at round-off although a mode of another branch is missing."""
    hidden(draw(seed, 3))


def test_a_decoupled_shape_in_a_pair_of_unknown_residual_hides_no_mode():
    """One mode falls to 0.3 of its frequency; its old shape is a pair 2.6 times as fast as it."""
    hidden(spatial_tree(1274, 3))


def hidden(drawn):
    """Some answer is wrong, for its mode is not in the basis: that must be covered or refused."""
    assert drawn is not None
    reduced = reduce(drawn.model.pencil, drawn.q0, drawn.y0, drawn.modes, drawn.half_order)
    pick = np.array(drawn.modes) - 1
    exact = drawn.model.frequencies(drawn.q, drawn.y, max(drawn.modes))[:, pick]
    error = np.abs(reduced.frequencies(drawn.q, drawn.y) / exact - 1.0)
    estimate = reduced.error_estimate(drawn.q, drawn.y)
    assert error.max() > 0.2
    assert (estimate >= error).all()


@pytest.mark.parametrize(("family", "seed"), [(spatial_loop, 25), (planar_loop, 85)])
def test_a_loop_is_not_turned_beyond_where_it_makes_sense(family, seed):
    """Turned by 90°, these close with a passive carriage off its beam: K was indefinite there."""
    drawn = family(seed, 3)
    reduced = reduce(drawn.model.pencil, drawn.q0, drawn.y0, drawn.modes, 2)
    assert np.isfinite(reduced.error_estimate(drawn.q0, drawn.y0)).all()


def test_a_pose_that_does_not_close_with_the_first_design_is_refused_alone():
    """With the lengths of y0 the third pose has no θ(q, y0), in which the residual is measured."""
    drawn = planar_loop(22, 3)
    reduced = reduce(drawn.model.pencil, drawn.q0, drawn.y0, drawn.modes, drawn.half_order)
    with pytest.raises(SingularityError, match="dead point"):
        drawn.model.frequencies(drawn.q, drawn.y0)
    estimate = reduced.error_estimate(drawn.q, drawn.y)
    assert np.isfinite(estimate[:, 0]).tolist() == [True, True, False]
    assert np.isfinite(reduced.frequencies(drawn.q, drawn.y)).all()
    alone = reduced.error_estimate(drawn.q[:2], drawn.y[:2])
    np.testing.assert_allclose(estimate[:2], alone, rtol=1e-6)
