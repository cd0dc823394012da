"""What targets ask for, at the samples of the trajectories."""

import itertools
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from small_case import TEXT

from eigassign.assignment import (
    Frequencies,
    Requirement,
    Requirements,
    Solved,
    followed_modes,
    requirements_of,
)
from eigassign.case import load
from eigassign.errors import CaseError, UsageError
from eigassign.mechanism import NamedTrajectory, Trajectories, Trajectory
from eigassign.study import named_pose

MOTION = TEXT[TEXT.index("trajectory:\n") : TEXT.index("design:\n")]
RISING = "{time: [0, 3], frequency: [100, 0.4 kHz]}"
SEVERAL = "trajectory:\n  - {name: a, file: a.csv}\n  - {name: b, file: b.csv}\n"
TARGETS = TEXT[TEXT.index("targets:\n") : TEXT.index("validation:")]
T_A, T_B = np.linspace(0.0, 1.0, 11), np.linspace(2.0, 3.0, 6)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, time in (("a", T_A), ("b", T_B)):
        rows = "".join(f"{t},{t},{2 * t}\n" for t in time)
        (tmp_path / f"{name}.csv").write_text("time,q1,q2\n" + rows)
    return tmp_path


@pytest.fixture
def path() -> Trajectories:
    parts = [
        NamedTrajectory(name, Trajectory(time, np.column_stack([time, 2 * time])))
        for name, time in (("a", T_A), ("b", T_B))
    ]
    return Trajectories(tuple(parts))


@pytest.fixture
def wanted(folder: Path, path: Trajectories) -> Callable[[str], tuple[Requirement, ...]]:
    def read(target: str) -> tuple[Requirement, ...]:
        text = TEXT.replace(MOTION, SEVERAL).replace(TARGETS, f"targets:\n  - {target}\n")
        (folder / "case.yaml").write_text(text)
        return requirements_of(load(folder / "case.yaml"), path)

    return read


Read = Callable[[str], tuple[Requirement, ...]]


def test_a_kind_that_has_no_words_is_refused(path: Trajectories) -> None:
    fields = {"during": None, "trajectory": None, "frequencies": ()}
    file: Any = SimpleNamespace(
        asked=[("targets[0]", SimpleNamespace(kind="at_least", **fields))], targets=()
    )
    with pytest.raises(UsageError, match="at_least: its words"):
        requirements_of(file, path)


def test_a_frequency_is_both_limits_and_a_limit_is_one(wanted: Read) -> None:
    for key, low, high in (
        ("frequency", 9.0, 9.0),
        ("at_least", 9.0, np.inf),
        ("at_most", -np.inf, 9.0),
    ):
        (one,) = wanted(f"{{mode: 2, {key}: 9 Hz, weight: 3}}")
        assert (one.modes, one.terms, one.weight, one.rows) == (
            (2,),
            ((2, 1.0),),
            3.0,
            slice(0, 17),
        )
        np.testing.assert_array_equal(one.lower, np.full(17, low))
        np.testing.assert_array_equal(one.upper, np.full(17, high))


def test_each_mode_of_a_list_is_wanted(wanted: Read) -> None:
    assert [one.mode for one in wanted("{modes: [3, 1], at_least: 9}")] == [3, 1]


def test_a_band_lies_between_its_edges_and_follows_the_harmonic(wanted: Read) -> None:
    (fixed,) = wanted("{keep_out: [48, 52]}")
    assert set(fixed.lower) == {48.0}
    assert set(fixed.upper) == {52.0}
    (moving,) = wanted(f"{{keep_out: {{harmonic: 2, of: {RISING}, margin: 10 %}}, trajectory: b}}")
    f = 100.0 + 100.0 * T_B
    np.testing.assert_allclose(moving.lower, 0.9 * 2 * f, rtol=1e-14)
    np.testing.assert_allclose(moving.upper, 1.1 * 2 * f, rtol=1e-14)


def test_a_gap_is_a_width(wanted: Read) -> None:
    (gap,) = wanted("{gap: {between: [1, 2], at_least: 20 Hz}}")
    assert (gap.modes, gap.terms) == ((1, 2), ((2, 1.0), (1, -1.0)))
    assert set(gap.lower) == {20.0}


