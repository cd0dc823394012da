"""Closed loops: branches kept and named, dead points refused, what cannot be closed or moved."""

import copy
from typing import Any

import numpy as np
import pytest
from spatial_cases import ALLOY, Built, built, changed, linkage
from spatial_examples import arm3r, four_bar, slider_crank, straight
from spatial_oracle import Tree, world

from eigassign.case import read_yaml
from eigassign.errors import CaseError, MechanismError, SingularityError


def ends(model: Built, q: Any, link: str) -> np.ndarray:
    return np.array([model.poses.position(model.x(q), link, node) for node in ("start", "end")])


def pasted(tree: Tree, message: str) -> Tree:
    """The tree with the ``assembly`` that a message ends with."""
    text = message.partition("mechanism.assembly: ")[2]
    mechanism = {**tree["mechanism"], "assembly": read_yaml(text.encode(), "pasted").tree}
    return {**tree, "mechanism": mechanism}


# Branches


@pytest.mark.parametrize("guess", [1.0, -1.0])
def test_a_crank_rocker_keeps_its_branch_through_whole_turns(guess: float) -> None:
    tree = four_bar("locked")
    tree["mechanism"]["assembly"] = {"guess": {"B": guess, "D": 2 * guess, "E": guess}}
    model, th = built(tree), np.linspace(-2 * np.pi, 2 * np.pi, 121)[:, None]
    crank = 0.12 * np.hstack([np.cos(th), np.sin(th), 0 * th])
    pin = ends(model, th, "rocker")[1]
    np.testing.assert_allclose(ends(model, th, "crank")[1], crank, atol=1e-13)
    np.testing.assert_allclose(np.linalg.norm(pin - crank, axis=1), 0.45, rtol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(pin - [0.5, 0, 0], axis=1), 0.4, rtol=1e-12)
    side = np.cross(np.array([0.5, 0, 0]) - crank, pin - crank)[:, 2]
    assert (side * guess > 0.0).all()  # the pin stays on its side of the line crank to pivot
    turns = ends(model, th[[0, 60, 120]], "rocker")
    np.testing.assert_allclose(turns[:, 1], turns[:, 0], atol=1e-12)


def test_both_branches_are_listed_where_none_is_chosen() -> None:
    tree = four_bar("free")
    del tree["mechanism"]["assembly"]
    with pytest.raises(MechanismError) as caught:
        built(tree)
    text = caught.value.message
    assert "close in 2 ways at th = 0 rad" in text
    one, other = (f"{{B: {s}56.87 deg, D: {s}109.6 deg, E: {s}52.71 deg}}" for s in ("", "-"))
    assert f"{one} | {other}; choose one with " in text
    assert text.endswith(f"mechanism.assembly: {{at: {{th: 0 deg}}, guess: {one}}}")


def rssr(driven: int) -> Tree:
    """Crank, coupler between two balls, rocker; one component of the first ball is driven."""
    beams = {"crank": 0.1, "coupler": 0.5, "rocker": 0.25}
    joints = {
        "A": {"type": "revolute", "base": "ground", "follower": "crank.start"},
        "S1": {"type": "spherical", "base": "crank.end", "follower": "coupler.start"},
        "S2": {"type": "spherical", "base": "coupler.end", "follower": "rocker.end"},
        "B": {"type": "revolute", "base": "ground", "follower": "rocker.start", "axis": [0, 1, 0]},
    }
    joints["B"]["position"] = [0.4, 0.1, 0.0]
    return linkage(
        {name: straight(length, 2) for name, length in beams.items()},
        joints,
        {"th": {"joint": "A"}, "spin": {"joint": "S1", "component": driven}},
        space="spatial",
    )


