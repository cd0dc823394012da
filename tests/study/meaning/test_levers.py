"""What properties do to frequencies, against mechanisms with other values of them."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from weighed_draws import weighed
from wide_draws import FAMILIES

from eigassign.case import CaseFile, parse
from eigassign.errors import EigassignError
from eigassign.modal import Model
from eigassign.output import run_tables, to_json, verdict_of
from eigassign.pipeline import modes as modes_at
from eigassign.pipeline import solve_case
from eigassign.study import BuiltCase, build_model, levers

CASES = Path(__file__).parents[3] / "cases"
APART = 0.1  # of f: with nearer modes curves of a frequency bend within 1 % of a property
Floats = Any


def seeds(count: int) -> list[Any]:
    """Few that are small in every run, the others in long ones."""
    small = {0, 2, 4}
    return [s if s in small else pytest.param(s, marks=pytest.mark.slow) for s in range(count)]


def drawn_model(seed: int) -> tuple[Model, Floats, Floats] | None:
    """A random mechanism with its pose and design, every other one under its weight."""
    if seed % 2:
        drawn = weighed(seed, 1)
    else:
        families = list(FAMILIES.values())[1:]  # planar trees are among the weighed
        drawn = families[seed // 2 % len(families)](seed, 1)
    return None if drawn is None else (drawn.model, drawn.q0, drawn.y0)


@pytest.mark.parametrize("seed", seeds(60))
def test_what_properties_do_agrees_with_solves_of_other_mechanisms(seed: int) -> None:
    """Up to ±1 % of each property is solved anew."""
    drawn = drawn_model(seed)
    if drawn is None:
        pytest.skip("nothing stands")
    model, q, y = drawn
    count = min(3, len(model.pencil.elastic) - 1)
    hz = model.frequencies(q, y, count + 1)[0]
    single = [k for k in range(count) if np.abs(np.delete(hz, k) / hz[k] - 1.0).min() > APART]
    numbers = {f"mode {k + 1}": np.array([k + 1]) for k in single}
    if not numbers:
        pytest.skip("modes meet")
    file = model.poses.case.with_design(y)
    found = list(levers(model, np.atleast_2d(q), y, numbers))
    own = {p.parameter for p in model.poses.case.design.parameters.values()}
    assert found
    assert not own.intersection(row.property for row in found)
    for path in sorted({row.property for row in found}):
        rows = [row for row in found if row.property == path]
        # by which frequencies change by 1 % at most: curves of larger changes bend
        step = 0.01 / max(1.0, *(abs(row.percent_per_percent) for row in rows))
        at = [changed_hz(file, path, factor, q, y, count) for factor in (1.0 - step, 1.0 + step)]
        if at[0] is None or at[1] is None:
            continue
        for row in rows:
            k = int(row.mode.removeprefix("mode ")) - 1
            difference = (at[1][k] - at[0][k]) / (2.0 * step * hz[k])
            assert row.percent_per_percent == pytest.approx(difference, rel=2e-2, abs=2e-3)


def changed_hz(
    file: CaseFile, path: str, factor: float, q: Floats, y: Floats, count: int
) -> Floats | None:
    """Frequencies of the mechanism with one property times ``factor``; None where there is none."""
    every = file.with_every_property()
    paths = list(every.design.parameters)
    values = np.array([file.value_at(p) for p in paths])
    values[paths.index(path)] *= factor
    try:
        other = build_model(replace(every.with_design(values), design=file.design))
        return other.frequencies(q, y, count)[0]
    except EigassignError:
        return None


MISSED = (
    (CASES / "drilling_arm.yaml")
    .read_text()
    .replace("samples: 41", "samples: 9")
    .replace("at_least: 28 Hz", "at_least: 90 Hz")
)
MISSED += "assignment: {starts: 3}\n"


def test_a_missed_target_is_told_what_would_help() -> None:
    result = solve_case(BuiltCase(parse(MISSED.encode(), "case.yaml")))
    found = result.results.meaning.levers
    assert {row.mode for row in found} == {"mode 1"}
    sizes = [abs(row.percent_per_percent) for row in found]
    assert sizes == sorted(sizes, reverse=True)
    paths = [row.property for row in found]
    assert "coordinates.q2.drive.stiffness" in paths
    assert "coordinates.q1.drive.stiffness" not in paths  # a parameter has its sensitivity
    assert "What would help" in {table.title for table in run_tables(result.results)}
    card = verdict_of(result.results)
    assert card.helps[0].startswith("1 % more of what is no parameter changes mode 1: ")
    assert "length of forearm −" in card.helps[0]
    rows = json.loads(to_json(result.results))["levers"]
    assert {row["mode"] for row in rows} == {"mode 1"}
    assert all(row["percent_per_percent_largest"] for row in rows)


def test_a_run_does_without_what_would_help(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: object, **__: object) -> CaseFile:
        raise EigassignError("such a mechanism cannot be made")

    monkeypatch.setattr(CaseFile, "with_every_property", refused)
    result = solve_case(BuiltCase(parse(MISSED.encode(), "case.yaml"))).results
    assert result.meaning.levers == ()
    assert any(
        note.endswith("not explained: such a mechanism cannot be made")
        for note in result.meaning.notes
    )


def test_nothing_is_told_of_modes_where_nothing_is_missed() -> None:
    text = MISSED.replace("at_least: 90 Hz", "at_least: 20 Hz")
    assert solve_case(BuiltCase(parse(text.encode(), "case.yaml"))).results.meaning.levers == ()


def test_lengths_that_a_rigid_loop_cannot_follow_are_left_out() -> None:
    answer = modes_at(CASES / "gantry.yaml", count=1)
    assert answer.levers
    assert not [row for row in answer.levers if row.property.endswith(".length")]
