"""Stiffness under weight against a nonlinear potential and another program; symbols and numbers."""

import copy
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from imported_parts import arm, beam_arm, exported, part, write
from scipy import linalg
from spatial_cases import ALLOY, built
from spatial_examples import arm3r, ball_screw, four_bar, gantry, rigid, slotted_lever, straight
from spatial_oracle import Tree
from spatial_random import EVERY_LOOP, EVERY_TREE, random_closed, random_open
from weight_comparison import agree_under_weight, direction, level_carriage, matrices, pulled
from weight_oracle import lowest, sag_slopes, weigh
from weight_webs import web

import eigassign as ea
from eigassign.mechanism import stiffness_under_load
from eigassign.modal import weight_changes

SLOW = pytest.mark.slow
DRAWS = [  # that hold every joint, a frame, rigid links, springs, tapers and shear
    *EVERY_TREE[:4:3], *EVERY_TREE[4:9], *EVERY_LOOP[:2], *EVERY_LOOP[5:8]
]  # fmt: skip

MIXED = (2, "spatial", 2, True, ("rigid",))  # one loop at a node that deforms, and one that is not
CASES = Path(__file__).parents[2] / "cases"


def drawn(draw: tuple[Any, ...]) -> tuple[Tree, np.ndarray]:
    if len(draw) == 3:
        return random_open(*draw)
    tree, _, q = random_closed(*draw)
    return tree, q


def agree(tree: Tree, q: Any, seed: int) -> None:
    """The pencil and the nonlinear potential, and K_g in symbols and in numbers."""
    agree_under_weight(tree, q, direction(tree, seed))
    agree_for_unit_weights(tree, q, direction(tree, seed))


def agree_for_unit_weights(tree: Tree, q: Any, g: np.ndarray) -> None:
    """K_g in numbers, from forces that displacements tell, is what the pencil has in symbols."""
    plain = built(tree)
    stated = matrices(pulled(tree, 50.0 * g), q)[0] - matrices(plain, q)[0]
    (pose,) = stiffness_under_load(plain.case, plain.numbers, plain.motion).at(plain.x(q))
    pull = pose.weight()
    units = pose.stressed(pull, pose.displaced(pull)).matrices()
    found = sum(50.0 * share * each.toarray() for share, each in zip(g, units, strict=True))
    np.testing.assert_allclose(found, stated, atol=1e-9 * np.abs(stated).max())


@pytest.mark.parametrize("draw", [*DRAWS, (2, "planar", 2, True), MIXED], ids=str)
def test_random_mechanisms_under_weight_are_those_of_the_nonlinear_potential(
    draw: tuple[Any, ...],
) -> None:
    tree, q = drawn(draw)
    agree(tree, q, draw[0])


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


def six_bar() -> Tree:
    """Watt's in space, of which a rod alone is a beam: conditions, freedoms and nodes share out."""
    tree = yaml.safe_load(CASES.joinpath("six_bar.yaml").read_text(encoding="utf-8"))
    tree = in_space({key: tree[key] for key in ("mechanism", "coordinates")})
    solid = {"type": "rigid", "mass": 0.4, "inertia": [1e-3, 1e-3, 1e-3]}
    m = tree["mechanism"]
    m["bodies"]["knob"]["at"], m["materials"]["steel"]["poissons_ratio"] = "rod.end", 0.3
    m["links"] |= {
        "crank": {**solid, "length": 0.08},
        "coupler": {**solid, "length": 0.3, "center": [0.15, 0.02, 0.01]},
        "bell_crank": {**solid, "nodes": {"input": [0.2, 0, 0], "output": [0.1, -0.15, 0]}},
    }
    tree["coordinates"]["crank_angle"]["drive"] = {"stiffness": 500.0}
    return tree


def test_a_redundant_six_bar_in_space() -> None:
    agree_for_unit_weights(six_bar(), [1.7], direction(six_bar(), 1))


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
    agree(make(), q, 1)


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


# --- what stays rigid


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


@pytest.mark.parametrize(("g", "doubted"), [(100.0, None), (200.0, False), (800.0, True)])
def test_struts_say_how_far_they_are_off_and_are_doubted_above_what_is_accepted(
    tmp_path: Path, g: float, doubted: bool | None
) -> None:
    """A standing column, at 1.5, 3 and 12 % of what buckles it, against the beam it is."""
    imported = part("planar", write(tmp_path, "npy", *exported("planar")))
    models, results = [], []
    for link in (imported, beam_arm("planar")["mechanism"]["links"]["part"]):
        tree = arm("planar", {"part": link})
        m = tree["mechanism"] | {"gravity": [0.0, -g], "bodies": {"b": {"at": "part.end"}}}
        m["bodies"]["b"]["mass"] = 3.0
        m["links"].pop("upper")
        m["joints"] = {"a": {"type": "revolute", "base": "ground", "follower": "part.start"}}
        q = {"a": {"joint": "a", "drive": "locked"}}
        tree = {"title": "t", "mechanism": m, "coordinates": q}
        tree |= {"trajectory": {"q": [[np.pi / 2]]}, "targets": [{"mode": 1, "at_least": 1.0}]}
        tree["design"] = {"m": {"parameter": "bodies.b.mass", "min": 2.99, "max": 3.0}}
        (tmp_path / "case.yaml").write_text(yaml.safe_dump(tree), encoding="utf-8")
        case = ea.load_case(tmp_path / "case.yaml")
        models.append(case.model().frequencies([np.pi / 2], [3.0], 1)[0, 0])
        results.append(ea.assign(case).results)
    strut, beam = results
    assert beam.weight.struts is None
    assert any("have no stress inside" in line for line in strut.notes) == (doubted is not None)
    assert ("have no stress inside" in strut.assignment.reason) == bool(doubted)
    if doubted is not None:
        assert 1.0 < strut.weight.struts / (models[0] / models[1] - 1.0) < 3.0


