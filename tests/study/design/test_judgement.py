"""Verdicts in words, where the worst error, the mean one and limits disagree."""

from __future__ import annotations

import numpy as np

from eigassign.assignment import KINDS
from eigassign.study import ErrorRow, ErrorSummary, TargetStudy, verdict


def missed(kind: str, initial: ErrorRow, exact: ErrorRow) -> TargetStudy:
    hz = np.full(3, 48.0)
    asked = KINDS[kind](
        label="mode 1 at 48 Hz", place="targets[0]", modes=(1,), terms=((1, 1.0),),
        rows=slice(0, 3), lower=hz, upper=hz, along=(("1", slice(0, 3)),),
    )  # fmt: skip
    return TargetStudy(
        asked=asked, initial_hz=hz, exact_hz=hz, predicted_hz=None, one_shot_hz=None,
        error=ErrorSummary(initial, exact), satisfied=False, weight_s=1.0, along=(),
    )  # fmt: skip


def test_a_worst_error_that_has_grown_is_said_beside_what_has_fallen() -> None:
    target = missed("frequency", ErrorRow(0.0548, 0.0422), ErrorRow(0.0602, 0.0212))
    word, why = verdict((target,), ((0.0, 0.0422**2), (0.0, 0.0212**2)), trusted=True)
    assert word == "improved"
    assert "6.02 % off at worst (before: 5.48 %), while the rms error fell from 4.22 to 2.12" in why
    better = missed("frequency", ErrorRow(0.08, 0.0422), ErrorRow(0.0602, 0.0212))
    assert "before" not in verdict((better,), ((0.0, 1.0), (0.0, 0.5)), trusted=True)[1]


def test_limits_are_violated_not_off() -> None:
    target = missed("at_most", ErrorRow(0.112, 0.1), ErrorRow(0.0568, 0.05))
    word, why = verdict((target,), ((0.112, 0.0), (0.0568, 0.0)), True, ["mode 1 is out of reach"])
    assert word == "unreachable"
    assert why == (
        "mode 1 is out of reach; the nearest design: mode 1 at 48 Hz: violated by 5.68 % at worst"
    )