def test_each_trajectory_takes_a_profile_by_its_own_time(wanted: Read) -> None:
    (one,) = wanted("{mode: 1, frequency: {time: [0, 3], frequency: [100, 400]}}")
    np.testing.assert_allclose(one.hz, 100.0 + 100.0 * np.append(T_A, T_B), rtol=1e-14)


def test_a_part_of_a_trajectory_has_its_samples_only(wanted: Read) -> None:
    (one,) = wanted(f"{{mode: 1, frequency: {RISING}, trajectory: b, during: [2.4, 2.8]}}")
    assert one.rows == slice(13, 16)  # 2.4, 2.6 and 2.8 s, of 11 + 6 samples
    np.testing.assert_allclose(one.hz, [340.0, 360.0, 380.0], rtol=1e-14)


def solved(hz: np.ndarray) -> Solved:
    return Solved(hz, np.zeros((len(hz), 0)), np.zeros((len(hz), 0), dtype=np.intp))


@pytest.mark.parametrize(
    ("target", "is_met"),
    [
        ("{mode: 2, frequency: 205}", False),
        ("{mode: 2, at_least: 205}", False),
        ("{mode: 2, at_least: 150}", True),
        ("{mode: 2, at_most: 195}", False),
        ("{gap: {between: [1, 2], at_least: 110}}", False),
        ("{gap: {between: [1, 2], at_least: 50}}", True),
        ("{keep_out: [105, 160]}", False),
        ("{keep_out: [140, 210]}", False),
        ("{keep_out: [140, 160]}", True),
        ("{modes: [2, 3], keep_out: [90, 210]}", False),
    ],
)
def test_errors_of_frequencies_that_lie_between_two_are_those_of_the_worst_and_the_best(
    wanted: Read, target: str, is_met: bool
) -> None:
    """Each of three modes may lie anywhere between two curves: against all their corners."""
    (one,) = wanted(target)
    rng = np.random.default_rng(4)
    lowest = np.array([100.0, 200.0, 300.0]) * rng.uniform(0.99, 1.01, (17, 3))
    highest = lowest * rng.uniform(1.0, 1.1, (17, 3))
    corners = [np.where(high, highest, lowest) for high in itertools.product([0, 1], repeat=3)]
    inside = [lowest + rng.random((17, 3)) * (highest - lowest) for _ in range(20)]
    worst, best = (
        one.worst_errors(solved(lowest), solved(highest)),
        one.least_errors(solved(lowest), solved(highest)),
    )
    at_corners = np.abs([one.errors(solved(hz)) for hz in corners])
    assert worst.max() == pytest.approx(at_corners.max(), rel=1e-12)
    assert bool(worst.max() == 0.0) is is_met
    for errors in np.abs([*at_corners, *(one.errors(solved(hz)) for hz in inside)]):
        assert (best <= errors + 1e-15).all()
        assert errors.max() <= worst.max() + 1e-15
    least, most = one.curve_range(solved(lowest), solved(highest))
    curves = np.array([one.curve(solved(hz)) for hz in (*corners, *inside)])
    if "keep_out" not in target:
        np.testing.assert_allclose([least, most], [curves.min(axis=0), curves.max(axis=0)])
    assert (curves >= least - 1e-9).all()
    assert (curves <= most + 1e-9).all()
    assert np.array_equal(*one.curve_range(solved(lowest), solved(lowest)))


def test_a_band_is_missed_by_the_best_number_of_modes_below_it(wanted: Read) -> None:
    """Mode 2 rises from 200 to 210 Hz: k is 2 where it is nearer to the lower edge, else 1."""
    hz = np.column_stack([np.full(17, 100.0), np.linspace(200.0, 210.0, 17), np.full(17, 300.0)])
    for low, high, error in ((205.0, 230.0, 210.0 / 205.0 - 1.0), (180.0, 208.0, 1.0 - 200 / 208)):
        (one,) = wanted(f"{{keep_out: [{low}, {high}]}}")
        assert one.errors(solved(hz)).max() == pytest.approx(error, rel=1e-12)
        assert one.below(solved(hz)).tolist() == [
            [1 + (f < edge) for f in hz[:, 1]] for edge in (low, high)
        ]


