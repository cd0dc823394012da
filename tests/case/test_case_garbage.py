"""Whatever is fed in, only errors meant for the user come out. Deterministic (derandomised)."""

import re
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from small_case import TEXT
from wide_cases import PLANAR, SPATIAL

from eigassign.case import CaseFile, parse
from eigassign.errors import CaseError, Problem

DATA = TEXT.encode()
TOKENS = re.findall(r"[\w.%-]+|\s+|[^\w\s]", TEXT)
STRAY = [
    *(
        "[",
        "]",
        "{",
        "}",
        ":",
        ": ",
        ",",
        "- ",
        "\n",
        "\t",
        "  ",
        "&a",
        "*a",
        "!!int",
        "? ",
        "|",
        ">",
    ),
    *("~", "null", "true", "1", "-1", "0", "1e999", ".nan", "x", "''", '"', "%", "#", "---", "..."),
    *("[1, 2]", "{a: 1}", "[[1]]", "auto", "q1", "ground", "1 mm", "9" * 400, "\u2028", "é", "\0"),
]
quick = settings(derandomize=True, deadline=None, max_examples=150)


def survives(data: bytes) -> None:
    """Either a case or a CaseError with at least one problem, each with a place and a message."""
    found = outcome(data)
    if isinstance(found, CaseFile):
        assert parse(found.resolved().encode(), "case.yaml") == found
        return
    assert found
    for problem in found:
        assert problem.line >= 1
        assert problem.column >= 1
        assert problem.message


def outcome(data: bytes) -> CaseFile | tuple[Problem, ...]:
    try:
        return parse(data, "case.yaml")
    except CaseError as error:
        return error.problems


@quick
@given(st.binary(max_size=200))
def test_random_bytes(data: bytes) -> None:
    survives(data)


@quick
@given(st.text(max_size=200))
def test_random_text(text: str) -> None:
    survives(text.encode("utf-8", "replace"))


@quick
@given(st.integers(0, len(DATA) - 1), st.integers(0, 30), st.binary(max_size=10))
def test_the_small_case_with_some_bytes_overwritten(start: int, length: int, new: bytes) -> None:
    survives(DATA[:start] + new + DATA[start + length :])


@quick
@given(st.lists(st.tuples(st.integers(0, len(TOKENS) - 1), st.sampled_from(STRAY)), max_size=3))
def test_the_small_case_with_some_words_replaced(changes: list[tuple[int, str]]) -> None:
    tokens = list(TOKENS)
    for place, word in changes:
        tokens[place] = word
    survives("".join(tokens).encode())


LINES = TEXT.splitlines(keepends=True)


@quick
@given(st.lists(st.integers(0, len(LINES) - 1), max_size=4), st.integers(0, len(LINES) - 1))
def test_the_small_case_with_some_lines_missing_and_one_repeated(
    gone: list[int], twice: int
) -> None:
    kept = [line for k, line in enumerate(LINES) if k not in gone]
    survives("".join([*kept, LINES[twice]]).encode())


MATRICES = Path(__file__).parents[2] / "cases" / "superelement_arm"
WITH_FILES = PLANAR.replace("K.mtx", str(MATRICES / "stiffness.mtx")).replace(
    "M.npz", str(MATRICES / "mass.mtx")
)
WORDS = ("~", "x", "-1", "[1, 2]", "{a: 1}")
MORE = ("true", "1e999", ".nan", "[[[1]]]", "[{}]")
VALUE = re.compile(r"(?<=: )([\w.%-]+(?: \w+)?|\[[^\]]*\]|\{[^}]*\})")


@pytest.mark.parametrize("words", [WORDS, pytest.param(MORE, marks=pytest.mark.slow)])
@pytest.mark.parametrize("text", [TEXT, WITH_FILES, SPATIAL], ids=["small", "planar", "spatial"])
def test_every_value_of_a_case_replaced_by_every_stray_word(
    text: str, words: tuple[str, ...]
) -> None:
    """Exhaustive where it matters: each value in turn is a number, a list, a mapping, nothing, …"""
    for start, end in [m.span(1) for m in VALUE.finditer(text)]:
        for word in words:
            survives((text[:start] + word + text[end:]).encode())


@pytest.mark.parametrize("text", [WITH_FILES, SPATIAL], ids=["planar", "spatial"])
def test_every_line_of_a_case_left_out(text: str) -> None:
    assert isinstance(outcome(text.encode()), CaseFile)
    lines = text.splitlines(keepends=True)
    for k in range(len(lines)):
        survives("".join(lines[:k] + lines[k + 1 :]).encode())