@pytest.mark.parametrize("driven", [1, 3])
def test_each_listed_branch_is_chosen_where_it_is_pasted_back(driven: int) -> None:
    tree = rssr(driven)
    with pytest.raises(MechanismError) as caught:
        built(tree)
    listed, _, choice = caught.value.message.partition("; choose one with mechanism.assembly: ")
    branches = listed.partition(": ")[2].split(" | ")
    assert len(branches) > 1
    tips = []
    for branch in branches:
        text = choice.replace(branches[0], branch)
        tree["mechanism"]["assembly"] = read_yaml(text.encode(), "pasted").tree
        tips.append(ends(built(tree), np.zeros((1, 2)), "rocker")[1, 0])
    assert np.ptp(tips, axis=0).max() > 0.1  # on either side
    tree["mechanism"]["assembly"]["guess"]["S1"] = [0.0]
    with pytest.raises(CaseError, match=r"needs a list of 3: 1, 2, 3; or of those without a coor"):
        built(tree)


def test_the_two_ways_to_write_one_orientation_of_a_ball_are_one_branch() -> None:
    tree = rssr(1)
    m = tree["mechanism"]
    m["joints"]["S2"] = {**m["joints"]["S2"], "type": "universal", "axes": [[0, 1, 0], [0, 0, 1]]}
    del tree["coordinates"]["spin"]
    with pytest.raises(MechanismError) as caught:
        built(tree)
    branches = caught.value.message.partition("; choose")[0].split(" | ")
    assert len(branches) == 4  # two places of the rocker, the coupler turned by half a turn
    for branch in branches:
        middle = branch.partition("S1: [")[2].split(",")[1]
        assert abs(float(middle.removesuffix(" deg"))) <= 90.0


def test_loops_that_close_as_they_are_drawn_need_no_guess() -> None:
    """A beam on a pin and a roller: mode n at β = nπ/L, within what six elements give."""
    beam = straight(1.0, 6)
    roller = {"type": "rigid", "nodes": {"start": [0.0, 0.0]}, "mass": 0.0}
    joints = {
        "left": {"type": "revolute", "base": "ground", "follower": "beam.start"},
        "slide": {"type": "prismatic", "base": "ground", "follower": "roller.start"},
        "right": {"type": "revolute", "base": "roller.start", "follower": "beam.end"},
    }
    joints["slide"]["position"] = [1.0, 0.0]
    model = built(linkage({"beam": beam, "roller": roller}, joints))
    d, E, rho = 0.02, ALLOY["youngs_modulus"], ALLOY["density"]
    exact = np.array([(n * np.pi) ** 4 * E * d**2 / (16 * rho) for n in (1, 2)])
    np.testing.assert_allclose(model.lam([[]], 2), exact, rtol=2e-3)


def clamped_triangle(side: float, turn: float = -np.pi / 2) -> Tree:
    """Three beams, clamped to each other all round: hypotenuse 1 m."""
    beams = {"a": 1.0, "b": side, "c": side}
    ends = {"j0": ("ground", "a.start"), "j1": ("a.start", "b.start"), "j2": ("b.end", "c.start")}
    angles = {"j0": 0.0, "j1": np.pi / 4, "j2": turn, "j3": np.pi / 4}
    return linkage(
        {name: straight(length, 3) for name, length in beams.items()},
        {
            name: {"type": "fixed", "base": base, "follower": follower, "angle": angles[name]}
            for name, (base, follower) in {**ends, "j3": ("c.end", "a.end")}.items()
        },
    )


def test_a_clamped_loop_of_rounded_dimensions_is_closed_as_if_it_met() -> None:
    exact = built(clamped_triangle(np.sqrt(0.5))).lam([[]], 4)
    np.testing.assert_allclose(built(clamped_triangle(0.707107)).lam([[]], 4), exact, rtol=3e-6)


@pytest.mark.parametrize(
    ("tree", "gap"),
    [
        (clamped_triangle(0.71), "0.0041 m and .*e-1. rad apart"),
        (clamped_triangle(np.sqrt(0.5), np.radians(-85.0)), "0.062 m and 0.087 rad apart"),
        (clamped_triangle(np.sqrt(0.5), np.pi / 2), "1.4 m and .* rad and half a turn apart"),
    ],
)
def test_a_clamped_loop_that_does_not_meet_is_refused_with_its_gap(tree: Tree, gap: str) -> None:
    with pytest.raises(MechanismError, match=f"two sides do not meet: {gap}, where 1e-05 m"):
        built(tree)


