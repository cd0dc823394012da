"""Tables of what only some runs have: bands, catalogues, limits."""

import io
import math
from contextlib import redirect_stdout
from dataclasses import replace

import numpy as np
import pytest
from synthetic_results import as_limit, make_results

from eigassign.output import CaseOutcome, Table, batch_table, print_assignment, run_tables
from eigassign.study import CatalogueRow, ClearanceRow, CombinationRow, ErrorRow, RunResults


def table(results: RunResults, title: str) -> Table | None:
    return next((one for one in run_tables(results) if one.title == title), None)


def searched() -> RunResults:
    """Limits alone, a catalogue and prices."""
    results = make_results()
    (target,) = results.targets
    limit = as_limit(target, "at_most", np.full(152, -np.inf), np.full(152, 205.0))
    y = np.full(2, 0.1)
    best = tuple(
        CombinationRow({"rod": rod, "hub": "20"}, y, cost, missed, price=cost)
        for rod, cost, missed in (("light", 3.5, 0.0), ("heavy", 4.0, 0.02))
    )
    row = replace(results.assignment, catalogue=CatalogueRow(7, 0.0, best))
    design = (replace(results.design[0], price=10.0), results.design[1])
    return replace(results, assignment=row, targets=(limit,), design=design, price=4.0)


def test_bands_say_how_many_modes_are_below_and_whether_that_is_checked() -> None:
    results = make_results()
    assert table(results, "Clearance") is None
    rows = (
        ClearanceRow("a band", 2, True, 0.013, True, 0.002),
        ClearanceRow("b", 0, False, -0.1, True, None),
    )
    found = table(
        replace(results, assignment=replace(results.assignment, clearances=rows)), "Clearance"
    )
    assert found.rows == (
        ("a band", "2", "1.30 %", "0.20 %", "checked"),
        ("b", "0", "0 %", "not known", "NO"),
    )


def test_combinations_take_the_place_of_local_optima_and_have_prices() -> None:
    assert table(make_results(), "Combinations") is None
    results = searched()
    found = table(results, "Combinations")
    assert found.columns == ("combination", "rod", "hub", "price", "limits")
    assert found.rows[1] == ("2", "heavy", "20", "4", "violated by 2.00 %")
    assert table(results, "Local optima") is None


def test_the_headline_says_what_the_initial_design_violated_and_round_off_is_met() -> None:
    results = make_results()
    (target,) = results.targets
    limit = as_limit(target, "at_least", np.full(152, 205.0), np.full(152, np.inf))
    error = replace(
        limit.error, initial=ErrorRow(0.681, 0.5), exact=ErrorRow(6e-11, 1e-11), one_shot=None
    )
    both = replace(results, targets=(target, replace(limit, error=error)))
    with redirect_stdout(io.StringIO()) as said:
        print_assignment(both)
    assert (
        "Worst violation of a limit: 68.1 % before (mode 1 at_least), 0 % after.\n"
        in said.getvalue()
    )
    found = table(both, "Limits and bands")
    assert found.rows[0][-2] == "met"


def test_parameters_are_shown_in_units_that_people_read() -> None:
    results = make_results()
    wall = replace(
        results.design[0], name="wall", unit="m",
        initial=0.005, optimal=0.0055, lower=0.0045, upper=0.0055,
    )  # fmt: skip
    drive = replace(
        results.design[1], name="drive", unit="N m/rad",
        initial=8e4, optimal=68679.2, lower=6.5e4, upper=9.5e4,
    )  # fmt: skip
    found = table(replace(results, design=(wall, drive)), "Design")
    assert found.rows[0][1:6] == ("mm", "5", "5.5", "4.5", "5.5")
    assert found.rows[1][1:4] == ("kN m/rad", "80", "68.68")


def test_values_of_a_catalogue_have_their_unit_and_names_stand_for_themselves() -> None:
    results = searched()
    drive = replace(
        results.design[0], name="hub", unit="N m/rad", choice="20000",
        initial=8e3, optimal=2e4, lower=8e3, upper=2e4,
    )  # fmt: skip
    rod = replace(results.design[1], name="rod.width", choice="light")
    changed = replace(results, design=(drive, rod))
    found, design = table(changed, "Combinations"), table(changed, "Design")
    assert found.rows[0][1:3] == ("light", "0.02 kN m/rad")  # "20" of the made-up catalogue
    at = design.columns.index("choice")
    assert [row[at] for row in design.rows[:2]] == ["", "light"]


@pytest.mark.parametrize(
    ("error", "text"),
    [
        (0.0155, "1.55 %"),
        (0.0, "0 %"),
        (1.0, "100 %"),
        (math.inf, "n/a"),
        (1.1e-11, "1.10e-09 %"),
    ],
)
def test_errors_are_written_as_people_read_them(error: float, text: str) -> None:
    row = CaseOutcome("arm", "arm.yaml", "ok", 1.0, exact_max_relative=error)
    assert batch_table([row]).rows[0][2] == text
