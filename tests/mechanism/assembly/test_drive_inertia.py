"""The inertia that a drive reflects through its gear: ½ J ṡ² with the joint's own rate ṡ."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from chains import Tree, model_of, two_link
from frame_comparison import agree
from spatial_random import EVERY_TREE, random_closed, random_open


def rigid_arm(joint: str, drive: Tree, own: float = 0.3) -> Tree:
    """One rigid link; the inertia ``own`` (kg m2, or kg where it slides) stands on its root."""
    body = {"mass": own} if joint == "prismatic" else {"inertia": own}
    return {
        "mechanism": {
            "space": "planar",
            "links": {"arm": {"type": "rigid", "length": 0.5, "mass": 0.0}},
            "joints": {"root": {"type": joint, "base": "ground", "follower": "arm.start"}},
            "bodies": {"own": {"at": "arm.start", **body}},
        },
        "coordinates": {"q": {"joint": "root", "drive": drive}},
    }


@pytest.mark.parametrize("joint", ["revolute", "prismatic"])
def test_a_held_rigid_link_swings_with_its_own_and_the_reflected_inertia(joint: str) -> None:
    k, J, own = 200.0, 0.7, 0.3
    model = model_of(rigid_arm(joint, {"stiffness": k, "inertia": J}, own))
    hz = model.frequencies([0.4], [], 1)[0, 0]
    np.testing.assert_allclose(hz, np.sqrt(k / (own + J)) / (2.0 * np.pi), rtol=1e-14)


@pytest.mark.parametrize("angle", ["relative", "absolute"])
def test_rotors_turn_with_the_joint_and_not_with_its_link(angle: str) -> None:
    plain = two_link(angles=("relative", angle), design={})
    geared = two_link(
        angles=("relative", angle), drives=({"inertia": 0.2}, {"inertia": 0.05}), design={}
    )
    q, rate = np.array([0.4, 1.7]), np.array([1.3, -0.6])
    elbow = rate[1] - rate[0] if angle == "absolute" else rate[1]
    added = model_of(geared).matrices(q, [])[0] - model_of(plain).matrices(q, [])[0]
    assert not added[:-2].any()
    energy = 0.5 * rate @ added[-2:, -2:] @ rate
    np.testing.assert_allclose(energy, 0.5 * (0.2 * rate[0] ** 2 + 0.05 * elbow**2), rtol=1e-12)


def test_a_free_joint_with_a_rotor_stays_a_rigid_motion() -> None:
    model = model_of(two_link(drives=({"inertia": 0.2}, "free")))
    assert model.n_rigid == 2
    heavy = model_of(two_link(drives=({"inertia": 1e9}, {"inertia": 1e9})))
    locked = model_of(two_link(drives=("locked", "locked")))
    q, y = [0.7, 2.0], [0.1, 0.1]  # rotors that cannot be turned hold their joints
    np.testing.assert_allclose(heavy.frequencies(q, y, 3), locked.frequencies(q, y, 3), rtol=1e-7)


def test_the_inertia_may_be_a_design_parameter() -> None:
    design = {"J": {"parameter": "coordinates.q2.drive.inertia", "min": 0.0, "max": 0.5}}
    drive = {"stiffness": 300.0, "inertia": 0.1}
    varied = model_of(two_link(drives=("free", drive), design=design))
    for J in (0.0, 0.1, 0.37):
        written = model_of(two_link(drives=("free", {**drive, "inertia": J}), design={}))
        np.testing.assert_allclose(
            varied.frequencies([0.3, 1.1], [J], 4),
            written.frequencies([0.3, 1.1], [], 4),
            rtol=1e-12,
        )


def geared(tree: Tree, seed: int) -> Tree:
    """The tree with an inertia on the drive of every coordinate that is not locked."""
    random = np.random.default_rng(seed)
    for data in tree["coordinates"].values():
        given: Any = data.get("drive", "free")
        if given != "locked":
            held = given if isinstance(given, dict) else {}
            data["drive"] = {**held, "inertia": float(10 ** random.uniform(-2, 1))}
    return tree


@pytest.mark.parametrize("drawn", EVERY_TREE, ids=str)
def test_random_trees_with_geared_drives_have_the_spectrum_of_the_plain_frame(
    drawn: tuple[int, str, bool],
) -> None:
    tree, q = random_open(*drawn)
    agree(geared(tree, drawn[0]), (q,))


@pytest.mark.parametrize("space", ["planar", "spatial"])
@pytest.mark.parametrize("seed", range(8))
def test_random_loops_with_geared_drives_have_the_spectrum_of_the_plain_frame(
    seed: int, space: str
) -> None:
    tree, *poses = random_closed(seed, space)
    agree(geared(tree, seed), tuple(poses))
