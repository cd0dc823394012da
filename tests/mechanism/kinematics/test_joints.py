"""Joints by differences: freedoms from their own motion, twists and poses from world frames."""

import sys
from types import SimpleNamespace as Given
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from spatial_cases import Built, built
from spatial_examples import four_bar, gantry, slotted_lever
from spatial_oracle import FREEDOMS, Tree, world
from spatial_random import EVERY_LOOP, EVERY_TREE, random_closed, random_open

from eigassign.case import FREEDOMS as KNOWN_FREEDOMS
from eigassign.errors import MechanismError, TravelError
from eigassign.mechanism import JointEdge, Placement, all_moving, joint_motion, resting_pose, turned
from eigassign.modal import eigenvalues
from eigassign.series import Samples, compile_table

H = 1e-5  # central differences: error about H² = 1e-10 times third derivatives of order 1
JOINTS = [
    Given(type="fixed"),
    Given(type="revolute", axis=None),
    Given(type="revolute", axis=(1.0, -2.0, 0.5)),
    Given(type="prismatic", axis=(0.3, 1.0)),
    Given(type="prismatic", axis=(0.3, 1.0, -4.0)),
    Given(type="cylindrical", axis=(0.2, 0.4, -1.0)),
    Given(type="screw", axis=(1.0, 1.0, 0.0), lead=0.3),
    Given(type="universal", axes=((0.0, 1.0, 0.0), (1.0, 0.0, 0.0))),
    Given(type="universal", axes=((0.3, 1.0, 0.2), (1.0, -0.1, 0.7))),
    Given(type="spherical"),
]
KINDS = [j.type for j in JOINTS]


