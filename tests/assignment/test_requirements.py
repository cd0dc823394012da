"""What targets ask for, at the samples of the trajectories."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from small_case import TEXT

from eigassign.assignment import (
    Requirement,
    followed_modes,
    named_design,
    named_pose,
    requirements_of,
)
from eigassign.case import load
from eigassign.errors import CaseError
from eigassign.mechanism import NamedTrajectory, Trajectories, Trajectory

MOTION = TEXT[TEXT.index("trajectory:\n") : TEXT.index("design:\n")]
SEVERAL = "trajectory:\n  - {name: a, file: a.csv}\n  - {name: b, file: b.csv}\n"
TARGETS = TEXT[TEXT.index("targets:\n") : TEXT.index("validation:")]
T_A, T_B = np.linspace(0.0, 1.0, 11), np.linspace(2.0, 3.0, 6)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, time in (("a", T_A), ("b", T_B)):
        rows = "".join(f"{t},{t},{2 * t}\n" for t in time)
        (tmp_path / f"{name}.csv").write_text("time,q1,q2\n" + rows)
    (tmp_path / "f.csv").write_text("frequency [kHz],time [ms]\n0.1,0\n0.4,3000\n")
    return tmp_path


@pytest.fixture
def path() -> Trajectories:
    parts = [
        NamedTrajectory(name, Trajectory(time, np.column_stack([time, 2 * time]), None))
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
    (moving,) = wanted("{keep_out: {harmonic: 2, of: {file: f.csv}, margin: 10 %}, trajectory: b}")
    f = 100.0 + 100.0 * T_B  # the file: 100 Hz at 0 s, 400 Hz at 3 s
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
    (one,) = wanted("{mode: 1, frequency: {file: f.csv}, trajectory: b, during: [2.4, 2.8]}")
    assert one.rows == slice(13, 16)  # 2.4, 2.6 and 2.8 s, of 11 + 6 samples
    np.testing.assert_allclose(one.hz, [340.0, 360.0, 380.0], rtol=1e-14)


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
        (
            "{mode: 1, at_least: {file: a.csv}}",
            "targets[0].at_least.file: a.csv:1: no column frequency",
        ),
    ],
)
def test_what_cannot_be_sampled_is_named(wanted: Read, target: str, message: str) -> None:
    with pytest.raises(CaseError) as caught:
        wanted(target)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("pose", "design", "q", "y"),
    [
        ("{time: 0.25 s, trajectory: a}", "{}", (0.25, 0.5), (0.1, 0.03, 0.04, 0.002)),
        ("{time: 3, trajectory: b}", "{m: 20 g}", (3.0, 6.0), (0.02, 0.03, 0.04, 0.002)),
        ("{q: [1, 2]}", "{pipe: thin, d: 2 cm}", (1.0, 2.0), (0.1, 0.02, 0.05, 0.001)),
    ],
)
def test_a_followed_mode_is_named_at_a_pose_and_design(
    folder: Path,
    path: Trajectories,
    pose: str,
    design: str,
    q: tuple[float, ...],
    y: tuple[float, ...],
) -> None:
    pipe = "sections.pipe.outer_diameter: {} mm, sections.pipe.thickness: {} mm"
    choices = f"thick: {{{pipe.format(40, 2)}}}, thin: {{{pipe.format(50, 1)}}}"
    target = f"{{mode: {{like: 2, at: {pose}, design: {design}}}, frequency: 9}}"
    text = TEXT.replace(MOTION, SEVERAL).replace(TARGETS, f"targets:\n  - {target}\n")
    text = text.replace("  constraints:\n", f"  pipe: {{choices: {{{choices}}}}}\n  constraints:\n")
    (folder / "case.yaml").write_text(text)
    file = load(folder / "case.yaml")
    (followed,) = followed_modes(file)
    named = named_design(file, followed)
    np.testing.assert_allclose(named, y, rtol=1e-14)
    for some in (path, path.chosen([0, 10, 11])):  # the pose is one of the whole trajectory
        found = named_pose(file, followed, some, named)
        np.testing.assert_allclose(found, q, rtol=1e-14)
    (one,) = requirements_of(file, path)
    assert (one.followed, one.modes, one.terms) == (followed, (), ((-1, 1.0),))
