"""Bars welded and pinned to each other in many loops."""

import itertools
from typing import Any

import numpy as np
from spatial_cases import linkage

STEEL = {"youngs_modulus": 2.1e11, "density": 7850.0}


def web(seed: int, pinned: float) -> dict[str, Any]:
    """Bars between random points, some with arms; joints in any order, one in five pinned or so."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1.0, 1.0, (int(rng.integers(3, 6)), 2))
    points = points[np.argsort(points[:, 0])]
    n = len(points)
    more = [pair for pair in itertools.combinations(range(n), 2) if pair[1] - pair[0] > 1]
    rng.shuffle(more)
    links: dict[str, Any] = {}
    ends: list[list[tuple[str, float]]] = [[] for _ in points]
    for k, pair in enumerate([*itertools.pairwise(range(n)), *more[: int(rng.integers(1, 3))]]):
        i, j = pair if rng.random() < 0.5 else pair[::-1]
        along = points[j] - points[i]
        links[f"b{k}"] = bar(float(np.linalg.norm(along)))
        angle = float(np.arctan2(along[1], along[0]))
        ends[i].append((f"b{k}.start", angle))
        ends[j].append((f"b{k}.end", angle))
    for k, own in enumerate(ends):
        if rng.random() < 0.4:
            links[f"arm{k}"] = bar(0.4)
            own.append((f"arm{k}.start", float(rng.uniform(-3.0, 3.0))))
    joints = []
    for k, own in enumerate(ends):
        order = rng.permutation(len(own)).tolist()
        if k in (0, n - 1):
            at = {"position": points[k].tolist()}
            joints.append(joint("ground", own[order[0]], 0.0, False) | at)
        for m in range(1, len(order)):
            base, angle = own[order[int(rng.integers(0, m))]]
            joints.append(joint(base, own[order[m]], angle, bool(rng.random() < pinned)))
    rng.shuffle(joints)
    masses, arms = rng.uniform(1.0, 30.0, n).tolist(), rng.uniform(-0.2, 0.2, (n, 2)).tolist()
    bodies = {
        f"m{k}": {"at": own[0][0], "mass": masses[k], "offset": arms[k]}
        for k, own in enumerate(ends)
    }
    return linkage(
        links,
        {f"j{k}": each for k, each in enumerate(joints)},
        sections={"bar": {"shape": "rectangle", "width": 0.02, "height": 0.02}},
        materials={"steel": STEEL},
        gravity=rng.normal(size=2).tolist(),
        bodies=bodies,
    ) | {"title": "a web"}


def bar(length: float) -> dict[str, Any]:
    return {"length": length, "section": "bar", "material": "steel", "elements": 2}


def joint(base: str, follower: tuple[str, float], angle: float, pinned: bool) -> dict[str, Any]:
    kind = "revolute" if pinned else "fixed"
    return {"type": kind, "base": base, "follower": follower[0], "angle": follower[1] - angle}
