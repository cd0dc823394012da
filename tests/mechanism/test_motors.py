"""The rotor of a motor behind a gear: as data sheets give it, and behind a gear that gives."""

from typing import Any

import numpy as np
import pytest
from scipy.linalg import eigh
from spatial_cases import case_of, linkage
from spatial_oracle import Tree

import eigassign as ea
from eigassign.mechanism import drive_forces


def arm(drive: Any, kind: str = "revolute", design: Tree | None = None) -> Tree:
    """An elastic link, which an elastic one carries on the driven joint."""
    beam = {"length": 0.5, "material": "m", "section": "s", "elements": 2}
    return linkage(
        {"a": beam, "b": beam},
        {
            "one": {"type": "revolute", "base": "ground", "follower": "a.start"},
            "two": {"type": kind, "base": "a.end", "follower": "b.start"},
        },
        {
            "q1": {"joint": "one", "drive": {"stiffness": 5e4}},
            "q2": {"joint": "two", "drive": drive},
        },
        section={"shape": "circle", "diameter": 0.03},
        material={"youngs_modulus": 7e10, "density": 2.7e3},
    ) | {
        "title": "Arm",
        "trajectory": {"points": [[0.1, 0.2], [0.5, 0.1]], "duration": 1.0, "samples": 9},
        "design": design or {},
    }


def torques(case: ea.Case, y: np.ndarray) -> np.ndarray:
    model = case.model()
    drives = drive_forces(model.poses.case, model.poses.parameters, model.motion)
    return drives.along(case.trajectory, y)[1]


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
@pytest.mark.parametrize("held", [{}, {"stiffness": 3e4}])
def test_a_motor_counts_with_the_square_of_its_gear_at_every_design(
    kind: str, held: dict[str, float]
) -> None:
    design = {
        "n": {"parameter": "coordinates.q2.drive.ratio", "min": 10.0, "max": 200.0},
        "J": {"parameter": "coordinates.q2.drive.motor_inertia", "min": 1e-6, "max": 1e-4},
    }
    motor = {**held, "motor_inertia": "0.3 kg cm2", "ratio": 100}
    case = ea.load_case(arm(motor, kind, design))
    for n, J in ((100.0, 3e-5), (30.0, 8e-6), (180.0, 9e-5)):
        same = ea.load_case(arm({**held, "inertia": J * n**2}, kind))
        expected = same.model().frequencies([0.2, 0.3], [], 5)
        found = case.model().frequencies([0.2, 0.3], [n, J], 5)
        np.testing.assert_allclose(found, expected, rtol=1e-10)
        np.testing.assert_allclose(
            torques(case, np.array([n, J])), torques(same, np.zeros(0)), rtol=1e-10
        )


def test_a_motor_without_a_gear_turns_with_its_joint() -> None:
    motor = ea.load_case(arm({"stiffness": 3e4, "motor_inertia": "2 kg m2"}))
    plain = ea.load_case(arm({"stiffness": 3e4, "inertia": "2 kg m2"}))
    found, same = (each.model().frequencies([0.2, 0.3], [], 5) for each in (motor, plain))
    np.testing.assert_array_equal(found, same)


def test_a_spindle_has_its_ratio_in_radians_per_metre() -> None:
    spindle = {"motor_inertia": "0.5 kg cm2", "ratio": "0.6283185307 rad/mm", "stiffness": "9 N/um"}
    drive = ea.load_case(arm(spindle, "prismatic")).file.coordinates["q2"].drive
    assert drive.ratio == pytest.approx(2 * np.pi / 0.01)


@pytest.mark.parametrize("loop", [1e3, 1e5, 1e7, None])
def test_a_rotor_behind_a_gear_that_gives_is_a_link_between_two_joints(loop: float | None) -> None:
    """Two masses in a row: J_m N² on the loop's spring, the arm on the gear's; or free."""
    rotor, ratio, J, gear = 4e-5, 120.0, 2.5, 4e4
    motor: Tree = {"motor_inertia": rotor, "ratio": ratio}
    tree: Tree = linkage(
        {
            "shaft": {"type": "rigid"},
            "arm": {"type": "rigid", "length": 1.0, "inertia": J},
        },
        {
            "motor": {"type": "revolute", "base": "ground", "follower": "shaft.start"},
            "gear": {"type": "revolute", "base": "shaft.start", "follower": "arm.start"},
        },
        {
            "m": {"joint": "motor", "drive": motor | ({} if loop is None else {"stiffness": loop})},
            "g": {"joint": "gear", "drive": {"stiffness": gear}},
        },
    ) | {"title": "Two masses"}
    K = np.array([[(loop or 0.0) + gear, -gear], [-gear, gear]])
    lam = eigh(K, np.diag([rotor * ratio**2, J]), eigvals_only=True)[loop is None :]
    found = case_of(tree)
    assert found.warnings == ()
    model = ea.load_case(tree).model()
    count = 2 if loop is not None else 1
    frequencies = model.frequencies([0.3, 0.0], [], count)[0]
    np.testing.assert_allclose(frequencies, np.sqrt(lam) / (2 * np.pi), rtol=1e-9)