def numbers(motion: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    R, d, A = (np.asarray(part, float) for part in motion)
    return R, d, A


def vee(W: np.ndarray) -> np.ndarray:
    return 0.5 * np.array([W[2, 1] - W[1, 2], W[0, 2] - W[2, 0], W[1, 0] - W[0, 1]])


@pytest.mark.parametrize("joint", JOINTS, ids=KINDS)
def test_a_joints_freedoms_are_the_derivatives_of_its_rotation_and_travel(joint: Any) -> None:
    rng = np.random.default_rng(0)
    for c in rng.uniform(-1.3, 1.3, (4, FREEDOMS[joint.type])):
        R, _, A = numbers(joint_motion(joint, c.tolist()))
        for k in range(len(c)):
            e = H * np.eye(len(c))[k]
            ahead, behind = (numbers(joint_motion(joint, (c + s * e).tolist())) for s in (1, -1))
            v = R.T @ (ahead[1] - behind[1]) / (2 * H)
            w = vee(R.T @ (ahead[0] - behind[0]) / (2 * H))
            np.testing.assert_allclose(A[:, k], [*v, *w], atol=1e-9)


def test_every_joint_of_the_language_has_its_freedoms() -> None:
    assert {kind: len(parts) for kind, parts in KNOWN_FREEDOMS.items()} == FREEDOMS


@pytest.mark.parametrize("joint", JOINTS, ids=KINDS)
def test_a_joint_walked_backwards_is_its_inverse(joint: Any) -> None:
    """The inverse pose, and freedoms that are the derivatives of its own rotation and travel."""
    c = np.linspace(0.4, -0.9, FREEDOMS[joint.type])

    place = np.array([0.1, -0.2, 0.3])

    def back(c: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        forth = joint_motion(joint, c.tolist())
        return numbers(turned(forth._replace(translation=place + forth.translation)))

    R, d, _ = numbers(joint_motion(joint, c.tolist()))
    B, e, A = back(c)
    np.testing.assert_allclose(R @ B, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(d + place + R @ e, 0.0, atol=1e-15)
    for k in range(len(c)):
        h = H * np.eye(len(c))[k]
        (B1, e1, _), (B0, e0, _) = back(c + h), back(c - h)
        v, w = B.T @ (e1 - e0) / (2 * H), vee(B.T @ (B1 - B0) / (2 * H))
        np.testing.assert_allclose(A[:, k], [*v, *w], atol=1e-9)


def test_an_absolute_angle_of_a_link_that_others_hold_is_refused_by_name() -> None:
    tree = four_bar("free")
    m = tree["mechanism"]
    m["links"] = {n: m["links"][n] for n in ("crank", "coupler")}
    m["joints"] = {
        "A": m["joints"]["A"],
        "B": {"type": "revolute", "base": "coupler.start", "follower": "crank.end"},
    }
    del m["assembly"]
    tree["coordinates"]["b"] = {"joint": "B", "angle": "absolute"}
    with pytest.raises(MechanismError, match="hangs its base on its follower") as caught:
        built(tree)
    assert caught.value.path == "coordinates.b.angle"
    tree["coordinates"]["b"]["angle"] = "relative"
    np.testing.assert_allclose(
        built(tree).lam([0.4, 0.7], 3), world(tree, [0.4, 0.7]).spectrum(3), rtol=1e-9
    )


# World frames of every link against their twists


def frames(
    model: Built, motion: Any, q: np.ndarray
) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """World rotation, origin and twist per q̇ of every link, evaluated."""
    n = len(model.numbers.coordinates)
    scalars: list[Any] = []
    for p in motion.placements:
        scalars += [*p.world_rotation.ravel(), *p.world_origin, *p.twist.ravel()]
    table = compile_table(model.numbers.recorder, scalars, n)
    z = (model.numbers.relative @ q + model.numbers.offset)[:, None]
    values = np.broadcast_to(table.evaluate(Samples(), z), (len(scalars), 1))[:, 0]
    cut = values.reshape(len(motion.placements), 12 + 6 * n)
    return [(v[:9].reshape(3, 3), v[9:12], v[12:].reshape(6, n)) for v in cut]


def twists_agree(tree: Tree, q: np.ndarray) -> None:
    model = built(tree)
    if not len(q):
        return
    motion = all_moving(model.case, model.numbers, model.motion)
    here = frames(model, motion, q)
    for i in range(len(q)):
        e = H * np.eye(len(q))[i]
        ahead, behind = frames(model, motion, q + e), frames(model, motion, q - e)
        for (R, _, T), (R1, o1, _), (R0, o0, _) in zip(here, ahead, behind, strict=True):
            v, w = R.T @ (o1 - o0) / (2 * H), vee(R.T @ (R1 - R0) / (2 * H))
            # third derivatives of loops near a dead point reach some 100
            np.testing.assert_allclose(T[:, i], [*v, *w], rtol=1e-6, atol=3e-8)


@pytest.mark.parametrize("drawn", EVERY_TREE, ids=str)
def test_twists_of_trees_are_the_derivatives_of_the_world_frames(
    drawn: tuple[int, str, bool],
) -> None:
    twists_agree(*random_open(*drawn))


@pytest.mark.parametrize("drawn", EVERY_LOOP, ids=str)
def test_twists_of_loops_are_the_derivatives_of_the_world_frames(
    drawn: tuple[int, str, int, bool],
) -> None:
    tree, q0, _ = random_closed(*drawn)
    twists_agree(tree, q0)


def test_a_tapered_beam_keeps_its_taper_where_a_carriage_splits_it() -> None:
    tree = gantry("locked")
    tree["mechanism"]["sections"]["t"] = {"shape": "rectangle", "height": 0.02, "width": 0.03}
    tree["mechanism"]["links"]["girder"]["section"] = {"start": "s", "end": "t"}
    model = built(tree)
    for x in (0.4, 0.5, 1.1):
        np.testing.assert_allclose(model.lam([x], 5), world(tree, [x]).spectrum(5), rtol=1e-8)


def test_an_absolute_angle_is_the_worlds_wherever_the_joint_is_in_the_file() -> None:
    tree = four_bar("locked")
    joints = tree["mechanism"]["joints"]
    tree["mechanism"]["joints"] = {
        "D": joints["D"],
        "E": {"type": "revolute", "base": "rocker.end", "follower": "coupler.end"},
        "B": {"type": "revolute", "base": "coupler.start", "follower": "crank.end"},
        "A": {**joints["A"], "angle": 0.4},  # closes the loop
    }
    tree["mechanism"]["assembly"] = {"guess": {"D": 2.0, "E": -1.0, "B": -1.0}}
    tree["coordinates"]["th"]["angle"] = "absolute"
    model, th = built(tree), 0.5
    crank = model.poses.position(model.x([th]), "crank", "end")[0]
    np.testing.assert_allclose(crank, [0.12 * np.cos(th), 0.12 * np.sin(th), 0.0], atol=1e-12)


def test_a_chain_may_have_more_links_than_calls_may_nest() -> None:
    count, length, bend = 2 * sys.getrecursionlimit(), 0.1, 1e-3
    R = Rotation.from_euler("z", bend).as_matrix().astype(object)
    none, end = np.array([[0.0] * 3, [length, 0.0, 0.0]], dtype=object)
    link: Placement | None = None
    for _ in range(count):
        foot = none if link is None else end
        edge = JointEdge("", ("ground", ""), ("", "start"))
        link = Placement("", edge, R, none, np.zeros((6, 0)), np.zeros((6, 0)), link, foot, none)
    angles = bend * np.arange(1, count)  # of all links that carry another
    reached = [length * np.cos(angles).sum(), length * np.sin(angles).sum(), 0.0]
    np.testing.assert_allclose(link.world_origin.astype(float), reached, rtol=1e-10)


# --- Carriages and nuts stay on their beams: refused by name, with the pose and the range


FIRST = 6 * 1e-4 * 1.6  # m: six elements of L/10⁴ before the carriage


@pytest.mark.parametrize("x", [-0.2, 0.0, 0.99 * FIRST, 1.6 - 0.99 * FIRST, 1.6, 2.0, np.nan])
def test_a_carriage_beyond_its_beam_is_refused_with_its_range(x: float) -> None:
    with pytest.raises(TravelError, match=r"from 0.00096 m to 1.59904 m") as caught:
        built(gantry("free")).lam([x], 1)
    assert caught.value.path == "mechanism.joints.car"
    said = f"{x:.6g} m" if x >= 1.0 or not x else f"{1000.0 * x:.6g} mm"
    assert f"in the pose x = {said}:" in caught.value.message


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_carriage_near_the_end_keeps_its_digits(mirrored: bool) -> None:
    """At the last place allowed λ is still what the cubic through places nearby leads to.

    Extrapolated by h = 5 mm of 1.6 m: the error is some (h/L)⁴ = 1e-10 times λ's derivatives.
    """
    model = built(gantry("locked"))
    places = np.array([1.01 * FIRST, 0.005, 0.01, 0.015, 0.02])
    x = 1.6 - places if mirrored else places
    lam = np.array([model.lam([v], 1)[0] for v in x])
    fitted = np.polynomial.Polynomial.fit(places[1:], lam[1:], 3)(places[0])
    assert lam[0] == pytest.approx(fitted, rel=1e-7)


def test_the_first_sample_that_leaves_the_beam_is_named() -> None:
    model = built(gantry("free"))
    x = np.array([[0.5], [1.2], [1.7], [-1.0]])
    with pytest.raises(TravelError, match=r"x = 1.7 m \(sample 2\)") as caught:
        eigenvalues(model.pencil, x, 1)
    assert caught.value.sample == 2


def test_the_length_that_counts_is_the_designs() -> None:
    tree = gantry("free")
    tree["mechanism"]["joints"].pop("f4")  # an open portal may change its girder's length
    tree["design"] = {"L": {"parameter": "links.girder.length", "min": 1.0, "max": 2.0}}
    model = built(tree)
    assert eigenvalues(model.pencil, np.array([[1.8, 2.0]]), 1)[0, 0] > 0.0
    with pytest.raises(TravelError, match=r"to 1.59904 m"):
        eigenvalues(model.pencil, np.array([[1.8, 1.6]]), 1)


def test_a_passive_block_that_leaves_its_lever_is_named_with_the_pose() -> None:
    tree = slotted_lever("free")
    tree["mechanism"]["links"]["lever"]["length"] = 0.4
    model = built(tree)
    assert model.lam([-1.0], 1)[0] > 0.0
    with pytest.raises(TravelError, match=r"in the pose th = 1.5") as caught:
        model.lam([1.5], 1)
    assert caught.value.path == "mechanism.joints.S"


def test_the_pose_to_try_has_its_carriage_in_the_middle() -> None:
    np.testing.assert_array_equal(resting_pose(built(gantry("free")).case), [0.8])
