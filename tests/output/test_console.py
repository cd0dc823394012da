"""Results reach any terminal, pipe or log whole and unchanged."""

import io
import math
from contextlib import redirect_stdout

import pytest
from synthetic_results import make_results

from eigassign.output import (
    Table,
    modes_table,
    print_assignment,
    print_tables,
    print_verdict,
    validation_table,
)
from eigassign.study import ValidationRow


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def piped(encoding: str = "utf-8") -> io.TextIOWrapper:
    return io.TextIOWrapper(io.BytesIO(), encoding=encoding, newline="")


def read(stream: io.TextIOWrapper) -> str:
    stream.flush()
    return stream.buffer.getvalue().decode(stream.encoding)


def shown(*tables: Table, encoding: str = "utf-8") -> str:
    out = piped(encoding)
    with redirect_stdout(out):
        print_tables(tables)
    return read(out)


def assignment(verbose: bool = True) -> str:
    out = piped()
    with redirect_stdout(out):
        print_assignment(make_results(), verbose=verbose)
    return read(out)


def test_an_assignment_shows_its_numbers_without_colour_codes_in_a_pipe():
    text = assignment()
    assert "\x1b" not in text
    for words in ("228.7", "6.00 %", "1.00 %", "solved", "3.1e-17", "Approximation"):
        assert words in text
    assert not any(line != line.rstrip() for line in text.splitlines())


@pytest.mark.parametrize("columns", [60, 80, 120])
def test_the_answer_alone_is_short(columns, monkeypatch):
    monkeypatch.setenv("COLUMNS", str(columns))
    text = assignment(verbose=False)
    assert len(text.splitlines()) <= 25
    assert "Distance to the target" in text
    assert not any(word in text for word in ("Approximation", "Sensitivity", "bodies."))


def test_an_ascii_locale_gets_ascii():
    text = shown(Table("Größe δ", ("名", "m"), (("Zweigelenkarm ä", "b"),)), encoding="ascii")
    assert "Zweigelenkarm ?" in text
    assert "Gr??e" in text


def test_brackets_are_text_and_control_characters_are_shown():
    cells = ("[case.yaml]", "[/red]", ":smile:", "x\x1b[2Jy\r")
    text = shown(Table("[bold] \x1b]0;b", ("a",), tuple((cell,) for cell in cells)))
    for words in ("[bold]", "[case.yaml]", "[/red]", ":smile:"):
        assert words in text
    assert "\x1b" not in text
    assert "\r" not in text


def test_long_cells_are_neither_wrapped_nor_cut_off_terminal():
    path = "/a/very/long/path" * 30
    assert f" {path}" in shown(Table("paths", ("name", "path"), (("x", path),)))


@pytest.mark.parametrize("columns", [40, 60, 80, 120])
def test_all_tables_of_a_run_fit_the_width_and_break_no_word(columns, monkeypatch):
    known = set(assignment().split())
    monkeypatch.setenv("COLUMNS", str(columns))
    lines = assignment().splitlines()
    assert max(map(len, lines)) <= columns
    new = {word for line in lines for word in line.split()} - known
    assert columns < 60 or {word for word in new if set(word) != {"─"}} == set()


def test_verdicts_have_colours_on_a_terminal_unless_nobody_wants_them(monkeypatch):
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.delenv("NO_COLOR", raising=False)
    rows = (("a", "met"), ("b", "VIOLATED"), ("c", "methane"))

    def coloured() -> str:
        out = Terminal()
        with redirect_stdout(out):
            print_tables([Table("", ("limit", "verdict"), rows)])
            print_verdict("Unreachable: mode 1 at 9 Hz")
            print_verdict("k = 3: this explains it", "fitted")
        return out.getvalue()

    text = coloured()
    for word in ("32mmet", "31mVIOLATED", "31mUnreachable: mode 1", "32mk = 3"):
        assert f"\x1b[{word}" in text
    assert " methane" in text
    for name, value in (("NO_COLOR", "1"), ("TERM", "dumb")):
        with monkeypatch.context() as changed:
            changed.setenv(name, value)
            assert "\x1b" not in coloured()


def test_modes_are_numbered_from_the_first_elastic_one():
    found = modes_table([202.21961234567, 513.2], rigid_modes=2, where="q1 = 1.8 rad")
    assert found.title == "Modes at q1 = 1.8 rad"
    assert found.rows == (("1", "202.220"), ("2", "513.200"))
    assert found.caption == "2 rigid-body modes not counted."
    unknown = modes_table([200.0], rigid_modes=1, where="", truncation=[math.inf], note="so it is")
    assert unknown.rows == (("1", "200.000", "not known"),)
    assert unknown.caption == "1 rigid-body mode not counted. So it is."


def test_a_validation_says_which_line_failed():
    common = {"case": "arm", "mode": 1, "order": 4, "limit": 0.02, "points": 152}
    spread = {"worst_linearised": 0.1, "rms_taylor": 1e-4, "rms_linearised": 0.01}
    spread |= {"lowest_hz": 180.0, "mean_hz": 190.0, "highest_hz": 200.0}
    rows = [
        ValidationRow(where=where, worst_taylor=worst, passed=passed, **common, **spread)
        for where, worst, passed in (("trajectory", 9e-4, True), ("box", 0.05, False))
    ]
    found = [(row[2], row[5], row[-1]) for row in validation_table(rows).rows]
    assert found == [("trajectory", "0.0900 %", "ok"), ("box", "5.00 %", "FAILED")]
