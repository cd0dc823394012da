"""The paper's arm with a limited mass, with catalogues, and with limits that contradict."""

import itertools

import numpy as np
import pytest
from run_cases import DESIGN, TAIL, answered, changed

from eigassign.case import parse
from eigassign.pipeline import Result, solve_case
from eigassign.study import AssignmentRow, BuiltCase

HEAD = changed(("samples: 152", "samples: 11")).split("design: #")[0]
HELD = HEAD.replace("{joint: shoulder}", "{joint: shoulder, drive: {stiffness: 2e4}}").replace(
    "{joint: elbow, angle: absolute}", "{joint: elbow, angle: absolute, drive: {stiffness: 2e4}}"
)


def solved(design: str, targets: str, head: str = HEAD) -> tuple[Result, AssignmentRow]:
    return answered(head + design + TAIL + targets)


def test_a_limit_of_the_mass_holds_and_is_named_where_it_binds() -> None:
    result, row = solved(DESIGN + "  mass: {max: 2.1 kg}\n", "  - {mode: 1, frequency: 190 Hz}\n")
    mass = result.results.mass
    assert mass.initial == pytest.approx(1.995)
    assert mass.optimal == pytest.approx(2.1, rel=1e-8)
    assert mass.upper == 2.1
    assert sum(result.design.values()) == pytest.approx(mass.optimal - mass.initial, abs=1e-9)
    assert ("design.mass", "upper") in [(limit.name, limit.side) for limit in row.active]
    assert row.verdict == "unreachable"  # of a design of 2.1 kg


def test_the_limits_that_contradict_are_named_and_no_others() -> None:
    targets = "  - {mode: 1, at_most: 200 Hz}\n  - {mode: 2, at_least: 300 Hz}\n"
    result, row = solved(DESIGN + "  mass: {max: 2 kg}\n", targets)
    assert row.verdict == "infeasible"
    assert sorted(row.conflict) == ["design.mass", "mode 1 at most 200 Hz"]
    assert "(line " in row.reason
    assert result.results.shortcoming is not None
    # the compromise misses both alike
    over = max(target.error.exact.max_relative for target in result.results.targets)
    assert over == pytest.approx(result.results.mass.optimal / 2.0 - 1.0, rel=1e-5)


def test_linear_limits_that_contradict_leave_a_compromise() -> None:
    design = DESIGN + (
        "  constraints:\n"
        "    more: {terms: {m1: 1, m2: 1}, min: 300 g}\n"
        "    less: {terms: {m1: 1, m2: 1}, max: 200 g}\n"
        "    idle: {terms: {m1: 1}, max: 240 g}\n"
    )
    result, row = solved(design, "  - {mode: 1, frequency: 190 Hz}\n")
    assert row.verdict == "infeasible"
    assert sorted(row.conflict) == ["less", "more"]
    assert sum(result.design.values()) == pytest.approx(0.24, rel=1e-6)  # 20 % off both


SECTIONS = {
    "light": (6e-4, 2.9e-8),
    "normal": (7.06317856e-4, 3.97e-8),
    "heavy": (9e-4, 6.4e-8),
}


def with_lists(
    masses: str, diameters: str, more: str = "", hz: float = 190.0, limits: str = ""
) -> BuiltCase:
    """The arm with lists of one mass, one diameter and three sections."""
    head = HEAD.replace(
        "rod: {area: 7.06317856e-4, bending_inertia: 3.97e-8}",
        "rod: {shape: circle, diameter: 30 mm}\n"
        "    fore: {area: 7.06317856e-4, bending_inertia: 3.97e-8}",
    ).replace("section: rod, elements: 3", "section: fore, elements: 3")
    choices = "".join(
        f"      {name}: {{sections.fore.area: {area}, sections.fore.bending_inertia: {inertia}}}\n"
        for name, (area, inertia) in SECTIONS.items()
    )
    design = (
        f"design:\n  m1: {{parameter: bodies.elbow_mass.mass, values: [{masses}]}}\n"
        f"  d: {{parameter: sections.rod.diameter, values: [{diameters}]}}\n"
        f"  fore:\n    choices:\n{choices}{limits}"
    )
    targets = f"  - {{mode: 1, frequency: {hz} Hz}}\n"
    return BuiltCase(parse((head + design + TAIL + targets + more).encode(), "case.yaml"))


def test_a_search_of_catalogues_without_time_proves_nothing_and_says_so() -> None:
    row = solve_case(with_lists("0, 80 g", "28 mm", "assignment: {seconds: 1e-9}\n"))
    found = row.results.assignment
    assert found.optimality.kind == "local"
    assert "of 6 combinations of the catalogues; time used up" in found.optimality.words
    assert "unfinished: time used up" in found.reason


