"""Random mechanisms on random tip paths, and what inverse kinematics sees: by an oracle."""

import copy

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from spatial_cases import built
from spatial_oracle import Tree
from spatial_random import EVERY_LOOP, EVERY_TREE, Random, last_node, random_closed, random_open
from tip_paths import between, chain_of, course, states, tips

from eigassign.mechanism import TipChain, follow, reduced

H = 1e-6  # central differences: error about h² and 1e-16 / h
SPACES = ["planar", "spatial"]


def mechanisms(space: str) -> list[tuple[Tree, np.ndarray]]:
    trees = [random_open(*drawn) for drawn in EVERY_TREE if drawn[1] == space]
    return trees + [random_closed(*drawn)[::2] for drawn in EVERY_LOOP if drawn[1] == space]


@pytest.mark.parametrize("space", SPACES)
def test_derivatives_by_every_freedom_are_those_of_differences(space: str) -> None:
    for k, (tree, q) in enumerate(mechanisms(space)):
        chain = chain_of(built(tree), last_node(tree), oriented=True)
        z = states(chain, q)
        z = z + 0.01 * np.sin(np.arange(z.size) + k)  # the loops need not be closed
        seen = chain.evaluate(z)
        for i, e in enumerate(H * np.eye(z.shape[1])):
            ahead, behind = chain.evaluate(z + e), chain.evaluate(z - e)
            by_differences = [(ahead.point - behind.point)[0] / (2 * H)]
            turn = ahead.rotation[0] @ behind.rotation[0].T
            spin = Rotation.from_matrix(turn).as_rotvec() / (2 * H)
            by_differences.append(spin[list(chain.turned_by)])
            J = seen.jacobian[0, :, i]
            np.testing.assert_allclose(J, np.concatenate(by_differences), rtol=1e-6, atol=3e-8)
            closing = (ahead.gap - behind.gap)[0] / (2 * H)
            np.testing.assert_allclose(seen.closure[0, :, i], closing, rtol=1e-6, atol=3e-8)


@pytest.mark.parametrize("space", SPACES)
def test_the_tip_is_where_the_oracle_has_it_and_the_loops_are_closed(space: str) -> None:
    for tree, q in mechanisms(space):
        tip = last_node(tree)
        chain = chain_of(built(tree), tip, oriented=True)
        seen = chain.evaluate(states(chain, q))
        point, R = tips(tree, q[None], tip)
        np.testing.assert_allclose(seen.point, point[:, : seen.point.shape[1]], atol=1e-8)
        np.testing.assert_allclose(seen.rotation, R, atol=1e-8)
        assert np.abs(seen.gap).max(initial=0.0) < 1e-9


def kinds(tree: Tree) -> tuple[str, ...]:
    chain: TipChain = chain_of(built(tree), last_node(tree))
    return chain.kinds


def test_freedoms_turn_slide_or_advance() -> None:
    found: dict[str, set[str]] = {}
    for seed in range(40):
        tree, _ = random_open(seed, "spatial")
        joints = tree["mechanism"]["joints"]
        for (_, data), kind in zip(tree["coordinates"].items(), kinds(tree), strict=True):
            key = joints[data["joint"]]["type"]
            if key == "cylindrical":
                key = data["component"]
            found.setdefault(key, set()).add(kind)
    assert found == {
        "revolute": {"turn"}, "universal": {"turn"}, "spherical": {"turn"}, "rotation": {"turn"},
        "translation": {"slide"}, "prismatic": {"slide"}, "carriage": {"slide"},
        "nut": {"slide"}, "screw": {"screw"},
    }  # fmt: skip


# --- Random mechanisms follow random tip paths, judged by an independent oracle


SIZE = 1e-9  # of the path's size: a tip on its path


def regularity(tree: Tree, q: np.ndarray, oriented: bool) -> float:
    """The smallest singular value of J at q, in m and rad; 0 if the tip cannot move every way."""
    chain = chain_of(built(tree), last_node(tree), oriented)
    J = reduced(chain.evaluate(states(chain, q)), chain.n_q).J[0]
    s = np.linalg.svd(J, compute_uv=False)
    return float(s[-1]) if len(s) == J.shape[0] else 0.0


