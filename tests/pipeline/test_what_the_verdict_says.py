"""Words of the verdict where limits, bands, load cases and coarse trajectories meet."""

import itertools
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from spatial_cases import linkage
from spatial_examples import straight
from two_elastic_links import ALLOY, TWO_LINKS

import eigassign as ea
from eigassign.facts import priced
from eigassign.pipeline import Result, solve_case
from eigassign.study import BuiltCase

K1 = {"parameter": "coordinates.q1.drive.stiffness", "min": 5000, "max": 40000}
K2 = {"parameter": "coordinates.q2.drive.stiffness", "min": 2000, "max": 16000}
MOTOR = {"parameter": "bodies.motor.mass", "min": 0.2, "max": 2}


def case_of(design: dict[str, Any], targets: list[Any], **more: Any) -> BuiltCase:
    return ea.load_case({**TWO_LINKS, "design": design, "targets": targets, **more})


def said(result: Result) -> tuple[str, str]:
    row = result.results.assignment
    return row.verdict, row.reason


def reached(reason: str) -> float:
    found = re.search(r"reaches there is ([\d.]+) Hz", reason)
    return float(found[1])


def sample(reason: str) -> int:
    found = re.search(r"sample (\d+)", reason)
    return int(found[1])


def frequencies(case: BuiltCase, designs: list[tuple[float, ...]], k: int) -> np.ndarray:
    """Modes 1 and 2 of some designs at sample k."""
    model, q = case.model(), case.trajectory.q[k : k + 1]
    return np.array([model.frequencies(q, y, count=2)[0] for y in designs])


# --- What is out of reach, beside all limits


def test_two_modes_are_no_farther_apart_than_a_design_brings_them() -> None:
    gap = {"gap": {"between": [1, 2], "at_least": 100}}
    case = case_of({"k1": K1, "motor": MOTOR}, [gap], assignment={"starts": 4})
    verdict, reason = said(solve_case(case))
    assert verdict == "unreachable"
    grid = list(itertools.product(np.linspace(5e3, 4e4, 15), np.linspace(0.2, 2.0, 15)))
    hz = frequencies(case, grid, sample(reason))
    assert reached(reason) == pytest.approx((hz[:, 1] - hz[:, 0]).max(), rel=1e-2)


def test_the_highest_of_a_catalogue_is_one_of_its_choices() -> None:
    stiffness, mass = K2["parameter"], MOTOR["parameter"]
    soft, stiff = {stiffness: 4000, mass: 0.2}, {stiffness: 12000, mass: 3.0}
    gear = {"choices": {"soft": soft, "stiff": stiff}}
    case = case_of({"gear": gear, "k1": {**K1, "min": 15000}}, [{"mode": 1, "frequency": 30}])
    verdict, reason = said(solve_case(case))
    assert verdict == "unreachable"
    model, q = case.model(), case.trajectory.q[sample(reason)][None]
    columns = [c.parameter for c in case.file.design.parameters.values()]
    best = max(
        model.frequencies(q, [{**one, K1["parameter"]: 4e4}[name] for name in columns], count=1)
        for one in (soft, stiff)
    )
    assert reached(reason) == pytest.approx(float(best[0, 0]), rel=1e-3)


def test_the_highest_keeps_linear_limits() -> None:
    limit = {"total": {"terms": {"k1": 1, "k2": 1}, "max": 20000}}
    design = {"k1": K1, "k2": K2, "motor": MOTOR, "constraints": limit}
    case = case_of(design, [{"mode": 1, "frequency": 24}])
    verdict, reason = said(solve_case(case))
    assert verdict == "unreachable"
    along = [(k1, 2e4 - k1, 0.2) for k1 in np.linspace(5e3, 1.8e4, 40)]
    best = frequencies(case, along, sample(reason))[:, 0].max()
    assert reached(reason) == pytest.approx(best, rel=1e-3)


def test_the_highest_is_in_no_band() -> None:
    targets = [{"mode": 1, "frequency": 24}, {"mode": 1, "keep_out": [8.5, 20]}]
    verdict, reason = said(solve_case(case_of({"k1": K1, "k2": K2}, targets)))
    assert verdict == "unreachable"
    assert reached(reason) == pytest.approx(8.5, rel=1e-3)


# --- Searches that were ended


def test_a_limit_of_the_mass_contradicts_however_soon_the_search_ends() -> None:
    thick = {"parameter": "sections.tube.outer_diameter", "min": 0.035, "max": 0.06}
    rod = {"parameter": "sections.rod.diameter", "min": 0.02, "max": 0.045}
    ended = {"assignment": {"steps": 1, "starts": 1}}
    wanted = [{"mode": 1, "frequency": 9}]
    case = case_of({"d1": thick, "d2": rod, "mass": {"max": 1.2}}, wanted, **ended)
    verdict, reason = said(solve_case(case))
    assert verdict == "infeasible"
    lightest = case.model().mass([0.035, 0.02])
    assert f"the lightest design has {lightest:.4g} kg" in reason
    more = {"mass": {"max": 1.01 * lightest}}
    result = solve_case(case_of({"d1": thick, "d2": rod, **more}, wanted, **ended))
    verdict, reason = said(result)
    assert verdict in ("do_not_use", "unreachable")
    assert "the lightest" not in reason
    assert result.results.shortcoming is not None


