"""The modes of one pose alone: tens of percent wrong on the paper's arm, which is measured."""

from __future__ import annotations

import numpy as np
from stress import judged, stated

from eigassign import load_case
from eigassign.modal import reduce

Q0, Y0 = [1.817, 5.312], [0.125, 0.125]


def test_without_derivatives_the_basis_loses_a_mode_and_that_is_measured():
    model = load_case("cases/two_link.yaml").model()
    reduced = reduce(model.pencil, Q0, Y0, (1,), 0)
    q = np.array(Q0) + np.column_stack([np.zeros(61), np.linspace(-1.05, 1.05, 61)])
    error = judged(model, reduced, q, [0.0, 0.0])
    assert error.max() > 0.1
    assert stated(model, reduced, q, [0.0, 0.0])[0] >= error.max()


def test_second_derivatives_answer_everywhere():
    case = load_case("cases/two_link.yaml")
    model, q = case.model(), case.trajectory.q
    reduced = reduce(model.pencil, Q0, Y0, (1,), 2)
    assert judged(model, reduced, q, [0.0, 0.0]).max() < 1e-9
