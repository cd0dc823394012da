"""Frequencies along the trajectory and their slopes, as the assignment asks for them."""

import numpy as np
from redesigned_arms import cart, extrapolated

from eigassign.pipeline import Stages, prepare
from eigassign.study import response_of


def test_a_coordinate_that_rests_may_follow_the_design_all_the_same() -> None:
    scene = prepare(cart([[0.2, 0.3], [0.6, 0.3]], leaning=True), Stages(lambda line: None), None)
    assert np.ptp(scene.path.q[:, 1]) < 1e-12
    response, y = response_of(scene, 2), np.array([0.52])
    slopes = response(y).slopes
    beside = extrapolated(lambda v: response(v).hz, y, 1e-3)
    np.testing.assert_allclose(slopes, beside, rtol=1e-7)
