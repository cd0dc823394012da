"""Lists beside what is continuous, and bands: one search, against trying every combination."""

from pathlib import Path

import numpy as np
import pytest
import yaml

import eigassign as ea
from eigassign.pipeline import Result
from eigassign.study import AssignmentRow

HERE = Path(__file__).parent


def answered(name: str, **changes: object) -> tuple[ea.Case, Result, AssignmentRow]:
    case = ea.load_case({**yaml.safe_load((HERE / f"{name}.yaml").read_text()), **changes})
    result = ea.assign(case)
    return case, result, result.results.assignment


def test_a_list_beside_two_drives_meets_all_limits_between_the_samples_too() -> None:
    """One start for each tube leads to compromises that miss some."""
    case, result, row = answered("list_and_drives")
    assert row.verdict == "reached"
    path = case.trajectory.finely
    hz = case.model().frequencies(path.q, np.array([*result.design.values()]), 2)
    go, back = (hz[path.rows_of(name)] for name in ("go", "back"))
    assert 8.349 < go[:, 0].min() < go[:, 0].max() < 9.651
    assert 23.298 < back[:, 1].min() < back[:, 1].max() < 24.702


@pytest.mark.parametrize("starts", [3, pytest.param("auto", marks=pytest.mark.slow)])
def test_every_combination_gets_its_starts(starts: object) -> None:
    """The first five of twelve, each of which ten starts with its rows held end at."""
    _, _, row = answered("two_lists_and_drives", assignment={"starts": starts})
    assert row.starts == 36 or starts == "auto"
    best = ["a70x3 b35x2", "a70x3 b45x2", "a80x4 b35x2", "a60x2 b35x2", "a80x4 b45x2"]
    worth = [0.0046213, 0.0049627, 0.0052319, 0.0054645, 0.0055506]
    assert [" ".join(one.choices.values()) for one in row.catalogue.best] == best
    np.testing.assert_allclose([one.objective for one in row.catalogue.best], worth, rtol=1e-3)


def test_of_27_000_combinations_the_cheapest_are_proved_in_the_order_of_their_price() -> None:
    _, _, row = answered("six_lists")
    assert row.optimality.kind == "proved"
    prices = [one.price for one in row.catalogue.best[:3]]
    assert prices == pytest.approx([35.5, 37.1, 37.6])


def test_all_at_their_cheapest_bound_with_every_limit_met_is_a_proof() -> None:
    """Bands along profiles and for one load alone, geometry among the parameters."""
    case, result, row = answered("cheapest_corner")
    assert [*result.design.values()] == [p.min for p in case.file.design.parameters.values()]
    assert (row.verdict, row.optimality.kind, row.optimality.gap) == ("reached", "proved", 0.0)


def test_what_no_combination_meets_contradicts_a_torque_too() -> None:
    """All is listed, and every combination exerts 12.6 N m at least."""
    _, _, row = answered("lists_and_torque")
    assert (row.verdict, row.conflict, row.optimality.kind) == (
        "infeasible", ("design.torque.q1",), "proved",
    )  # fmt: skip


def test_a_limit_contradicts_with_the_linear_one_that_forbids_what_would_meet_it() -> None:
    """Lists and a linear limit that rules all combinations out which keep the other."""
    design = {
        "A": {"parameter": "sections.A.outer_diameter", "values": ["50 mm", "90 mm"]},
        "m": {"parameter": "bodies.mot.mass", "values": [2.0, 2.5]},
        "constraints": {"thin": {"terms": {"A": 1}, "max": "60 mm"}},
    }
    low = {"mode": 1, "at_least": "9 Hz", "trajectory": "go"}
    changes = {"design": design, "targets": [low]}
    _, _, row = answered("list_and_drives", **changes)
    assert row.verdict == "infeasible"
    assert sorted(row.conflict) == ["mode 1 at least 9 Hz along 'go'", "thin"]


def test_lists_alone_beside_a_band_are_compared_on_all_of_many_samples() -> None:
    """Starts are compared on few of the samples, which are fewer than the 101 of this path."""
    text = (Path(ea.__file__).parent / "starters" / "planar_arm.yaml").read_text()
    tree = yaml.safe_load(text.partition("\ntargets:")[0].partition("\ndesign:")[0])
    tree["trajectory"] |= {"samples": 101}
    outer = "sections.upper_tube.outer_diameter"
    tree["design"] = {"diameter": {"parameter": outer, "values": [0.038, 0.050]}}
    case = ea.load_case(tree)
    q, both = case.trajectory.q, (0.038, 0.050)
    hz = {y: case.model().frequencies(q, np.full((len(q), 1), y), 4) for y in both}
    low, high = (hz[y][:, 0] for y in both)  # mode 1 of the thicker tube is higher
    edges = [float(low.min() + 1e-3), float(low.max() - 1e-3)]
    free = (hz[0.050] < edges[0]) | (hz[0.050] > edges[1])
    assert high.min() > low.min()
    tree["targets"] = [{"modes": "all", "keep_out": edges}]
    row = ea.assign(ea.load_case(tree)).results.assignment
    assert row.verdict == ("reached" if free.all() else "infeasible")
