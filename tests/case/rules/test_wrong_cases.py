"""Every mistake has its own message, at its own key, in its own line and column; and only one."""

from pathlib import Path

import pytest
from mistakes import Wrong, problems_of, tables, told_once
from small_case import edited

TABLES = tables("wrong_cases")
MECHANISM = [Wrong(*row) for row in TABLES["mechanism"]]
STUDY = [Wrong(*row) for row in TABLES["study"]]
SAMPLED = [Wrong(*row) for row in TABLES["sampled"]]


@pytest.mark.parametrize("wrong", [*MECHANISM, *STUDY, *SAMPLED], ids=lambda wrong: wrong.name)
def test_a_mistake_is_told_once_where_it_is_and_what_is_allowed(
    wrong: Wrong, tmp_path: Path
) -> None:
    path, message = told_once(edited(wrong.old, wrong.new), tmp_path / "case.yaml")
    assert path == wrong.path
    assert wrong.message in message


def messages(old: str, new: str, path: Path) -> list[str]:
    return [message for *_, message in problems_of(edited(old, new), path / "case.yaml")]


def test_a_decimal_comma_between_braces_is_recognised(tmp_path: Path) -> None:
    for number in ("0,03", "0,03 m"):
        found = messages("diameter: 30 mm", f"diameter: {number}", tmp_path)
        assert any("decimals take a point, not a comma" in message for message in found)


def test_misspelt_constraints_are_recognised(tmp_path: Path) -> None:
    found = messages("  constraints:", "  constraint:", tmp_path)
    assert "no entry, which has a parameter; did you mean 'constraints'?" in found


def test_bodies_that_no_file_has_are_unknown(tmp_path: Path) -> None:
    found = messages("  bodies:\n    tool: {at: hand.end, mass: 0.1}\n", "", tmp_path)
    assert "unknown body 'tool'; known: none" in found


def test_a_bound_that_is_wrong_is_not_compared_with_the_other(tmp_path: Path) -> None:
    (found,) = messages("min: 20 mm", "min: 20 Hz", tmp_path)
    assert "which is frequency" in found


def test_long_lists_of_names_are_cut_short(tmp_path: Path) -> None:
    many = "".join(f"    s{k}: {{shape: circle, diameter: 1}}\n" for k in range(40))
    text = edited("sections:\n", "sections:\n" + many).replace("section: pipe", "section: zzz")
    ((*_, message),) = problems_of(text, tmp_path / "case.yaml")
    assert message.endswith("s18, s19, …")
