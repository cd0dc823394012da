"""Springs whose axes are the ground's under weight: a column, crooked arms, random mechanisms.

What a rigid post carries is the same spring, and the nonlinear potential another program.
"""

import copy
from typing import Any

import numpy as np
import pytest
from spatial_cases import case_of, linkage
from spatial_examples import straight
from spatial_oracle import Tree, solve_pose
from spatial_random import add_springs, random_closed, random_open
from weight_comparison import agree_under_weight, direction

import eigassign as ea
from eigassign.modal import buckling, weight_changes


def arm(space: str, density: float, lengths: Tree, **more: Any) -> Tree:
    """Square bars of 10 mm under their weight."""
    links = {name: straight(length, 4) for name, length in lengths.items()}
    gravity = [0.0, -9.81, 0.0][: 2 if space == "planar" else 3]
    metal = {"youngs_modulus": 70e9, "density": density, "poissons_ratio": 0.3}
    square = {"shape": "rectangle", "width": 0.01, "height": 0.01}
    own = {"space": space, "gravity": gravity, "section": square, "material": metal}
    return linkage(links, **own, **more)


def on_a_post(tree: Tree, q: Any) -> Tree:
    """The spring k to the ground stands on a rigid post instead, where its other end is."""
    out = copy.deepcopy(tree)
    m, between = out["mechanism"], out["mechanism"]["springs"]["k"]["between"]
    node = next(end for end in between if end != "ground")
    between[between.index("ground")] = "post.start"
    place = solve_pose(tree, np.array(q)).node(tree, node)[: 2 if m["space"] == "planar" else 3]
    m["links"]["post"] = {"type": "rigid"}
    m["joints"]["post"] = {"type": "fixed", "base": "ground", "follower": "post.start",
                           "position": place.tolist()}  # fmt: skip
    return out


def asked(tree: Tree, q: list[float]) -> tuple[np.ndarray, np.ndarray, float]:
    """The lowest frequencies, their slopes in gravity, and the share of buckling."""
    model, at = ea.Case(case_of(tree)).model(), (np.array([q]), np.zeros((1, 0)))
    slopes = weight_changes(model, *at, [1, 2, 3]).stress[0]
    return model.frequencies(*at, 3)[0], slopes, float(buckling(model, *at)[0])


def column(between: list[str], stiffness: list[float]) -> Tree:
    """A column whose head a spring of EA/L relieves of half of its 5 kg."""
    foot = {"type": "fixed", "base": "ground", "follower": "a.start", "angle": np.pi / 2}
    return arm("planar", 1e-3, {"a": 1.0}, joints={"j": foot},
               bodies={"b": {"at": "a.end", "mass": 5.0}},
               springs={"k": {"between": between, "translational": stiffness}})  # fmt: skip


def test_a_spring_that_carries_half_of_a_columns_head_makes_it_stiffer() -> None:
    upright = column(["ground", "a.end"], [0.0, 7e6])
    turning = column(["a.end", "ground"], [7e6, 0.0])
    for tree, f, share in ((upright, 0.859, 0.170), (turning, 0.590, 0.618)):
        found, _, buckles = asked(tree, [])
        assert found[0] == pytest.approx(f, abs=5e-4)
        assert buckles == pytest.approx(share, abs=5e-4)
    assert asked(upright, [])[0] == pytest.approx(asked(on_a_post(upright, []), [])[0])


def crooked(space: str, spring: Tree) -> Tree:
    """Two bars at an angle on an elastic drive, with a load on the elbow and one on the tip."""
    turn = {"angle": 1.2} if space == "planar" else {"orientation": [0.4, -0.3, 1.2]}
    joints = {"j": {"type": "revolute", "base": "ground", "follower": "a.start"},
              "e": {"type": "fixed", "base": "a.end", "follower": "b.start", **turn}}  # fmt: skip
    bodies = {"e": {"at": "a.end", "mass": 2.0}, "tip": {"at": "b.end", "mass": 3.0}}
    tree = arm(space, 2700.0, {"a": 0.7, "b": 0.4}, joints=joints, bodies=bodies,
               springs={"k": spring})  # fmt: skip
    return {**tree, "coordinates": {"q": {"joint": "j", "drive": {"stiffness": 3e3}}}}


@pytest.mark.parametrize(
    ("space", "turns", "node"),
    [("planar", False, "b.end"), ("planar", True, "b.start"),
     ("spatial", False, "b.start"), ("spatial", True, "b.end")],
)  # fmt: skip
def test_either_end_of_a_crooked_arm_rests_as_on_a_post(space: str, turns: bool, node: str) -> None:
    planar = space == "planar"
    turn = {"angle": 0.3} if planar else {"orientation": [0.1, 0.2, 0.3]}
    for k in (1e2, 1e5, 1e9):
        stiffness = {"translational": [0.0, k] if planar else [0.2 * k, 0.0, k]}
        stiffness["rotational"] = 0.01 * k if planar else [0.0, 0.01 * k, 0.003 * k]
        between = [node, "ground"] if turns else ["ground", node]
        tree = crooked(space, {"between": between, **stiffness, **turn})
        for one, other in zip(
            asked(tree, [0.5]), asked(on_a_post(tree, [0.5]), [0.5]), strict=True
        ):
            np.testing.assert_allclose(one, other, rtol=1e-6, atol=1e-9 * np.abs(other).max())
        agree_under_weight(tree, [0.5], direction(tree, 1))


@pytest.mark.parametrize("loop", [False, True])
@pytest.mark.parametrize("space", ["planar", "spatial"])
@pytest.mark.parametrize("seed", range(3))
def test_random_springs_to_the_ground_are_those_of_the_potential(
    seed: int, space: str, loop: bool
) -> None:
    """Springs of about 1e2 to 1e9 N/m, where no coordinate is free."""
    tree, q = random_closed(seed, space, swap=True)[::2] if loop else random_open(seed, space)
    rng = np.random.default_rng([seed, 3])
    for data in tree["coordinates"].values():
        data["drive"] = "locked" if data.get("drive", "free") == "free" else data["drive"]
    add_springs(tree, rng)
    for spring in tree["mechanism"]["springs"].values():
        spring["between"] = ["ground", spring["between"][0]]
        for key in {"translational", "rotational"} & set(spring):
            spring[key] = (np.array(spring[key]) * 10.0 ** rng.uniform(-2.5, 4.5)).tolist()
    agree_under_weight(tree, q, direction(tree, seed))