# --- bars welded and pinned to each other in many loops


@pytest.mark.parametrize("seed", range(4))
def test_forces_between_bars_are_found_in_whatever_order_joints_come(seed: int) -> None:
    tree = web(seed, 0.2 * (seed % 2))
    try:
        model = ea.load_case(tree).model()
    except ea.CaseError:
        pytest.skip("so many pins leave it loose")
    x = model.x([], [])
    stated = model.pencil.sparse((model.pencil.weight.stiffness @ model.pencil.theta(x))[:, 0])
    (pose,) = model.under_load.at(x)
    pull = pose.weight() @ np.array(tree["mechanism"]["gravity"])[:, None]
    (found,) = pose.stressed(pull, pose.displaced(pull)).matrices()
    most = abs(found).max()
    np.testing.assert_allclose(stated.toarray(), found.toarray(), atol=1e-8 * most)


@pytest.mark.parametrize("seed", [1, 3])
def test_a_welded_web_is_that_of_the_nonlinear_potential(seed: int) -> None:
    tree = web(seed, 0.0)
    g = np.array(tree["mechanism"].pop("gravity"))
    agree_under_weight(tree, np.zeros(0), g)


# --- numbers of another program, which has no code of ours

FOLDER = Path(__file__).parent / "weight_references"
STRESSED = {  # pose, and the lowest frequencies in Hz with the internal forces of the weight
    "double_arm": (
        [0.4, -1.1],
        [1.2619000253464134, 3.9456612087395126, 48.23762263403272, 78.1594258346546,
         202.38241841721154],
    ),
    "four_bar": (
        [0.9],
        [10.34648166483722, 26.888482136982947, 45.845752605718474, 48.07192832069266,
         144.67127499488532],
    ),
    "l_beam": (
        [0.3],
        [2.215944876961315, 6.2447522805677815, 9.900417219141325, 19.914673076754354,
         39.85264158106639],
    ),
    "pendulum": (
        [-1.1],
        [0.38332275185728615, 9.837283958035798, 32.14082793442983, 65.37405460740419,
         120.70802129690145],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", STRESSED)
def test_frequencies_under_weight_are_those_of_another_program(name: str) -> None:
    case = ea.load_case(FOLDER / f"{name}.yaml")
    q, expected = STRESSED[name]
    found = case.model().frequencies(q, case.initial_design, 5)[0]
    np.testing.assert_allclose(found, expected, rtol=1e-5)


SLOPES = {  # of λ per m/s² downwards without gravity, by stress alone and by stress and sag
    "double_arm": (
        [0.354945467, -0.0832215893, 21.0961471, -33.4450296, -6.6676459],
        [0.4254092, -2.27787999, 388.603423, 655.601318, -5007.7266],
    ),
    "four_bar": (
        [-6.4809543, -6.16283009, -246.494656, -49.6402854, -133.763949],
        [-20.4607819, 10.3669218, -263.706157, 106.545454, 805.720422],
    ),
    "pendulum": (
        [16.9319193, 43.1937786, 90.8762367, 195.646191],
        [49.8861067, -349.713938, 764.925465, -1757.52567],
    ),
    "l_beam": (
        [0.0661645379, 0.0966081141, -0.345484722, 3.47218204, 0.512333463],
        [0.105002806, -0.181515416, -7.44611385, 4.58166957, -44.9720155],
    ),
}


@pytest.mark.parametrize("name", SLOPES)
def test_slopes_by_stress_and_sag_are_those_of_another_program(name: str) -> None:
    """Between nodes loads are linear: in space that errs, by less than the mesh does."""
    text = (FOLDER / f"{name}.yaml").read_text(encoding="utf-8")
    case = ea.load_case(yaml.safe_load(re.sub("gravity:.*", "gravity: none", text)))
    q, (stress, both) = STRESSED[name][0], np.array(SLOPES[name])
    model, modes = case.model(), tuple(range(1, len(stress) + 1))
    lam = (2 * np.pi * model.frequencies(q, case.initial_design, len(modes))[0]) ** 2
    found = weight_changes(model, q, case.initial_design, modes)
    axis = -1 if case.file.mechanism.space == "spatial" else 1
    np.testing.assert_allclose(-lam * found.stress[0, :, axis], stress, rtol=1e-6)
    sag, tolerance = -lam * found.sag[0, :, axis], 2e-2 if name == "l_beam" else 1e-6
    np.testing.assert_allclose(sag, both - stress, rtol=tolerance)