def arm_on(tree: Tree, q: np.ndarray, rng: Random, count: int) -> tuple[Tree, np.ndarray]:
    """The mechanism with ``count`` more links, one on the other, on turning or sliding joints."""
    tree = copy.deepcopy(tree)
    m, values = tree["mechanism"], [*q]
    space = m["space"]
    for k in range(count):
        node, link = last_node(tree), f"arm{k}"
        end = [0.4, *rng.uniform(-0.1, 0.1, 1 if space == "planar" else 2)]
        mass = {"mass": 1.0, "inertia": 0.1 if space == "planar" else [0.1, 0.1, 0.1]}
        m["links"][link] = {"type": "rigid", "nodes": {"end": end}, **mass}
        slides = rng.random() < 0.2
        joint = {"type": "prismatic" if slides else "revolute", "base": node}
        if space == "spatial" or slides:
            joint["axis"] = rng.normal(size=2 if space == "planar" else 3).tolist()
        m["joints"][f"arm{k}"] = joint | {"follower": f"{link}.start"}
        tree["coordinates"][f"arm{k}"] = {"joint": f"arm{k}"}
        values.append(float(rng.uniform(-0.2, 0.2) if slides else rng.uniform(-1.2, 1.2)))
    return tree, np.array(values)


def mechanism(seed: int, space: str, oriented: bool, closed: bool) -> tuple[Tree, np.ndarray]:
    """A random mechanism whose tip, on an arm it carries, can be moved every way in one manner."""
    wanted = {"planar": 2 + oriented, "spatial": 3 + 3 * oriented}[space]
    for attempt in range(100):
        own = seed + 100 * attempt
        tree, q = random_closed(own, space)[:2] if closed else random_open(own, space)
        if len(q) > wanted:
            continue
        longer = arm_on(tree, q, np.random.default_rng([seed, attempt]), wanted - len(q))
        if regularity(*longer, oriented) > 0.1:
            return longer
    raise AssertionError("no mechanism found")


OPEN = [(k, space, False) for k in range(8) for space in SPACES]
DRAWN = [*OPEN, (0, "planar", True), (1, "spatial", True), (1, "planar", True), (2, "planar", True)]
QUICK = [*OPEN[:6], *DRAWN[16:18]]


@pytest.mark.parametrize("oriented", [False, True])
@pytest.mark.parametrize(
    "drawn", [d if d in QUICK else pytest.param(d, marks=pytest.mark.slow) for d in DRAWN], ids=str
)
def test_mechanisms_stay_on_their_paths(drawn: tuple[int, str, bool], oriented: bool) -> None:
    """From the tip's place at q along a short bent path, turning a little if oriented."""
    seed, space, closed = drawn
    tree, q = mechanism(seed, space, oriented, closed)
    tip, rng = last_node(tree), np.random.default_rng(seed)
    chain = chain_of(built(tree), tip, oriented)
    seen = chain.evaluate(states(chain, q))
    d = seen.point.shape[1]
    far = min(0.02, 0.1 * regularity(tree, q, oriented) ** 2)  # within reach, to second order
    points = seen.point + np.vstack([np.zeros(d), rng.uniform(-far, far, (2, d))])
    wish = {}
    if oriented and d == 2:
        angle = np.arctan2(seen.rotation[0, 1, 0], seen.rotation[0, 0, 0])
        wish["angle"] = angle + np.array([0.0, *rng.uniform(-far, far, 2)])
    elif oriented:
        turns = Rotation.from_rotvec(np.vstack([np.zeros(3), rng.uniform(-far, far, (2, 3))]))
        wish["orientation"] = (turns * Rotation.from_matrix(seen.rotation)).as_euler("xyz")
    due = course(points, 9, "spline", **wish)
    followed = follow(chain, due, start=q)
    np.testing.assert_allclose(followed.q[0], q, atol=1e-6)  # it starts where it was told to
    place, R = tips(tree, followed.q, tip)
    target = due.target(due.s)
    # the oracle closes its loops to 1e-10 and this is its error, too
    assert np.abs(place[:, :d] - target.point).max() < SIZE * max(1.0, due.size)
    if oriented:
        assert between(target.rotation, R).max() < 1e-8  # the angle of a cosine near 1
    steps = np.abs(np.diff(followed.q, axis=0)).max(axis=0)
    assert (steps < 0.3 * np.maximum(1.0, np.abs(followed.q).max(axis=0))).all()  # no jump
