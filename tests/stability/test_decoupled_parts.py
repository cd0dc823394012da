"""Parts that know nothing of each other: a mode without a vector in the basis comes down."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from calibration import Drawn, Tally, tally
from decoupled import comb, decoupled
from stress import answered, judged
from test_calibration import polynomial, reduced_model

from eigassign.modal import expand, reduce, reduce_adaptively

TIP = np.linspace(0.0, 0.1, 21)[:, None]  # kg


@pytest.mark.parametrize("start", [0.0, 0.005])
def test_a_cantilever_that_a_mass_brings_down_is_not_overlooked(start):
    """Of twelve the last one is the stiffest; with 100 g on its tip it has the lowest mode."""
    model = comb(12)
    exact = model.frequencies([], TIP, 1)[:, 0]
    assert exact[0] == pytest.approx(52.65, abs=0.01)
    assert exact[-1] == pytest.approx(48.25, abs=0.01)
    for approximation in (
        reduce(model.pencil, [], [start], (1,), 2),
        expand(model.pencil, [], [start], (1,), 4),
    ):
        judged(model, approximation, [], TIP)  # by the wider model, which has that mode
        assert (approximation.error_estimate([], TIP)[exact < 0.999 * exact[0]] > 0.01).all()
        assert answered(approximation, [], TIP[TIP[:, 0] < 0.07]) == 1.0
        assert answered(approximation, [], 5.0 * TIP[10:]) == 0.0


def test_a_reduced_model_that_adapts_finds_it():
    model = comb(12)
    x = model.x(np.zeros((len(TIP), 0)), TIP)
    found = reduce_adaptively(model.pencil, x, 1e-6, (1,))
    assert judged(model, found.reduced, [], TIP).max() < 1e-9
    assert answered(found.reduced, [], TIP) == 1.0


@pytest.mark.parametrize("seed", [11_382, 11_672, 11_962])
def test_a_shape_that_grew_heavy_while_its_joints_turned_is_missed(seed):
    """The pod's own shape is in the basis, but kinked in this pose, and too stiff by far there."""
    found = tally(range(seed, seed + 1), 6, reduced_model, decoupled)
    assert found.error.max() > 0.2
    assert (found.estimate >= found.error).all()


def none_below(found: Tally) -> None:
    """No error is above 4/3 of its estimate; few are refused, and the others stay sharp."""
    assert (found.error <= 4.0 / 3.0 * found.estimate).all()
    assert found.covered >= 0.999
    assert np.median(found.overestimate[found.above_rounding]) < 20.0
    assert found.refused[found.half_orders > 1].mean() < 0.1


def test_no_answer_of_decoupled_parts_is_below_its_estimate():
    none_below(tally(range(30), 4, reduced_model, decoupled))


@pytest.mark.slow
def test_no_answer_of_20_000_of_decoupled_parts_is_below_its_estimate():
    found = tally(range(10_000, 12_000), 6, reduced_model, decoupled)
    assert len(found.error) > 20_000
    none_below(found)


@pytest.mark.slow
def test_no_polynomial_of_decoupled_parts_is_below_its_estimate():
    assert tally(range(20_000, 20_400), 6, polynomial, decoupled).covered == 1.0


def light(seed: int, samples: int) -> Drawn | None:
    """An arm with a link almost without mass, and vectors of first order only."""
    drawn = decoupled(5 * seed + 4, samples)
    return None if drawn is None else replace(drawn, half_order=1)


@pytest.mark.parametrize(
    "seeds", [range(10), pytest.param(range(10, 400), marks=pytest.mark.slow)], ids=["few", "many"]
)
def test_first_order_and_links_almost_without_mass_are_right_or_refused(seeds):
    found = tally(seeds, 6, reduced_model, light)
    assert found.covered == 1.0
    assert found.refused.mean() < 0.5
