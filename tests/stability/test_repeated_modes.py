"""Every mode of a cross of four equal bars comes four times."""

from __future__ import annotations

import numpy as np
from stress import case, judged

from eigassign.modal import expand, reduce

D = np.linspace(0.008, 0.012, 9)[:, None]


def test_the_four_are_found_together_and_stay_together():
    model = case("repeated_modes").model()
    expansion = expand(model.pencil, [], [0.01], (1,), order=8)
    assert [c.modes for c in expansion.clusters] == [(1, 2, 3, 4)]
    assert judged(model, expansion, [], D).max() < 1e-9


def test_the_reduced_model_has_all_four():
    model = case("repeated_modes").model()
    reduced = reduce(model.pencil, [], [0.01], (1, 2, 3, 4, 5), 1)
    assert judged(model, reduced, [], D).max() < 1e-9
    f = reduced.frequencies([], D)
    np.testing.assert_allclose(f[:, 1:4], f[:, :1] * np.ones(3), rtol=1e-10)


def test_tracking_makes_up_no_swaps_among_them():
    tracked = case("repeated_modes").model().tracked([], D, (1, 2, 3, 4))
    assert tracked.certain.all()
    assert tracked.overlap.min() > 0.999
