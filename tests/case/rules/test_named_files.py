"""Files that a case names lie below its folder and are files, or nothing is read of them."""

import os
from pathlib import Path

import pytest
from small_case import TEXT

from eigassign.case import load
from eigassign.errors import CaseError

MOTION = TEXT[TEXT.index("  tip:") : TEXT.index("design:")]
TABLE = "time,q1,q2\n0,0,0\n1,1,1\n"


def case_with(folder: Path, file: str) -> Path:
    folder.mkdir(exist_ok=True)
    path = folder / "case.yaml"
    path.write_text(TEXT.replace(MOTION, f"  file: {file}\n"))
    return path


@pytest.mark.parametrize("how", ["..", "absolute", "link", "sibling"])
def test_a_file_outside_the_folder_is_read_only_where_that_is_allowed(
    how: str, tmp_path: Path
) -> None:
    (tmp_path / "secret.csv").write_text(TABLE)
    inside = tmp_path / "case"
    inside.mkdir()
    (tmp_path / "case2").mkdir()
    (tmp_path / "case2" / "a.csv").write_text(TABLE)
    (inside / "link.csv").symlink_to(tmp_path / "secret.csv")
    names = {"..": "../secret.csv", "absolute": f"{tmp_path}/secret.csv", "link": "link.csv"}
    path = case_with(inside, names.get(how, "../case2/a.csv"))
    with pytest.raises(CaseError, match=r"trajectory\.file: .* lies outside .*--allow-outside"):
        load(path)
    assert len(load(path, allow_outside=True).files) == 1


def test_whether_a_file_outside_exists_is_not_told(tmp_path: Path) -> None:
    for name in ("../here.csv", "../gone.csv"):
        (tmp_path / "here.csv").touch()
        with pytest.raises(CaseError, match="lies outside") as caught:
            load(case_with(tmp_path / "case", name))
        assert "no such" not in str(caught.value)


def test_below_the_folder_any_way_of_writing_it_is_fine(tmp_path: Path) -> None:
    (tmp_path / "case" / "data").mkdir(parents=True)
    (tmp_path / "case" / "data" / "a.csv").write_text(TABLE)
    (tmp_path / "other").symlink_to(tmp_path / "case")
    for name in ("data/../data/a.csv", str(tmp_path / "other" / "data" / "a.csv")):
        assert list(load(case_with(tmp_path / "case", name)).files.values())
        assert load(tmp_path / "other" / "case.yaml").files


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes here")
def test_a_pipe_and_a_file_of_a_terabyte_are_told_at_their_line(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.csv")
    with open(tmp_path / "huge.csv", "wb") as file:
        file.truncate(10**12)
    for name, reason in (("pipe", "it is a pipe"), ("huge", "100 MB at most; .*=10000 allows it")):
        with pytest.raises(CaseError, match=rf"case\.yaml:\d+:3: trajectory\.file: .*{reason}"):
            load(case_with(tmp_path, f"{name}.csv"))


def test_a_name_with_a_null_character_is_a_problem_of_its_line(tmp_path: Path) -> None:
    for allowed in (False, True):
        with pytest.raises(CaseError, match=r"trajectory\.file: no such file: .*a\\x00b\.csv"):
            load(case_with(tmp_path, '"a\\0b.csv"'), allow_outside=allowed)
