"""What springs leave free: rigid motions of several coordinates at once, exact or refused."""

import copy
from functools import cache
from typing import Any

import numpy as np
import pytest
from spatial_cases import Built, built, changed, linkage
from spatial_oracle import Tree, world
from spatial_random import add_springs as add_random_springs
from spatial_random import random_closed, random_open

from eigassign.errors import MechanismError
from eigassign.modal import eigenvalues


def chain(springs: Tree, n: int = 3, **joint: Any) -> Tree:
    """Revolute links one after the other, all free."""
    link = {"length": 0.4, "elements": 2, "material": "m", "section": "s"}
    names = [f"l{k}" for k in range(n)]
    ends = ["ground", *(f"{name}.end" for name in names[:-1])]
    return linkage(
        {name: dict(link) for name in names},
        {
            f"j{k}": {"type": "revolute", "base": ends[k], "follower": f"l{k}.start", **joint}
            for k in range(n)
        },
        {f"q{k}": {"joint": f"j{k}"} for k in range(n)},
        section={"shape": "tube", "outer_diameter": 0.03, "thickness": 0.003},
        springs=springs,
    )


def turning(a: str, b: str, k: float = 400.0) -> Tree:
    return {"x": {"between": [a, b], "rotational": k}}


def agrees(tree: Tree, q: list[float], n_rigid: int) -> None:
    model, frame = built(tree), world(tree, q)
    assert len(model.pencil.rigid) == n_rigid
    frame.n_free = n_rigid
    np.testing.assert_allclose(model.lam(q, 6), frame.spectrum(6), rtol=1e-8)


def test_a_spring_across_an_elbow_leaves_the_shoulder_alone() -> None:
    """Resisted by cancelling terms only: round-off must not hold the shoulder."""
    springs = {"x": {"between": ["l0.start", "l1.end"], "translational": 5e4}}
    for drives in (("free", "free"), ("free", "locked"), ("free", {"stiffness": 90.0})):
        tree = chain(copy.deepcopy(springs), 2)
        for data, drive in zip(tree["coordinates"].values(), drives, strict=True):
            data["drive"] = drive
        agrees(tree, [0.2, 0.7], 1)


def test_the_stiffness_takes_no_part_in_what_is_rigid() -> None:
    tree = chain(turning("l0.end", "l2.start", 1e-6))
    assert len(built(tree).pencil.rigid) == 2
    tree["mechanism"]["springs"]["y"] = {
        "between": ["l0.end", "ground"], "translational": 1e9
    }  # fmt: skip
    assert len(built(tree).pencil.rigid) == 1
    assert len(built(changed(tree, "springs.x.rotational", 0.0)).pencil.rigid) == 2


def test_a_designed_stiffness_resists_whatever_it_starts_from() -> None:
    tree = chain(turning("l0.end", "l2.start", 0.0))
    tree["design"] = {"k": {"parameter": "springs.x.rotational", "min": 1.0, "max": 900.0}}
    model = built(tree)
    assert len(model.pencil.rigid) == 2
    q = [0.2, 0.4, -0.9]
    lam = eigenvalues(model.pencil, np.array([[*q, 400.0]]), 4)[0]
    np.testing.assert_allclose(lam, built(chain(turning("l0.end", "l2.start"))).lam(q, 4))


def test_a_rigid_motion_that_turns_with_the_pose_is_refused_with_its_coordinates() -> None:
    tree = chain({"x": {"between": ["l1.end", "ground"], "translational": [0.0, 3e4]}}, 2)
    with pytest.raises(MechanismError, match="hold q0 and q1 in one direction only") as caught:
        built(tree)
    assert caught.value.path == "mechanism.springs.x"
    tree["coordinates"]["q1"]["drive"] = "locked"
    agrees(tree, [0.2, 0.4], 0)


@pytest.mark.parametrize("space", ["planar", "spatial"])
@pytest.mark.parametrize(
    "seed", [*range(12), *(pytest.param(k, marks=pytest.mark.slow) for k in range(12, 40))]
)
def test_random_sprung_mechanisms_have_the_spectrum_of_the_plain_frame_or_are_refused(
    seed: int, space: str
) -> None:
    tree, q = sprung(seed, space)
    model = built_or_refused(seed, space)
    if model is not None and model.n_elastic:
        frame = world(tree, q)
        frame.n_free = len(model.pencil.rigid)
        count = min(3, model.n_elastic)
        np.testing.assert_allclose(model.lam(q, count), frame.spectrum(count), rtol=1e-7)


@pytest.mark.parametrize(("count", "most"), [(12, 4), pytest.param(40, 12, marks=pytest.mark.slow)])
def test_few_random_sprung_mechanisms_are_refused(count: int, most: int) -> None:
    models = [built_or_refused(k, space) for k in range(count) for space in ("planar", "spatial")]
    assert sum(model is None for model in models) <= most


@cache
def built_or_refused(seed: int, space: str) -> Built | None:
    try:
        return built(sprung(seed, space)[0])
    except MechanismError as error:
        if "in one direction only" not in error.message:
            raise
        return None


def sprung(seed: int, space: str) -> tuple[Tree, np.ndarray]:
    """A random mechanism with free coordinates and springs."""
    if seed % 4 == 3:
        tree, q, _ = random_closed(seed, space, swap=True)
    else:
        tree, q = random_open(seed, space, swap=seed % 2 == 0)
    rng = np.random.default_rng([seed, 7])
    for data in tree["coordinates"].values():
        data["drive"] = "free" if rng.random() < 0.7 else data["drive"]
    add_random_springs(tree, rng)
    return tree, q


def test_a_spring_of_one_direction_is_named_with_the_coordinates_it_leaves() -> None:
    tree = chain({"x": {"between": ["l2.end", "ground"], "translational": [1000.0, 0.0]}})
    with pytest.raises(
        MechanismError, match=r"springs.x.translational hold q0 and q1 in one direction only,"
    ) as e:
        built(tree)
    assert e.value.path == "mechanism.springs.x"
    for drive in ("locked", {"stiffness": 1.0}):
        tree["coordinates"]["q0"]["drive"] = drive
        tree["coordinates"]["q1"]["drive"] = drive
        assert len(built(tree).motion.rigid) == 1


def with_least(tree: Tree, least: float) -> Tree:
    k = {"parameter": "springs.x.rotational", "min": least, "max": 900.0}
    return {**tree, "design": {"k": k}}


def test_a_stiffness_that_may_vanish_is_named_where_nothing_else_resists() -> None:
    tree = chain(turning("l0.end", "ground"))
    with pytest.raises(MechanismError, match=r"with k = 0 nothing holds q0,") as e:
        built(with_least(tree, 0.0))
    assert e.value.path == "design.k.min"
    assert len(built(with_least(tree, 0.9)).motion.rigid) == 2


def test_a_stiffness_may_vanish_where_something_else_resists() -> None:
    tree = chain(turning("l0.end", "ground"))
    tree["mechanism"]["springs"]["other"] = {"between": ["l0.end", "ground"], "rotational": 1.0}
    assert len(built(with_least(tree, 0.0)).motion.rigid) == 2
    held = chain(turning("l0.end", "ground"))
    held["coordinates"]["q0"]["drive"] = {"stiffness": 1.0}
    assert len(built(with_least(held, 0.0)).motion.rigid) == 2
