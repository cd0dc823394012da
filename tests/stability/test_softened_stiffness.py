"""Where stiffness moves with the pose, an estimate holds for designs that are far softer, too."""

from __future__ import annotations

import numpy as np
import pytest
from calibration import Drawn, Floats, tally
from softened import draw

from eigassign.modal import reduce


def at_one_point(drawn: Drawn) -> tuple[Floats, Floats]:
    model = reduce(drawn.model.pencil, drawn.q0, drawn.y0, drawn.modes, drawn.half_order)
    return model.frequencies(drawn.q, drawn.y), model.error_estimate(drawn.q, drawn.y)


def at_two_points(drawn: Drawn) -> tuple[Floats, Floats]:
    """The second with the design and pose of a sample."""
    q0, y0 = np.array([drawn.q0, drawn.q[0]]), np.array([drawn.y0, drawn.y[0]])
    model = reduce(drawn.model.pencil, q0, y0, drawn.modes, drawn.half_order)
    return model.frequencies(drawn.q, drawn.y), model.error_estimate(drawn.q, drawn.y)


def check(seeds: range, samples: int, refused: float) -> None:
    for judge in (at_one_point, at_two_points):
        found = tally(seeds, samples, judge, draw)
        given = ~found.refused
        least = np.maximum(found.estimate, 2.0 * found.floor)
        below = given & (found.error > least)
        assert not below.any(), found.seeds[below]
        print(f"{judge.__name__}: {given.size} answers, {1.0 - given.mean():.1%} refused")  # noqa: T201
        assert found.refused.mean() < refused


def test_no_estimate_is_below_the_error_of_a_softer_design():
    check(range(24), 4, 0.4)


@pytest.mark.slow
def test_no_estimate_is_below_the_error_of_twenty_thousand_softer_designs():
    check(range(100, 900), 16, 0.4)
