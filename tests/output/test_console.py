"""Results reach any terminal, pipe or log whole and unchanged."""

from __future__ import annotations

import io

import pytest
from synthetic_results import make_results

from eigassign.output import (
    CaseOutcome,
    batch_table,
    console,
    number,
    percent,
    residual,
    seconds,
    terminal,
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


def test_an_assignment_shows_its_numbers_without_colour_codes_in_a_pipe():
    out = piped()
    console.print_assignment(make_results(), stream=out)
    text = read(out)
    assert "\x1b" not in text
    for words in ("228.7", "6.00 %", "1.00 %", "solved", "3.1e-17", "over m1 and m2"):
        assert words in text
    assert not any(line != line.rstrip() for line in text.splitlines())


def test_an_ascii_locale_gets_ascii():
    out = piped("ascii")
    console.print_table("Größe δ", ("名",), [("Zweigelenkarm ä",)], stream=out)
    text = read(out)
    assert "Zweigelenkarm ?" in text
    assert "Gr??e" in text


def test_brackets_are_text_and_not_markup():
    out = piped()
    console.print_table("[bold]", ("a",), [("[case.yaml]",), ("[/red]",), (":smile:",)], stream=out)
    text = read(out)
    for words in ("[bold]", "[case.yaml]", "[/red]", ":smile:"):
        assert words in text


def test_long_cells_are_neither_wrapped_nor_cut_off_terminal():
    out, path = piped(), "/a/very/long/path" * 30
    console.print_table("paths", ("name", "path"), [("x", path)], stream=out)
    assert f" {path}" in read(out)


@pytest.mark.parametrize("columns", [40, 60, 80, 120])
def test_all_tables_of_a_run_fit_the_width_and_break_no_word(columns, monkeypatch):
    wide, narrow = piped(), piped()
    console.print_assignment(make_results(), stream=wide)
    monkeypatch.setenv("COLUMNS", str(columns))
    console.print_assignment(make_results(), stream=narrow)
    lines = read(narrow).splitlines()
    assert max(map(len, lines)) <= columns
    known = set(read(wide).split())
    new = {word for line in lines for word in line.split()} - known
    assert {word for word in new if set(word) != {"─"} and "…" not in word} == set()
    if columns >= 60:
        assert not any("…" in word for word in new)


def test_long_paths_are_shortened_in_the_middle_on_a_narrow_terminal(monkeypatch):
    monkeypatch.setenv("COLUMNS", "40")
    out, path = Terminal(), "coordinates.shoulder_of_the_arm.drive.stiffness"
    console.print_table("", ("name", "path", "value"), [("k", path, "1.5e+05")], stream=out)
    (shown,) = [word for word in out.getvalue().split() if "…" in word]
    head, tail = shown.split("…")
    assert path.startswith(head)
    assert path.endswith(tail)
    assert min(len(head), len(tail)) > 10
    assert "1.5e+05" in out.getvalue()
    text = piped("ascii")
    console.print_table("", ("name", "path"), [("k", path)], stream=text)
    assert "..." in read(text)


def test_rows_that_share_their_first_cell_are_named_by_two_in_every_part(monkeypatch):
    monkeypatch.setenv("COLUMNS", "40")
    out = piped()
    rows = [("mode 1", "over q", "1" * 12, "2" * 12), ("mode 1", "over y", "3" * 12, "4" * 12)]
    console.print_table("", ("mode", "where", "Taylor", "linear"), rows, stream=out)
    found = [line.split() for line in read(out).splitlines()]
    assert ["mode", "1", "over", "y", "3" * 12] in found
    assert ["mode", "1", "over", "y", "4" * 12] in found


def test_verdicts_have_colours_on_a_terminal_unless_nobody_wants_them(monkeypatch):
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.delenv("NO_COLOR", raising=False)
    rows = [("a", "met"), ("b", "VIOLATED"), ("c", "methane")]

    def shown() -> str:
        out = Terminal()
        console.print_table("", ("limit", "verdict"), rows, stream=out)
        console.print_verdict("Unreachable: mode 1 at 9 Hz", stream=out)
        console.print_verdict("k = 3: this explains it", "fitted", stream=out)
        return out.getvalue()

    text = shown()
    for coloured in (
        "\x1b[32mmet",
        "\x1b[31mVIOLATED",
        "\x1b[31mUnreachable: mode 1",
        "\x1b[32mk = 3",
    ):
        assert coloured in text
    assert " methane" in text
    for name, value in (("NO_COLOR", "1"), ("TERM", "dumb")):
        with monkeypatch.context() as changed:
            changed.setenv(name, value)
            assert "\x1b" not in shown()


def test_columns_that_need_a_second_part_are_not_shortened_for_nothing(monkeypatch):
    path = "sections.upper_tube.outer_diameter"
    monkeypatch.setenv("COLUMNS", "60")
    out = piped()
    columns = ("name", "parameter", "unit", "initial", "optimal", "lower", "upper", "lies on")
    row = ("diameter", path, "m", "0.04", "0.0433304", "0.035", "0.06", "upper")
    console.print_table("", columns, [row], stream=out)
    assert path in read(out)


def test_long_lines_end_between_words_and_go_on_indented():
    lines = ["a short line", "  note: one two three /a/path/longer/than/the/line four"]
    assert terminal.wrapped(lines, 20) == [
        "a short line",
        "  note: one two",
        "    three",
        "    /a/path/longer/than/the/line",
        "    four",
    ]
    assert terminal.wrapped(lines, terminal.ENDLESS) == lines


def test_control_characters_do_not_reach_the_terminal():
    out = piped()
    console.print_table("a\x1b]0;b", ("n",), [("x\x1b[2Jy\r",)], stream=out)
    assert "\x1b" not in read(out)
    assert "\r" not in read(out)


def test_modes_are_numbered_from_the_first_elastic_one():
    out = piped()
    console.print_modes([202.21961234567, 513.2], rigid_modes=2, where="q1 = 1.8 rad", stream=out)
    text = read(out)
    assert "202.2196123" in text
    assert "2 rigid-body modes not counted" in text
    assert "Modes at q1 = 1.8 rad" in text


def test_a_validation_says_which_line_failed():
    out = piped()
    common = {"case": "arm", "mode": 1, "order": 4, "limit": 0.02}
    spread = {"worst_linearised": 0.1, "rms_taylor": 1e-4, "rms_linearised": 0.01}
    spread |= {"lowest_hz": 180.0, "mean_hz": 190.0, "highest_hz": 200.0}
    rows = [
        ValidationRow(
            where=where, points=152, worst_taylor=worst, passed=passed, **common, **spread
        )
        for where, worst, passed in (("trajectory", 9e-4, True), ("box", 0.05, False))
    ]
    console.print_validation(rows, stream=out)
    lines = read(out).splitlines()
    assert any("trajectory" in line and "0.0900 %" in line and "ok" in line for line in lines)
    assert any("box" in line and "5.00 %" in line and "FAILED" in line for line in lines)


def test_a_batch_lists_every_case():
    out = piped()
    good = CaseOutcome("arm", "arm.yaml", "ok", 1.25, exact_max_relative=0.0155)
    bad = CaseOutcome("leg", "leg.yaml", "error", 0.5, "leg.yaml:3:1: [what] is wrong")
    console.print_tables([batch_table([good, bad])], stream=out)
    text = read(out)
    for words in ("arm", "1.55 %", "1.25 s", "leg.yaml:3:1: [what] is wrong"):
        assert words in text


def test_progress_counts_in_lines_off_terminal_and_in_place_on_one():
    log, terminal = piped(), Terminal()
    for stream in (log, terminal):
        with console.progress("cases", 2, stream=stream) as advance:
            advance("arm")
            advance("leg\n")
    assert read(log) == "cases 1/2 arm\ncases 2/2 leg\n"
    assert "\n" not in terminal.getvalue()
    assert terminal.getvalue().endswith("\r\x1b[2K")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (percent(0.0155), "1.55 %"),
        (percent(0.0), "0.00 %"),
        (percent(1.0), "100 %"),
        (percent(float("inf")), "n/a"),
        (percent(1.1e-11), "1.10e-09 %"),
        (number(0.22871234), "0.228712"),
        (number(-0.0), "0"),
        (seconds(0.0123), "12.3 ms"),
        (seconds(4.5678), "4.57 s"),
        (residual(3.14e-17), "3.1e-17"),
    ],
)
def test_numbers_are_written_as_people_read_them(text, expected):
    assert text == expected
