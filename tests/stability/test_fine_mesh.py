"""1000 elements a link: strain energy is a small difference of large numbers."""

from __future__ import annotations

import numpy as np
import pytest
from chains import model_of, two_link
from stress import case, judged

from eigassign.errors import AccuracyError
from eigassign.modal import reduce, rounding_error

Q0, Y0 = [1.817, 5.312], [0.125, 0.125]


def test_rigid_modes_stay_out_and_the_round_off_is_stated():
    model = case("fine_mesh").model()
    f = model.frequencies(Q0, Y0, 2)[0]
    lost = rounding_error(model.pencil, model.x(Q0, Y0)[0], 2)
    # The mesh of 40 elements a link is converged to 1e-8, its own round-off is as small.
    coarse = model_of(two_link(elements=(40, 40))).frequencies(Q0, Y0, 2)[0]
    assert 1e-6 < lost < 0.05
    # 2e-6: the printed area of the case against the one of the helper
    assert np.abs(f / coarse - 1.0).max() < lost + 2e-6


def test_a_reduced_model_has_it_too_or_is_refused():
    model = case("fine_mesh").model()
    try:
        reduced = reduce(model.pencil, Q0, Y0, (1,), 1)
    except AccuracyError as refusal:
        assert "orthonormal" in str(refusal)  # noqa: PT017
    else:
        lost = rounding_error(model.pencil, model.x(Q0, Y0)[0], 1)
        assert judged(model, reduced, Q0, Y0).max() < lost


@pytest.mark.parametrize("elements", [10, 40, 160])
def test_the_round_off_of_an_exact_solve_stays_below_what_is_stated(elements):
    """Against the same mesh turned as a whole: nothing physical changes, only the rounding."""
    model = model_of(two_link(elements=(elements, elements), angles=("relative", "relative")))
    q = np.column_stack([np.linspace(0.0, 6.0, 7), np.full(7, 1.0)])
    pencil = model.pencil
    f = model.frequencies(q, Y0, 2)
    lost = rounding_error(pencil, model.x(q[0], Y0)[0], 2)
    assert np.abs(f / f[0] - 1.0).max() <= 2.0 * lost
