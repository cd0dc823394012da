"""What the coefficients say of a polynomial's error: a guide."""

from __future__ import annotations

import numpy as np
from chains import model_of, two_link

from eigassign import load_case
from eigassign.modal import expand

Q0, Y0 = np.array([1.817, 5.312]), np.array([0.125, 0.125])


def test_the_share_of_the_last_degree_is_what_that_degree_adds():
    """f² ∝ λ: it is the change of the frequency from one order to the next, in the first order."""
    case = load_case("cases/two_link.yaml")
    model, q = case.model(), case.trajectory.q
    three, four = (expand(model.pencil, Q0, Y0, (1, 2), order=p) for p in (3, 4))
    share, hz = four.last_degree_share(q, Y0), four.frequencies(q, Y0)
    added = np.abs(three.eigenvalues(q, Y0) / four.eigenvalues(q, Y0) - 1.0)
    np.testing.assert_allclose(2.0 * share, added, rtol=1e-9, atol=1e-14)
    error = np.abs(hz / model.frequencies(q, Y0, 2) - 1.0)
    assert 0.1 < share.max() / error.max() < 30.0


def test_of_a_cluster_it_is_that_of_its_matrix():
    model = model_of(two_link())
    expansion = expand(model.pencil, Q0, Y0, (2, 3), order=4, cluster_gap=0.64)
    assert [c.modes for c in expansion.clusters] == [(2, 3)]
    q = Q0 + np.column_stack([np.zeros(5), np.linspace(-0.3, 0.3, 5)])
    share = expansion.last_degree_share(q, Y0)
    assert share.shape == (5, 2)
    assert share[2].max() == 0.0 < share[[0, 4]].min()
