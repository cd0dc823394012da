"""Files that are no YAML case at all: one clear message each, never a traceback, never a crash."""

import os
from pathlib import Path
from typing import NamedTuple

import pytest
from small_case import MOTION, TEXT, edited, unmarked

from eigassign.case import load, parse
from eigassign.errors import CaseError, StorageError, UsageError
from eigassign.files import CASE


class Unreadable(NamedTuple):
    name: str
    text: str  # with ¦ where the problem must be shown; at 1:1 where there is none
    message: str


NESTED = "¦".join(("[" * 50, "[" * 199_950))
TABLE = [
    Unreadable("empty", "", "the file is empty: expected keys such as title, mechanism"),
    Unreadable("comments only", "# nothing\n\n", "the file is empty"),
    Unreadable("only a separator", "---\n", "the file is empty"),
    Unreadable("a sentence", "hello", "the file holds 'hello'"),
    Unreadable("a list", "- 1\n- 2\n", "the file holds a list"),
    Unreadable("two documents", "title: a\n¦---\ntitle: b\n", "a second document starts here"),
    Unreadable("tab", "title: a\nmechanism:\n¦\tspace: planar\n", "a tab cannot indent YAML"),
    Unreadable("tab after spaces", "mechanism:\n  a: 1\n ¦\tb: 1\n", "a tab cannot indent YAML"),
    Unreadable("open bracket", "title: [a, b\n¦", "check brackets, quotes and indentation"),
    Unreadable("open quote", 'title: "a\n¦', "check brackets, quotes and indentation"),
    Unreadable("colon in text", "title: a¦: b\n", "quote text that contains ': '"),
    Unreadable("key without colon", "title: a\nmechanism\n¦x: 1\n", "a key needs ': ' behind it"),
    Unreadable("reserved character", "title: ¦@home\n", "not valid YAML"),
    Unreadable("NUL", "title: a¦\0b\n", "control character U+0000"),
    Unreadable("escape character", "title: ä¦\x1b[1m\n", "control character U+001B"),
    Unreadable("deep nesting", f"a: {NESTED}", "nested more than 50 levels deep"),
    Unreadable("deep mapping", "a: " + "{b: " * 49 + "{¦b: " + "{b: " * 9, "more than 50 levels"),
    Unreadable("anchor", "a: ¦&x 1\n", "anchors (&) and aliases (*) are refused"),
    Unreadable("alias", "a: ¦*x\n", "anchors (&) and aliases (*) are refused"),
    Unreadable("tag", "a: ¦!!python/object:os.system ls\n", "tags (!) are refused"),
    Unreadable("standard tag", "a: ¦!!str 5\n", "tags (!) are refused"),
    Unreadable("tagged key", "¦!!str a: 5\n", "tags (!) are refused"),
]


@pytest.mark.parametrize("case", TABLE, ids=lambda case: case.name)
def test_a_file_that_is_no_case_is_refused_at_the_right_place(case: Unreadable) -> None:
    text, places = unmarked(case.text)
    with pytest.raises(CaseError) as caught:
        parse(text.encode(), "case.yaml")
    (problem,) = caught.value.problems
    assert case.message in problem.message
    assert (problem.line, problem.column) == (places[0] if places else (1, 1))


def message_for(data: bytes) -> str:
    with pytest.raises(CaseError) as caught:
        parse(data, "case.yaml")
    return str(caught.value)


def test_an_alias_bomb_is_refused_before_it_goes_off() -> None:
    levels = "".join(f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]\n" for k in range(1, 40))
    message = message_for(("a0: &a0 [x]\n" + levels).encode())
    assert "anchors (&) and aliases (*) are refused" in message
    assert len(message.splitlines()) == 1


def test_bytes_that_are_not_utf_8_are_told_with_their_place() -> None:
    assert message_for(b"title: a\nx: \xff\xfe\n").startswith("case.yaml:2:4: not UTF-8 text (byte")


def test_utf_16_is_refused() -> None:
    assert "save the file as UTF-8" in message_for(TEXT.encode("utf-16"))


def test_a_file_over_the_size_limit_is_refused() -> None:
    assert "larger than 10 MB" in message_for(b"#" * (CASE + 1))