def test_modes_near_a_band_and_on_either_side_of_it_are_shown_with_it(wanted: Read) -> None:
    (one,) = wanted("{keep_out: [140, 160]}")
    far = np.tile([20.0, 30.0, 700.0, 900.0], (17, 1))
    assert one.near(solved(far), solved(far)) == (2, 3)
    assert one.near(solved(np.where(far == 20.0, 150.0, far)), solved(far)) == (1, 2, 3)
    assert one.near(solved(far), solved(10.0 * far)) == (1,)
    assert one.near(solved(far), solved(0.1 * far)) == (4,)


@pytest.mark.parametrize(
    ("target", "message"),
    [
        (
            "{mode: 1, at_least: 9, trajectory: a, during: [0.41, 0.45]}",
            "targets[0].during: no sample of the trajectory is between 0.41 and 0.45 s",
        ),
        (
            "{mode: 1, at_least: {time: [0, 1], frequency: [1, 2]}}",
            "targets[0].at_least: target time: 0 … 1 s does not cover the trajectory's 2 … 3 s "
            "(trajectory 'b')",
        ),
    ],
)
def test_what_cannot_be_sampled_is_named(wanted: Read, target: str, message: str) -> None:
    with pytest.raises(CaseError) as caught:
        wanted(target)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("pose", "q"),
    [
        ("{time: 0.25 s, trajectory: a}", (0.25, 0.5)),
        ("{time: 3, trajectory: b}", (3.0, 6.0)),
        ("{q: [1, 2]}", (1.0, 2.0)),
    ],
)
def test_a_followed_mode_is_named_at_a_pose(
    folder: Path, path: Trajectories, pose: str, q: tuple[float, ...]
) -> None:
    target = f"{{mode: {{like: 2, at: {pose}}}, frequency: 9}}"
    text = TEXT.replace(MOTION, SEVERAL).replace(TARGETS, f"targets:\n  - {target}\n")
    (folder / "case.yaml").write_text(text)
    file = load(folder / "case.yaml")
    (followed,) = followed_modes(file)
    for some in (path, path.chosen([0, 10, 11])):  # the pose is one of the whole trajectory
        found = named_pose(file, followed, some, np.array([0.1, 0.03]))
        np.testing.assert_allclose(found, q, rtol=1e-14)
    (one,) = requirements_of(file, path)
    assert (one.followed, one.modes, one.terms) == ((followed,), (), ((-1, 1.0),))


def test_a_difference_that_is_round_off_is_none(wanted: Read) -> None:
    """Of the design's own numbers and of frequencies; what is more than that stays."""
    rng = np.random.default_rng(0)
    y = 10.0 ** rng.uniform(-6, 12, 200)
    beside = y * (1.0 + rng.choice([-1, 1], 200) * np.finfo(float).eps)
    apart = y * (1.0 + 1e-14)
    (limit,) = wanted("{mode: 1, at_least: 50}")
    n = len(limit.lower)
    asked = Requirements((limit,), np.ones(n), least_change=(y, 1e-3 * y))
    hz = np.full((n, 1), 50.0 * (1.0 + np.finfo(float).eps))
    found = Frequencies(hz, np.zeros((n, 1, 200)))
    assert not asked.appraise(beside, found).residual.any()
    assert not asked.appraise(beside, found).excess.any()
    assert asked.appraise(apart, found).residual.all()


def test_speeds_of_rotation_are_frequencies(wanted: Read) -> None:
    (edges,) = wanted("{keep_out: [3000 rpm, 60 Hz]}")
    assert (edges.lower[0], edges.upper[0]) == (50.0, 60.0)
    for of, last in (
        ("3000 rpm", 50.0),
        ("{time: [0, 3], frequency: [3000 rpm, 100 Hz]}", 100.0),
    ):
        (one,) = wanted(f"{{keep_out: {{harmonic: 2, of: {of}, margin: 10 %}}}}")
        assert one.lower[0] == pytest.approx(90.0, rel=1e-12)
        assert one.upper[-1] == pytest.approx(2.2 * last, rel=1e-12)
    (limit,) = wanted("{mode: 1, at_least: 3000 rpm}")
    assert limit.lower[0] == 50.0
