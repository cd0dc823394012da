"""Where modes have their energy, and what properties do to them, against slopes and re-solves."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from weighed_draws import weighed
from wide_draws import FAMILIES

from eigassign import load_case
from eigassign.case import CaseFile, parse
from eigassign.errors import EigassignError
from eigassign.modal import Model, modes
from eigassign.output import run_tables, to_json, verdict_of
from eigassign.pipeline import modes as modes_at
from eigassign.pipeline import solve_case
from eigassign.study import BuiltCase, anatomies, build_model

CASES = Path(__file__).parents[3] / "cases"
SHIPPED = sorted(path.stem for path in CASES.glob("*.yaml"))
APART = 0.1  # of f: with nearer modes curves of a frequency bend within 1 % of a property
Floats = Any


def sums_to_one(model: Model, x: Floats, count: int) -> None:
    found = modes(model.pencil, x, count)
    shares = model.energies.shares(model.pencil, x, found.lam, found.phi)
    for of in shares:
        np.testing.assert_allclose(sum(of.values()), 1.0, atol=1e-9)
    strain, kinetic = shares
    assert min(own.min() for own in kinetic.values()) > -1e-12
    assert min(own.min() for key, own in strain.items() if key != "weight") > -1e-9


@pytest.mark.parametrize("name", SHIPPED)
def test_the_energies_of_a_shipped_mechanism_are_all_there(name: str) -> None:
    case = load_case(CASES / f"{name}.yaml")
    model, y = case.model(), case.initial_design
    sums_to_one(model, model.x(case.trajectory.at(y)[0][::7], y), 4)


def seeds(count: int) -> list[Any]:
    """Few that are small in every run, the others in long ones."""
    small = {0, 2, 4}
    return [s if s in small else pytest.param(s, marks=pytest.mark.slow) for s in range(count)]


def drawn_model(seed: int) -> tuple[Model, Floats, Floats] | None:
    """A random mechanism with its pose and design, every other one under its weight."""
    if seed % 2:
        drawn = weighed(seed, 1)
    else:
        families = list(FAMILIES.values())
        drawn = families[seed // 2 % len(families)](seed, 1)
    return None if drawn is None else (drawn.model, drawn.q0, drawn.y0)


@pytest.mark.parametrize("seed", seeds(60))
def test_energies_and_what_properties_do_agree_with_solves_of_other_mechanisms(seed: int) -> None:
    """Shares of drives and springs are slopes; up to ±1 % of each property is solved anew."""
    drawn = drawn_model(seed)
    if drawn is None:
        pytest.skip("nothing stands")
    model, q, y = drawn
    count = min(3, len(model.pencil.elastic) - 1)
    x = model.x(q, y)
    sums_to_one(model, x, count)
    hz = model.frequencies(q, y, count + 1)[0]
    single = [k for k in range(count) if np.abs(np.delete(hz, k) / hz[k] - 1.0).min() > APART]
    numbers = {f"mode {k + 1}": np.array([k + 1]) for k in single}
    if not numbers:
        pytest.skip("modes meet")
    file = model.poses.case.with_design(y)
    found = list(anatomies(model, np.atleast_2d(q), y, numbers))
    own = {p.parameter for p in model.poses.case.design.parameters.values()}
    effects = [{row.property: row.percent_per_percent for row in one.properties} for one in found]
    for of, one in zip(effects, found, strict=True):
        assert not own.intersection(of)
        strain = {row.part: row.strain for row in one.parts}
        for part, share in strain.items():
            if part.startswith("coordinates.") and f"{part}.stiffness" in of:
                assert 2.0 * of[f"{part}.stiffness"] == pytest.approx(share, abs=1e-8)
    for path in sorted({path for of in effects for path in of} - own):
        # by which frequencies change by 1 % at most: curves of larger changes bend
        step = 0.01 / max(1.0, *(abs(of.get(path, 0.0)) for of in effects))
        at = [changed_hz(file, path, factor, q, y, count) for factor in (1.0 - step, 1.0 + step)]
        if at[0] is None or at[1] is None:
            continue
        for k, of in zip(single, effects, strict=True):
            if path in of:
                difference = (at[1][k] - at[0][k]) / (2.0 * step * hz[k])
                assert of[path] == pytest.approx(difference, rel=2e-2, abs=2e-3)


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


def test_a_missed_target_is_told_what_it_is_and_what_would_help() -> None:
    result = solve_case(BuiltCase(parse(MISSED.encode(), "case.yaml")))
    (one,) = result.results.meaning.anatomies
    assert one.mode == "mode 1"
    strain = {row.part: row.strain for row in one.parts}
    assert max(strain, key=lambda part: strain[part]) == "coordinates.q2.drive"
    assert sum(strain.values()) == pytest.approx(1.0, abs=1e-9)
    assert "weight" in strain
    paths = [row.property for row in one.properties]
    assert "coordinates.q2.drive.stiffness" in paths
    assert "coordinates.q1.drive.stiffness" not in paths  # a parameter has its sensitivity
    said = "mode 1: strain is in coordinates.q2.drive"
    assert any(note.startswith(said) for note in result.results.notes)
    tables = {table.title for table in run_tables(result.results)}
    assert {"What the missed modes are", "What would help"} <= tables
    card = verdict_of(result.results)
    assert card is not None
    assert any("1 % more of what is no parameter" in line for line in card.helps)
    assert card.helps[0].startswith("Strain energy of mode 1: drive of q2 ")
    assert b'"anatomies"' in to_json(result.results)


def test_nothing_is_told_of_modes_where_nothing_is_missed() -> None:
    text = MISSED.replace("at_least: 90 Hz", "at_least: 20 Hz")
    assert solve_case(BuiltCase(parse(text.encode(), "case.yaml"))).results.meaning.anatomies == ()


def test_modes_have_columns_of_what_they_are() -> None:
    answer = modes_at(CASES / "palletiser.yaml", count=2)
    assert [one.mode for one in answer.anatomies] == ["mode 1", "mode 2"]
    assert answer.anatomies[0].most("strain", 1).startswith("coordinates.q2.drive")


def test_lengths_that_a_rigid_loop_cannot_follow_are_left_out() -> None:
    answer = modes_at(CASES / "gantry.yaml", count=1)
    paths = [row.property for row in answer.anatomies[0].properties]
    assert paths
    assert not [path for path in paths if path.endswith(".length")]
