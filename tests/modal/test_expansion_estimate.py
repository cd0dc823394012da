"""The error estimate of a polynomial covers the error, and its radius of convergence is found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from chains import model_of, two_link

from eigassign import load_case
from eigassign.errors import UsageError
from eigassign.modal import companion_order, expand, radius_share
from eigassign.series import lower_set

Q0, Y0 = np.array([1.817, 5.312]), np.array([0.125, 0.125])


@pytest.fixture(scope="module")
def arm():
    case = load_case("cases/two_link.yaml")
    return case.model(), case.trajectory.q


@pytest.mark.parametrize("kind", [{"order": 2}, {"order": 4}, {"order": 4, "linear_in_y": True}])
def test_it_is_the_true_error_along_the_papers_trajectory(arm, kind):
    model, q = arm
    expansion = expand(model.pencil, Q0, Y0, (1,), **kind)
    exact = model.frequencies(q, [0.0, 0.0], 1)
    error = np.abs(expansion.frequencies(q, [0.0, 0.0]) / exact - 1.0)
    estimate = expansion.error_estimate(q, [0.0, 0.0])
    assert estimate.shape == (len(q), 1)
    assert (estimate >= error).all()
    np.testing.assert_allclose(estimate, error, rtol=1e-3, atol=1e-8)


def test_a_negative_eigenvalue_is_refused(arm):
    model, _ = arm
    expansion = expand(model.pencil, Q0, Y0, (1,), order=4)
    q = Q0 + np.array([[0.0, 0.1], [0.0, -1.6]])
    assert np.isnan(expansion.frequencies(q, Y0)).ravel().tolist() == [False, True]
    assert np.isinf(expansion.error_estimate(q, Y0)).ravel().tolist() == [False, True]


def test_known_vectors_and_recomputed_ones_make_the_same_estimate(arm):
    """A box set lacks some second-order vectors, so that they are computed for the estimate."""
    model, q = arm
    known = expand(model.pencil, Q0, Y0, (1,), order=4)
    other = expand(model.pencil, Q0, Y0, (1,), space=lower_set(list(np.ndindex(1, 5, 2, 2))))
    exact = model.frequencies(q, Y0, 1)
    for expansion in (known, other):
        error = np.abs(expansion.frequencies(q, Y0) / exact - 1.0)
        np.testing.assert_allclose(expansion.error_estimate(q, Y0), error, rtol=1e-3, atol=1e-8)


def test_clusters_are_estimated_too():
    model = model_of(two_link())
    expansion = expand(model.pencil, Q0, Y0, (2, 3), order=4, cluster_gap=0.64)
    assert [c.modes for c in expansion.clusters] == [(2, 3)]
    q = Q0 + np.column_stack([np.zeros(5), np.linspace(-0.3, 0.3, 5)])
    error = np.abs(expansion.frequencies(q, Y0) / model.frequencies(q, Y0, 3)[:, 1:] - 1.0)
    assert (expansion.error_estimate(q, Y0) >= error).all()


def test_an_expansion_without_its_pencil_gives_no_estimate(arm):
    expansion = replace(expand(arm[0].pencil, Q0, Y0), pencil=None)
    with pytest.raises(UsageError, match="without its model"):
        expansion.error_estimate(Q0, Y0)


def test_the_vectors_taken_along_stay_few():
    assert companion_order(3, 1) == 2
    assert companion_order(3, 2) == 2
    assert companion_order(3, 10) == 7
    assert companion_order(50, 2) == 1


def test_the_radius_of_convergence_is_that_of_a_pole():
    """An almost massless bar with a tip mass y: λ = k/(m0 + y), a pole at y = −m0."""
    tree = two_link(elements=(2, 2), drives=("locked", "locked"))
    tree["mechanism"]["materials"]["al"]["density"] = 1e-6
    tree["mechanism"]["bodies"]["elbow_mass"]["mass"] = 1e-6
    tree["design"] = {"m": {"parameter": "bodies.tool_mass.mass", "min": 0.0, "max": 1.0}}
    model = model_of(tree)
    expansion = expand(model.pencil, [0.0, 1.0], [0.2], (1,), order=9)
    y = np.array([[0.1], [0.3], [0.5]])
    share = radius_share(expansion, [0.0, 1.0], y)[:, 0]
    np.testing.assert_allclose(share, np.abs(y[:, 0] - 0.2) / 0.2, rtol=1e-3)
