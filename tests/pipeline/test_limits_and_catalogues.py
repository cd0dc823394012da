"""The paper's arm with a limited mass, with catalogues, and with limits that contradict."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

from eigassign.case import parse
from eigassign.pipeline.run import Result, solve_case
from eigassign.study.built_case import Case
from eigassign.study.results import AssignmentRow

TEXT = (Path(__file__).parents[2] / "cases" / "two_link.yaml").read_text()
HEAD, REST = TEXT.replace("samples: 152", "samples: 11").split("design: #")
DESIGN = """\
design:
  m1: {parameter: bodies.elbow_mass.mass, min: 0, max: 250 g}
  m2: {parameter: bodies.tool_mass.mass, min: 0, max: 250 g}
"""
TAIL = "\nexpansion: {order: 2, q: [1.817, 5.312], y: auto, modes: [1]}\ntargets:\n"
HELD = HEAD.replace("{joint: shoulder}", "{joint: shoulder, drive: {stiffness: 2e4}}").replace(
    "{joint: elbow, angle: absolute}", "{joint: elbow, angle: absolute, drive: {stiffness: 2e4}}"
)


def solved(design: str, targets: str, head: str = HEAD) -> tuple[Result, AssignmentRow]:
    result = solve_case(Case(parse((head + design + TAIL + targets).encode(), "case.yaml")))
    assert result.results.assignment is not None
    return result, result.results.assignment


def test_a_limit_of_the_mass_holds_and_is_named_where_it_binds() -> None:
    result, row = solved(DESIGN + "  mass: {max: 2.1 kg}\n", "  - {mode: 1, frequency: 190 Hz}\n")
    mass = result.results.mass
    assert mass is not None
    assert mass.initial == pytest.approx(1.995)
    assert mass.optimal == pytest.approx(2.1, rel=1e-8)
    assert mass.upper == 2.1
    assert sum(result.design.values()) == pytest.approx(mass.optimal - mass.initial, abs=1e-9)
    assert "design.mass" in [limit.name for limit in row.active]
    assert row.verdict == "improved"


def test_the_limits_that_contradict_are_named_and_no_others() -> None:
    targets = "  - {mode: 1, at_most: 200 Hz}\n  - {mode: 2, at_least: 300 Hz}\n"
    result, row = solved(DESIGN + "  mass: {max: 2 kg}\n", targets)
    assert row.verdict == "infeasible"
    assert sorted(row.conflict) == ["design.mass", "mode 1 at most 200 Hz"]
    assert "(line " in row.reason
    assert result.results.shortcoming is not None
    # the compromise misses both alike
    over = max(target.error.exact.max_relative for target in result.results.targets)
    assert result.results.mass is not None
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


def test_catalogues_give_the_combination_that_brute_force_gives() -> None:
    head = HEAD.replace(
        "rod: {area: 7.06317856e-4, bending_inertia: 3.97e-8}",
        "rod: {shape: circle, diameter: 30 mm}\n"
        "    fore: {area: 7.06317856e-4, bending_inertia: 3.97e-8}",
    ).replace("section: rod, elements: 3", "section: fore, elements: 3")
    design = """\
design:
  m1: {parameter: bodies.elbow_mass.mass, values: [0, 80 g, 160 g, 250 g]}
  d: {parameter: sections.rod.diameter, values: [28 mm, 30 mm, 32 mm]}
  fore:
    choices:
      light: {sections.fore.area: 6e-4, sections.fore.bending_inertia: 2.9e-8}
      normal: {sections.fore.area: 7.06317856e-4, sections.fore.bending_inertia: 3.97e-8}
      heavy: {sections.fore.area: 9e-4, sections.fore.bending_inertia: 6.4e-8}
"""
    case = Case(parse((head + design + TAIL + "  - {mode: 1, frequency: 190 Hz}\n").encode(), "c"))
    result = solve_case(case)
    model, q = case.model(), case.trajectory.q
    weights = np.convolve(np.diff(case.trajectory.time_s), [0.5, 0.5])
    sections = {
        "light": (6e-4, 2.9e-8),
        "normal": (7.06317856e-4, 3.97e-8),
        "heavy": (9e-4, 6.4e-8),
    }
    found = {}
    for m, d, name in itertools.product((0, 0.08, 0.16, 0.25), (0.028, 0.03, 0.032), sections):
        error = model.frequencies(q, [m, d, *sections[name]], 1)[:, 0] / 190.0 - 1.0
        found[m, d, name] = float(weights @ error**2 / weights.sum())
    best = min(found, key=lambda key: found[key])
    row = result.results.assignment
    assert row is not None
    assert row.catalogue is not None
    assert row.objective_optimal == pytest.approx(found[best], rel=1e-9)
    assert [r.choice for r in result.results.design] == [
        f"{best[0]:g}",
        f"{best[1]:g}",
        *[best[2]] * 2,
    ]
    assert row.optimality.kind == "bounded"
    assert row.catalogue.gap == 0.0
    listed = [one.objective for one in row.catalogue.best]
    assert listed == sorted(listed)
    assert row.catalogue.best[0].choices["fore"] == best[2]


def test_mode_1_at_least_f_of_held_joints_is_proved() -> None:
    drive = "{parameter: coordinates.q2.drive.stiffness, min: 1e3, max: 1e5, price: 1e-6}"
    design = f"{DESIGN}  k: {drive}\n"
    _, row = solved(design, "  - {mode: 1, at_least: 12 Hz}\n", HELD)
    assert row.verdict == "reached"
    assert row.optimality.kind == "proved"


def test_free_joints_and_diameters_prove_nothing() -> None:
    target = "  - {mode: 1, at_least: 100 Hz}\n"
    _, free = solved(DESIGN, target)
    assert free.optimality.kind == "local"
    head = HELD.replace("rod: {area: 7.06317856e-4, bending_inertia: 3.97e-8}",
                        "rod: {shape: circle, diameter: 30 mm}")  # fmt: skip
    design = DESIGN + "  d: {parameter: sections.rod.diameter, min: 28 mm, max: 32 mm}\n"
    _, curved = solved(design, "  - {mode: 1, at_least: 12 Hz}\n", head)
    assert curved.optimality.kind == "local"


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
    notes = " ".join(result.results.notes)
    assert "nothing that is asked depends on foot" in notes
    assert "m1, second have the same effect" in notes
