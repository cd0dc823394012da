"""Stiffness under weight: the pencil against a nonlinear potential, and what must always hold."""

from __future__ import annotations

import copy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from imported_parts import arm, beam_arm, exported, part, write
from scipy import linalg
from spatial_cases import ALLOY, built
from spatial_examples import arm3r, ball_screw, four_bar, gantry, rigid, slotted_lever, straight
from spatial_oracle import Tree
from spatial_random import EVERY_LOOP, EVERY_TREE, random_closed, random_open
from weight_comparison import (
    agree_under_weight,
    direction,
    level_carriage,
    matrices,
    pulled,
    turned_about,
)
from weight_oracle import lowest, sag_slopes, weigh

from eigassign.mechanism import stiffness_under_load

SLOW = pytest.mark.slow
DRAWS = [  # that hold every joint, a frame, rigid links, springs, tapers and shear
    *EVERY_TREE[:4:3], *EVERY_TREE[4:9], *EVERY_LOOP[:2], *EVERY_LOOP[5:8]
]  # fmt: skip


def drawn(draw: tuple[Any, ...]) -> tuple[Tree, np.ndarray]:
    if len(draw) == 3:
        return random_open(*draw)
    tree, _, q = random_closed(*draw)
    return tree, q


# --- the oracle itself


def test_the_oracle_knows_the_pendulum_on_a_free_joint() -> None:
    """A rigid rod of mass m and inertia J about its middle, hanging: λ = m g (L/2)/(J + m L²/4)."""
    rod = {"type": "rigid", "length": 0.8, "center": [0.4, 0.0], "mass": 2.0, "inertia": 0.15}
    tree = one_link(rod, {"type": "revolute", "angle": -np.pi / 2}, "free")
    found = weigh(tree, [0.0], [0.0, -9.81])
    expected = 2.0 * 9.81 * 0.4 / (0.15 + 2.0 * 0.4**2)
    np.testing.assert_allclose(found.spectrum(1), [expected], rtol=1e-12)


def test_the_oracle_knows_the_column_that_buckles() -> None:
    """λ vanishes at the tip load π²EI/4L² of a clamped column."""
    tree = one_link(straight(2.0, 8), {"type": "fixed", "angle": np.pi / 2}, None)
    tree["mechanism"]["materials"]["m"]["density"] = 1e-6
    EI = 200e9 * 0.02 * 0.004**3 / 12
    tree["mechanism"]["bodies"] = {"load": {"at": "l.end", "mass": 3.0}}
    critical = np.pi**2 * EI / (4 * 2.0**2)
    found = weigh(tree, [], [0.0, -critical / 3.0])
    assert abs(found.spectrum(1)[0]) < 1e-4 * found.spectrum(1, 0.0)[0]


def one_link(link: Tree, joint: Tree, drive: Any) -> Tree:
    tree = copy.deepcopy(four_bar("free"))
    m = {k: v for k, v in tree["mechanism"].items() if k != "assembly"}
    m |= {"links": {"l": link}, "joints": {"A": {**joint, "base": "ground", "follower": "l.start"}}}
    coordinates = {} if drive is None else {"q": {"joint": "A", "drive": drive}}
    return {"mechanism": m, "coordinates": coordinates}


# --- the package


@pytest.mark.parametrize("draw", DRAWS, ids=str)
def test_random_mechanisms_under_weight_are_those_of_the_nonlinear_potential(
    draw: tuple[Any, ...],
) -> None:
    tree, q = drawn(draw)
    agree_under_weight(tree, q, direction(tree, draw[0]))


def lopsided(tree: Tree) -> Tree:
    tree["mechanism"]["links"]["trolley"] |= {"center": [0.1, -0.3], "inertia": 0.1}
    return tree


def in_space(tree: Tree) -> Tree:
    """The same in space, where a planar loop has more conditions than freedoms."""
    m = tree["mechanism"]
    m["space"] = "spatial"
    for joint in m["joints"].values():
        if "position" in joint:
            joint["position"] = [*joint["position"], 0.0]
    m["bodies"] = {"knob": {"at": "coupler.end", "mass": 0.6, "offset": [0.05, -0.03, 0.04]}}
    return tree


def reduced(tree: Tree) -> Tree:
    for link in tree["mechanism"]["links"].values():
        link["reduce_to"] = 1e6
    return tree