def cardan_shaft(place: list[float]) -> Tree:
    """Two parallel shafts joined by a third with a universal joint at either end."""
    beams = {"driver": 0.3, "middle": 0.5, "driven": 0.3}
    turning = {"type": "revolute", "base": "ground", "axis": [1, 0, 0]}
    cross = {"type": "universal"}
    y, z = [0, 1, 0], [0, 0, 1]
    joints = {
        "A": {**turning, "follower": "driver.start"},
        "U": {**cross, "base": "driver.end", "follower": "middle.start", "axes": [y, z]},
        "V": {**cross, "base": "middle.end", "follower": "driven.start", "axes": [z, y]},
        "B": {**turning, "follower": "driven.end", "position": [*place, 0.0]},
    }
    return linkage(
        {name: straight(length, 2) for name, length in beams.items()},
        joints,
        {"th": {"joint": "A"}},
        space="spatial",
        assembly={"at": {"th": 0.4}, "guess": {"U": [0.18, 0.4], "V": [-0.4, -0.18]}},
    )


def test_a_cardan_shaft_of_rounded_dimensions_is_told_its_gap_and_what_to_do() -> None:
    exact = [0.6 + 0.5 * np.cos(np.radians(25)), 0.5 * np.sin(np.radians(25))]
    twelve = [round(value, 12) for value in exact]
    assert len(built(cardan_shaft(twelve)).motion.tree.passive) == 5
    with pytest.raises(MechanismError, match=r"but nearly: 4.*e-08 m .* 1e-09 are accepted") as e:
        built(cardan_shaft([round(value, 6) for value in exact]))
    assert "give these twelve digits" in e.value.message
    assert "too many" not in e.value.message
    with pytest.raises(
        MechanismError, match=r"1 coordinate.s. too many.* The nearest pose found leaves 0.0"
    ):
        built(cardan_shaft([1.1, 0.3]))


def test_loops_that_do_not_reach_where_they_are_put_together_ask_for_another_pose() -> None:
    """A boom lifted by a cylinder that is 0.2 m too short before it is driven out."""
    links = {"boom": straight(1.0, 2), "foot": straight(0.4, 2), "head": straight(0.4, 2)}
    hinge, ground = {"type": "revolute"}, {"base": "ground"}
    joints = {
        "A": {**hinge, **ground, "follower": "boom.start"},
        "B": {**hinge, **ground, "follower": "foot.start", "position": [0.0, -2.0]},
        "S": {"type": "prismatic", "base": "foot.end", "follower": "head.start"},
        "C": {**hinge, "base": "head.end", "follower": "boom.end"},
    }
    tree: Tree = linkage(links, joints, {"stroke": {"joint": "S"}})
    says = r"at stroke = 0 m: links do not reach.* nearest pose found leaves 0.2 m.*assembly: \{at"
    with pytest.raises(MechanismError, match=says) as caught:
        built(tree)
    built(pasted(tree, caught.value.message))
    tree["mechanism"]["assembly"] = {"at": {"stroke": 0.6}}
    with pytest.raises(MechanismError, match=r"close in 2 ways at stroke = 600 mm"):
        built(tree)


def test_a_slide_longer_than_a_turn_is_not_taken_for_an_angle() -> None:
    tree = slider_crank("locked")
    tree["mechanism"]["links"]["crank"]["length"] = 1.5
    tree["mechanism"]["links"]["rod"]["length"] = 4.5
    del tree["mechanism"]["assembly"]
    with pytest.raises(MechanismError, match=r"P: 6.* P: -3"):
        built(tree)


def test_a_guess_that_leads_nowhere_is_answered_with_the_ways_there_are() -> None:
    tree = slider_crank("locked")
    tree["mechanism"]["assembly"] = {"at": {"th": 0.7}, "guess": {"P": 80.0}}
    with pytest.raises(
        MechanismError, match=r"the guess leads to no closed pose.* 2 ways"
    ) as caught:
        built(tree)
    assert caught.value.path == "mechanism.assembly"


