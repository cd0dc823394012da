# ruff: noqa: E501  (a table)
"""`trajectory:` as a list: read, resolved, and every mistake at its own line and column."""

from pathlib import Path

import pytest
from json_schema_reader import SCHEMA, accepts
from small_case import edited, unmarked

from eigassign.case import CaseFile, parse, read_yaml
from eigassign.errors import CaseError

ONE = (
    "  tip: hand.end\n  waypoints: [[0.3, 0.1], [0.2, 0.2]]\n  branch: {elbow: [10 deg, 170 deg]}\n"
)
LIST = """\
  - {name: pick, tip: hand.end, waypoints: [[0.3, 0.1], [0.2, 0.2]], branch: {elbow: [10 deg, 170 deg]}}
  - {q: [[0, 90 deg], [1, 2]], time: [1 s, 3 s], weight: 2.5}
"""
TARGETS = "  - {mode: 1, frequency: 190 Hz}\n"


def read(text: str) -> CaseFile:
    return parse(text.encode(), "case.yaml")


def listed(*changes: tuple[str, str], targets: str = TARGETS) -> str:
    text = edited(ONE, LIST).replace(TARGETS, targets)
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
    file = read(edited(ONE, ONE))
    assert file.trajectory.tip == "hand.end"
    assert [(path, name) for path, name, _ in file.trajectories] == [("trajectory", "1")]


def test_a_list_resolves_to_itself_in_lines_short_enough_to_read() -> None:
    targets = "  - {mode: 1, frequency: 190 Hz, trajectory: pick}\n"
    file = read(listed(targets=targets))
    again = read(file.resolved())
    assert again == file
    assert again.resolved() == file.resolved()
    assert max(map(len, file.resolved().splitlines())) <= 90


def test_the_schema_accepts_both_forms() -> None:
    for text in (listed(), edited(ONE, ONE)):
        assert accepts(SCHEMA, read_yaml(text.encode(), "x").tree)


def test_a_mode_may_have_a_target_of_its_own_on_each_trajectory() -> None:
    targets = "".join(
        f"  - {{mode: 1, frequency: 190 Hz, trajectory: {n}}}\n" for n in ("pick", '"2"')
    )
    assert [t.trajectory for t in read(listed(targets=targets)).targets] == ["pick", "2"]


WRONG = {
    "no trajectory in the list": (
        ("trajectory:\n" + LIST, "¦trajectory: []\n"),
        "trajectory",
        "needs at least 1 entries",
    ),
    "name with a slash": (("name: pick", "¦name: ../x"), "trajectory[0].name", "not a usable name"),
    "name that is a number": (("name: pick", "¦name: 7"), "trajectory[0].name", 'write "7"'),
    "the same name": (
        ("weight: 2.5", "¦name: pick"),
        "trajectory[1].name",
        "has this name already",
    ),
    "the same name but for case": (
        ("weight: 2.5", "¦name: Pick"),
        "trajectory[1].name",
        "'pick' (some file systems",
    ),
    "no weight": (("weight: 2.5", "¦weight: 0"), "trajectory[1].weight", "must be > 0"),
    "unknown key": (("weight: 2.5", "¦wait: 2.5"), "trajectory[1].wait", "unknown key"),
    "no form at all": (
        ("  - {q: [[0, 90 deg], [1, 2]], time: [1 s, 3 s], weight: 2.5}", "  - ¦{weight: 2.5}"),
        "trajectory[1]",
        "expected one of the keys tip",
    ),
    "text in the list": (
        ("  - {q: [[0, 90 deg], [1, 2]], time: [1 s, 3 s], weight: 2.5}", "  - ¦pick"),
        "trajectory[1]",
        "expected a mapping",
    ),
    "wrong unit in the second": (
        ("[[0, 90 deg]", "[[0, ¦90 mm]"),
        "trajectory[1].q[0][1]",
        "got '90 mm', which is length",
    ),
    "wrong number of coordinates": (
        ("[[0, 90 deg], [1, 2]]", "[[0, 90 deg], ¦[1]]"),
        "trajectory[1].q[1]",
        "needs 2 entries",
    ),
    "unknown node": (
        ("tip: hand.end", "¦tip: hand.tip"),
        "trajectory[0].tip",
        "expected 'hand.start' or 'hand.end'",
    ),
    "waypoint in space": (
        ("[0.2, 0.2]]", "¦[0.2, 0.2, 0]]"),
        "trajectory[0].waypoints[1]",
        "needs 2 components",
    ),
    "branch of no joint": (
        ("branch: {elbow:", "branch: {¦elbo:"),
        "trajectory[0].branch.elbo",
        "did you mean 'elbow'",
    ),
    "missing file": (
        ("q: [[0, 90 deg], [1, 2]], time: [1 s, 3 s]", "¦file: none.csv"),
        "trajectory[1].file",
        "none.csv",
    ),
    "unknown trajectory of a target": (
        (TARGETS, "  - {mode: 1, frequency: 190 Hz, ¦trajectory: pic}\n"),
        "targets[0].trajectory",
        "did you mean 'pick'",
    ),
    "two targets of a mode on one": (
        (TARGETS, TARGETS + "  - {¦mode: 1, frequency: 180 Hz, trajectory: pick}\n"),
        "targets[1].mode",
        "mode 1 has a target already along trajectory 'pick'",
    ),
    "profile too short for one of them": (
        (TARGETS, "  - {mode: 1, frequency: {¦time: [0, 2], frequency: [190, 180]}}\n"),
        "targets[0].frequency.time",
        "trajectory '2' lasts from 1 to 3 s",
    ),
    "profile too short for its own": (
        (
            TARGETS,
            "  - {mode: 1, trajectory: pick, frequency: {¦time: [0.5, 2], frequency: [190, 180]}}\n",
        ),
        "targets[0].frequency.time",
        "trajectory 'pick' lasts from 0 to 1 s",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_mistake_is_told_at_its_place(name: str, tmp_path: Path) -> None:
    change, path, message = WRONG[name]
    text, ((line, column),) = unmarked(listed(change))
    with pytest.raises(CaseError) as caught:
        parse(text.encode(), tmp_path / "case.yaml")
    (problem,) = caught.value.problems
    assert (problem.line, problem.column, problem.path) == (line, column, path)
    assert message in problem.message


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
