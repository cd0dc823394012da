"""Sentences of a run that claim something, each held against what makes it true."""

import re
from typing import Any

import numpy as np
import pytest
from chains import Tree, case_of, two_link

from eigassign.output import verdict_of
from eigassign.pipeline import Options, Result, solve_case

JOINTS = {"q1": "shoulder", "q2": "elbow"}
HELD = ({"stiffness": 2e4}, {"stiffness": 4e3})
ELBOW = {"parameter": "bodies.elbow_mass.mass", "min": 0.0, "max": 0.25}
TOOL = {"parameter": "bodies.tool_mass.mass", "min": 0.0, "max": 0.25}


def run(targets: list[Tree], elements: tuple[int, int] = (2, 2), **more: Any) -> Result:
    tree = two_link(elements=elements, drives=HELD, masses=(0.1, 0.1))
    tree["trajectory"] = {"points": [[0.1, 0.5], [0.6, 1.5]], "duration": 1.0, "samples": 12}
    tree |= {"design": {"m1": ELBOW, "m2": TOOL}, "targets": targets} | more
    return solve_case(case_of(tree), Options(use_cache=False, study="none"))


def page(result: Result) -> str:
    screen = verdict_of(result.results)
    return " ".join(screen.trust)


def finely(result: Result, modes: int) -> np.ndarray:
    """Exact frequencies of the answer with 16 elements a link."""
    tree = two_link(elements=(16, 16), drives=HELD, masses=(0.1, 0.1))
    model = case_of(tree | {"design": {"m1": ELBOW, "m2": TOOL}}).model()
    return model.frequencies(result.results.q, list(result.design.values()), modes)


def test_bounds_and_limits_that_the_answer_lies_on_are_those_and_no_others() -> None:
    result = run([{"mode": 1, "at_least": 10.0}, {"mode": 2, "frequency": 70.0}])
    notes = " ".join(result.results.notes)
    for row in result.results.design:
        for side, bound in (("lower", row.lower), ("upper", row.upper)):
            named = re.search(rf"lies on its {side} bound of [m12, ]*{row.name}", notes)
            assert (named is not None) == (abs(row.optimal - bound) <= 1e-7)
    met = "just meets mode 1 at least" in notes
    assert met == (abs(result.results.targets[0].exact_hz.min() / 10.0 - 1.0) <= 1e-7)


def test_the_page_says_how_far_frequencies_can_be_trusted() -> None:
    result = run([{"mode": 3, "at_most": 900.0}, {"mode": 1, "at_least": 5.0}])
    said = page(result)
    assert "solved exactly at all 12 samples" in said
    trust = r"too high because of the mesh: about ([0-9.]+) % \(checked at \d+ samples\)"
    (share,) = re.findall(trust, said)
    fine = finely(result, 3)[:, [2, 0]]
    coarse = np.column_stack([target.exact_hz for target in result.results.targets])
    assert 0.0 < (coarse / fine - 1.0).max() <= 0.01 * float(share)


def test_a_search_that_time_has_ended_is_not_called_done() -> None:
    result = run([{"mode": 1, "frequency": 12.0}], assignment={"seconds": 1e-9})
    assert "The search was ended before it was done." in page(result)
    row = result.results.assignment
    assert "time used up" in row.reason
    assert "time used up" in row.optimality.words


@pytest.mark.parametrize("order", [1, 4])
def test_an_expansion_that_misleads_is_said_to(order: int) -> None:
    """About the lightest design, a straight line foresees far too low frequencies."""
    expansion = {"order": order, "q": [0.3, 1.0], "y": [0.0, 0.0]}
    heavy = {name: {**one, "max": 20.0} for name, one in (("m1", ELBOW), ("m2", TOOL))}
    result = run(
        [{"mode": 1, "frequency": 6.0}],
        assignment={"method": "one_shot"}, expansion=expansion, design=heavy,
    )  # fmt: skip
    (target,), said = result.results.targets, " ".join(result.results.warnings)
    far = target.approximation_error > 0.02
    assert ("the predicted frequency is up to" in said) == far
    row = result.results.assignment
    assert (row.verdict == "do_not_use") or not far
    assert row.optimality.words == "the optimum of the linearised problem only"


PEAKS = {
    "d": {"parameter": "sections.thin.diameter", "min": 0.005, "max": 0.12},
    "m2": {"parameter": "bodies.tool_mass.mass", "min": 0.05, "max": 1.0},
}


@pytest.mark.parametrize(("share", "word"), [(0.999, "reached"), (1.05, "unreachable")])
def test_out_of_reach_is_what_no_design_of_a_grid_comes_near(share: float, word: str) -> None:
    """Mode 1 is highest for a diameter between the bounds."""
    tree = two_link(elements=(1, 1), drives=HELD)
    mechanism = tree["mechanism"]
    mechanism["sections"]["thin"] = {"shape": "circle", "diameter": 0.1}
    mechanism["links"]["fore"]["section"] = "thin"
    tree["trajectory"] = {"points": [[0.0, 0.5], [0.5, 1.0]], "duration": 1.0, "samples": 2}
    tree |= {"design": PEAKS, "targets": [{"mode": 1, "at_least": 1.0}]}
    case = case_of(tree)
    designs = np.column_stack([np.linspace(0.005, 0.12, 400), np.full(400, 0.05)])
    q = np.repeat(case.trajectory.q[:1], 400, axis=0)
    best = float(case.model().frequencies(q, designs, 1).max())
    tree["targets"] = [{"mode": 1, "at_least": share * best}]
    row = solve_case(case_of(tree), Options(use_cache=False, study="none")).results.assignment
    assert row.verdict == word, row.reason
    assert ("found by a search from 3 starts" in row.reason) == (word == "unreachable")


def test_a_limit_that_the_mesh_alone_may_miss_is_not_proved_to_be_out_of_reach() -> None:
    """Of one element each: with the heaviest tip mode 2 is missed by less than the mesh's error."""
    coarse = run([{"mode": 2, "at_most": 1.0}], elements=(1, 1))
    lowest = float(coarse.results.targets[0].exact_hz.max())
    within = run([{"mode": 2, "at_most": lowest * (1.0 - 1e-5)}], elements=(1, 1)).results
    assert finely(coarse, 2)[:, 1].max() < lowest * (1.0 - 1e-5)
    assert within.assignment.verdict == "do_not_use"
    assert "Give the links more elements" in within.assignment.reason
    assert coarse.results.assignment.verdict == "unreachable"


def test_inputs_say_what_drives_are_alike_and_what_is_carried_along_which_trajectory() -> None:
    path = {"points": [[0.1, 0.5], [0.6, 1.5]], "duration": 1.0, "samples": 12}
    loaded = {**path, "name": "there", "set": {"bodies.tool_mass.mass": 3.0}}
    design = {"m1": ELBOW}
    both = [loaded, {**path, "name": "back"}]
    result = run([{"mode": 1, "at_least": 5.0}], trajectory=both, design=design)
    _, drives, motion = result.results.given
    assert drives == "Drives: q1 20 kN m/rad, q2 4 kN m/rad"
    assert motion.endswith("mass of tool_mass 3 kg or 100 g")
    locked = {name: {"joint": joint, "drive": "locked"} for name, joint in JOINTS.items()}
    held = run([{"mode": 1, "at_least": 5.0}], coordinates=locked).results
    assert held.given[1] == "Drives: q1, q2 locked"