def test_the_guess_chooses_the_branch_where_it_is_said_to_hold() -> None:
    tree = four_bar("locked")
    tree["mechanism"]["assembly"] = {"at": {"th": 2.5}, "guess": {"B": -1.0, "D": 2.0, "E": 0.5}}
    there = built(tree)
    frame = world(tree, [0.4])
    np.testing.assert_allclose(there.lam([0.4], 4), frame.spectrum(4), rtol=1e-8)


# From scratch


def parallelogram(arm: float = 1.0, crank: float = 0.3) -> Tree:
    """The forearm of a palletiser, turned by a crank and a rod along its lower arm."""
    fore = {"type": "rigid", "nodes": {"lever": [-crank, 0.0], "end": [1.2, 0.0]}, "mass": 5.0}
    pins = {
        "shoulder": ("ground", "lower.start"),
        "elbow": ("lower.end", "fore.start"),
        "motor": ("ground", "crank.start"),
        "pin": ("crank.end", "rod.start"),
        "eye": ("rod.end", "fore.lever"),
    }
    links = {"lower": straight(arm, 2), "crank": straight(crank, 2), "rod": straight(arm, 2)}
    return linkage(
        {**links, "fore": fore},
        {
            name: {"type": "revolute", "base": base, "follower": follower}
            for name, (base, follower) in pins.items()
        },
        {"q1": {"joint": "shoulder"}, "q2": {"joint": "motor"}},
        section={"shape": "circle", "diameter": 0.03},
    )


def five_bar() -> Tree:
    """Two cranks and two rods that meet: folded onto each other at zero."""
    tree = parallelogram(0.6, 0.4)
    m = tree["mechanism"]
    m["links"] = {name: straight(0.5, 2) for name in ("lower", "fore", "crank", "rod")}
    m["joints"]["eye"]["follower"] = "fore.end"
    m["joints"]["motor"]["position"] = [0.0, 0.0]
    return tree


@pytest.mark.parametrize("tree", [parallelogram(), parallelogram(0.5, 0.4), five_bar()])
def test_a_dead_point_is_answered_with_ways_that_close_elsewhere(tree: Tree) -> None:
    with pytest.raises(MechanismError, match=r"is a dead point.* \| .*choose one with") as caught:
        built(tree)
    built(pasted(tree, caught.value.message))


@pytest.mark.parametrize("wrong", ["elbow", "pin", "eye"])
@pytest.mark.parametrize("at", [(80.0, 170.0), (20.0, 110.0), (100.0, 200.0)])
def test_a_guess_half_a_turn_off_lists_the_parallelogram_first(
    wrong: str, at: tuple[float, float]
) -> None:
    tree = parallelogram()
    between = at[1] - at[0]
    guess = {"elbow": between - 180.0, "pin": -between, "eye": between - 180.0}
    off = {**guess, wrong: guess[wrong] + 180.0}
    tree["mechanism"]["assembly"] = {
        "at": {name: f"{value} deg" for name, value in zip(("q1", "q2"), at, strict=True)},
        "guess": {name: f"{value} deg" for name, value in off.items()},
    }
    with pytest.raises(MechanismError, match="close in 2 ways") as caught:
        built(tree)
    proposed = pasted(tree, caught.value.message)["mechanism"]["assembly"]["guess"]
    for name, value in guess.items():
        assert abs(float(proposed[name].split()[0]) - value) % 360.0 < 0.1


# Dead points


def driven_by_the_slider() -> Tree:
    tree = slider_crank("locked")
    tree["coordinates"] = {"x": {"joint": "P", "drive": "locked"}}
    tree["mechanism"]["assembly"] = {"at": {"x": 0.5}, "guess": {"A": 0.8, "B": -1.0, "E": 0.2}}
    return tree


