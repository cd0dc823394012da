from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from run_cases import SHIPPED, automatic, chain, shipped, without, written

from eigassign.errors import CaseError, UsageError
from eigassign.pipeline import check, modes


def test_modes_are_taken_where_the_case_says_unless_asked_elsewhere() -> None:
    answer = modes(SHIPPED)
    assert answer.q == (("q1", 1.817), ("q2", 5.312))
    assert answer.y == (("m1", 0.0), ("m2", 0.0))
    assert modes(SHIPPED, [1.817, 5.312], [0.0, 0.0]) == answer


def test_without_an_expansion_point_the_trajectory_starts_the_pose(tmp_path: Path) -> None:
    answer = modes(written(tmp_path, chain(2)))
    assert answer.q == (("q0", 0.3), ("q1", 0.5))
    assert answer.y == (("m0", 0.05), ("m1", 0.05))


def test_without_any_pose_one_is_asked_for(tmp_path: Path) -> None:
    path = written(tmp_path, without(chain(2), "trajectory", "targets"))
    with pytest.raises(UsageError, match="give a value for q0, q1"):
        modes(path)
    assert len(modes(path, [0.1, 0.2]).frequencies_hz) == 3


@pytest.mark.parametrize(
    ("q", "y", "count", "message"),
    [
        ([1.0], None, 3, "q has 1 values"),
        (None, [1.0], 3, "y has 1 values"),
        ([1.0, float("nan")], None, 3, "q must be finite"),
        (None, None, 0, "1 to 21"),
        (None, None, 22, "1 to 21"),
        ("1 deg", None, 3, "expected 2"),
    ],
)
def test_questions_that_make_no_sense_are_refused(
    q: list[float] | str | None, y: list[float] | None, count: int, message: str
) -> None:
    with pytest.raises(UsageError, match=message):
        modes(SHIPPED, q, y, count)


def test_modes_state_what_round_off_leaves(tmp_path: Path) -> None:
    answers = []
    for factor in (1.0, 7.3, 0.61, 23.7):  # of stiffness and mass: no frequency changes
        text = shipped(
            ("69 GPa", f"{69e9 * factor}"),
            ("2690.007033", f"{2690.007033 * factor}"),
            ("elements: 4", "elements: 60"),
            ("joint: shoulder}", f"joint: shoulder, drive: {{stiffness: {1e15 * factor}}}}}"),
        )
        answers.append(modes(written(tmp_path, text)))
    hz = np.array([answer.frequencies_hz for answer in answers])
    assert 1e-10 < (np.ptp(hz, axis=0) / hz[0]).max() < answers[0].round_off < 1e-2


def test_check_says_what_the_case_amounts_to() -> None:
    answer = check(SHIPPED)
    assert (answer.n_dof, answer.n_rigid, answer.samples, answer.duration_s) == (23, 2, 152, 1.0)
    assert (answer.q_names, answer.y_names, answer.targets) == (("q1", "q2"), ("m1", "m2"), 1)
    assert answer.warnings == ()


def test_check_follows_the_trajectory(tmp_path: Path) -> None:
    path = written(tmp_path, shipped(("[-0.01, 0.19]", "[-2, 0.19]")))
    with pytest.raises(CaseError, match="sample"):
        check(path)


def test_check_finds_a_mechanism_without_mass_at_its_line(tmp_path: Path) -> None:
    text = automatic(("density: 2690.007033", "density: 0"))
    with pytest.raises(CaseError, match=r"case.yaml:\d+:\d+: mechanism"):
        check(written(tmp_path, text))


def test_check_needs_neither_trajectory_nor_design_nor_targets(tmp_path: Path) -> None:
    text = without(chain(3), "trajectory", "design", "targets")
    answer = check(written(tmp_path, text))
    assert (answer.samples, answer.targets, answer.y_names) == (0, 0, ())


def test_check_passes_warnings_on(tmp_path: Path) -> None:
    text = shipped(("bending_inertia: 3.97e-8", "bending_inertia: 3.97e-4"))
    warned = [warning.path for warning in check(written(tmp_path, text)).warnings]
    assert "mechanism.sections.rod.bending_inertia" in warned


def test_modes_need_no_measurements_and_check_misses_them_at_their_line(tmp_path: Path) -> None:
    path = written(tmp_path, shipped() + "\nmeasurements: {file: lost.csv}\n")
    assert modes(path) == modes(SHIPPED)
    with pytest.raises(
        CaseError, match=r"measurements\.file: .*lost\.csv: cannot be read: No such"
    ):
        check(path)