KNOWN: dict[str, tuple[Callable[[], Tree], list[float]]] = {
    "a portal with a lopsided trolley": (lambda: lopsided(gantry("free")), [0.5]),
    "a block on a lever": (lambda: slotted_lever("free"), [0.2]),
    "a ball screw": (lambda: ball_screw([0.3, 0.5, -0.4]), [0.37]),
    "an arm": (lambda: arm3r("free"), [0.4, 0.8, -0.9]),
    "a four-bar with rigid links": (lambda: rigid(four_bar("free"), "crank", "coupler"), [1.0]),
    "a redundant four-bar in space": (lambda: in_space(four_bar({"stiffness": 300.0})), [1.0]),
    "reduced links": (lambda: reduced(four_bar("free")), [1.0]),
}


@pytest.mark.parametrize("name", KNOWN)
def test_known_mechanisms_under_weight_are_those_of_the_nonlinear_potential(name: str) -> None:
    make, q = KNOWN[name]
    tree = make()
    agree_under_weight(tree, q, direction(tree, 1))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100))
@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_many_random_trees_under_weight(space: str, seed: int) -> None:
    tree, q = random_open(1000 + seed, space, seed % 2 == 1)
    agree_under_weight(tree, q, direction(tree, seed))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(30))
@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_many_random_loops_under_weight(space: str, seed: int) -> None:
    tree, q, _ = random_closed(seed, space, 1 + (seed % 5 == 4), seed % 2 == 1)
    agree_under_weight(tree, q, direction(tree, seed))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_random_loops_of_rigid_links_under_weight(space: str, seed: int) -> None:
    tree, q, _ = random_closed(seed, space, 1 + seed % 3 // 2, seed % 2 == 0, ("rigid",))
    agree_under_weight(tree, q, direction(tree, seed))


def agree_for_unit_weights(tree: Tree, q: Any, g: np.ndarray) -> None:
    """K_g in numbers, from forces that displacements tell, is what the pencil has in symbols."""
    plain = built(tree)
    stated = matrices(pulled(tree, 50.0 * g), q)[0] - matrices(plain, q)[0]
    (pose,) = stiffness_under_load(plain.case, plain.numbers, plain.motion).at(plain.x(q))
    pull = pose.weight()
    units = pose.stressed(pull, pose.displaced(pull)).matrices()
    found = sum(50.0 * share * each.toarray() for share, each in zip(g, units, strict=True))
    np.testing.assert_allclose(found, stated, atol=1e-9 * np.abs(stated).max())


@pytest.mark.parametrize("draw", [*DRAWS[::2], (2, "planar", 2, True)], ids=str)
def test_unit_weights_of_random_mechanisms_add_up_to_any(draw: tuple[Any, ...]) -> None:
    tree, q = drawn(draw)
    agree_for_unit_weights(tree, q, direction(tree, draw[0]))


@pytest.mark.parametrize("name", KNOWN)
def test_unit_weights_of_known_mechanisms_add_up_to_any(name: str) -> None:
    make, q = KNOWN[name]
    tree = make()
    agree_for_unit_weights(tree, q, direction(tree, 1))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(30))
@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_unit_weights_of_many_mechanisms_add_up_to_any(space: str, seed: int) -> None:
    if seed % 2:
        tree, q = random_open(2000 + seed, space, seed % 4 == 1)
    else:
        tree, q, _ = random_closed(seed // 2, space, 1 + (seed % 5 == 4), seed % 4 == 2)
    agree_for_unit_weights(tree, q, direction(tree, seed))


def agree_about_sag(tree: Tree, q: Any, g: np.ndarray) -> None:
    """What sag changes of the lowest λ, from the forces that a mode's own inertia causes."""
    found, plain = weigh(tree, q, g), built(tree)
    lam, expected = sag_slopes(found, 3)
    K, M = matrices(plain, q)
    (pose,) = stiffness_under_load(plain.case, plain.numbers, plain.motion).at(plain.x(q))
    shift = np.trace(K) / np.trace(M) * 1e-6
    modes = linalg.eigh(M, K + shift * M)[1]
    phi = modes[:, ::-1][:, found.n_free : found.n_free + 3]
    phi = phi / np.sqrt(np.einsum("ik,ij,jk->k", phi, M, phi))
    weight, pull = pose.weight() @ g[:, None], lam * np.asarray(pose.B @ phi)
    moved = pose.displaced(pull, phi[pose.model.n_u :])
    works = pose.stressed(pull, moved).works(np.hstack([pose.displaced(weight), phi]))
    slopes = np.array([2.0 * works[k, 0, 1 + k] for k in range(3)])
    # rotary inertia of beams and what N(ξ) is beyond degree 4 is where the two differ
    np.testing.assert_allclose(slopes, expected, atol=2e-2 * np.abs(expected).max())


@pytest.mark.parametrize("draw", [*DRAWS[4:7], *DRAWS[-3:]], ids=str)
def test_sag_of_random_mechanisms_is_that_of_the_nonlinear_potential(draw: tuple[Any, ...]) -> None:
    tree, q = drawn(draw)
    agree_about_sag(tree, q, direction(tree, draw[0]))


@pytest.mark.parametrize("name", KNOWN)
def test_sag_of_known_mechanisms_is_that_of_the_nonlinear_potential(name: str) -> None:
    make, q = KNOWN[name]
    tree = make()
    agree_about_sag(tree, q, direction(tree, 1))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(50))