# --- Bands in several load cases


def one_link(**more: Any) -> Result:
    """A band that the design may pass on either side in each of five load cases."""
    motions = [
        {"name": f"L{k}", "q": [[0.0], [0.5], [1.0]], "duration": 1, "set": {"bodies.tool.mass": m}}
        for k, m in enumerate((1.0, 1.1, 1.2, 1.3, 1.4))
    ]
    tree = linkage(
        {"a": straight(0.6, 3)},
        {"shoulder": {"type": "revolute", "base": "ground", "follower": "a.start"}},
        {"q1": {"joint": "shoulder", "drive": {"stiffness": 5000}}},
        section={"shape": "circle", "diameter": 0.03},
        material=ALLOY,
        bodies={"tool": {"at": "a.end", "mass": 1.0}},
    )
    k = {"parameter": "coordinates.q1.drive.stiffness", "min": 500, "max": 6000, **more}
    tree |= {"title": "one link, five loads", "trajectory": motions, "design": {"k": k}}
    return solve_case(ea.load_case({**tree, "targets": [{"keep_out": [8, 13.2]}]}))


def test_a_band_that_all_loads_pass_below_is_not_called_infeasible() -> None:
    result = one_link()
    assert said(result)[0] == "reached"
    notes = " ".join(result.results.notes)
    assert "of 32 choices of how many modes are below each band" in notes


def test_the_cheapest_of_both_sides_of_a_band_is_proved_on_its_bound() -> None:
    result = one_link(price=1e-3)
    row = result.results.assignment
    assert row.verdict == "reached"
    assert result.design["k"] == pytest.approx(500.0)
    assert row.optimality.kind == "proved"


# --- Between samples that are far apart


def swinging(*targets: Any) -> BuiltCase:
    trajectory = {"q": [[0.0, -1.5], [0.0, 1.5]], "duration": 1}
    return case_of({"k2": {**K2, "max": 20000}}, list(targets), trajectory=trajectory)


def at_the_samples() -> float:
    """Mode 1 with the stiffest drive; stretched out, between the samples, it is far lower."""
    case = swinging({"mode": 1, "at_least": 1})
    return float(case.model().frequencies(case.trajectory.q, [20000.0], count=1).min())


def test_a_limit_that_is_missed_between_coarse_samples_is_not_called_met() -> None:
    verdict, reason = said(solve_case(swinging({"mode": 1, "at_least": 0.99 * at_the_samples()})))
    assert verdict == "unreachable"  # whatever the design
    assert "at an instant between samples" in reason


def test_a_band_that_can_be_met_at_the_samples_alone_is_not_called_infeasible() -> None:
    hz = at_the_samples()
    band = {"mode": 1, "keep_out": [0.92 * hz, 0.99 * hz]}
    verdict, reason = said(solve_case(swinging(band)))
    assert verdict in ("do_not_use", "reached")
    assert verdict == "reached" or "not clear" in reason


def test_a_band_that_is_clear_but_for_what_the_mesh_leaves_open_says_both_shares() -> None:
    coarse = {**TWO_LINKS["mechanism"], "links": {}}
    for name, link in TWO_LINKS["mechanism"]["links"].items():
        coarse["links"][name] = {**link, "elements": 1}
    design = {"k1": {**K1, "min": 19999, "max": 20001}}
    plain = case_of(design, [{"mode": 1, "at_least": 1}], mechanism=coarse)
    hz = plain.model().frequencies(plain.trajectory.q, plain.initial_design, count=3)
    band = {"keep_out": [0.9 * hz[:, 2].min(), 0.9995 * hz[:, 2].min()]}
    verdict, reason = said(solve_case(case_of(design, [band], mechanism=coarse)))
    assert verdict == "do_not_use"
    assert re.search(r"the model is clear by 0\.0\d+ %", reason)
    assert "more elements" in reason


def test_a_price_that_lowers_what_is_to_be_high_is_named() -> None:
    cheaper = {**K1, "price": 1e-4}
    aim = {"objective": {"highest": 1}, "starts": 1}
    result = solve_case(case_of({"k1": cheaper, "k2": K2}, [], assignment=aim))
    _, reason = said(result)
    assert f"; its price, {priced(result.results.price)}, counts against it, 1 as 1 Hz" in reason


def test_a_mesh_that_is_too_coarse_is_to_be_made_finer(tmp_path: Path) -> None:
    """Neither elements of beams nor reduce_to would help the casting."""
    starters = Path(ea.__file__).parent / "starters"
    shutil.copytree(starters / "casting", tmp_path / "casting")
    text = (starters / "casting.yaml").read_text() + "assignment: {max_error: 1e-4}\n"
    (tmp_path / "arm.yaml").write_text(text)
    verdict, reason = said(solve_case(ea.load_case(tmp_path / "arm.yaml")))
    assert verdict == "do_not_use"
    assert re.search(r"by about [\d.]+ %.*mesh solids finer", reason, re.IGNORECASE)
