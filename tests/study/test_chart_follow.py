"""A chart read back, and what of it a case that follows it is given."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eigassign.api import load_case
from eigassign.case import CaseFile
from eigassign.errors import CaseError
from eigassign.study.chart_follow import SCHEMA, Charted, read_chart, suggestions, within

ARM = (Path(__file__).parents[2] / "cases" / "two_link.yaml").read_text()
Q0, Y0 = np.array([1.817, 5.312]), np.array([0.125, 0.125])


def method(
    name: str, order: int, seconds: float, worst: float | None, **how: Any
) -> dict[str, Any]:
    parameters = {"order": order, "q0": Q0.tolist(), "y0": Y0.tolist(), **how}
    return {
        "method": name, "family": "Taylor, full", "parameters": parameters,
        "offline": {"median_s": seconds}, "online": {"median_s": 1e-9},
        "everywhere": {"worst_relative": worst},
    }  # fmt: skip


POINTS = [
    method("slow", 6, 2e-3, 1e-5),
    method("quick", 4, 1e-3, 9e-4),
    method("wrong", 2, 1e-4, 1e-2),
    method("hopeless", 1, 1e-5, None),
    {"method": "exact dense", "family": "exact"},
]


def following(
    folder: Path, points: list[dict[str, Any]] = POINTS, accuracy: str = "1e-3", **changes: Any
) -> CaseFile:
    """The shipped case, told to follow a chart of it."""
    (folder / "chart.json").write_text("{}")
    path = folder / "arm.yaml"
    keys = f"  order: auto\n  accuracy: {accuracy}\n  chart: chart.json\n"
    order = next(line for line in ARM.splitlines(True) if line.startswith("  order: 4"))
    path.write_text(ARM.replace(order, keys))
    chart = {
        "schema": SCHEMA, "subject_sha256": load_case(path).file.subject_sha256,
        "asked": {"modes": [1], "evaluations": 152}, "points": points, **changes,
    }  # fmt: skip
    (folder / "chart.json").write_text(json.dumps(chart))
    return load_case(path).file


def test_the_quickest_within_the_accuracy_comes_first(tmp_path: Path) -> None:
    tried, said = suggestions(following(tmp_path), Q0, Y0, (1,), 1e-3)
    assert [each.name.split(",")[0] for each in tried] == ["quick", "slow"]
    assert [each.order for each in tried] == [4, 6]
    np.testing.assert_array_equal(tried[0].points, [[*Q0, *Y0]])
    assert "quick is its quickest expansion within 1.0e-03 for 152 evaluations" in said[0]


def test_set_up_and_evaluations_are_weighed_by_their_number() -> None:
    def charted(name: str, offline: float, online: float) -> Charted:
        return Charted(name, 4, Q0[None], Y0, 0.02, offline, online, 1e-6)

    both = charted("ready", 1e-4, 1e-6), charted("fast", 1e-2, 1e-8)
    assert [e.method for e in within(both, 1e-3, 1e2)] == ["ready", "fast"]
    assert [e.method for e in within(both, 1e-3, 1e6)] == ["fast", "ready"]
    assert within(both, 1e-7, 1e2) == ()


def test_a_chart_without_such_accuracy_is_not_followed(tmp_path: Path) -> None:
    tried, said = suggestions(following(tmp_path), Q0, Y0, (1,), 1e-6)
    assert tried == ()
    assert said == ("the chart has no expansion within 1.0e-06: auto chooses by itself",)


def test_a_chart_of_another_case_is_not_followed(tmp_path: Path) -> None:
    file = following(tmp_path, subject_sha256="0" * 64)
    assert suggestions(file, Q0, Y0, (1,), 1e-3) == (
        (), ("the chart is not followed: it is of another case",),
    )  # fmt: skip


def test_a_chart_of_other_modes_is_not_followed(tmp_path: Path) -> None:
    file = following(tmp_path, asked={"modes": [2, 3], "evaluations": 1})
    tried, said = suggestions(file, Q0, Y0, (1,), 1e-3)
    assert not tried
    assert said == ("the chart is not followed: it is of mode 2, 3",)


def test_only_expansions_at_the_design_and_at_a_pose_that_is_given_count(tmp_path: Path) -> None:
    elsewhere = [
        method("other design", 4, 1e-5, 1e-6, y0=[0.1, 0.1]),
        method("other pose", 4, 1e-5, 1e-6, q0=[1.5, 5.0]),
        method("fewer coordinates", 4, 1e-5, 1e-6, q0=[1.5]),
    ]
    file = following(tmp_path, [*elsewhere, *POINTS])
    tried, _ = suggestions(file, Q0, Y0, (1,), 1e-3)
    assert tried[0].name.startswith("quick")


def test_a_case_that_follows_no_chart_reads_none(tmp_path: Path) -> None:
    path = tmp_path / "arm.yaml"
    path.write_text(ARM)
    assert suggestions(load_case(path).file, Q0, Y0, (1,), 1e-3) == ((), ())


@pytest.mark.parametrize(
    "content",
    [
        "", "[", "[]", "3", "null", '{"schema": 1}', '{"schema": 2}', "\ufeff{}", "[" * 100_000,
        '{"schema": 2, "asked": {"modes": [1], "evaluations": 0}, "points": []}',
        '{"schema": 2, "asked": {"modes": 1, "evaluations": 2}, "points": []}',
    ],
)  # fmt: skip
def test_a_file_that_is_no_chart_is_refused_at_its_line(tmp_path: Path, content: str) -> None:
    file = following(tmp_path)
    (tmp_path / "chart.json").write_text(content)
    with pytest.raises(CaseError, match=r"expansion\.chart: .* is no chart\.json of this version"):
        read_chart(file)


@pytest.mark.parametrize(
    "wrong",
    [
        {"order": 0}, {"order": 21}, {"order": "x"}, {"order": float("inf")},
        {"q0": [float("nan")]},
        {"q0": [[[1.0]]]}, {"q0": [[1.0], [1.0, 2.0]]}, {"y0": [[0.1], [0.2]]}, {"cluster_gap": 0},
        {"q0": "here"}, {"y0": None},
    ],
)  # fmt: skip
def test_impossible_numbers_are_no_chart(tmp_path: Path, wrong: dict[str, Any]) -> None:
    file = following(tmp_path, [method("strange", 4, 1.0, 0.0)])
    chart = json.loads((tmp_path / "chart.json").read_text())
    chart["points"][0]["parameters"].update(wrong)
    (tmp_path / "chart.json").write_text(json.dumps(chart))
    with pytest.raises(CaseError, match="is no chart"):
        read_chart(file)


@pytest.mark.parametrize(("seconds", "worst"), [(0.0, 1e-3), (-1.0, 1e-3), (1.0, -1e-3)])
def test_impossible_times_and_errors_are_no_chart(
    tmp_path: Path, seconds: float, worst: float
) -> None:
    with pytest.raises(CaseError, match="impossible number"):
        read_chart(following(tmp_path, [method("strange", 4, seconds, worst)]))
