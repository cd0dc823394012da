"""Mistakes in targets, design entries and the assignment: each told once, at its place."""

from pathlib import Path

import pytest
from mistakes import tables, told_once
from small_case import TEXT, edited

T = "  - {mode: 1, frequency: 190 Hz}\n"
D = "  d: {parameter: sections.rod.diameter, min: 20 mm, max: 40 mm}\n"
ONE = "sections.rod.diameter: 2 cm"

TABLES = tables("wrong_targets")
TARGETS = TABLES["targets"]
ENTRIES = TABLES["entries"]
ASSIGNMENT = TABLES["assignment"]
NOT_OF_OBJECTIVES = TABLES["not_of_objectives"]
NOT_IN_ONE_SHOT = TABLES["not_in_one_shot"]


def check(marked: str, path: str, message: str, folder: Path) -> None:
    found, told = told_once(marked, folder / "case.yaml")
    assert found == path
    assert message in told


@pytest.mark.parametrize(("target", "key", "message"), TARGETS.values(), ids=TARGETS)
def test_a_wrong_target_is_told_once(target: str, key: str, message: str, tmp_path: Path) -> None:
    k = target[: target.index("¦")].count("\n")
    path = f"targets[{k}].{key}".removesuffix(".")
    check(edited(T, f"  - {target}\n"), path, message, tmp_path)


@pytest.mark.parametrize(("entry", "key", "message"), ENTRIES.values(), ids=ENTRIES)
def test_a_wrong_entry_of_the_design_is_told_once(
    entry: str, key: str, message: str, tmp_path: Path
) -> None:
    check(edited(D, f"  {entry}\n"), f"design.{key}", message, tmp_path)


@pytest.mark.parametrize(("keys", "key", "message"), ASSIGNMENT.values(), ids=ASSIGNMENT)
def test_a_wrong_assignment_is_told_once(keys: str, key: str, message: str, tmp_path: Path) -> None:
    check(TEXT + f"assignment: {keys}\n", f"assignment.{key}", message, tmp_path)


@pytest.mark.parametrize(("old", "new", "path"), NOT_IN_ONE_SHOT.values(), ids=NOT_IN_ONE_SHOT)
def test_one_shot_refuses_by_name_what_its_program_cannot_take(
    old: str, new: str, path: str, tmp_path: Path
) -> None:
    text = edited(old, new) + "assignment: {method: one_shot}\n"
    check(text, path, "write method: sequential", tmp_path)


@pytest.mark.parametrize(
    ("keys", "old", "new", "path", "message"), NOT_OF_OBJECTIVES.values(), ids=NOT_OF_OBJECTIVES
)
def test_objectives_and_prices_say_what_they_cannot_take(
    keys: str, old: str, new: str, path: str, message: str, tmp_path: Path
) -> None:
    check(edited(old, new or old) + f"assignment: {keys}\n", path, message, tmp_path)


def test_a_constraint_does_not_name_choices(tmp_path: Path) -> None:
    text = edited(D, f"  d: {{choices: {{x: {{{ONE}}}}}}}\n")
    text = text.replace("terms: {m: 1}", "terms: {m: 1, ¦d: 1}")
    message = "'d' is a list of choices; a constraint is between parameters"
    check(text, "design.constraints.budget.terms.d", message, tmp_path)


def test_a_part_is_of_a_named_trajectory_where_there_are_several(tmp_path: Path) -> None:
    motion = TEXT[TEXT.index("trajectory:\n") : TEXT.index("design:\n")]
    several = "trajectory:\n" + 2 * "  - {q: [[0, 0], [1, 1]], duration: 1}\n"
    target = "  - {mode: 1, at_least: 3, ¦during: [0.1, 0.2]}\n"
    text = edited(motion, several).replace(T, target)
    check(
        text,
        "targets[0].during",
        "needs the trajectory that is meant, as trajectory (1, 2)",
        tmp_path,
    )