def test_a_file_of_more_entries_than_any_case_has_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("EIGASSIGN_LIMITS", "0.01")
    long = f"{TEXT}x: [{'1,' * 2_500}]\n".encode()
    assert "more than 2000 entries: put long tables into CSV files" in message_for(long)
    monkeypatch.setenv("EIGASSIGN_LIMITS", "0.02")
    assert "more than" not in message_for(long)


def test_a_group_of_more_names_than_any_mechanism_has_is_refused() -> None:
    bodies = "".join(f"    b{k}: {{at: x}}\n" for k in range(1001))
    text = TEXT.replace("  bodies:\n", "  bodies:\n" + bodies)
    assert message_for(text.encode()).endswith("mechanism.bodies: more than 1000 entries")


def test_a_byte_order_mark_is_no_problem() -> None:
    assert parse(b"\xef\xbb\xbf" + TEXT.encode(), "case.yaml").title == "Arm"


@pytest.mark.parametrize("ending", ["\r\n", "\r"])
def test_line_endings_of_other_systems_are_read(ending: str) -> None:
    assert parse(TEXT.replace("\n", ending).encode(), "x") == parse(TEXT.encode(), "x")


def test_a_duplicate_key_is_an_error_that_names_the_first() -> None:
    text = TEXT.replace("    rod:", "    pipe: {shape: circle, diameter: 1 cm}\n    rod:")
    expected = "case.yaml:9:5: mechanism.sections.pipe: 'pipe' is given twice; first in line 7"
    assert expected in message_for(text.encode())


@pytest.mark.parametrize("key", ["1", "true", "~", "1e3", "[a]", "{a: 1}", "? {a: 1}\n"])
def test_a_key_that_is_not_text_is_refused(key: str) -> None:
    message = message_for(f"{TEXT}{key}: x\n".encode())
    assert "keys must be text" in message
    assert message.startswith("case.yaml:36:")


def test_a_duplicate_is_told_with_errors_of_form_and_with_unknown_names() -> None:
    text = TEXT.replace("title: Arm", "title: Arm\ntitle: Leg")
    text = text.replace("section: pipe", "section: pip")
    for old, new, path in (
        ("density: 2700", "density: -1", "mechanism.materials.alu.density"),
        ("density: 2700", "density: 2700", "mechanism.links.fore.section"),
    ):
        lines = message_for(text.replace(old, new).encode()).splitlines()
        assert [line.split(": ")[1] for line in lines] == ["title", path]


def test_a_missing_file_is_wrong_usage(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"nowhere\.yaml: no such case file$"):
        load(tmp_path / "nowhere.yaml")
    (tmp_path / "arm.yaml").touch()
    with pytest.raises(UsageError, match=r"no such case file; did you mean .*arm\.yaml\?"):
        load(tmp_path / "arm")


def test_a_folder_is_wrong_usage(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="it is a folder"):
        load(tmp_path)


def test_a_path_through_a_file_is_wrong_usage(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(UsageError, match="no such case file"):
        load(tmp_path / "file" / "case.yaml")


def test_a_pipe_is_wrong_usage_and_does_not_block(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(UsageError, match="it is a pipe, not a file"):
        load(tmp_path / "pipe")


@pytest.mark.parametrize("path", ["a\0b", "x" * 5000])
def test_a_path_no_file_can_have_is_an_error_of_ours(path: str) -> None:
    with pytest.raises((UsageError, StorageError)):
        load(path)


def test_a_file_that_may_not_be_read_is_a_storage_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "case.yaml"
    path.write_text(TEXT)

    def denied(*_args: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("os.open", denied)  # root may read anything, so chmod is no test
    with pytest.raises(StorageError, match="cannot be read: Permission denied"):
        load(path)


@pytest.mark.parametrize(
    "text",
    [
        edited(MOTION, "  file: table.csv\n"),
        TEXT + "measurements: {file: table.csv}\n",  # of which a run records what they are
    ],
)
def test_so_is_a_table_that_a_case_names(
    text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "case.yaml").write_text(text)
    (tmp_path / "table.csv").write_text("a\n")
    really = os.open

    def denied(path: Path, *how: int) -> int:
        if Path(path).name == "table.csv":
            raise PermissionError(13, "Permission denied")
        return really(path, *how)

    monkeypatch.setattr("os.open", denied)
    with pytest.raises(StorageError, match=r"table\.csv: cannot be read"):
        load(tmp_path / "case.yaml")