@pytest.mark.parametrize(("masses", "below"), [("0, 10 g", 1), ("240 g, 250 g", 2)])
def test_catalogues_are_searched_for_every_number_of_modes_below_a_band(
    masses: str, below: int
) -> None:
    """Mode 2 of light arms is above 487 Hz, that of heavy ones below 399 Hz."""
    design = "".join(
        f"  {name}: {{parameter: bodies.{body}.mass, values: [{masses}]}}\n"
        for name, body in (("m1", "elbow_mass"), ("m2", "tool_mass"))
    )
    _, row = solved(f"design:\n{design}", "  - {keep_out: [400 Hz, 480 Hz]}\n")
    assert row.verdict == "reached"
    assert [(one.below, one.clear) for one in row.clearances] == [(below, True)]


@pytest.mark.parametrize("band", [(185, 420), (380, 500), (380, 520)])
def test_where_no_combination_is_clear_of_a_band_the_nearest_is_the_answer(
    band: tuple[int, int],
) -> None:
    """By the number of modes that the first sample has below it another may seem so."""
    masses = (0.0, 0.12, 0.25)
    design = "".join(
        f"  {name}: {{parameter: bodies.{body}.mass, values: [0, 120 g, 250 g]}}\n"
        for name, body in (("m1", "elbow_mass"), ("m2", "tool_mass"))
    )
    target = f"  - {{keep_out: [{band[0]} Hz, {band[1]} Hz]}}\n"
    text = f"{HEAD}design:\n{design}{TAIL}{target}"
    case = BuiltCase(parse(text.encode(), "case.yaml"))
    result, row = solved(f"design:\n{design}", target)
    model, q = case.model(), case.trajectory.q
    pairs = itertools.product(masses, repeat=2)
    missed = {y: _inside(model.frequencies(q, y, 4), band) for y in pairs}
    assert min(missed.values()) > 0.0
    assert row.verdict in ("infeasible", "unreachable")
    found = tuple(float(v) for v in result.design.values())
    assert missed[found] == pytest.approx(min(missed.values()), abs=1e-9)


def _inside(hz: np.ndarray, band: tuple[int, int]) -> float:
    """How far modes are in a band, relative to its edges, with the best number of modes below."""
    n, (lower, upper) = hz.shape[1], band
    below = np.hstack([np.zeros((len(hz), 1)), hz])
    above = np.hstack([hz, np.full((len(hz), 1), np.inf)])
    each = np.maximum(below / lower - 1.0, 1.0 - above / upper).max(axis=0)
    return float(each[:n].min())


def test_of_compromises_that_miss_alike_the_one_with_the_least_objective_is_the_answer() -> None:
    limits = (
        "  constraints:\n"
        "    less: {terms: {m1: 1}, max: 50 g}\n"
        "    more: {terms: {m1: 1}, min: 60 g}\n"
    )
    _, row = solved(DESIGN + limits, "  - {mode: 1, frequency: 190 Hz}\n")
    assert row.verdict == "infeasible"
    assert row.optimality.kind == "proved"
    assert "no design within the bounds meets less" in row.reason
    assert row.objective_optimal == min(one.objective for one in row.local_optima)


def test_lists_that_contradict_linear_limits_leave_a_compromise() -> None:
    limits = (
        "  constraints:\n"
        "    more: {terms: {m1: 1, d: 4}, min: 0.3}\n"
        "    less: {terms: {m1: 1}, max: 0.2}\n"
        "    idle: {terms: {d: 1}, min: 20 mm}\n"
    )
    case = with_lists("160 g, 250 g", "28 mm, 32 mm", limits=limits)
    row = solve_case(case).results.assignment
    assert row.verdict == "infeasible"
    assert sorted(row.conflict) == ["less", "more"]
    # 0.16 + 4 · 0.032 = 0.288 misses the first by 4 %, 0.25 the second by 25 %
    assert row.catalogue.best[0].violation == pytest.approx(0.04)


def test_limits_that_only_time_left_missed_are_not_said_to_be_out_of_reach() -> None:
    """The initial design has mode 1 at 22.7 Hz, the lightest at 27.1 Hz."""
    heavy = HELD.replace("upper_arm.end, mass: 0", "upper_arm.end, mass: 0.25")
    heavy = heavy.replace("forearm.end, mass: 0", "forearm.end, mass: 0.25")
    target, no_time = "  - {mode: 1, at_least: 25 Hz}\n", "assignment: {seconds: 1e-9}\n"
    _, ended = solved(DESIGN, target + no_time, heavy)
    assert (ended.verdict, ended.optimality.kind, ended.conflict) == ("do_not_use", "local", ())
    _, row = solved(DESIGN, target, heavy)
    assert row.verdict == "reached"


