"""What a chart says at its end, before any of it is written."""

from __future__ import annotations

from pathlib import Path

import pytest

from eigassign import load_case
from eigassign.chart.comparison import Request
from eigassign.chart.effort import Effort
from eigassign.chart.timing import Patience
from eigassign.modal.adaptive import order as expansion_choice
from eigassign.pipeline import Options, chart_case, skipped_notes

SHIPPED = (Path(__file__).parents[2] / "cases" / "two_link.yaml").read_text()
EFFORT = Effort(
    random_points=20, designs=2, samples_per_design=9, orders=(3, 4, 5, 6), half_orders=(),
    expansion_points=(1,), nodes=(), stations=(), accuracies=(), training=(27,),
    reference_s=1e9, training_s=1e9, factors=(1.0,), objectives=3, searched_s=0.1,
    patience=Patience(rounds=1, seconds=0.0, long_s=60.0),
)  # fmt: skip


def test_a_case_whose_auto_refuses_is_charted_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(expansion_choice, "MOST_TERMS", 50)
    start, end = SHIPPED.index("expansion:"), SHIPPED.index("targets:")
    line = "expansion: {order: auto, accuracy: 1e-9}\n"
    (tmp_path / "arm.yaml").write_text(f"{SHIPPED[:start]}{line}{SHIPPED[end:]}")
    made = chart_case(load_case(tmp_path / "arm.yaml"), Options(), EFFORT, Request(accuracy=1e-9))
    assert made.advice[0].auto is not None
    assert made.advice[0].auto.refused.startswith("no expansion of order up to 4")


def test_a_reason_that_many_methods_share_is_said_once_with_their_names() -> None:
    skipped = (("fit 1", "too many axes"), ("RBF", "too few points"), ("fit 2", "too many axes"))
    assert list(skipped_notes(skipped)) == [
        "fit 1, fit 2 have no answer: too many axes",
        "RBF has no answer: too few points",
    ]
    assert not list(skipped_notes(()))


def test_reasons_that_differ_by_a_number_in_front_are_said_once() -> None:
    skipped = tuple((f"fit of {k}", f"{k} solves for 4 stretches: 12 are needed") for k in (3, 5))
    assert list(skipped_notes(skipped)) == [
        "fit of 3, fit of 5 have no answer: that many solves for 4 stretches: 12 are needed"
    ]
