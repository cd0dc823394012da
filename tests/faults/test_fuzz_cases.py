"""Whatever a case file holds: an answer, or an error with its place."""

import copy
import math
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import pytest
from fuzz import checked, optimized
from fuzz_mutations import shipped, written
from fuzz_worker import Outcome, Worker

# What fuzzing has found and was mended since: a shipped case, the keys of a value, and another one
FOUND: list[tuple[str, tuple[str | int, ...], Any]] = [
    ("two_link.yaml", ("mechanism", "links", "upper_arm", "length"), "1e150"),
    ("two_link.yaml", ("mechanism", "links", "upper_arm", "length"), "1e-308"),
    ("two_link.yaml", ("mechanism", "materials", "aluminium", "density"), "1e-308"),
    ("two_link.yaml", ("mechanism", "materials", "aluminium", "youngs_modulus"), "1e-300"),
    ("arm_3r.yaml", ("mechanism", "sections", "tube", "outer_diameter"), "1e308"),
    ("arm_3r.yaml", ("mechanism", "joints", "shoulder", "orientation", 1), "2.2e-308 deg"),
    ("arm_3r.yaml", ("mechanism", "joints", "shoulder", "axis", 1), "-5e-324"),
    (
        "palletiser.yaml",
        ("trajectory",),
        {"q": [["126 deg", "68 deg"], ["1", "1"]], "duration": "1"},
    ),
]


@pytest.fixture(scope="module")
def worker() -> Iterator[Worker]:
    with Worker() as running:
        yield running


def require_no_fault(outcome: Outcome) -> None:
    faults = outcome.faults()
    assert not faults, f"{faults}\n{outcome.err}\n{outcome.text}"


def test_case_files_that_nobody_wrote_are_refused_or_right(worker: Worker) -> None:
    for outcome in islice(checked(worker, 1), 20):
        require_no_fault(outcome)


def test_right_case_files_that_nobody_wrote_are_optimised_or_refused(worker: Worker) -> None:
    for outcome in islice(optimized(worker, 1), 1):
        require_no_fault(outcome)


@pytest.mark.slow
def test_many_case_files_that_nobody_wrote_are_refused_or_right(worker: Worker) -> None:
    for outcome in islice(checked(worker, 2), 2000):
        require_no_fault(outcome)
    for outcome in islice(optimized(worker, 2), 20):
        require_no_fault(outcome)


@pytest.mark.parametrize("found", FOUND, ids=[f"{name}-{keys[-1]}" for name, keys, _ in FOUND])
def test_what_was_found_is_refused_at_its_place(
    found: tuple[str, tuple[str | int, ...], Any], worker: Worker
) -> None:
    name, keys, value = found
    tree = copy.deepcopy(shipped()[name])
    inner = tree
    for key in keys[:-1]:
        inner = inner[key]
    inner[keys[-1]] = value
    outcome = worker.run("check", written(tree))
    assert outcome.code == 2
    require_no_fault(outcome)


def test_a_shipped_case_is_right_as_it_is_written_here(worker: Worker) -> None:
    outcome = worker.run("check", written(shipped()["two_link.yaml"]))
    assert outcome.code == 0, outcome.err
    require_no_fault(outcome)


@pytest.mark.parametrize(
    ("ended", "fault"),
    [
        ({"code": 4}, "exit code 4"),
        ({"code": -11}, "exit code -11"),
        ({"code": 3, "err": "eigassign: error: out of memory"}, "out of memory"),
        ({"err": "x.py:3: RuntimeWarning: overflow"}, "a message of Python's"),
        ({"err": "Traceback (most recent call last)"}, "a message of Python's"),
        ({"code": 2, "err": "eigassign: error: no"}, "refused without a place in the file"),
        ({"out": "case.yaml: nan\n  mass nan kg"}, "a result that is no number"),
        ({"seconds": 10.5}, "10 s"),
        ({"megabytes": 1500.0}, "1500 MB"),
    ],
)
def test_what_may_not_happen_is_called_a_fault(ended: dict[str, Any], fault: str) -> None:
    fine = {"code": 0, "out": "case.yaml: Title of nan\n", "err": "", "seconds": 0, "megabytes": 0}
    assert Outcome("check", "", **fine).faults() == []
    assert Outcome("check", "", **{**fine, **ended}).faults() == [fault]


def test_a_planar_taper_with_shear_has_no_bending_out_of_the_plane(worker: Worker) -> None:
    tree = shipped()["two_link.yaml"]
    section = {"start": "rod", "end": "rod"}
    tree["mechanism"]["links"]["forearm"] |= {"section": section, "shear": "true"}
    tree["mechanism"]["materials"]["aluminium"]["poissons_ratio"] = "0.3"
    outcome = worker.run("check", written(tree))
    assert outcome.code == 0, outcome.err
    require_no_fault(outcome)


@pytest.mark.slow  # starts another process
def test_a_case_that_ends_the_process_is_seen_and_the_next_one_runs(
    worker: Worker, monkeypatch: pytest.MonkeyPatch
) -> None:
    tree = shipped()["two_link.yaml"]
    tree["expansion"]["order"] = "nonsense"
    ended = worker.ran(("check", "case.yaml"), Path("/nowhere"))
    assert ended.code != 0
    assert math.isnan(ended.seconds)
    assert worker.run("check", written(tree)).code == 2
