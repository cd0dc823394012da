"""What a run takes, said before it is made, and the picture of a mechanism alone."""

from __future__ import annotations

from pathlib import Path

import pytest
from run_cases import SHIPPED

from eigassign.errors import StorageError
from eigassign.pipeline import check, draw


def test_check_states_coefficients_memory_and_seconds_and_the_next_step() -> None:
    answer = check(SHIPPED)
    assert answer.outlook is not None
    assert (answer.outlook.expansion.order, answer.outlook.modes) == (4, (1,))
    assert answer.outlook.expansion.coefficients == 35  # C(3 + 4, 4): q1 does not matter
    assert 0.0 < answer.outlook.expansion.memory_mb < 1.0
    assert 0.0 < answer.outlook.expansion.seconds < (answer.outlook.optimize_s or 0.0)
    assert answer.next == f"eigassign optimize {SHIPPED}"


def test_what_a_run_takes_grows_with_the_order_and_is_not_stated_without_a_point(
    tmp_path: Path,
) -> None:
    text = (SHIPPED.parent / "arm_6r.yaml").read_text()
    found = []
    for order in (3, 8):
        path = tmp_path / f"order_{order}.yaml"
        path.write_text(text.replace("order: 3", f"order: {order}"))
        found.append(check(path).outlook)
    low, high = found
    assert low is not None
    assert high is not None
    assert (low.expansion.coefficients, high.expansion.coefficients) == (165, 12870)
    assert 0.5 < high.expansion.seconds < 5.0  # between 1.1 and 4.4 s where it was measured
    assert 400.0 < high.expansion.memory_mb < 900.0  # 650 MB
    assert high.expansion.memory_mb > 100 * low.expansion.memory_mb
    path.write_text(text.partition("trajectory:")[0])
    answer = check(path)
    assert answer.outlook is None
    assert "needs trajectory, design and targets" in answer.next
    assert '--q "0, 0, 0, 0, 0, 0" --draw' in answer.next


def test_what_a_run_takes_counts_large_parts() -> None:
    """Of 7 685 unknowns before they are reduced."""
    answer = check(SHIPPED.parent / "casting_arm.yaml")
    assert answer.outlook is not None
    assert 350.0 < answer.outlook.memory_mb < 600.0
    small = check(SHIPPED).outlook
    assert small is not None
    assert small.memory_mb < 160.0


@pytest.mark.parametrize("trajectory", [True, False])
def test_a_case_is_drawn_with_and_without_its_trajectory(
    trajectory: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text = (SHIPPED.parent / "gantry.yaml").read_text()
    path = Path("gantry.yaml")
    path.write_text(text if trajectory else text.partition("trajectory:")[0])
    folder = draw(path, None, False, ("svg",))
    assert folder == Path("results/gantry_check")
    assert (folder / "figures" / "mechanism.svg").read_bytes().startswith(b"<?xml")
    assert draw(path, None, False, ("svg",)) == folder  # again: of the same case
    Path("mine").mkdir()
    Path("mine/thesis.txt").touch()
    with pytest.raises(StorageError, match="mine"):
        draw(path, Path("mine"), False, ("svg",))
