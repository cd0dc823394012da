"""Limits of stiffness, compliance and sag: what a run does with them and says of them."""

import csv
import io
import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from run_cases import answered

from eigassign import load_case
from eigassign.assignment import design_limits
from eigassign.case import parse
from eigassign.errors import CaseError
from eigassign.modal import compliances
from eigassign.output import run_figures, run_tables, sample_files, to_json, verdict_of
from eigassign.pipeline import Result, check, solve_case
from eigassign.study import AssignmentRow, BuiltCase

CASES = Path(__file__).parents[2] / "cases"
TEXT = (CASES / "drilling_arm.yaml").read_text().replace("samples: 41", "samples: 9")
HEAD = TEXT[: TEXT.index("design:\n")]
LEVEL = HEAD.replace("  gravity: [0, -9.81]\n", "  gravity: none\n")
GEARS = """\
design:
  shoulder: {parameter: coordinates.q1.drive.stiffness, min: 5e4, max: 5e5}
  elbow: {parameter: coordinates.q2.drive.stiffness, min: 5e4, max: 5e5}
"""
TUBES = """\
design:
  upper: {parameter: sections.upper.outer_diameter, min: 60 mm, max: 120 mm}
  fore: {parameter: sections.fore.outer_diameter, min: 50 mm, max: 100 mm}
"""
AT = "at: forearm.end, direction: [0, 1]"


def solved(targets: str, design: str = GEARS, head: str = LEVEL) -> tuple[Result, AssignmentRow]:
    return answered(f"{head}{design}targets:\n{targets}")


@cache
def drilled() -> Result:
    return solve_case(load_case(CASES / "drilling_arm.yaml"))


def test_the_cheapest_arm_that_does_not_give_way_is_told_everywhere() -> None:
    results = drilled().results
    row = results.assignment
    assert row.verdict == "reached"
    assert [static.name.split()[0] for static in results.statics] == [
        "stiffness",
        "compliance",
        "sag",
    ]
    limits = {limit.name: limit for limit in row.limits}
    assert all(limits[static.name].satisfied for static in results.statics)
    compliance = results.statics[1]
    assert limits[compliance.name].optimal == pytest.approx(5.5e-6, rel=1e-6)
    assert compliance.optimal_curve.max() == limits[compliance.name].optimal
    assert compliance.name in [one.name for one in row.active]
    kept = json.loads(to_json(results))
    assert kept["statics"][compliance.name]["limit"] == 5.5e-6
    assert kept["statics"][compliance.name]["optimal_curve"] == compliance.optimal_curve.tolist()
    rows = list(csv.DictReader(io.StringIO(sample_files(results)["statics.csv"].decode())))
    assert [float(each[f"{compliance.name} exact [um/N]"]) for each in rows] == pytest.approx(
        (1e6 * compliance.optimal_curve).tolist()
    )
    assert "statics" in [plan.name for plan in run_figures(results)]
    (table,) = [each for each in run_tables(results) if each.title == "Limits and bands"]
    (line,) = [each for each in table.rows if each[0].startswith("compliance")]
    assert line[2:] == ("5.5 um/N", "0 %")
    card = verdict_of(results)
    assert any(
        "Compliance of forearm.end along [0, 1] at most 5.5 um/N" in f.label for f in card.findings
    )
    assert [one.tone for one in card.findings] == ["good"] * 4


def test_the_limits_hold_at_5000_instants() -> None:
    case, result = load_case(CASES / "drilling_arm.yaml"), drilled()
    model, y = case.model(), np.array(list(result.design.values()))
    (part,) = case.trajectory.parts
    fine = part.trajectory.motion.poses(np.linspace(0, 10, 5000))
    found = compliances(model, {"forearm.end": [[1, 0], [0, 1]]})
    x = model.x(fine, y)
    w = found.at(x, np.zeros(x.shape[1], dtype=bool))[0].max(axis=0)
    assert w[0] <= 1e-6 / 0.3
    assert w[1] <= 5.5e-6 * (1 + 1e-4)


def test_a_case_with_nothing_but_a_stiffness_has_an_answer() -> None:
    """The least change that meets it."""
    result, row = solved(f"  - {{stiffness: {{{AT}}}, at_least: 0.4 N/um}}\n")
    assert row.verdict == "reached"
    (limit,) = row.limits
    assert limit.optimal == pytest.approx(4e5, rel=1e-6)
    assert limit.initial < 4e5
    assert (limit.lower, limit.upper, limit.unit) == (4e5, None, "N/m")
    assert "Reached: every target is met. Worst violation of a limit: " in repr(result)
    assert repr(result).endswith(f" before ({limit.words}), 0 % after, solved exactly.>")
    assert verdict_of(result.results) is not None
    to_json(result.results)
    assert run_figures(result.results)


def test_what_no_gears_can_hold_is_infeasible_and_what_tubes_might_is_not_said_to_be() -> None:
    asked = f"  - {{stiffness: {{{AT}}}, at_least: 40 N/um}}\n"
    _, row = solved(asked)
    assert row.verdict == "infeasible"
    (limit,) = row.limits
    assert row.conflict == (limit.name,)
    assert limit.extreme is not None
    assert "the most found is" in row.reason
    assert "at sample" in row.reason
    _, row = solved(asked, TUBES)
    assert row.verdict == "do_not_use"
    assert row.conflict == ()


