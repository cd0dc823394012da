"""Frequencies of what moves: the forces of the motion stretch and compress links."""

from typing import Any

import numpy as np
import pytest
from spatial_cases import linkage

import eigassign as ea
from eigassign.mechanism import velocity_terms
from eigassign.modal import change_at
from eigassign.pipeline import solve_case


def blade(space: str) -> ea.Case:
    return ea.load_case(blade_tree(space))


def blade_tree(space: str) -> dict[str, Any]:
    """A uniform blade, clamped in a hub without radius that turns about z."""
    beam = {"length": 2.0, "elements": 8, "material": "m", "section": "s"}
    section = {"shape": "rectangle", "width": 0.05, "height": 0.03}
    if space == "spatial":
        section = {"shape": "rectangle", "width": 0.02, "height": 0.03}
    return linkage(
        {"b": beam},
        {"hub": {"type": "revolute", "base": "ground", "follower": "b.start"}},
        {"turn": {"joint": "hub", "drive": "locked"}},
        section=section,
        material={"youngs_modulus": 7e10, "density": 2700.0, "shear_modulus": 2.6e10},
        space=space,
    ) | {"title": "a blade"}


def change(case: ea.Case, share: float, wanted: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Relative changes at a speed that is this share of the first frequency, and Ω²/ω²."""
    model = case.model()
    omega = 2 * np.pi * model.frequencies([0.3], [], max(wanted))[0]
    speed = share * omega[0]
    terms = velocity_terms(case.file, model.poses.parameters, model.motion)
    at = np.array([[0.3]]), np.array([[speed]]), np.zeros((1, 1))
    (found,) = change_at(model.pencil, terms, *at, np.zeros(0), wanted, model.under_load)
    return found, (speed / omega[np.array(wanted) - 1]) ** 2


def test_a_blade_in_the_plane_of_its_turning_is_southwells() -> None:
    """ω² = ω₀² + (1.193 − 1) Ω² of the first lag mode."""
    (found,), (ratio,) = change(blade("planar"), 0.3, (1,))
    assert found == pytest.approx(np.sqrt(1.0 + 0.193 * ratio) - 1.0, rel=0.02)


def test_a_blade_out_of_the_plane_of_its_turning_is_southwells() -> None:
    """ω² = ω₀² + 1.193 Ω² of the first flap mode, the lower, and of lag beside it."""
    found, ratio = change(blade("spatial"), 0.3, (1, 2))
    expected = np.sqrt(1.0 + np.array([1.193, 0.193]) * ratio) - 1.0
    np.testing.assert_allclose(found, expected, rtol=0.02)


def test_a_run_says_how_much_a_blade_stiffens() -> None:
    """The velocity terms alone change its flap by 0.002 %."""
    case = blade("spatial")
    hz = float(case.model().frequencies([0.3], [], 1)[0, 0])
    duration = 1.875 * 1.5 / (0.3 * 2 * np.pi * hz)  # of a quintic law that goes by 1.5 rad
    moving = {"points": [[0.0], [1.5]], "duration": duration, "samples": 41}
    tree = blade_tree("spatial") | {"trajectory": moving, "targets": [{"mode": 1, "frequency": hz}]}
    tree["design"] = {"E": {"parameter": "materials.m.youngs_modulus", "min": 6e10, "max": 8e10}}
    (warning,) = [w for w in solve_case(ea.load_case(tree)).results.warnings if "not slow" in w]
    stated = float(warning.split("by about ")[1].split(" %")[0])
    assert stated == pytest.approx(100 * (np.sqrt(1.0 + 1.193 * 0.09) - 1.0), rel=0.05)
