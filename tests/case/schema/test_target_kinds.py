# ruff: noqa: E501  (a table)
"""Every kind of target is read in Hz, comes to requirements by mode, and is written out again."""

import math

import numpy as np
import pytest
from json_schema_reader import reads_back
from small_case import TEXT, edited, read

from eigassign.assignment import Requirement, requirements_of
from eigassign.case import CaseFile
from eigassign.errors import CaseError
from eigassign.mechanism import NamedTrajectory, Trajectories, Trajectory

T = "  - {mode: 1, frequency: 190 Hz}\n"
KINDS = {
    "several modes": "{modes: [1, 3], frequency: 0.19 kHz, weight: 2}",
    "at least": "{mode: 2, at_least: 320 Hz, during: [200 ms, 0.5]}",
    "every mode at least": "{modes: all, at_least: 20}",
    "at most, in time": "{mode: 2, at_most: {time: [0, 1], frequency: [300, 400 Hz]}}",
    "band": "{keep_out: [48 Hz, 52 Hz]}",
    "band of some": "{modes: [1, 2], keep_out: [48, 52]}",
    "band of one": "{mode: 2, keep_out: [48, 52]}",
    "harmonic": "{keep_out: {harmonic: 2, of: 25 Hz, margin: 5 %}}",
    "harmonic in time": "{keep_out: {harmonic: 0.5, of: {time: [0, 1], frequency: [9, 10]}, margin: 0.1}}",
    "gap": "{gap: {between: [1, 3], at_least: 20 Hz}}",
    "followed from a time": "{mode: {like: 2, at: {time: 0.2 s}}, frequency: 20}",
    "followed from a pose": "{mode: {like: 2, at: {q: [10 deg, 1]}}, at_least: 20}",
}  # fmt: skip
ASSIGNMENTS = (
    "{}",
    "{method: one_shot}",
    "{objective: worst_case, starts: 3, steps: 20, seconds: 1 min, max_error: 1 %}",
)


def with_target(*targets: str) -> CaseFile:
    return read(edited(T, "".join(f"  - {t}\n" for t in targets)))


def asked(*targets: str) -> tuple[Requirement, ...]:
    motion = Trajectory(np.linspace(0.0, 1.0, 11), np.zeros((11, 2)))
    path = Trajectories((NamedTrajectory("1", motion),))
    return requirements_of(with_target(*targets), path)


@pytest.mark.parametrize("target", KINDS.values(), ids=KINDS)
def test_every_kind_reads_back_equal_and_is_described_by_the_schema(target: str) -> None:
    assert reads_back(edited(T, f"  - {target}\n")).warnings == ()


@pytest.mark.parametrize(
    ("target", "requirements"),
    [
        ("several modes", [("frequency", (1,)), ("frequency", (3,))]),
        ("every mode at least", [("at_least", (1,))]),
        ("band", [("keep_out", ())]),
        ("band of some", [("keep_out", (1, 2))]),
        ("band of one", [("keep_out", (2,))]),
        ("gap", [("gap", (1, 3))]),
        ("followed from a time", [("frequency", ())]),
    ],
)
def test_a_target_comes_to_one_requirement_for_each_mode(
    target: str, requirements: list[tuple[str, tuple[int, ...]]]
) -> None:
    found = asked("{mode: 4, frequency: 500}", KINDS[target])
    assert [(each.place, each.kind, each.modes) for each in found] == [
        ("targets[0]", "frequency", (4,)),
        *(("targets[1]", kind, modes) for kind, modes in requirements),
    ]


def test_the_first_harmonic_is_called_by_its_frequency() -> None:
    target = "{keep_out: {harmonic: 1, of: 48 Hz, margin: 10 %}}"
    assert asked(target)[0].label == "every mode clear of 48 Hz ± 10 %"


def test_requirements_are_called_by_what_they_ask_for() -> None:
    assert [each.label for each in asked(*KINDS.values())] == [
        "mode 1 at 0.19 kHz",
        "mode 3 at 0.19 kHz",
        "mode 2 at least 320 Hz from 0.2 to 0.5 s",
        "mode 1 at least 20 Hz",
        "mode 2 at most its profile",
        "every mode clear of 48 … 52 Hz",
        "modes 1 and 2 clear of 48 … 52 Hz",
        "mode 2 clear of 48 … 52 Hz",
        "every mode clear of 2 × 25 Hz ± 5 %",
        "every mode clear of 0.5 × 9 … 10 Hz ± 10 %",
        "modes 1 and 3 at least 20 Hz apart",
        "the mode like mode 2 (t = 0.2 s) at 20 Hz",
        "the mode like mode 2 (q = 10 deg 1) at least 20 Hz",
    ]


def test_values_are_read_in_si() -> None:
    harmonic, from_time, from_pose = (
        with_target(KINDS[kind]).targets[0]
        for kind in ("harmonic in time", "followed from a time", "followed from a pose")
    )
    band, followed = harmonic.keep_out, from_time.mode
    assert (band.harmonic, band.margin) == (0.5, 0.1)
    assert (band.of.time, band.of.frequency) == ((0, 1), (9, 10))
    assert (followed.like, followed.at.time) == (2, 0.2)
    assert from_pose.mode.at.q == (math.radians(10), 1.0)


@pytest.mark.parametrize("given", ASSIGNMENTS)
def test_assignments_read_back_equal_and_are_described_by_the_schema(given: str) -> None:
    reads_back(TEXT + f"assignment: {given}\n")


def test_the_assignment_has_defaults() -> None:
    keys = read(TEXT).assignment
    assert (keys.method, keys.objective, keys.starts) == ("sequential", "least_squares", "auto")
    assert (keys.steps, keys.seconds, keys.max_error) == (100, None, None)
    given = read(TEXT + f"assignment: {ASSIGNMENTS[2]}\n").assignment
    assert (given.starts, given.seconds, given.max_error) == (3, 60.0, 0.01)


def test_a_mode_may_have_limits_beside_its_frequency_and_frequencies_one_after_the_other() -> None:
    with_target("{mode: 1, frequency: 9}", "{mode: 1, at_least: 8}", "{mode: 1, at_most: 10}")
    with_target(
        "{mode: 1, frequency: 9, during: [0, 0.5]}", "{mode: 1, frequency: 8, during: [0.5, 1]}"
    )


def test_a_profile_covers_only_the_part_that_is_wanted() -> None:
    with_target("{mode: 1, at_least: {time: [0, 0.5], frequency: [1, 2]}, during: [0.1, 0.4]}")


def test_targets_may_be_on_modes_that_the_file_does_not_expand() -> None:
    case = with_target("{mode: 3, frequency: 300}")
    assert case.expansion.modes == (1, 2)


def test_a_band_written_with_min_and_max_is_told_how_to_write_it():
    with pytest.raises(CaseError, match=r"with its two edges, as \[40 Hz, 50 Hz\]") as raised:
        with_target("{keep_out: {min: 48 Hz, max: 52 Hz}}")
    assert len(raised.value.problems) == 1