@pytest.mark.parametrize(
    ("x", "where"), [(0.6, "600 mm"), (0.61, r"60\d\.\d* mm on the way to x = 610 mm")]
)
def test_a_slider_crank_driven_by_its_slider_stops_at_the_dead_centre(x: float, where: str) -> None:
    with pytest.raises(SingularityError, match=f"dead point, at x = {where}"):
        built(driven_by_the_slider()).lam([x], 1)


def test_only_the_sample_at_the_dead_point_is_named() -> None:
    with pytest.raises(SingularityError, match=r"x = 600 mm$"):
        built(driven_by_the_slider()).poses.position(np.array([[0.5], [0.6], [0.4]]), "rod", "end")


# What cannot be closed or moved


def test_links_that_do_not_reach_are_told_from_too_many_coordinates() -> None:
    short = changed(four_bar("free"), "links.coupler.length", 0.05)
    short = changed(short, "links.rocker.length", 0.2)
    with pytest.raises(MechanismError, match="links do not reach"):
        built(short)
    tree = four_bar("free")
    tree["coordinates"]["extra"] = {"joint": "E"}
    message = "3 conditions, of which B, D can meet 2: 1 coordinate.* too many"
    with pytest.raises(MechanismError, match=message):
        built(tree)


def triangle(drive: Any) -> Tree:
    """Two links pinned to each other and to the ground: a truss."""
    angle = float(np.arctan2(0.24, 0.32))  # sides 0.4, 0.3, 0.5
    return linkage(
        {"a": straight(0.4, 2), "b": straight(0.3, 2)},
        {
            "A": {"type": "revolute", "base": "ground", "follower": "a.start"},
            "B": {"type": "revolute", "base": "a.end", "follower": "b.start"},
            "C": {"type": "revolute", "base": "ground", "follower": "b.end",
                  "position": [0.5, 0.0]},
        },
        {"q": {"joint": "A", "drive": drive}},
        section={"shape": "rectangle", "height": 0.02, "width": 0.02},
        assembly={"at": {"q": angle}, "guess": {"B": -np.pi / 2, "C": angle - np.pi / 2}},
    )  # fmt: skip


@pytest.mark.parametrize("drive", ["free", {"stiffness": 100.0}])
def test_a_structure_is_not_taken_for_a_mechanism(drive: Any) -> None:
    message = r"q cannot change at q = 0.643501 rad.* structure.*, or lock it$"
    with pytest.raises(MechanismError, match=message) as caught:
        built(triangle(drive))
    assert caught.value.path == "coordinates"


def bennett(error: float = 0.0) -> Tree:
    """Bennett's overconstrained linkage: sides a, b, twists α, β with sin α / a = sin β / b."""
    a, b, alpha = 0.3, 0.4, 0.5
    beta = float(np.arcsin(b / a * np.sin(alpha))) + error
    tree = arm3r("free")
    m = tree["mechanism"]
    m["links"] = {n: straight(L, 2) for n, L in (("l1", a), ("l2", b), ("l3", a))}
    m["links"]["foot"] = {"type": "rigid", "nodes": {}}
    pin = {"type": "revolute", "axis": [0.0, 0.0, 1.0]}
    m["joints"] = {
        "J1": {**pin, "base": "ground", "follower": "l1.start"},
        "J2": {**pin, "base": "l1.end", "follower": "l2.start", "orientation": [alpha, 0, 0]},
        "J3": {**pin, "base": "l2.end", "follower": "l3.start", "orientation": [beta, 0, 0]},
        "J4": {**pin, "base": "l3.end", "follower": "foot.start", "orientation": [alpha, 0, 0]},
        "root": {"type": "fixed", "base": "ground", "follower": "foot.start",
                 "position": [-b, 0.0, 0.0], "orientation": [-beta, 0.0, 0.0]},
    }  # fmt: skip
    m.pop("bodies")
    tree["coordinates"] = {"q": {"joint": "J1", "drive": {"stiffness": 500.0}}}
    second = 2 * np.arctan(np.sin((beta + alpha) / 2) / np.sin((beta - alpha) / 2) / np.tan(0.5))
    m["assembly"] = {
        "at": {"q": 1.0}, "guess": {"J2": float(second), "J3": -1.0, "J4": -float(second)}
    }  # fmt: skip
    return tree


