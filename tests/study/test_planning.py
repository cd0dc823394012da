from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenes import HEAD, SHIPPED, automatic, changed, scene_of

from eigassign import load_case
from eigassign.errors import CaseError, UsageError
from eigassign.study import Plan, central_sample, joint_map, plan_expansion


def plan_of(folder: Path, text: str, **override: object) -> Plan:
    path = folder / "arm.yaml"
    path.write_text(text)
    case = load_case(path)
    trajectory = case.trajectory if case.file.trajectory is not None else None
    return plan_expansion(case.file, case.model(), trajectory, **override)  # type: ignore[arg-type]


def test_what_the_case_asks_for_is_taken(tmp_path: Path) -> None:
    plan = plan_of(tmp_path, SHIPPED)
    assert plan.q0.tolist() == [1.817, 5.312]
    assert plan.y0.tolist() == [0.125, 0.125]
    assert (plan.order, plan.modes) == (4, (1,))
    assert all("from the case file" in note for note in plan.notes)


def test_auto_takes_the_most_central_pose_the_middle_of_the_bounds_and_the_target_modes(
    tmp_path: Path,
) -> None:
    text = automatic(
        ("min: 0, max: 250 g}\n  m2", "min: 0, max: 100 g}\n  m2"), ("mode: 1", "mode: 2")
    )
    plan, scene = plan_of(tmp_path, text), scene_of(tmp_path, text)
    elbow = scene.path.q[:, 1] - scene.path.q[:, 0]
    farthest = np.abs(elbow[:, None] - elbow).max(axis=1)
    assert plan.q0.tolist() == scene.path.q[np.argmin(farthest)].tolist()
    np.testing.assert_allclose(plan.y0, [0.05, 0.125], rtol=1e-15)
    assert plan.modes == (2,)
    assert [note.split(":")[0] for note in plan.notes] == [
        "expansion point",
        "expansion design",
        "expanded modes",
    ]


def test_turning_the_whole_arm_does_not_count_as_distance(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, SHIPPED)
    assert joint_map(scene.model).tolist() == [[-1.0, 1.0]]


@given(st.lists(st.tuples(st.floats(-9, 9), st.floats(-9, 9)), min_size=1, max_size=30))
def test_no_other_sample_is_more_central(points: list[tuple[float, float]]) -> None:
    rows = np.array(points)
    farthest = np.linalg.norm(rows[:, None] - rows, axis=2).max(axis=1)
    assert farthest[central_sample(rows)] <= farthest.min() + 1e-7  # roots of rounded squares


def test_a_very_long_trajectory_is_nearly_centred() -> None:
    line = np.linspace(0.0, 1.0, 7001)[:, None]
    assert abs(central_sample(line) - 3500) <= 10


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (HEAD, "expansion.q: auto takes a pose of the trajectory"),
        (changed(("[1.817, 5.312]", "[1.817]")), "expansion.q: .*needs 2 entries"),
        (changed(("y: [0.125, 0.125]", "y: [0.125]")), "expansion.y: .*needs 2 entries"),
        (changed(("modes: [1]", "modes: [1, 22]")), "expansion.modes.*no mode 22: .* has 21"),
        (automatic(("mode: 1", "mode: 22")), r"targets\[0\].mode.*no mode 22: .* has 21"),
    ],
)
def test_a_plan_that_cannot_be_is_refused_at_its_key(
    text: str, message: str, tmp_path: Path
) -> None:
    with pytest.raises(CaseError, match=message):
        plan_of(tmp_path, text)


def test_an_order_that_fills_the_memory_is_refused_before_the_expansion(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "arm.yaml"
    path.write_text(SHIPPED)
    case, model = load_case(path), load_case(path).model()
    monkeypatch.setenv("EIGASSIGN_LIMITS", "2e-6")  # a memory for 20 pairs of coefficients
    with pytest.raises(CaseError, match=r"expansion.order: order 4 in 3 .*EIGASSIGN_LIMITS="):
        plan_expansion(case.file, model, None)
    with pytest.raises(UsageError, match="lower the order"):
        plan_expansion(case.file, model, None, order=6)


def test_without_a_design_only_q_is_planned(tmp_path: Path) -> None:
    plan = plan_of(tmp_path, HEAD + "expansion: {q: [1.8, 5.3], order: 3}\n")
    assert plan.y0.shape == (0,)
    assert (plan.order, plan.modes) == (3, (1,))
    assert any("because no target names a mode" in note for note in plan.notes)
