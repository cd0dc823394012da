"""Loops that close between rigid links: closed forms, the plain frame, and what is refused."""

import copy

import numpy as np
import pytest
from frame_comparison import agree
from spatial_cases import built
from spatial_examples import INERTIA, MASS, four_bar, rigid
from spatial_oracle import Tree
from spatial_random import random_closed

from eigassign.errors import MechanismError
from eigassign.mechanism import JointEdge, require_consistent


def effective_inertia(theta: float) -> float:
    """Σ m v² + J ω² per θ̇² of the rigid four-bar, its rates from the vector loop.

    a e^{iθ} + b e^{iβ} = d + c e^{iγ}:  a θ̇ e'(θ) + b β̇ e'(β) = c γ̇ e'(γ).
    """
    a, b, c, d = 0.12, 0.45, 0.4, 0.5
    pin = a * np.exp(1j * theta)
    span = d - pin
    inside = np.arccos((b**2 + abs(span) ** 2 - c**2) / (2 * b * abs(span)))
    beta = np.angle(span) + inside
    end = pin + b * np.exp(1j * beta)
    gamma = np.angle(end - d)
    left = np.array([[b * 1j * np.exp(1j * beta), -c * 1j * np.exp(1j * gamma)]])
    beta_rate, gamma_rate = np.linalg.solve(
        np.vstack([left.real, left.imag]), [-(1j * pin).real, -(1j * pin).imag]
    )
    middle = 1j * pin + 0.5 * b * beta_rate * 1j * np.exp(1j * beta)
    speeds = [0.5 * a, abs(middle), 0.5 * c * abs(gamma_rate)]
    turns = [1.0, beta_rate, gamma_rate]
    return float(MASS * np.square(speeds).sum() + INERTIA * np.square(turns).sum())


@pytest.mark.parametrize("theta", [0.4, 1.9, 4.0])
def test_a_rigid_four_bar_on_its_drive_swings_like_its_effective_inertia(theta: float) -> None:
    k = 750.0
    model = built(rigid(four_bar({"stiffness": k})))
    assert model.pencil.n_dof == 1
    expected = k / effective_inertia(theta)
    np.testing.assert_allclose(model.lam([theta], 1), [expected], rtol=1e-10)


def two_dyads() -> Tree:
    """A beam's tip held by two pairs of rigid bars: the second closes at a node already taken."""
    tree = rigid(four_bar("locked"))
    m = tree["mechanism"]
    bars = {n: copy.deepcopy(m["links"]["rocker"]) for n in ("a", "b", "c", "d")}
    m["links"] = {"beam": four_bar("locked")["mechanism"]["links"]["coupler"], **bars}
    pin = {"type": "revolute"}
    m["joints"] = {
        "root": {"type": "revolute", "base": "ground", "follower": "beam.start"},
        "a1": {**pin, "base": "ground", "follower": "a.start", "position": [0.4, 0.6]},
        "a2": {**pin, "base": "a.end", "follower": "b.start"},
        "a3": {**pin, "base": "b.end", "follower": "beam.end"},
        "c1": {**pin, "base": "ground", "follower": "c.start", "position": [0.5, -0.6]},
        "c2": {**pin, "base": "c.end", "follower": "d.start"},
        "c3": {**pin, "base": "d.end", "follower": "beam.end"},
    }
    m["assembly"] = {
        "at": {"th": 0.0},
        "guess": {"a1": -0.77, "a2": -1.44, "a3": 2.2, "c1": 0.94, "c2": 1.44, "c3": -2.37},
    }
    tree["coordinates"] = {"th": {"joint": "root", "drive": {"stiffness": 4e3}}}
    return tree


def test_a_second_rigid_dyad_on_one_node_follows_what_the_first_allows() -> None:
    tree = two_dyads()
    model = built(tree)
    assert len(model.motion.tree.loops) == 2
    assert model.motion.tree.n_elastic == 1
    agree(tree, (np.array([0.0]), np.array([0.2])))


@pytest.mark.parametrize("space", ["planar", "spatial"])
@pytest.mark.parametrize(
    "seed", [*range(4), *(pytest.param(k, marks=pytest.mark.slow) for k in range(4, 12))]
)
def test_random_loops_of_rigid_links_have_the_spectrum_of_the_plain_frame(
    seed: int, space: str
) -> None:
    tree, *poses = random_closed(seed, space, 1 + seed % 3 // 2, seed % 2 == 0, ("rigid",))
    agree(tree, tuple(poses))


def test_a_planar_linkage_of_rigid_links_works_in_space_on_rigid_ground() -> None:
    """Four parallel pins overconstrain it by three; its dimensions agree."""
    tree = rigid(four_bar({"stiffness": 750.0}))
    flat = built(tree).lam([1.0], 1)
    m = tree["mechanism"]
    m["space"] = "spatial"
    m["joints"]["D"]["position"] = [0.5, 0.0, 0.0]
    for link in m["links"].values():
        link |= {"center": [*link["center"], 0.0], "inertia": [0.01, 0.02, INERTIA]}
    np.testing.assert_allclose(built(tree).lam([1.0], 1), flat, rtol=1e-10)


def test_rows_that_no_passive_joint_can_meet_are_refused_at_their_joint() -> None:
    """Two planar loops on one unknown: the second demands of it what its one joint cannot give."""
    J, G = np.zeros((6, 2)), np.zeros((6, 1))
    J[[0, 4], [0, 1]] = 1.0
    G[0] = G[4] = 0.3
    loops = [JointEdge(name, ("a", "end"), ("b", "end")) for name in ("first", "second")]
    require_consistent(J, G, loops, "planar")
    G[5] = 1e-6
    with pytest.raises(MechanismError, match="no room to move") as caught:
        require_consistent(J, G, loops, "planar")
    assert caught.value.path == "mechanism.joints.second"