@pytest.mark.parametrize("q", [1.0, 1.4, 0.7])
def test_bennetts_linkage_works_where_its_dimensions_agree(q: float) -> None:
    tree = bennett()
    np.testing.assert_allclose(built(tree).lam([q], 5), world(tree, [q]).spectrum(5), rtol=1e-7)


def test_bennetts_linkage_is_refused_where_its_dimensions_do_not_agree() -> None:
    with pytest.raises(MechanismError, match="Of 6 conditions J2, J3, J4 can meet 3"):
        built(bennett(1e-4))


def test_an_absolute_coordinate_is_named_by_its_joint_where_its_relative_angle_is_shown() -> None:
    tree = four_bar("free")
    tree["mechanism"]["joints"]["A"]["angle"] = 0.4
    tree["coordinates"]["th"]["angle"] = "absolute"
    tree["mechanism"]["links"]["coupler"]["length"] = 0.02
    with pytest.raises(MechanismError, match=r"th relative to the base of 'A' = -0\.4 rad"):
        built(tree)


def test_missing_coordinates_are_counted_and_the_moving_joints_named() -> None:
    tree = four_bar("free")
    tree["coordinates"] = {}
    with pytest.raises(MechanismError, match=r"1 more .*joints A, B, D, E") as caught:
        built(tree)
    assert caught.value.path == "coordinates"


def test_a_joint_without_coordinate_in_an_open_chain_is_named() -> None:
    tree = arm3r("free")
    del tree["coordinates"]["pitch"]
    with pytest.raises(CaseError, match=r"mechanism\.joints\.pitch: no coordinate"):
        built(tree)


def test_a_side_chain_that_swings_freely_beside_a_loop_is_not_determined() -> None:
    tree = four_bar("free")
    tree["mechanism"]["links"]["pendulum"] = straight(0.2, 2)
    tree["mechanism"]["joints"]["P"] = {
        "type": "revolute", "base": "rocker.start", "follower": "pendulum.start"
    }  # fmt: skip
    tree["mechanism"]["assembly"]["guess"]["P"] = 0.0
    with pytest.raises(MechanismError, match="1 more coordinate"):
        built(tree)


def test_an_absolute_angle_carried_by_a_passive_joint_is_refused_by_name() -> None:
    tree = four_bar("free")
    tree["mechanism"]["links"]["tool"] = straight(0.2, 2)
    tree["mechanism"]["joints"]["T"] = {
        "type": "revolute", "base": "rocker.end", "follower": "tool.start"
    }  # fmt: skip
    tree["coordinates"]["tool"] = {"joint": "T", "angle": "absolute"}
    with pytest.raises(MechanismError, match="absolute angle") as caught:
        built(tree)
    assert caught.value.path == "coordinates.tool.angle"


# More mechanisms


def test_a_second_joint_on_the_same_pin_changes_nothing() -> None:
    tree = four_bar("free")
    pin = {"type": "revolute", "base": "crank.end", "follower": "coupler.start"}
    tree["mechanism"]["joints"]["again"] = pin
    expected = built(four_bar("free")).lam([0.6], 3)
    np.testing.assert_allclose(built(tree).lam([0.6], 3), expected, rtol=1e-8)


def test_a_planar_linkage_is_the_same_in_space_where_its_loop_is_overconstrained() -> None:
    tree = four_bar("free")
    spatial = copy.deepcopy(tree)
    spatial["mechanism"]["space"] = "spatial"
    spatial["mechanism"]["joints"]["D"]["position"] = [0.5, 0.0, 0.0]
    flat, deep = built(tree).lam([1.0], 4), built(spatial).lam([1.0], 12)
    for lam in flat:  # the spatial one has modes out of the plane as well
        assert np.abs(deep / lam - 1.0).min() < 1e-8
    np.testing.assert_allclose(deep, world(spatial, [1.0]).spectrum(12), rtol=1e-7)
