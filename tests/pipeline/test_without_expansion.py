"""An answer that does without the Taylor expansion is found where no expansion will do."""

import json
from pathlib import Path

import numpy as np
import pytest
from run_cases import SHIPPED, UNCACHED, automatic, changed, shipped, solved, written

from eigassign import load_case
from eigassign.cli import main
from eigassign.errors import AccuracyError
from eigassign.modal import raise_order
from eigassign.pipeline import Result, expand_case, validate

CASES = SHIPPED.parent
FINE = "expansion: {order: auto, accuracy: 1e-12}\n"  # beyond round-off
REFUSED = "no expansion of order up to 16 at up to 32 points reaches"
ONCE = "assignment: {starts: 1}\n"


def fine(more: str = "") -> str:
    return automatic() + FINE + more


def between(text: str, start: str, end: str, new: str) -> str:
    """The text with what stands from ``start`` up to ``end`` replaced."""
    return text[: text.index(start)] + new + text[text.index(end) :]


def without(result: Result) -> str:
    """The one note that says that there is no expansion, nor anything that rests on it."""
    results = result.results
    assert (result.expansion, result.linearised, result.assignment) == (None, None, None)
    assert (results.studies, results.solver) == ((), None)
    assert results.assignment.one_shot is None
    assert results.error.one_shot is None
    (note,) = (note for note in results.notes if "no expansion" in note or "one-shot" in note)
    return note


def test_an_expansion_is_given_up_after_so_many_coefficients() -> None:
    case = load_case(SHIPPED)
    path = case.trajectory
    x = np.hstack([path.q, np.tile(case.initial_design, (len(path.q), 1))])
    with pytest.raises(AccuracyError, match="no expansion tried reaches"):
        raise_order(case.model().pencil, x, x[0], 1e-12, most=100)


def test_the_design_is_the_one_that_is_found_with_an_expansion(tmp_path: Path) -> None:
    with_one, result = solved(tmp_path, shipped()), solved(tmp_path, fine())
    note = without(result)
    assert note.startswith("there is no expansion, and so no one-shot design: ")
    before, after = with_one.results.error, result.results.error
    assert after.exact.rms_relative == pytest.approx(before.exact.rms_relative, rel=1e-6)
    assert after.predicted is not None  # by the last step's own program, of exact slopes


def test_what_rests_on_the_expansion_is_refused_with_the_reason(tmp_path: Path) -> None:
    text, path = fine("assignment: {method: one_shot}\n"), tmp_path / "fine.yaml"
    with pytest.raises(AccuracyError, match=REFUSED):
        solved(tmp_path, text)
    path.write_text(fine())
    for asked in (
        lambda: expand_case(path, UNCACHED),
        lambda: validate(path, UNCACHED),
    ):
        with pytest.raises(AccuracyError, match=REFUSED):
            asked()


def test_a_run_folder_and_a_check_say_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    case, out = written(tmp_path, fine()), tmp_path / "out"
    assert main(["check", str(case)]) == 0
    told = capsys.readouterr().out
    assert "there is no expansion, and so" in told
    assert "to order" not in told
    assert main(["optimize", str(case), "--out", str(out), "--report", "light"]) == 0
    found = json.loads((out / "results.json").read_text())
    assert (found["approximation"], found["solver"]) == ([], None)
    assert found["error"]["one_shot"] is None
    assert "there is no expansion, and so" in (out / "log.txt").read_text()
    assert "there is no expansion, and so" in (out / "report.html").read_text()


def test_an_expansion_point_that_cannot_follow_the_path_ends_nothing(tmp_path: Path) -> None:
    """The middle of the bounds is too long an arm and too short a one to reach the path."""
    text = between((CASES / "arm_lengths.yaml").read_text(), "expansion:", "targets:", ONCE)
    text = changed(
        ("samples: 101", "samples: 11"),
        ("min: 580 mm, max: 610 mm", "min: 580 mm, max: 1000 mm"),
        ("min: 440 mm, max: 480 mm", "min: 100 mm, max: 480 mm"),
        text=text,
    )
    result = solved(tmp_path, text)
    assert result.assignment is None
    assert any("no one-shot design: " in note for note in result.results.notes)


def lengths(order: str) -> str:
    """Couplers too short to close the loop, but for a few."""
    return between((CASES / "four_bar.yaml").read_text(), "design:", "targets:", f"""design:
  coupler: {{parameter: links.coupler.length, min: 0.1, max: 0.5}}
expansion: {{order: {order}, y: [0.45]}}
assignment: {{starts: 1}}
""")  # fmt: skip


def test_lengths_with_which_a_loop_cannot_be_closed_end_nothing(tmp_path: Path) -> None:
    assert "cannot be closed" in without(solved(tmp_path, lengths("auto")))