def test_a_limit_holds_where_it_is_asked_for_only() -> None:
    motion = LEVEL[LEVEL.index("trajectory:") :]
    body = "\n".join(motion.splitlines()[1:])
    other = body.replace("0.65, 0.25], [0.65, -0.25", "0.3, 0.25], [0.3, -0.25")
    head = LEVEL[: LEVEL.index("trajectory:")]
    head += f"trajectory:\n  - name: far\n{_indented(body)}\n  - name: near\n{_indented(other)}\n"
    limit = f"{{compliance: {{{AT}}}, at_most: 4 um/N, trajectory: near, during: [2 s, 6.1 s]}}"
    result, row = solved(f"  - {limit}\n", head=head)
    (static,) = result.results.statics
    there = np.isfinite(static.optimal_curve)
    near = result.results.trajectories[1].rows
    time_s = result.results.time_s
    expected = (np.arange(len(time_s)) >= near.start) & (time_s >= 2.0) & (time_s <= 6.1)
    assert np.array_equal(there, expected)
    assert 6.1 in time_s[there]  # an instant between samples
    assert "along 'near' from 2 to 6.1 s" in static.name
    assert row.verdict == "reached"


def _indented(text: str) -> str:
    return "\n".join(f"  {line}" for line in text.splitlines())


SHOULDER, ELBOW = (f"drive: {{stiffness: {k} kN m/rad}}" for k in (200, 100))


@pytest.mark.parametrize(
    ("head", "at", "message"),
    [
        (LEVEL.replace(f", {ELBOW}", ""), "forearm.end", "moves freely in this direction"),
        (LEVEL.replace(SHOULDER, "drive: locked"), "upper_arm.start", "nothing gives way at"),
    ],
    ids=["free", "rigid"],
)
def test_what_has_no_stiffness_is_refused_by_name(
    head: str, at: str, message: str, tmp_path: Path
) -> None:
    target = f"  - {{stiffness: {{at: {at}, direction: [0, 1]}}, at_least: 3}}\n"
    with pytest.raises(CaseError) as error:
        solved(target, TUBES, head)
    (problem,) = error.value.problems
    (tmp_path / "case.yaml").write_text(f"{head}{TUBES}targets:\n{target}")
    with pytest.raises(CaseError, match=message):
        check(tmp_path / "case.yaml")
    assert problem.path == "targets[0].stiffness"
    assert message in problem.message
    assert ("nothing holds q2" in problem.message) == (at == "forearm.end")


def test_a_catalogue_keeps_a_limit_of_compliance() -> None:
    listed = """\
design:
  upper: {parameter: sections.upper.outer_diameter, values: [60 mm, 70 mm, 90 mm, 110 mm], price: 1}
  fore: {parameter: sections.fore.outer_diameter, values: [50 mm, 60 mm, 70 mm], price: 1}
"""
    result, row = solved(f"  - {{compliance: {{{AT}}}, at_most: 4.5 um/N}}\n", listed)
    case = BuiltCase(
        parse((LEVEL + listed + "targets: [{mode: 1, at_least: 1}]\n").encode(), "c.yaml")
    )
    found = compliances(case.model(), {"forearm.end": [[0, 1]]})
    kept = {}
    for a in (0.06, 0.07, 0.09, 0.11):
        for b in (0.05, 0.06, 0.07):
            x = case.model().x(case.trajectory.q, [a, b])
            worst = found.at(x, np.zeros(x.shape[1], dtype=bool))[0].max()
            kept[a, b] = worst <= 4.5e-6
    best = min((a + b for (a, b), met in kept.items() if met))
    assert not all(kept.values())
    assert sum(result.design.values()) == pytest.approx(best)
    assert (row.verdict, row.optimality.kind) == ("reached", "proved")


def limits_of(case: BuiltCase) -> Any:
    return design_limits(case.file, case.model(), case.trajectory)


def test_slopes_along_a_path_that_lengths_follow_are_total() -> None:
    text = HEAD + (
        "design:\n"
        "  a: {parameter: links.upper_arm.length, min: 0.45, max: 0.55}\n"
        "  b: {parameter: links.forearm.length, min: 0.35, max: 0.45}\n"
        "  d: {parameter: sections.fore.outer_diameter, min: 50 mm, max: 90 mm}\n"
        "targets:\n"
        f"  - {{stiffness: {{{AT}}}, at_least: 0.3 N/um}}\n"
        "  - {sag: {at: forearm.end}, at_most: 0.1 mm}\n"
    )
    case = BuiltCase(parse(text.encode(), "case.yaml"))
    y = case.initial_design
    for limit in limits_of(case):
        way = limit.way
        slopes = way(y)[1]
        for k, h in enumerate((1e-4, 1e-4, 1e-5)):
            ends = [way(y + s * h * np.eye(3)[k])[0] for s in (-2, -1, 1, 2)]
            differences = (ends[0] - 8 * ends[1] + 8 * ends[2] - ends[3]) / (12 * h)
            np.testing.assert_allclose(slopes[:, k], differences, rtol=1e-6)
        assert not limit.is_decided


def test_a_node_inside_a_reduced_link_stays_in_the_model() -> None:
    """Statics at nodes of the interface are those of the whole link."""
    head = LEVEL.replace(
        "elements: 3, shear: true}", "elements: 6, shear: true, reduce_to: 2 kHz}", 1
    )
    design = GEARS
    values = []
    for own in (head, LEVEL.replace("elements: 3, shear: true}", "elements: 6, shear: true}", 1)):
        text = f"{own}{design}targets:\n  - {{stiffness: {{{AT}}}, at_least: 1}}\n"
        case = BuiltCase(parse(text.encode(), "case.yaml"))
        (limit,) = limits_of(case)
        values.append(limit.way(case.initial_design)[0])
    np.testing.assert_allclose(*values, rtol=1e-9)
