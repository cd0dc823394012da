"""Where stiffness moves with the pose, an estimate holds for designs that are far softer, too."""

from __future__ import annotations

import numpy as np
import pytest
from calibration import Drawn, Floats, tally
from softened import CASES, draw

import eigassign as ea
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
    check(range(24), 4, 0.2)


@pytest.mark.slow
def test_no_estimate_is_below_the_error_of_forty_thousand_softer_designs():
    check(range(100, 1100), 16, 0.25)


@pytest.mark.parametrize("modes", [(4,), (1, 4), (2, 3, 4), (1, 2, 3, 4)])
@pytest.mark.parametrize("half_order", [1, 2, 3])
def test_modes_that_a_travelling_nut_brings_down_are_not_passed_over(
    modes: tuple[int, ...], half_order: int
) -> None:
    """Bending of the span behind the nut is in no basis made where that span was short."""
    case = ea.load_case(CASES / "ball_screw.yaml")
    model, y = case.model(), case.initial_design
    q, others = case.trajectory.q, np.array(modes) - 1
    reduced = reduce(model.pencil, q[-1], y, modes, half_order)
    error = np.abs(reduced.frequencies(q, y) / model.frequencies(q, y, count=4)[:, others] - 1.0)
    estimate = reduced.error_estimate(q, y)
    assert np.all(error <= np.maximum(estimate, 1e-11))
    assert np.isfinite(estimate[-1]).all()


@pytest.mark.parametrize("stiffer", [1.0, 5.0, 10.0, 60.0])
def test_nor_where_a_stiffer_servo_lets_them_pass_a_mode(stiffer: float) -> None:
    model = ea.load_case(CASES / "ball_screw.yaml").model()
    y0, y = np.array([4752.0, 151.8]), np.array([stiffer * 4752.0, 151.8])
    reduced = reduce(model.pencil, [0.4], y0, (2,), 3)
    true = model.frequencies([0.25], y, count=2)[0, 1]
    error = abs(reduced.frequencies([0.25], y)[0, 0] / true - 1.0)
    assert error <= reduced.error_estimate([0.25], y)[0, 0]
