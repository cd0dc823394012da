"""A pose at rest as a trajectory: alone, beside a motion, and under weight."""

from pathlib import Path

import numpy as np
import pytest
from run_cases import held

from eigassign.case import parse
from eigassign.output import run_figures
from eigassign.pipeline import solve_case
from eigassign.study import BuiltCase, RunResults

TEXT = (Path(__file__).parents[2] / "cases" / "two_link.yaml").read_text()
HEAD, REST = TEXT[: TEXT.index("# The paper draws")], TEXT[TEXT.index("design: #") :]
POSE = [1.817, 5.312]


def solved(motion: str, targets: str, head: str = HEAD) -> RunResults:
    tail = REST[: REST.index("targets:")] + f"targets:\n{targets}"
    text = f"{head}trajectory:\n{motion}{tail}"
    return solve_case(BuiltCase(parse(text.encode(), "case.yaml"))).results


def test_one_pose_is_assigned_as_it_stands() -> None:
    found = solved(f"  q: [{POSE}]\n", "  - {mode: 1, frequency: 190 Hz}\n")
    (target,) = found.targets
    assert found.time_s.tolist() == [0.0]
    assert target.exact_hz == pytest.approx([190.0], rel=1e-9)
    assert found.assignment.verdict == "reached"
    assert run_figures(found)


def test_beside_a_motion_a_pose_counts_as_one_second() -> None:
    """Mode 1 at 188 Hz at rest and at 192 Hz for a second at the same place: 190 in the middle."""
    move = f"{{name: wait, q: [{POSE}, {POSE}, {POSE}], duration: 1}}"
    for weight, middle in ((1, 0.5), (3, 0.75)):
        found = solved(
            f"  - {{name: rest, q: [{POSE}], weight: {weight}}}\n  - {move}\n",
            "  - {mode: 1, frequency: 190 Hz, trajectory: rest}\n"
            "  - {mode: 1, frequency: 194 Hz, trajectory: wait}\n",
        )
        hz = found.targets[0].exact_hz[0]
        a, b = middle / 190.0, (1.0 - middle) / 194.0
        best = (a + b) / (a / 190.0 + b / 194.0)
        assert hz == pytest.approx(best, rel=1e-6)


def test_a_pose_under_weight_is_held_by_its_drives_without_motion() -> None:
    found = solved(f"  q: [{POSE}]\n", "  - {mode: 1, at_most: 90 Hz}\n", held(HEAD))
    for row in found.drives:
        assert np.isfinite([row.optimal.peak, row.optimal.rms]).all()
        assert row.optimal.peak == pytest.approx(row.optimal.rms, rel=1e-12)
