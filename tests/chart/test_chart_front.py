"""Fronts, break-even counts and advice follow from the numbers alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from eigassign.chart.front import (
    advise_accuracy,
    advise_budget,
    break_even,
    cheapest,
    front,
    front_notes,
    pareto,
)
from eigassign.chart.results import NO_TIME, ChartPoint, Errors, Timing, excess_over


def timing(seconds: float) -> Timing:
    return Timing(seconds, seconds, seconds, 3)


def point(name: str, offline: float, online: float, worst: float, ours: bool = True) -> ChartPoint:
    errors = Errors(worst, worst / 2.0, worst / 100.0, 10, 0)
    return ChartPoint(
        name, "family", ours, {}, timing(offline), timing(online), 1, 0.0,
        errors, errors, errors, None,
    )  # fmt: skip


POINTS = [
    point("exact", 0.0, 1e-3, 0.0),
    point("good", 1e-2, 1e-5, 1e-6),
    point("rough", 1e-3, 1e-6, 1e-1, ours=False),
    point("bad", 2e-2, 1e-4, 1e-1),
]


def test_what_doubts_itself_is_not_advised_however_well_it_did() -> None:
    quick = replace(point("lucky", 0.0, 1e-7, 1e-6), estimate=1e-3)
    assert cheapest([*POINTS, quick], 1e-6, 1e4).method == "good"  # type: ignore[union-attr]
    assert advise_accuracy([*POINTS, quick], 1e-6, 1e4, 0.0).method == "good"
    assert advise_accuracy([*POINTS, quick], 1e-5, 1e4, 0.0).method == "lucky"


def test_no_front_member_is_beaten_and_every_other_is() -> None:
    random = np.random.default_rng(0)
    for _ in range(30):
        cost, error = random.integers(0, 8, (2, 25)).astype(float)
        kept = pareto(cost, error)
        for k in range(25):
            no_worse = (cost <= cost[k]) & (error <= error[k])
            beaten = (no_worse & ((cost < cost[k]) | (error < error[k]))).any()
            if k in kept:
                assert not beaten
            else:
                equal = [j for j in kept if cost[j] == cost[k] and error[j] == error[k]]
                assert beaten or equal
        assert list(error[kept]) == sorted(error[kept])


def test_what_is_set_up_for_a_whole_trajectory_is_paid_for_whole() -> None:
    stations = replace(point("stations", 0.0, 1e-6, 1e-4), at_once=150)
    assert stations.total_s(1) == stations.total_s(150) == pytest.approx(150e-6)
    assert stations.total_s(151) == pytest.approx(300e-6)
    exact = point("exact", 0.0, 4e-5, 0.0)
    assert cheapest([stations, exact], 1e-2, 1) is exact
    assert cheapest([stations, exact], 1e-2, 150) is stations


def test_an_objective_of_next_to_nothing_is_no_yardstick() -> None:
    assert excess_over(2.0, 3.0) == 0.5
    assert excess_over(1e-30, 1e-28) < 1e-15
    assert excess_over(0.0, 0.0) == 0.0


def test_what_gives_no_number_is_on_no_front() -> None:
    assert pareto(np.array([1.0, 2.0]), np.array([np.inf, 3.0])) == [1]
    assert pareto(np.array([np.nan, 2.0]), np.array([1.0, 3.0])) == [1]


def test_a_front_counts_the_set_up_or_leaves_it_out() -> None:
    assert front(POINTS, "few", 2.0, 0.0).methods == ("exact", "rough")
    assert front(POINTS, "many", 1e4, 0.0).methods == ("exact", "good", "rough")
    assert front(POINTS, "online", None, 0.0).methods == ("exact", "good", "rough")


def test_differences_below_the_floor_win_nothing() -> None:
    assert front(POINTS, "many", 1e4, 1e-5).methods == ("good", "rough")


def test_it_pays_from_where_both_costs_are_equal() -> None:
    count = break_even(1e-2, 1e-5, 1e-3)
    assert count is not None
    assert 1e-2 + count * 1e-5 == pytest.approx(count * 1e-3)
    assert break_even(0.0, 2.0, 1.0) is None


def test_advice_is_the_cheapest_that_is_good_enough() -> None:
    found = advise_accuracy(POINTS, 1e-7, 1e4, 0.0)
    assert found.method == "good"
    assert found.total_s == pytest.approx(1e-2 + 1e4 * 1e-5)
    assert "good" in found.words
    assert advise_accuracy(POINTS, 1e-2, 1e4, 0.0).method == "rough"
    assert advise_accuracy(POINTS[1:], 1e-9, 1e4, 0.0).method is None


def test_nothing_is_advised_below_round_off() -> None:
    found = advise_accuracy(POINTS, 1e-7, 1e4, 2e-7)
    assert found.method is None
    assert "round-off moves even exact solves by 2.0e-07" in found.words


def test_advice_for_a_budget_is_the_most_accurate_in_time() -> None:
    assert advise_budget(POINTS, 0.2, 1e4).method == "good"
    assert advise_budget(POINTS, 20.0, 1e4).method == "exact"
    assert advise_budget(POINTS, 1e-9, 1e4).method is None


def test_peers_on_a_front_are_named() -> None:
    (note,) = front_notes(POINTS, [front(POINTS, "many", 1e4, 0.0)])
    assert "1 of 2" in note or "0 of 1" in note
    assert "rough" in note


def test_nothing_takes_no_time() -> None:
    assert NO_TIME.plus(timing(2.0)).median_s == 2.0
    assert timing(2.0).times(3.0).high_s == 6.0


def test_advice_is_a_sentence_that_says_what_the_method_does() -> None:
    stations = replace(point("stations linear 3", 0.0, 1e-3, 1e-3), family="stations, linear")
    found = advise_accuracy([stations], 1e-2, 152, 0.0)
    assert found.words.startswith(
        "for 152 evaluations within 1 % of exact the quickest is stations linear 3: exact solves at"
    )
    assert "and is off by 0.001 % at most" in found.words
