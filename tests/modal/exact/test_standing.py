"""Poses that fall under their weight, and loads beyond buckling, are errors that say so."""

import copy
from typing import Any

import numpy as np
import pytest
from spatial_cases import linkage

import eigassign as ea
from eigassign.errors import CaseError, MechanismError

EI = 210e9 * np.pi * 0.02**4 / 64
ROD: dict[str, Any] = linkage(
    {"rod": {"length": 2.0, "elements": 8, "section": "s", "material": "steel"}},
    {"hinge": {"type": "revolute", "base": "ground", "follower": "rod.start"}},
    {"q": {"joint": "hinge", "drive": "free"}},
    materials={"steel": {"youngs_modulus": 210e9, "density": 1e-3}},
    gravity=[0.0, -9.81],
    bodies={"b": {"at": "rod.end", "mass": 5.0}},
) | {"title": "rod"}


def rod(drive: Any = "free", mass: float = 5.0, elements: int = 8, **more: Any) -> ea.Case:
    tree = copy.deepcopy(ROD) | more
    tree["coordinates"]["q"]["drive"] = drive
    tree["mechanism"]["links"]["rod"]["elements"] = elements
    tree["mechanism"]["bodies"]["b"]["mass"] = mass
    return ea.load_case(tree)


def refused(case: ea.Case, q: Any) -> str:
    with pytest.raises(MechanismError) as error:
        case.model().frequencies(q, [], 1)
    return str(error.value)


def test_a_pose_that_would_fall_names_coordinate_and_sample() -> None:
    said = refused(rod(), [[-1.5], [-1.0], [1.5]])
    assert "coordinates.q: would fall in the pose q = 1.5 rad (sample 2)" in said
    assert "give it a drive stiffness, lock it, or write `gravity: none`" in said


def test_a_coordinate_that_the_weight_does_not_hold_is_no_mode() -> None:
    assert "held by nothing, the weight included, in the pose q = 0" in refused(rod(), [0.0])


@pytest.mark.parametrize("elements", [8, 90], ids=["dense", "sparse"])
def test_a_load_beyond_buckling_names_its_factor(elements: int) -> None:
    critical = np.pi**2 * EI / (4 * 2.0**2)
    case = rod({"stiffness": 1e12}, 2.5 * critical / 9.81, elements)
    said = refused(case, [[-np.pi / 2], [np.pi / 2]])
    assert "buckles under 0.4 times its weight in the pose q = 1.5708 rad (sample 1)" in said
    assert case.model().frequencies([-np.pi / 2], [], 1) > 0.0


def test_a_trajectory_that_falls_is_named_with_its_line() -> None:
    way = [{"name": name, "points": [[-1.5], [end]], "duration": 1.0, "samples": 5}
           for name, end in (("low", -1.4), ("high", 0.3))]  # fmt: skip
    with pytest.raises(CaseError, match=r"would fall .*sample 3 of trajectory 'high'"):
        _ = rod(trajectory=way).trajectory
