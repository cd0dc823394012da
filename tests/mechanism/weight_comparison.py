"""The pencil of a mechanism under weight against the nonlinear potential of the plain frame.

Gravity is taken so strong that it changes the lowest modes by a fifth: K_g is linear in it, and its
errors stand out of the round-off of K. Each λ agrees to 1e-6 of what gravity changes, beside 2e-8
of itself, which is the round-off of `frame_comparison`.
"""

import copy
from typing import Any

import numpy as np
from scipy import linalg
from scipy.spatial.transform import Rotation
from spatial_cases import Built, built
from spatial_oracle import Tree
from weight_oracle import Weighed, lowest, weigh

COUNT = 6


def direction(tree: Tree, seed: int) -> np.ndarray:
    """Some direction of gravity."""
    g = np.random.default_rng(seed).normal(size=2 if tree["mechanism"]["space"] == "planar" else 3)
    return np.asarray(g / np.linalg.norm(g))


def pulled(tree: Tree, gravity: Any) -> Built:
    """The mechanism under gravity."""
    out = copy.deepcopy(tree)
    out["mechanism"]["gravity"] = np.asarray(gravity).tolist()
    return built(out)


def matrices(model: Built, q: Any) -> np.ndarray:
    """K and M (2, n_dof, n_dof) at one q."""
    return np.asarray(model.pencil.matrices(model.pencil.theta(model.x(q)))[:, 0])


def strong(found: Weighed) -> float:
    """How many times the gravity changes the lowest elastic modes by a fifth at most."""
    n, M = found.n_free, found.M + 1e-12 * np.trace(found.M) / len(found.M) * np.eye(len(found.M))
    lam, modes = linalg.eigh(found.K, M, subset_by_index=[0, min(n + 3, len(M) - 1)])
    if len(lam) == n:
        return 10.0
    change = modes[:, n:].T @ found.K_g @ modes[:, n:]
    size = np.abs(change / np.sqrt(np.outer(lam[n:], lam[n:]))).max()
    return float(min(0.2 / max(size, 1e-9), 1e5))


def agree_under_weight(tree: Tree, q: Any, g: np.ndarray) -> None:
    """The change of the lowest λ by gravity along g is that of the oracle, and K_g symmetric."""
    found = weigh(tree, q, g)
    share = strong(found)
    model = pulled(tree, share * g)
    (K, M), rigid = matrices(model, q), len(model.pencil.rigid) > 0
    assert len(K) == len(found.K)
    count = min(COUNT, len(K))
    expected, plain = found.spectrum(count, share, rigid), found.spectrum(count, 0.0)
    change = np.abs(expected - plain).max()
    missed = np.abs(lowest(K, M, count) - expected)
    assert (missed <= 1e-6 * change + 2e-8 * np.abs(expected)).all()
    assert np.abs(K - K.T).max() <= 1e-14 * np.abs(K).max()


def level_carriage(seed: int, space: str) -> tuple[Tree, list[float], np.ndarray]:
    """A free slide along a level girder on a crooked post, with an arm below; q, and down."""
    rng = np.random.default_rng(seed)
    planar = space == "planar"
    R = Rotation.from_euler("z" if planar else "xyz", rng.uniform(-1.0, 1.0, 1 if planar else 3))
    level = Rotation.from_euler("xz", rng.uniform(-3.0, 3.0, 2))
    if planar:
        level = Rotation.identity()

    def turned(rotation: Rotation) -> Tree:
        angles = rotation.as_euler("xyz")
        return {"angle": float(angles[2])} if planar else {"orientation": angles.tolist()}

    def beam(length: float) -> Tree:
        return {"length": length, "elements": 3, "section": "s", "material": "m"}

    on, where = ("prismatic", "g.end") if seed % 3 == 0 else ("carriage", "g")
    m: Tree = {
        "space": space,
        "materials": {"m": {"youngs_modulus": 210e9, "density": 7850.0, "poissons_ratio": 0.3}},
        "sections": {"s": {"shape": "rectangle", "height": 0.03, "width": 0.02}},
        "links": {"p": beam(rng.uniform(0.3, 1.0)), "g": beam(rng.uniform(0.8, 1.5)),
                  "t": {"type": "rigid", "mass": rng.uniform(1.0, 30.0), "length": 0.1,
                        "center": [0.1, -0.2] if planar else [0.1, 0.05, -0.2], "inertia": 0.1},
                  "a": beam(rng.uniform(0.2, 0.8))},
        "joints": {
            "f": {"type": "fixed", "base": "ground", "follower": "p.start", **turned(R)},
            "h": {"type": "fixed", "base": "p.end", "follower": "g.start",
                  **turned(R.inv() * level)},
            "s": {"type": on, "base": where, "follower": "t.start"},
            "r": {"type": "revolute", "base": "t.end", "follower": "a.start",
                  **turned(Rotation.from_euler("z", -1.3))},
        },
        "bodies": {"tip": {"at": "a.end", "mass": rng.uniform(0.5, 10.0)}},
    }  # fmt: skip
    if on == "prismatic":
        m["joints"]["s"]["axis"] = [1.0, 0.0] if planar else [1.0, 0.0, 0.0]
    drive = "free" if seed % 2 else {"stiffness": 1e4}
    tree = {
        "mechanism": m,
        "coordinates": {"x": {"joint": "s", "drive": "free"}, "a": {"joint": "r", "drive": drive}},
    }
    if not planar:
        m["links"]["t"]["inertia"] = [0.1, 0.2, 0.15]
    return tree, [0.37, -0.2], np.array([0.0, -1.0] if planar else [0.0, 0.0, -1.0])
