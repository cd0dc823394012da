"""First derivatives of one mode only: over 100 % wrong on the paper's arm, and never believed."""

from __future__ import annotations

import numpy as np
from stress import answered, judged

from eigassign import load_case
from eigassign.modal import reduce

Q0, Y0 = [1.817, 5.312], [0.125, 0.125]


def test_where_the_error_exceeds_100_percent_the_answer_is_refused():
    model = load_case("cases/two_link.yaml").model()
    reduced = reduce(model.pencil, Q0, Y0, (1,), 1, guard=False)
    q = np.array(Q0) + np.column_stack([np.zeros(61), np.linspace(-1.05, 1.05, 61)])
    exact = model.frequencies(q, [0.0, 0.0], 1)
    error = np.abs(reduced.frequencies(q, [0.0, 0.0]) / exact - 1.0)
    assert error.max() > 1.0
    believed = judged(model, reduced, q, [0.0, 0.0])
    assert np.nanmax(believed) < 0.05
    assert answered(reduced, q, [0.0, 0.0]) < 0.5


def test_second_derivatives_answer_everywhere():
    case = load_case("cases/two_link.yaml")
    model, q = case.model(), case.trajectory.q
    reduced = reduce(model.pencil, Q0, Y0, (1,), 2)
    assert judged(model, reduced, q, [0.0, 0.0]).max() < 1e-9
    assert answered(reduced, q, [0.0, 0.0]) == 1.0
