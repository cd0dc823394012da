"""The fastest motion that stands still: against grids and integrations, and what is said of it."""

import csv
import json
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from calibration import Floats
from json_schema_reader import reads_back
from whole_moves import ZETA, Matter, largest, left, whole_scara

import eigassign as ea
from eigassign.assignment import design_limits
from eigassign.errors import CaseError
from eigassign.mechanism import Moving
from eigassign.modal import Shaper, Sizes, residual_share
from eigassign.pipeline import Options, optimize

CASES = Path(__file__).parents[2] / "cases"
Tree = dict[str, Any]
FINE = Sizes(steps=640, poses=5, loads=25)
TIMES = np.linspace(0.12, 0.4, 100)


def small(law: str = "quintic", *names: str, **residual: Any) -> Tree:
    """The shipped SCARA of one element each, with the motion time and some of its parameters."""
    data: Tree = yaml.safe_load((CASES / "scara.yaml").read_text())
    del data["expansion"], data["validation"]
    for link in data["mechanism"]["links"].values():
        link["elements"] = 1
    data["trajectory"] |= {"samples": 11, "timing": law}
    data["design"] = {name: data["design"][name] for name in (*(names or ["k1"]), "T")}
    target = {"at": "forearm.end", **residual}
    data["targets"] = [{"residual": target, "at_most": target.pop("at_most", "0.5 mm")}]
    return data


def limits(case: ea.Case) -> tuple[Any, Any]:
    """The limit of the residual, and that of a torque."""
    own = list(design_limits(case.file, case.model(), case.trajectory))
    return next(one for one in own if one.is_residual), own[0]


def fastest_of_grid(case: ea.Case, count: int = 12, torque: float = np.inf) -> float:
    """The least of `TIMES` at which some design of a grid keeps the limits."""
    residual, load = limits(case)
    ends, best = case.file.box[:-1], np.inf
    for design in product(*(np.linspace(low, high, count) for low, high in ends)):
        y = np.array([*design, 0.25])
        kept = residual.quantity.along(y, TIMES) <= residual.allowed[1]
        if torque < np.inf:  # without gravity it goes as 1/T²
            kept &= np.abs(load.quantity(y)[0]).max() * (0.25 / TIMES) ** 2 <= torque
        best = min([best, *TIMES[kept][:1]])
    return float(best)


def checked(data: Tree, count: int = 12, torque: float = np.inf) -> Floats:
    """The optimum: no slower than that of the grid, its residual kept with finer steps."""
    case = ea.load_case(data)
    found = ea.assign(case)
    y = np.array(list(found.design.values()))
    assert found.results.assignment.verdict in ("reached", "improved")
    # a basin of the grid's best begins up to a step before it
    assert y[-1] <= fastest_of_grid(case, count, torque) + TIMES[1] - TIMES[0]
    residual, _ = limits(case)
    assert residual.quantity.along(y, y[-1:], FINE)[0] <= residual.allowed[1]
    return y


@pytest.mark.parametrize(("law", "most"), [("quintic", "0.5 mm"), ("trapezoidal", "1.5 mm")])
def test_no_motion_of_a_grid_is_faster(law: str, most: str) -> None:
    checked(small(law, at_most=most))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "most"), [("quintic", "0.3 mm"), ("trapezoidal", "0.6 mm"), ("cubic", "0.5 mm")]
)
def test_no_motion_of_a_grid_of_two_stiffnesses_is_faster(law: str, most: str) -> None:
    checked(small(law, "k1", "k2", at_most=most))


def test_a_torque_bounds_the_motion_from_the_other_side() -> None:
    """280 N m are reached before the residual is, in a design whose basins lie elsewhere."""
    data = small(at_most="0.5 mm")
    data["design"]["torque"] = {"q1": {"max": "150 N m"}}
    y = checked(data, torque=150.0)
    _, load = limits(ea.load_case(data))
    values, slopes = load.quantity(y)
    assert y[-1] > 0.2  # 0.195 s without it
    assert np.abs(values).max() == pytest.approx(150.0, rel=2e-3)
    h = 1e-5
    beside = [load.quantity(y + [0.0, step])[0] for step in (h, -h)]
    np.testing.assert_allclose(slopes[:, -1], (beside[0] - beside[1]) / (2 * h), rtol=1e-6, atol=1e-3)
    np.testing.assert_allclose(values, load.quantity(np.array([y[0], 0.25]))[0] * (0.25 / y[-1]) ** 2)


def test_a_residual_is_a_limit_beside_wanted_frequencies() -> None:
    """The stiffness next to that of 19 Hz that leaves no more; the motion time is given."""
    data = small(at_most="0.6 mm")
    del data["design"]["T"], data["assignment"]
    data["targets"].append({"mode": 1, "frequency": "20 Hz"})
    case = ea.load_case(data)
    found = ea.assign(case)
    residual, _ = limits(case)
    hz, q = [], case.trajectory.q
    grid = np.linspace(15e3, 45e3, 61)
    for k in grid:
        hz.append(case.model().frequencies(q, np.tile(k, (len(q), 1)), count=1)[:, 0])
    missed = np.sqrt(np.mean((np.array(hz) / 20.0 - 1.0) ** 2, axis=1))
    kept = [residual.quantity(np.array([k]))[0] <= residual.allowed[1] for k in grid]
    y = np.array(list(found.design.values()))
    print(y, grid[np.argmin(missed)], grid[kept], missed[kept].min(), found.results.error)
