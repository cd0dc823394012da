"""Frequencies along the trajectory and their slopes, as the assignment asks for them."""

from __future__ import annotations

import numpy as np
from redesigned_arms import cart, extrapolated

from eigassign.pipeline.run import prepare
from eigassign.pipeline.stages import Stages
from eigassign.study.design.response import exact_response


def test_a_coordinate_that_rests_may_follow_the_design_all_the_same() -> None:
    scene = prepare(cart([[0.2, 0.3], [0.6, 0.3]], leaning=True), Stages(lambda line: None), None)
    assert np.ptp(scene.path.q[:, 1]) < 1e-12
    response, y = exact_response(scene, 2), np.array([0.52])
    slopes = response(y).slopes
    beside = extrapolated(lambda v: response(v).hz, y, 1e-3)
    np.testing.assert_allclose(slopes, beside, rtol=1e-7)
