"""Times are medians of repeats after a first run, taken in turns."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from eigassign.chart.timing import Patience, machine, measure, take_turns, time_in_words


class FakeClock:
    """Advances by the cost of what is run."""

    def __init__(self) -> None:
        self.now = 0.0
        self.order: list[str] = []

    def __call__(self) -> float:
        return self.now

    def job(self, name: str, costs: Iterator[float]) -> object:
        self.order.append(name)
        self.now += next(costs)
        return name


def test_the_first_run_warms_up_and_does_not_count() -> None:
    clock = FakeClock()
    costs = iter([0.5, 3.0, 1.0, 2.0])
    patience = Patience(rounds=3, seconds=0.0, long_s=10.0)
    result, spent = measure(lambda: clock.job("a", costs), patience, clock)
    assert result == "a"
    assert (spent.median_s, spent.low_s, spent.high_s, spent.repeats) == (2.0, 1.5, 2.5, 3)


def test_a_long_job_is_not_repeated_and_says_so() -> None:
    clock = FakeClock()
    _, spent = measure(lambda: clock.job("a", iter([7.0])), Patience(long_s=5.0), clock)
    assert (spent.median_s, spent.repeats) == (7.0, 0)


def test_jobs_take_turns() -> None:
    clock = FakeClock()
    a, b = iter([1.0] * 9), iter([2.0] * 9)
    jobs = [(lambda: clock.job("a", a), 1.0), (lambda: clock.job("b", b), 2.0)]
    spent = take_turns(jobs, Patience(rounds=3, seconds=0.0, long_s=10.0), clock)
    assert clock.order == ["a", "b"] * 3
    assert [s.median_s for s in spent] == [1.0, 2.0]


def test_within_a_round_a_short_job_is_repeated_and_its_quickest_run_counts() -> None:
    clock = FakeClock()
    costs = iter([0.5, 0.2, 0.5, 9.0])
    jobs = [(lambda: clock.job("a", costs), 0.5)]
    (spent,) = take_turns(jobs, Patience(rounds=1, seconds=1.0, long_s=10.0), clock)
    assert len(clock.order) == 3
    assert spent.median_s == pytest.approx(0.2)


def test_the_machine_is_described_without_names_of_host_or_paths() -> None:
    found = machine()
    assert {"Python", "NumPy", "SciPy", "eigassign"} == set(found.versions)
    assert found.cores >= 1
    assert found.processor
    assert "/" not in found.system


def test_a_processor_has_its_model_name(tmp_path: Path) -> None:
    file = tmp_path / "cpuinfo"
    file.write_text("processor: 0\nmodel name\t: Fast CPU @ 3 GHz\n")
    assert machine(file).processor == "Fast CPU @ 3 GHz"
    assert machine(tmp_path / "none").processor


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(2.5, "2.5 s"), (2.5e-3, "2.5 ms"), (2.5e-6, "2.5 µs"), (2e-8, "20 ns"), (0, "0")],
)
def test_times_are_written_with_a_fitting_unit(seconds: float, text: str) -> None:
    assert time_in_words(seconds) == text
