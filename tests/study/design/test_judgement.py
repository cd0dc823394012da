"""Verdicts in words, where the worst error, the mean one and limits disagree."""

from dataclasses import replace
from typing import Any

import numpy as np

from eigassign.assignment import KINDS
from eigassign.study import ErrorRow, ErrorSummary, Facts, LimitRow, TargetStudy, Verdict, verdict


def missed(kind: str, initial: ErrorRow, exact: ErrorRow) -> TargetStudy:
    hz = np.full(3, 48.0)
    asked = KINDS[kind](
        label="mode 1 at 48 Hz", place="targets[0]", modes=(1,), terms=((1, 1.0),),
        rows=slice(0, 3), lower=hz, upper=hz, along=(("1", slice(0, 3)),),
    )  # fmt: skip
    return TargetStudy(
        asked=asked, time_s=hz, initial_hz=hz, exact_hz=hz, predicted_hz=None, one_shot_hz=None,
        error=ErrorSummary(initial, exact), satisfied=False, weight_s=1.0, along=(),
    )  # fmt: skip


def judged(target: TargetStudy, before: float, after: float, **others: Any) -> Verdict:
    """Of one target that is missed, with the objective before and after."""
    return verdict(Facts((target,), ((0.0, before), (0.0, after)), **others))


def test_a_worst_error_that_has_grown_is_said_beside_what_has_fallen() -> None:
    target = missed("frequency", ErrorRow(0.0548, 0.0422), ErrorRow(0.0602, 0.0212))
    said = judged(target, 0.0422**2, 0.0212**2)
    assert said.word == "improved"
    assert said.shortcoming is None
    why = "6.02 % off at worst (before: 5.48 %), while the rms error fell from 4.22 to 2.12"
    assert why in said.reason
    better = missed("frequency", ErrorRow(0.08, 0.0422), ErrorRow(0.0602, 0.0212))
    assert "before" not in judged(better, 1.0, 0.5).reason


def test_limits_are_violated_not_off() -> None:
    target = missed("at_most", ErrorRow(0.112, 0.1), ErrorRow(0.0568, 0.05))
    said = judged(target, 0.0, 0.0, unreachable=["mode 1 is out of reach"])
    assert said.word == "unreachable"
    assert said.reason == (
        "mode 1 is out of reach; the nearest design: mode 1 at 48 Hz: 48 Hz, violated by 5.68 % "
        "at worst"
    )


def test_a_limit_that_is_missed_is_named_before_what_is_wanted() -> None:
    limit = missed("at_most", ErrorRow(0.1, 0.1), ErrorRow(0.01, 0.01))
    goal = missed("frequency", ErrorRow(0.2, 0.2), ErrorRow(0.2, 0.2))
    facts = Facts((goal, limit), ((0.1, 1.0), (0.01, 0.5)))
    assert verdict(facts).reason.endswith("violated by 1 % at worst")


def test_the_first_that_holds_is_the_word() -> None:
    """Each fact alone, and beside all those that come after it."""
    target = missed("frequency", ErrorRow(0.08, 0.04), ErrorRow(0.06, 0.02))
    broken = LimitRow(
        "design.mass", "mass at most 3 kg", "kg", None, 3.0, 5.0, 5.47, False, 0.67, 0.82, 3.2,
        "mass 5.47 kg, at most 3 kg; the lightest design has 3.2 kg",
    )  # fmt: skip
    facts: list[tuple[str, dict[str, Any]]] = [
        ("infeasible", {"conflict": "a and b contradict", "of_frequencies": False}),
        ("do_not_use", {"doubts": ["the mesh is too coarse"]}),
        ("unreachable", {"unreachable": ["mode 1 is out of reach"]}),
        ("infeasible", {"conflict": "a and mode 1 contradict"}),
        ("improved", {}),
    ]
    for k, (word, own) in enumerate(facts):
        later: dict[str, Any] = {}
        for _, other in reversed(facts[k:]):
            later |= other
        for said in (judged(target, 1.0, 0.5, **own), judged(target, 1.0, 0.5, **later)):
            assert said.word == word
            assert (said.shortcoming is None) == (word == "improved")
    whole = {"limits": [broken], "conflict": "a contradicts", "of_frequencies": False}
    for others in ({}, {"conflict": ""}, {"unreachable": ["out"], "of_frequencies": True}):
        assert broken.stated in judged(target, 1.0, 0.5, **(whole | others)).reason


def test_reached_is_every_target_met_every_limit_kept_and_nothing_unproved() -> None:
    met = replace(missed("frequency", ErrorRow(0.08, 0.04), ErrorRow(0.01, 0.01)), satisfied=True)
    assert judged(met, 1.0, 0.5) == Verdict("reached", "every target is met", None)
    unproved = judged(met, 1.0, 0.5, unproved=["not clear"])
    assert (unproved.word, unproved.reason) == ("do_not_use", "not clear")
    kept = LimitRow("a", "a at most 1", "", None, 1.0, 0.5, 0.5, True, 0.0, 0.0, None, "")
    assert judged(met, 1.0, 0.5, limits=[kept]).word == "reached"
    broken = replace(kept, optimal=2.0, satisfied=False, violation=1.0, stated="a 2, at most 1")
    assert "a 2, at most 1" in judged(met, 1.0, 0.5, limits=[broken]).reason
    assert judged(met, 1.0, 0.5, limits=[broken]).word == "improved"
    assert judged(met, 1.0, 0.5, max_error=0.005).shortcoming == (
        "worst error 1 %, above the 0.5 % of assignment.max_error"
    )
