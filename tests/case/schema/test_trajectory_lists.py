# ruff: noqa: E501  (a table)
"""`trajectory:` as a list: read, resolved, and every mistake at its own line and column."""

import json
from pathlib import Path

import pytest
from json_schema_reader import reads_back
from mistakes import told_once
from small_case import MOTION, TEXT, edited, read

from eigassign.errors import CaseError

LIST = """\
  - {name: pick, tip: hand.end, waypoints: [[0.3, 0.1], [0.2, 0.2]], branch: {elbow: [10 deg, 170 deg]}}
  - {q: [[0, 90 deg], [1, 2]], time: [1 s, 3 s], weight: 2.5}
"""
TARGETS = "  - {mode: 1, frequency: 190 Hz}\n"


def listed(*changes: tuple[str, str], targets: str = TARGETS) -> str:
    text = edited(MOTION, LIST).replace(TARGETS, targets)
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return text


def test_a_list_is_read_in_order_with_names_and_weights() -> None:
    file = read(listed())
    (path1, name1, first), (path2, name2, second) = file.trajectories
    assert (path1, name1, path2, name2) == ("trajectory[0]", "pick", "trajectory[1]", "2")
    assert (first.tip, first.weight) == ("hand.end", 1.0)
    assert (second.weight, second.time) == (2.5, (1.0, 3.0))


def test_a_mapping_stays_what_it_was_and_is_called_1() -> None:
    file = read(TEXT)
    assert file.trajectory.tip == "hand.end"
    assert [(path, name) for path, name, _ in file.trajectories] == [("trajectory", "1")]


def test_a_list_resolves_to_itself_in_lines_short_enough_to_read() -> None:
    targets = "  - {mode: 1, frequency: 190 Hz, trajectory: pick}\n"
    file = reads_back(listed(targets=targets))
    assert max(map(len, file.resolved().splitlines())) <= 90


def test_a_mode_may_have_a_target_of_its_own_on_each_trajectory() -> None:
    targets = "".join(
        f"  - {{mode: 1, frequency: 190 Hz, trajectory: {n}}}\n" for n in ("pick", '"2"')
    )
    assert [t.trajectory for t in read(listed(targets=targets)).targets] == ["pick", "2"]


MISTAKES = Path(__file__).with_name("wrong_trajectory_lists.json")
WRONG = json.loads(MISTAKES.read_text("utf-8"))


@pytest.mark.parametrize("name", WRONG)
def test_a_mistake_is_told_at_its_place(name: str, tmp_path: Path) -> None:
    change, path, message = WRONG[name]
    found, told = told_once(listed(change), tmp_path / "case.yaml")
    assert found == path
    assert message in told


def test_a_profile_need_only_reach_over_the_trajectory_it_is_for() -> None:
    profile = "  - {mode: 1, trajectory: pick, frequency: {time: [0, 1], frequency: [190, 180]}}\n"
    assert read(listed(targets=profile)).targets[0].trajectory == "pick"


def test_angles_meant_in_degrees_are_warned_of_in_any_trajectory() -> None:
    (warning,) = read(listed(("[1, 2]]", "[1, 200]]"))).warnings
    assert warning.path == "trajectory[1].q"


def test_no_coordinate_is_called_time_for_that_is_a_column() -> None:
    text = edited("q1: {joint: shoulder}", "time: {joint: shoulder}")
    with pytest.raises(CaseError, match="heads a column of its own"):
        read(text)


def test_a_branch_of_a_passive_joint_is_refused_and_the_driven_ones_named() -> None:
    text = Path(__file__).parents[3].joinpath("cases/five_bar.yaml").read_text(encoding="utf-8")
    head, rest = text.split("trajectory:\n")
    path = "  tip: left_arm.end\n  waypoints: [[0.1, 0.3], [0.12, 0.3]]\n"
    path += "  branch: {left_elbow: [0, 1]}\n\n"
    rest = rest[rest.index("design:") :]
    with pytest.raises(CaseError, match=r"no coordinate moves this joint, .*left_motor") as caught:
        read(f"{head}trajectory:\n{path}{rest}")
    assert [p.path for p in caught.value.problems] == ["trajectory.branch.left_elbow"]
