"""Plain scalars follow the YAML 1.2 core schema, not PyYAML's 1.1."""

import math

import pytest

from eigassign.case import read_yaml
from eigassign.errors import CaseError


def resolve(text: str) -> object:
    return read_yaml(f"a: {text}\n".encode(), "f").tree["a"]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e3", 1000.0),
        ("1e-6", 1e-6),
        ("1E+2", 100.0),
        ("+.5", 0.5),
        ("1.", 1.0),
        ("-0", 0),
        ("012", 12),
        ("0o14", 12),
        ("0x1F", 31),
        ("+12", 12),
        (".inf", math.inf),
        ("-.INF", -math.inf),
        ("true", True),
        ("False", False),
        ("null", None),
        ("~", None),
        ("", None),
    ],
)
def test_a_plain_scalar_has_its_core_schema_value(text: str, value: object) -> None:
    assert resolve(text) == value
    assert type(resolve(text)) is type(value)


@pytest.mark.parametrize(
    "text",
    [
        *("no", "No", "yes", "on", "off", "y", "n", "tRUE"),
        *("12:30", "1:30:00", "2024-01-01", "1_000", "0b11", "-0x1F", "0o9"),
        *("e3", "1e", ".", "+", "1.2.3", "inf", "nan", ".Nan", "=", "<<", "30 mm", "1,5"),
    ],
)
def test_everything_else_is_text(text: str) -> None:
    assert resolve(text) == text


def test_nan_is_a_number_here_and_refused_where_it_is_used() -> None:
    assert math.isnan(resolve(".nan"))


@pytest.mark.parametrize("text", ["9" * 5000, "-" + "9" * 5000, "0x" + "f" * 5000])
def test_an_integer_beyond_any_float_does_not_hang_or_raise(text: str) -> None:
    assert math.isinf(resolve(text))


def test_a_quoted_number_is_text() -> None:
    assert read_yaml(b"a: '12'\nb: \"true\"\nc: |\n  1\n", "f").tree == {
        "a": "12",
        "b": "true",
        "c": "1\n",
    }


def test_marks_are_those_of_keys_and_items() -> None:
    source = read_yaml(b"a:\n  b: [10,\n      {c: 20}]\n", "f")
    assert source.tree == {"a": {"b": (10, {"c": 20})}}
    marks = {path: source.marks.find(path)[:2] for path in [(), ("a",), ("a", "b"), ("a", "b", 0)]}
    assert marks == {(): (1, 1), ("a",): (1, 1), ("a", "b"): (2, 3), ("a", "b", 0): (2, 7)}
    assert source.marks.find(("a", "b", 1, "c"))[:2] == (3, 8)


def test_a_path_that_is_not_there_is_shown_at_its_nearest_parent() -> None:
    source = read_yaml(b"x: 1\na: {b: 1}\n", "f")
    problem = source.problem(("a", "c", 0), "missing")
    assert str(problem) == "f:2:1: a.c[0]: missing"
    assert source.problem(("a\nb", 2), "").path == "'a\\nb'[2]"


def test_columns_count_characters_not_bytes() -> None:
    source = read_yaml("ä: {öl: 1, z: 2}\n".encode(), "f")
    assert source.marks.find(("ä", "z"))[:2] == (1, 12)


@pytest.mark.parametrize(
    ("text", "line", "meant"),
    [
        ("a: {b: 1, length:300}\n", 1, "length: 300"),
        ("a: {b: 1, diameter:10 mm}\n", 1, "diameter: 10 mm"),
        ("a:\n  length:300\n  b: 1\n", 3, "length: 300"),
        ("a:\n  b: 1\n  length:300\nc: 1\n", 4, "length: 300"),
        ("title:An arm\n", 1, "title: An arm"),
        ("title:An arm\nmechanism:\n", 2, "title: An arm"),
    ],
)
def test_a_key_without_a_blank_behind_its_colon_is_recognised(
    text: str, line: int, meant: str
) -> None:
    try:
        problems = read_yaml(text.encode(), "f").problems
    except CaseError as error:
        problems = error.problems
    (problem,) = problems
    assert problem.line == line
    assert problem.message.endswith(f"a blank is missing behind the colon: write {meant!r}")


def test_what_was_meant_by_a_key_without_a_blank_is_read_on() -> None:
    assert read_yaml(b"{a: {length:300, b:10 mm, 'c:d': 1}}", "f").tree == {
        "a": {"length": 300, "b": "10 mm", "c:d": 1}
    }


@pytest.mark.parametrize("text", ["a: https://x.org\n", "a: 'b:c'\n", "a: b:c\n", "{'b:c': x}\n"])
def test_a_colon_inside_text_is_none_of_this(text: str) -> None:
    assert read_yaml(text.encode(), "f").problems == ()
