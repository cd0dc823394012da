"""A plan has its cases in order, each with a name that says its values and a key that tells it."""

from pathlib import Path
from typing import Any

import pytest
from instant import MASS, TEXT, case

from eigassign.batch import folder_names, plan_of, variant_problem
from eigassign.errors import Problem


def names(plan: Any) -> list[str]:
    return [plan[k].name for k in range(len(plan))]


def keys(plan: Any) -> list[str]:
    return [plan[k].key for k in range(len(plan))]


def test_variants_are_named_by_their_values(tmp_path: Path) -> None:
    arm = case(tmp_path)
    assert names(plan_of([arm], [f"{MASS}=0,100 g", "targets.0.frequency=180 Hz,190.5"])) == [
        *("mass=0,frequency=180Hz", "mass=0,frequency=190.5"),
        *("mass=100g,frequency=180Hz", "mass=100g,frequency=190.5"),
    ]
    other = "mechanism.bodies.elbow_mass.mass"
    found = names(plan_of([arm], [f"{MASS}=1", f"{other}=2"]))
    assert found == ["tool_mass.mass=1,elbow_mass.mass=2"]


def test_names_that_do_not_say_all_end_with_a_hash_of_their_values(tmp_path: Path) -> None:
    settings = [f"{MASS}=0.12345678,0.123456789,1/3", f"title=../a b,a{200 * 'b'},{90 * '漢'}"]
    plan = plan_of([case(tmp_path)], settings)
    found = names(plan)
    assert names(plan_of([case(tmp_path, end="assignment: {starts: 2}\n")], settings)) == found
    assert found[0].startswith("mass=0.123457,title=.._ab~")
    assert len(set(found)) == len(plan) == 9
    assert max(len(name.encode()) for name in found) < 120
    assert not any("/" in name for name in found)


def test_names_that_differ_in_the_case_of_letters_alone_are_told_apart(tmp_path: Path) -> None:
    titles = ["arm", "Arm", "ARM", "180 MHz", "180 mHz", "beam"]
    (tmp_path / "titles.csv").write_text("\n".join(["title", *titles, ""]))
    for values in (f"parameters: {{title: [{', '.join(titles)}]}}", "file: titles.csv"):
        found = names(plan_of([case(tmp_path, end=f"sweep: {{{values}}}\n")]))
        assert len({name.casefold() for name in found}) == len(found) == 6
        assert [name.partition("~")[0] for name in found[:2]] == ["title=arm", "title=Arm"]
        assert found[-1] == "title=beam"


STRANGE = (
    *(
        "plain",
        "Case",
        "case",
        "a\nb",
        "a\x1b[2J",
        "a\u202eb",
        "CON",
        "aux",
        "nul.x",
        "Com1",
        "blank ",
        "point.",
    ),
    *("x" * 250, "x" * 251, 120 * "ü", "\udcff\udcfe", "\udcff\udcfd"),
)


def test_names_of_case_files_are_such_as_every_file_system_allows() -> None:
    found = folder_names([Path("cases", f"{name}.yaml") for name in STRANGE])
    assert len({name.casefold() for name in found}) == len(STRANGE)
    assert found[:3] == ["plain", "Case", "case-2"]
    for name in found:
        assert name.isprintable()
        assert len(name.encode()) <= 111
        assert name.rstrip(" .") == name
        assert name.partition(".")[0].upper() not in ("CON", "AUX", "NUL", "COM1")


def test_keys_are_those_of_the_content(tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    first = plan_of([case(tmp_path)], [f"{MASS}=0,100 g"])
    moved = plan_of([case(tmp_path / "other", end="# a comment\n")], [f"{MASS}=0,100 g,200 g"])
    assert keys(moved)[:2] == keys(first)
    edited = plan_of([case(tmp_path, end="assignment: {starts: 2}\n")], [f"{MASS}=0,100 g"])
    assert not set(keys(edited)) & set(keys(first))
    assert len(set(keys(first))) == 2


def test_the_files_of_a_plan_follow_one_another(tmp_path: Path) -> None:
    swept = case(tmp_path, "b.yaml", f"sweep: {{parameters: {{{MASS}: [1, 2]}}}}\n")
    plan = plan_of([case(tmp_path, "a.yaml"), swept, tmp_path / "missing.yaml"])
    assert names(plan) == ["a", "b,mass=1", "b,mass=2", "missing"]
    assert [plan[k].index for k in range(4)] == [0, 1, 2, 3]
    assert [plan[k].values for k in range(3)] == [{}, {MASS: 1}, {MASS: 2}]
    with pytest.raises(IndexError):
        plan[4]


def test_a_problem_of_a_variant_is_shown_where_its_value_was_given(tmp_path: Path) -> None:
    arm = case(tmp_path, end=f"sweep:\n  parameters:\n    {MASS}: [1, -2]\n")
    wrong = Problem(str(arm), 7, 5, MASS, "must be >= 0 kg, got -2")
    last = TEXT.count("\n") + 3
    shown = variant_problem(plan_of([arm]), 1, wrong)
    assert str(shown) == f"{arm}:{last}:5: sweep.parameters.{MASS}: mass=-2: {wrong.message}"
    shown = variant_problem(plan_of([arm], [f"{MASS}=-2"]), 0, wrong)
    assert str(shown) == f"--set: {MASS}: mass=-2: {wrong.message}"
    elsewhere = Problem(str(arm), 3, 1, "title", "is wrong")
    assert (
        str(variant_problem(plan_of([arm]), 0, elsewhere)) == f"{arm}:3:1: title: mass=1: is wrong"
    )


def test_a_plan_of_many_variants_is_made_at_once(tmp_path: Path) -> None:
    plan = plan_of([case(tmp_path)], [f"{MASS}=0..1:1000", "targets.0.frequency=180..190:1001"])
    assert len(plan) == 1_001_000
    assert plan[len(plan) - 1].values == {MASS: 1, "targets.0.frequency": 190}
