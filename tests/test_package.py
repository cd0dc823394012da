"""The package as one meets it in an interactive session."""

import inspect
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eigassign as ea
from eigassign.brief import LONGEST
from eigassign.pipeline import Result

TWO_LINK = Path(__file__).parents[1] / "cases" / "two_link.yaml"


def test_dir_lists_the_public_names_alone_though_they_are_loaded_when_used() -> None:
    assert sorted(ea.__all__) == dir(ea)
    assert all(getattr(ea, name) is not None for name in ea.__all__)


@pytest.fixture(scope="module")
def case() -> ea.Case:
    return ea.load_case(TWO_LINK)


@pytest.fixture(scope="module")
def result(case: ea.Case) -> Result:
    return ea.assign(case)


def test_what_people_look_at_is_shown_in_a_few_lines(case: ea.Case, result: Result) -> None:
    model, q, y = case.model(), case.trajectory.q, case.initial_design
    expansion = ea.expand(model, q[0], y, order=2)
    shown: list[object] = [
        case,
        case.file,
        model,
        model.pencil,
        case.trajectory,
        *case.trajectories,
        expansion,
    ]
    shown += [expansion.inverse, expansion.space, ea.reduce(model, q[0], y), model.shapes(q[0], y)]
    shown += [result, result.results, result.assignment]
    shown += [*result.results.targets, *result.results.studies, result.results.poses]
    assert [each for each in shown if len(repr(each)) > LONGEST or "\n" in repr(each)] == []


def test_a_repr_says_what_it_is(case: ea.Case, result: Result) -> None:
    assert repr(case).startswith("<Case ")
    assert "q = (q1, q2), y = (m1, m2), 1 target" in repr(case)
    assert "23 degrees of freedom, 2 of them rigid" in repr(case.model())
    assert f"m1 = {result.design['m1']:.4g} kg" in repr(result)
    expansion = ea.expand(case.model(), [1.8, 5.3], [0.1, 0.1], order=2)
    assert repr(expansion).startswith("<Expansion of λ of mode 1: order 2, 10 coefficients in 3 va")


@pytest.mark.parametrize("name", [n for n in ea.__all__ if inspect.isfunction(getattr(ea, n))])
def test_help_says_what_a_function_raises(name: str) -> None:
    text = " ".join((inspect.getdoc(getattr(ea, name)) or "").split())
    assert "Raises" in text or "raises" in text
    assert "See :func:" not in text


def test_help_says_what_objects_hold_and_in_which_units(case: ea.Case) -> None:
    model, q, y = case.model(), case.trajectory.q, case.initial_design
    objects = [case, model, ea.expand(model, q[0], y, order=1), ea.reduce(model, q[0], y)]
    for each in objects:
        text = " ".join((inspect.getdoc(type(each)) or "").split())
        assert "(n" in text, type(each)  # shapes
        assert "Hz" in text or "f = √λ / 2π" in text, type(each)


# --- Pictures and tables


def test_figures_show_themselves_in_a_notebook(case: ea.Case, result: Result) -> None:
    figures: list[Any] = [case.plot(), case.plot_mode(2), result.plot(), result.plot("coordinates")]
    for figure in figures:
        assert figure._repr_png_().startswith(b"\x89PNG")


def test_a_notebook_shows_a_picture_and_what_was_found(case: ea.Case, result: Result) -> None:
    assert "data:image/png;base64," in case._repr_html_()
    page = result._repr_html_()
    assert "data:image/png;base64," in page
    assert f"{1000.0 * result.design['m1']:.4g}" in page  # g


def test_an_unknown_figure_and_a_mode_zero_are_refused(case: ea.Case, result: Result) -> None:
    with pytest.raises(ea.EigassignError, match="no figure 'arm'; there are frequencies, "):
        result.plot("arm")
    with pytest.raises(ea.EigassignError, match="numbered from 1, got 0"):
        case.plot_mode(0)


def test_a_mechanism_that_cannot_be_drawn_is_shown_in_words(tmp_path: Path) -> None:
    text = TWO_LINK.read_text().replace("[0.30, 0.19]", "[3.0, 0.19]")
    far = tmp_path / "far.yaml"
    far.write_text(text)
    page = ea.load_case(far)._repr_html_()
    assert "<img" not in page
    assert "&lt;Case" in page


def test_columns_are_those_of_the_csv_file_as_arrays(result: Result) -> None:
    columns = result.to_dict()
    assert {values.shape for values in columns.values()} == {result.time_s.shape}
    np.testing.assert_array_equal(columns["mode 1 exact [Hz]"], result.exact_hz)
    np.testing.assert_array_equal(columns["time [s]"], result.time_s)


def test_the_case_of_an_update_can_be_drawn_too() -> None:
    updated = ea.update(ea.load_case(TWO_LINK.with_name("arm_update.yaml")))
    assert isinstance(updated.case, ea.Case)
    assert len(repr(updated)) <= LONGEST
    assert updated.figures == ("measurements", "parameters")
    assert "data:image/png;base64," in updated._repr_html_()


def test_what_is_no_case_is_refused_with_what_makes_one():
    for whole in (ea.assign, ea.update):
        with pytest.raises(ea.EigassignError, match=r"expected a case, got str: ea\.load_case"):
            whole("arm.yaml")
