"""Along the motion the folding arm's frequency passes that of a fixed antenna."""

from __future__ import annotations

import numpy as np
from stress import case, judged

from eigassign.modal import expand, reduce

Q = np.deg2rad(np.linspace(10.0, 165.0, 40))[:, None]


def test_the_tracked_modes_are_the_arm_and_the_antenna_all_the_way():
    model = case("mode_swaps").model()
    tracked = model.tracked(Q, [], (1, 2))
    np.testing.assert_allclose(tracked.frequencies[:, 1], tracked.frequencies[0, 1], rtol=1e-10)
    assert (np.diff(tracked.frequencies[:, 0]) > 0.0).all()
    assert tracked.ordinals[-1].tolist() == [2, 1]
    assert len(tracked.swaps) == 1
    assert "modes 1 and 2 cross" in tracked.notes[0]


def test_approximations_of_mode_1_are_of_the_lower_one_or_refused():
    model = case("mode_swaps").model()
    q0 = np.deg2rad([80.0])
    judged(model, expand(model.pencil, q0, [], (1,), order=8), Q, [])
    reduced = reduce(model.pencil, q0, [], (1, 2), 3)
    assert judged(model, reduced, Q, []).max() < 1e-5