def test_sag_of_many_mechanisms_is_that_of_the_nonlinear_potential(seed: int) -> None:
    space = "spatial" if seed % 2 else "planar"
    if seed % 4 < 2:
        tree, q = random_open(3000 + seed, space, seed % 8 > 3)
    else:
        tree, q, _ = random_closed(seed, space, 1, seed % 8 > 3)
    agree_about_sag(tree, q, direction(tree, seed))


# --- what must always hold


def holds_what_must(tree: Tree, q: np.ndarray, seed: int) -> None:
    """K_g is symmetric, linear in g, and does not change where all turns about the vertical."""
    g, other = (50.0 * direction(tree, k) for k in (seed, seed + 1))
    # slides that stay level together do so for one direction, and elastic modes take them along
    if pulled(tree, g).pencil.rigid.size:
        other = -0.3 * g
    models = [built(tree), *(pulled(tree, v) for v in (g, other, 2.0 * g - other))]
    if len(g) == 3:
        models.append(pulled(turned_about(tree, g / np.linalg.norm(g), 0.8), g))
    # which coordinates stand for what stays rigid depends on the direction
    rigid = {int(k) for model in models[1:] for k in model.pencil.rigid}
    kept = np.setdiff1d(np.arange(models[0].pencil.n_dof), list(rigid))
    plain, *weighed = (matrices(model, q)[0][np.ix_(kept, kept)] for model in models)
    a, b, both, *turned = (K - plain for K in weighed)
    atol = 1e-11 * np.abs(plain).max()
    np.testing.assert_allclose(a, a.T, atol=1e-2 * atol)
    np.testing.assert_allclose(both, 2.0 * a - b, atol=atol)
    for K in turned:
        np.testing.assert_allclose(K, a, atol=atol)


@pytest.mark.parametrize("draw", [DRAWS[-6], *DRAWS[-3::-4]], ids=str)
def test_what_always_holds_under_weight(draw: tuple[Any, ...]) -> None:
    holds_what_must(*drawn(draw), draw[0])


@pytest.mark.slow
@pytest.mark.parametrize("number", range(250))
@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_what_always_holds_of_many_mechanisms_under_weight(space: str, number: int) -> None:
    more = (1 + (number % 16 == 3),) if number % 4 == 3 else ()
    holds_what_must(*drawn((2000 + number, space, *more, number % 3 == 1)), number)


@pytest.mark.parametrize("name", ["a portal with a lopsided trolley", "an arm"])
def test_slopes_along_the_coordinates_are_those_of_differences(name: str) -> None:
    make, q = KNOWN[name]
    tree, h = make(), 1e-5
    weights = direction(tree, 3) * 1e3
    model, plain = pulled(tree, weights), built(tree)
    along = np.arange(len(q))
    for k in along:
        step = h * np.eye(len(q))[k]
        ends = [
            matrices(model, q + s * step)[0] - matrices(plain, q + s * step)[0] for s in (-1, 1)
        ]
        slopes = [
            m.pencil.stiffness_matrices(m.pencil.theta_slopes(m.x(q), along)[k])[0]
            for m in (model, plain)
        ]
        expected = (ends[1] - ends[0]) / (2 * h)
        found = slopes[0] - slopes[1]
        np.testing.assert_allclose(found, expected, atol=1e-6 * np.abs(expected).max())


def test_a_free_turn_about_the_vertical_stays_rigid_and_all_others_swing() -> None:
    tree = arm3r("free")
    model = pulled(tree, [0.0, 0.0, -9.81])
    assert len(model.pencil.rigid) == 1
    assert len(pulled(tree, [0.0, -9.81, 0.0]).pencil.rigid) == 0
    K_g = weigh(copy.deepcopy(tree), [0.4, 0.8, -0.9], [0.0, 0.0, -9.81]).K_g
    assert np.sum(np.abs(np.linalg.eigvalsh(K_g)) > 1e-9 * np.abs(K_g).max()) < len(K_g)


