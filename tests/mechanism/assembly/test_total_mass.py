"""The mass of a mechanism is what its parts weigh when they are added up by hand."""

from __future__ import annotations

from math import pi
from pathlib import Path

import numpy as np
import pytest
from small_case import edited

from eigassign.case import parse
from eigassign.study import BuiltCase, load_case

CASES = Path(__file__).parents[3] / "cases"


def gantry(depth: float, m: float) -> float:
    return 7850 * (2 * 0.8 * 0.05 * depth + 1.6 * 0.05 * 0.05) + m


def ball_screw(_servo: float, m: float) -> float:
    return 7850 * 0.6 * pi / 4 * 0.025**2 + m + 1.5


def arm_lengths(upper: float, fore: float, m: float) -> float:
    return 2690.007033 * 7.06317856e-4 * (upper + fore) + m


def superelement_arm(m1: float, m2: float) -> float:
    return 2690.007033 * 7.06317856e-4 * (0.6 + 0.45) + m1 + m2


# a clamped portal with a carriage on it; a loop with a nut; lengths; a part given by its matrices
@pytest.mark.parametrize("by_hand", [gantry, ball_screw, arm_lengths, superelement_arm])
def test_links_and_bodies_add_up(by_hand) -> None:  # type: ignore[no-untyped-def]
    case = load_case(CASES / f"{by_hand.__name__}.yaml")
    model, width = (
        case.model(),
        np.ptp([(p.min, p.max) for p in case.file.design.parameters.values()], axis=1),
    )
    for share in (0.1, 0.2, 0.3):
        y = case.initial_design + share * width
        assert model.mass(y) == pytest.approx(by_hand(*y), rel=1e-9)  # matrices of 10 digits
        step = 1e-5 * np.eye(len(y))
        differences = [(by_hand(*(y + h)) - by_hand(*(y - h))) / 2e-5 for h in step]
        np.testing.assert_allclose(model.total_mass(y)[1], differences, rtol=1e-8, atol=1e-8)


def test_the_slope_is_that_of_a_curved_dependence() -> None:
    text = edited(
        "parameter: bodies.tool.mass, min", "parameter: coordinates.q2.drive.inertia, min"
    )
    text = text.replace("drive: {stiffness: 100}", "drive: {stiffness: 100, inertia: 0.5}")
    text = text.replace("max: 250 g", "max: 1").replace("max: 200 g", "max: 1")
    case = BuiltCase(parse(text.encode(), "case.yaml"))
    model = case.model()
    pipe, bar = pi / 4 * (0.04**2 - 0.036**2), 7.0632e-4
    for d in (0.02, 0.035):
        expected = 2700 * (0.6 * pi / 4 * d**2 + 0.45 * pipe + 0.3 * bar) + 0.1
        assert model.mass([0.7, d]) == pytest.approx(expected, rel=1e-12)
        # what a drive reflects is no mass
        np.testing.assert_allclose(
            model.total_mass(np.array([0.7, d]))[1], [0.0, 2700 * 0.6 * pi / 2 * d], rtol=1e-12
        )
