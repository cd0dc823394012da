"""The rotor of a motor behind a gear that gives."""

import numpy as np
import pytest
from scipy.linalg import eigh
from spatial_cases import case_of
from spatial_oracle import Tree

import eigassign as ea


@pytest.mark.parametrize("loop", [1e3, 1e5, 1e7, None])
def test_a_rotor_behind_a_gear_that_gives_is_a_link_between_two_joints(loop: float | None) -> None:
    """Two masses in a row: J_m N² on the loop's spring, the arm on the gear's; or free."""
    rotor, ratio, J, gear = 4e-5, 120.0, 2.5, 4e4
    motor: Tree = {"inertia": rotor * ratio**2}
    tree: Tree = {
        "title": "Two masses",
        "mechanism": {
            "space": "planar",
            "links": {
                "shaft": {"type": "rigid"},
                "arm": {"type": "rigid", "length": 1.0, "inertia": J},
            },
            "joints": {
                "motor": {"type": "revolute", "base": "ground", "follower": "shaft.start"},
                "gear": {"type": "revolute", "base": "shaft.start", "follower": "arm.start"},
            },
        },
        "coordinates": {
            "m": {"joint": "motor", "drive": motor | ({} if loop is None else {"stiffness": loop})},
            "g": {"joint": "gear", "drive": {"stiffness": gear}},
        },
    }
    K = np.array([[(loop or 0.0) + gear, -gear], [-gear, gear]])
    lam = eigh(K, np.diag([rotor * ratio**2, J]), eigvals_only=True)[loop is None :]
    found = case_of(tree)
    assert found.warnings == ()
    model = ea.load_case(tree).model()
    count = 2 if loop is not None else 1
    frequencies = model.frequencies([0.3, 0.0], [], count)[0]
    np.testing.assert_allclose(frequencies, np.sqrt(lam) / (2 * np.pi), rtol=1e-9)