def cross_slides(tree: Tree, *axes: list[float]) -> Tree:
    """A mass on free slides along these axes, one on the other."""
    m = tree["mechanism"]
    m["links"], m["joints"], below = {}, {}, "ground"
    for k, axis in enumerate(axes):
        m["links"][f"l{k}"] = {"type": "rigid", "mass": 1.0, "inertia": 0.1, "length": 0.1}
        m["joints"][f"s{k}"] = {
            "type": "prismatic", "base": below, "follower": f"l{k}.start", "axis": axis
        }  # fmt: skip
        below = f"l{k}.end"
    m.pop("assembly", None)
    m["links"]["tip"] = straight(0.3, 2)
    m["joints"]["tip"] = {"type": "fixed", "base": below, "follower": "tip.start"}
    tree["coordinates"] = {f"q{k}": {"joint": f"s{k}", "drive": "free"} for k in range(len(axes))}
    return tree


def test_slides_that_together_keep_the_height_leave_one_rigid_motion() -> None:
    tree = cross_slides(copy.deepcopy(four_bar("free")), [1.0, 1.0], [1.0, -1.0])
    model = pulled(tree, [0.0, -9.81])
    assert len(model.pencil.rigid) == 1
    assert len(built(tree).pencil.rigid) == 2
    level = cross_slides(copy.deepcopy(four_bar("free")), [1.0, 0.0])
    assert len(pulled(level, [0.0, -9.81]).pencil.rigid) == 1
    agree_under_weight(tree, [0.1, 0.2], np.array([0.0, -1.0]))


@pytest.mark.parametrize("place", [0.5, 0.8])
def test_a_free_trolley_on_a_level_girder_is_rigid_but_bends_it_where_it_goes(place: float) -> None:
    tree = lopsided(gantry("free"))
    assert len(pulled(tree, [0.0, -9.81]).pencil.rigid) == 1
    agree_under_weight(tree, [place], np.array([0.0, -1.0]))


@pytest.mark.parametrize("seed", [0, 1, 2, *(pytest.param(k, marks=SLOW) for k in range(3, 60))])
@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_elastic_modes_take_a_free_slide_along_that_the_weight_couples_to_them(
    space: str, seed: int
) -> None:
    tree, q, down = level_carriage(seed, space)
    pencil = pulled(tree, 9.81 * down).pencil
    assert len(pencil.rigid) == 1
    agree_under_weight(tree, q, down)
    K = matrices(pulled(tree, 9.81 * down), q)[0]
    assert not K[pencil.rigid].any()


@pytest.mark.parametrize("draw", [(25, "planar", 1, True), (12, "spatial", 1, False)], ids=str)
def test_loops_that_do_not_reach_far_are_asked_near_their_pose(draw: tuple[Any, ...]) -> None:
    """Whether a free coordinate swings is told at random poses, of which some may not close."""
    tree, q = drawn(draw)
    assert np.isfinite(matrices(pulled(tree, direction(tree, 2)), q)).all()


# --- parts known by their matrices


@pytest.mark.parametrize("sprung", [False, True])
@pytest.mark.parametrize("more", [{}, {"reduce_to": 1e5}], ids=["whole", "reduced"])
@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_a_stiff_imported_part_is_the_beam_it_was_exported_from(
    tmp_path: Path, space: str, more: Tree, sprung: bool
) -> None:
    """A strut between its nodes has all but the bending of the part under its own forces."""
    stiff = {**ALLOY, **{key: 1e4 * ALLOY[key] for key in ("youngs_modulus", "shear_modulus")}}
    K, M = exported(space)
    imported = part(space, write(tmp_path, "npy", 1e4 * K, M), **more)
    trees = copy.deepcopy((beam_arm(space), arm(space, {"part": imported})))
    offset = [0.05, 0.1, -0.07][: 2 if space == "planar" else 3]
    changes = []
    for tree in trees:
        m = tree["mechanism"]
        m["materials"]["n"] = stiff
        m["bodies"]["tip"]["offset"] = offset
        if "material" in m["links"]["part"]:
            m["links"]["part"]["material"] = "n"
        if sprung:
            m["springs"] = {"s": {"between": ["part.end", "ground"], "translational": 3e4}}
        plain = matrices(built(tree, tmp_path / "case.yaml"), [0.4, 0.9])
        m["gravity"] = (20.0 * direction(tree, 1)).tolist()
        weighed = matrices(built(tree, tmp_path / "case.yaml"), [0.4, 0.9])
        changes.append(lowest(*weighed, 3) - lowest(*plain, 3))
    np.testing.assert_allclose(changes[1], changes[0], rtol=1e-3)
