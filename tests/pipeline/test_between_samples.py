"""Limits hold between samples too, and what a search finds hardly hangs on where it starts."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from two_elastic_links import TWO_LINKS

import eigassign as ea
from eigassign.pipeline import Result, solve_case
from eigassign.study import AssignmentRow, BuiltCase

CASES = Path(__file__).parents[2] / "cases"
GAP = {"gap": {"between": [1, 2], "at_least": "0.2 Hz"}}
WIDE = {"gap": {"between": [1, 2], "at_least": "2 Hz"}}
FEW = {"assignment": {"starts": 2}}
INSTANTS = 5000
WITHIN = 2e-4  # of a limit: what answers may miss between samples, and q between these instants


def two_rods(rod: str = "20 mm", antenna: str = "20 mm") -> dict[str, Any]:
    """A mast beside an arm whose frequency passes that of the mast, with a section for each."""
    case: dict[str, Any] = yaml.safe_load((CASES / "stress" / "mode_swaps.yaml").read_text())
    mechanism = case["mechanism"]
    mechanism["sections"]["mast"] = {"shape": "circle", "diameter": antenna}
    mechanism["sections"]["rod"]["diameter"] = rod
    mechanism["links"]["antenna"]["section"] = "mast"
    return case


def rods(least: tuple[str, str], **price: float) -> dict[str, Any]:
    names = {"d": "rod", "a": "mast"}
    return {
        key: {"parameter": f"sections.{names[key]}.diameter", "min": low, "max": "30 mm"}
        | ({"price": price[key]} if price else {})
        for key, low in zip(names, least, strict=True)
    }


def solved(case: dict[str, Any]) -> tuple[BuiltCase, Result, AssignmentRow]:
    built = ea.load_case(case)
    result = solve_case(built)
    return built, result, result.results.assignment


def at_instants(built: BuiltCase, result: Result, count: int) -> np.ndarray:
    (part,) = built.trajectory.parts
    at = np.linspace(0.0, part.trajectory.time_s[-1], INSTANTS)
    q = part.trajectory.motion.poses(at)
    return built.model().frequencies(q, np.array(list(result.design.values())), count)


def test_modes_that_cross_between_samples_are_not_said_to_be_apart() -> None:
    case = two_rods() | {"design": rods(("17.4 mm", "17.6 mm"), d=-77, a=110), "targets": [GAP]}
    case |= FEW
    built, result, row = solved(case)
    hz = at_instants(built, result, 2)
    assert (hz[:, 1] - hz[:, 0]).min() < 0.05
    assert row.verdict in ("do_not_use", "infeasible")
    assert row.verdict == "infeasible" or "cross" in row.reason


@pytest.mark.parametrize("limit", [{"mode": 1, "at_least": 11.0}, {"mode": 2, "at_most": 57.0}])
def test_the_cheapest_design_keeps_its_limit_between_coarse_samples(limit: dict[str, Any]) -> None:
    # a stroke of 80° in two steps, across the pose of the least or the largest frequency
    trajectory = {"q": [[0.0, -0.9], [0.0, -0.3], [0.0, 0.5]], "duration": 1}
    price = 1.0 if "at_least" in limit else -1.0
    design = {
        name: {"parameter": f"coordinates.{name}.drive.stiffness", "min": 2e3, "max": 6e4}
        | {"price": price}
        for name in ("q1", "q2")
    }
    given = {**TWO_LINKS, "design": design, "targets": [limit], "trajectory": trajectory}
    built, first, row = solved(given)
    hz = at_instants(built, first, 2)
    assert row.verdict == "reached", row.reason
    if "at_least" in limit:
        assert hz[:, 0].min() == pytest.approx(limit["at_least"], rel=WITHIN)
    else:
        assert hz[:, 1].max() == pytest.approx(limit["at_most"], rel=WITHIN)


def test_a_gap_beside_a_band_is_found_though_the_first_valley_has_none() -> None:
    targets = [WIDE, {"keep_out": ["60 Hz", "70 Hz"]}]
    case = two_rods() | FEW | {"design": rods(("12 mm", "15 mm")), "targets": targets}
    _, _, row = solved(case)
    assert row.verdict == "reached", row.reason


def test_what_misses_a_target_by_far_is_not_blamed_on_the_mesh() -> None:
    design = {"k1": {"parameter": "coordinates.q1.drive.stiffness", "min": 2e4, "max": 4e4}}
    model = ea.load_case({**TWO_LINKS, "design": design, "targets": [{"mode": 1, "at_least": 1}]})
    path = model.trajectory
    hz = model.model().frequencies(path.q, [4e4], 1).min()
    target = {"mode": 1, "frequency": float(hz)}
    case = {**TWO_LINKS, "design": design, "targets": [target]}
    _, _, row = solved({**case, "validation": {"max_error": "100 %"}})
    assert "mesh" not in row.reason
    assert row.verdict in ("improved", "unreachable", "do_not_use")


def test_a_mechanism_has_its_mass_though_trajectories_set_what_cannot_be_nothing() -> None:
    given = {**TWO_LINKS, "design": {"k1": {"parameter": "coordinates.q1.drive.stiffness"}}}
    given["design"]["k1"] |= {"min": 5e3, "max": 4e4}
    path = {"q": [[0.0, 0.3], [0.5, 0.8]], "duration": 1}
    one, other = ({**path, "name": name} for name in "ab")
    plain = ea.load_case({**given, "trajectory": [one, other]}).model()
    one["set"] = {"coordinates.q2.drive.stiffness": 3e4}
    model = ea.load_case({**given, "trajectory": [one, other]}).model()
    assert model.mass([2e4]) == pytest.approx(plain.mass([2e4]), rel=1e-12)
