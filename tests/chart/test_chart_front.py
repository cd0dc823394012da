"""Fronts and advice follow from the numbers alone; times are medians of repeats in turns."""

import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from eigassign.chart import (
    Advice,
    Asked,
    ChartPoint,
    Effort,
    Errors,
    Timing,
    advise,
    front,
    machine,
    measure,
    skipped_notes,
    time_in_words,
)


def timing(seconds: float) -> Timing:
    return Timing(seconds, seconds, seconds, 3)


def point(name: str, offline: float, online: float, worst: float, **more: Any) -> ChartPoint:
    errors = Errors(worst, worst / 2.0, worst / 100.0, 10, 0)
    made = ChartPoint(
        name, "family", True, {}, timing(offline), timing(online), 1, 0.0,
        errors, errors, errors, None,
    )  # fmt: skip
    return replace(made, **more)


POINTS = [
    point("exact", 0.0, 1e-3, 0.0),
    point("good", 1e-2, 1e-5, 1e-6),
    point("rough", 1e-3, 1e-6, 1e-1, ours=False),
    point("bad", 2e-2, 1e-4, 1e-1),
]


def advised(points: list[ChartPoint], accuracy: float, floor: float = 0.0) -> Advice:
    asked = Asked((1,), 1, 1, 1, 1, 1, 1, 1.0, floor)
    (given,) = advise(points, asked, (accuracy,))
    return given


def test_no_front_member_is_beaten_and_every_other_is() -> None:
    random = np.random.default_rng(0)
    for _ in range(30):
        cost, error = random.integers(0, 8, (2, 25)).astype(float)
        error[0] = np.inf  # no number somewhere
        points = [point(str(k), 0.0, cost[k], error[k]) for k in range(25)]
        kept = [int(name) for name in front(points, "online", None, 0.0).methods]
        for k in range(25):
            no_worse = (cost <= cost[k]) & (error <= error[k])
            beaten = (no_worse & ((cost < cost[k]) | (error < error[k]))).any()
            if k in kept:
                assert not beaten
            else:
                equal = [j for j in kept if cost[j] == cost[k] and error[j] == error[k]]
                assert beaten or equal or k == 0
        assert list(error[kept]) == sorted(error[kept])
        assert 0 not in kept


def test_a_front_counts_the_set_up_or_leaves_it_out_and_nothing_below_the_floor_wins() -> None:
    assert front(POINTS, "few", 2.0, 0.0).methods == ("exact", "rough")
    assert front(POINTS, "many", 1e4, 0.0).methods == ("exact", "good", "rough")
    assert front(POINTS, "online", None, 0.0).methods == ("exact", "good", "rough")
    assert front(POINTS, "many", 1e4, 1e-5).methods == ("good", "rough")


def test_nothing_is_advised_below_round_off() -> None:
    found = advised(POINTS, 1e-7, 2e-7)
    assert (found.key, found.is_below_round_off) == (None, True)
    assert "round-off moves even exact solves by 2.0e-07" in found.words


def test_advice_is_a_sentence_that_names_the_lowest_order_and_not_the_quickest_method() -> None:
    exact = replace(POINTS[0], family="exact")
    orders = [point(f"Taylor {k}", 0.0, t, 10.0 ** (2 - k), key=f"order: {k}")
              for k, t in ((1, 1e-9), (2, 3e-7), (3, 2e-7))]  # fmt: skip
    found = advised([exact, *POINTS[1:], *orders], 1e-2)
    assert found.words == (
        "write `order: 2` under `expansion`: 1 % off at worst, 300 ns a sample (an exact solve "
        "takes 1 ms)"
    )
    assert (found.key, found.method, found.sample_s) == ("order: 2", "Taylor 2", 3e-7)
    none = advised([exact, *orders], 1e-6)
    assert (none.key, none.method) == (None, None)
    assert none.words == (
        "write `method: sequential` under `assignment`, which needs no expansion: no order that "
        "was charted is within 0.0001 % of exact, the nearest is 0.1 % off at worst"
    )


def test_a_reason_that_many_methods_share_is_said_once_with_their_names() -> None:
    skipped = {"Taylor 1": "too slow", "reduced": "no basis", "Taylor 2": "too slow"}
    assert list(skipped_notes(skipped)) == [
        "Taylor 1, Taylor 2 have no answer: too slow",
        "reduced has no answer: no basis",
    ]


# --- Times


@pytest.fixture
def cost(monkeypatch: pytest.MonkeyPatch) -> Any:
    """A clock that advances by what is run: a job of given costs."""
    now = [0.0]
    monkeypatch.setattr(time, "process_time", lambda: now[0])

    def job(costs: Iterator[float]) -> str:
        now[0] += next(costs)
        return "done"

    return job


def test_the_first_run_warms_up_and_a_long_one_is_not_repeated(cost: Any) -> None:
    costs = iter([0.5, 3.0, 1.0, 2.0])
    effort = Effort(repeats=3, repeat_s=10.0)
    result, spent = measure(lambda: cost(costs), effort)
    assert result == "done"
    assert (spent.median_s, spent.low_s, spent.high_s, spent.repeats) == (2.0, 1.5, 2.5, 3)
    _, spent = measure(lambda: cost(iter([7.0])), Effort(repeat_s=5.0))
    assert (spent.median_s, spent.repeats) == (7.0, 0)


def test_no_run_is_begun_after_the_time_for_repeats(cost: Any) -> None:
    costs = iter([0.5, 0.3, 0.1, 0.2, 9.0])
    _, spent = measure(lambda: cost(costs), Effort(repeats=15, repeat_s=1.0))
    assert (spent.median_s, spent.repeats) == (pytest.approx(0.2), 3)
    assert next(costs) == 9.0


def test_the_machine_is_described_without_names_of_host_or_paths() -> None:
    found = machine()
    assert {"Python", "NumPy", "SciPy", "eigassign"} == set(found["versions"])
    assert found["cores"] >= 1
    assert found["processor"]
    assert "/" not in found["system"]


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(2.5, "2.5 s"), (2.5e-3, "2.5 ms"), (2.5e-6, "2.5 µs"), (2e-8, "20 ns"), (0, "0")],
)
def test_times_are_written_with_a_fitting_unit(seconds: float, text: str) -> None:
    assert time_in_words(seconds) == text