def test_limits_that_contradict_are_proved_where_corners_bound_them() -> None:
    """Whatever is wanted besides: mode 1 at most 10 Hz is no convex limit, a frequency is none."""
    stiff, few = "  - {mode: 1, at_least: 900 Hz}\n", "assignment: {starts: 10}\n"
    for more in ("", "  - {mode: 2, frequency: 40 Hz}\n"):
        result, row = solved(DESIGN, stiff + more + few, HELD)
        assert row.verdict in ("unreachable", "infeasible")
        assert not any("just meets" in note for note in result.results.notes)
        assert row.optimality.kind == "proved"
        assert "was found" not in row.reason
    _, row = solved(DESIGN, stiff + "  - {mode: 1, at_most: 10 Hz}\n" + few, HELD)
    assert row.optimality.words == "proved: no design within the bounds meets all limits"


def test_mode_1_at_least_f_of_held_joints_is_proved() -> None:
    drive = "{parameter: coordinates.q2.drive.stiffness, min: 1e3, max: 1e5, price: 1e-6}"
    design = f"{DESIGN}  k: {drive}\n"
    _, row = solved(design, "  - {mode: 1, at_least: 12 Hz}\n", HELD)
    assert row.verdict == "reached"
    assert row.optimality.kind == "proved"


def test_what_has_no_effect_stays_and_what_has_the_same_changes_least() -> None:
    head = HEAD.replace(
        "    tool_mass:", "    second: {at: upper_arm.end, mass: 20 g}\n"
        "    foot: {at: upper_arm.start, mass: 30 g}\n    tool_mass:"
    )  # fmt: skip
    design = (
        DESIGN
        + "  second: {parameter: bodies.second.mass, min: 0, max: 250 g}\n"
        + "  foot: {parameter: bodies.foot.mass, min: 0, max: 250 g}\n"
    )
    result, _ = solved(design, "  - {mode: 1, frequency: 190 Hz}\n", head)
    assert result.design["foot"] == pytest.approx(0.03, abs=1e-6)
    # both at the elbow: the change is shared
    assert result.design["second"] - 0.02 == pytest.approx(result.design["m1"], abs=1e-6)


def test_slopes_that_vanish_or_are_alike_at_one_design_only_are_no_lack_of_effect() -> None:
    """At the top of a curve a diameter has no slope, and one sample cannot tell two masses."""
    start, end = HEAD.index("  links:"), HEAD.index("  joints:")
    head = HEAD[:start] + (
        "    thin: {shape: circle, diameter: 20 mm}\n  links:\n"
        "    upper_arm: {length: 0.6, material: aluminium, section: rod, elements: 2}\n"
        "    forearm: {length: 0.45, material: aluminium, section: thin, elements: 2}\n"
    ) + HEAD[end : HEAD.index("trajectory:")]  # fmt: skip
    head = head.replace("{joint: shoulder}", "{joint: shoulder, drive: {stiffness: 2 MN m/rad}}")
    head = head.replace("angle: absolute}", "drive: {stiffness: 2 MN m/rad}}")
    design = (
        "trajectory: {points: [[0, 0.5], [0.5, 0.5]], duration: 1 s, samples: 2}\n"
        "assignment: {starts: 1}\ndesign:\n"
        "  d: {parameter: sections.thin.diameter, min: 5 mm, max: 120 mm}\n"
        "  tool: {parameter: bodies.tool_mass.mass, min: 50 g, max: 1 kg}\n"
    )
    result, _ = solved(design, "  - {mode: 1, frequency: 300 Hz}\n", head)
    assert result.design["tool"] == 0.05
    assert "effect" not in (notes := " ".join(result.results.notes))
    assert "depends on d" not in notes
    design = design[: design.index("  d:")] + (
        "  elbow: {parameter: bodies.elbow_mass.mass, min: 0, max: 250 g}\n"
        "  tool: {parameter: bodies.tool_mass.mass, min: 0, max: 250 g}\n"
    )
    _, row = solved(design, "  - {mode: 1, frequency: 22 Hz}\n", head)
    assert row.verdict == "reached", row.reason


@pytest.mark.parametrize(
    ("above", "word"), [(0.0, "reached"), (5e-9, "reached"), (1e-6, "infeasible")]
)
def test_a_limit_that_only_round_off_misses_contradicts_nothing(above: float, word: str) -> None:
    design = DESIGN.replace("max: 250 g", "max: 1 g")
    still = "trajectory: {q: [[1, 5], [1, 5]], duration: 1 s}\n"
    head = HELD[: HELD.index("trajectory:")] + still
    case = BuiltCase(
        parse((head + design + TAIL + "  - {mode: 1, at_least: 1 Hz}\n").encode(), "a")
    )
    most = case.model().frequencies(case.trajectory.q, [0.0, 0.0], 1).min()
    target = f"  - {{mode: 1, at_least: {most * (1.0 + above):.17g}}}\n"
    _, row = solved(design, target, head)
    assert row.verdict == word, row.reason
    assert (row.conflict != ()) == (word == "infeasible")
