"""Random arms whose links can be reduced."""

import copy
from typing import Any

import numpy as np
from spatial_cases import Built, linkage

Tree = dict[str, Any]


def random_arm(seed: int, design: bool = True) -> Tree:
    """A beam, tapered or not, that carries a frame, or the other way round; y where asked for."""
    rng = np.random.default_rng(seed)
    space = ("planar", "spatial")[seed % 2]
    axis = {} if space == "planar" else {"axis": rng.uniform(-1, 1, 3).tolist()}
    frame_first = bool(rng.integers(2))
    base, tip = ("frame", "beam") if frame_first else ("beam", "frame")
    at = "frame.n3" if frame_first else "beam.end"
    tree: Tree = linkage(
        {"beam": _beam(rng), "frame": _frame(rng, space)},
        {
            "j1": {"type": "revolute", "base": "ground", "follower": f"{base}.start", **axis},
            "j2": {"type": "revolute", "base": at, "follower": f"{tip}.start", **axis},
        },
        {
            "q1": {"joint": "j1"},
            "q2": {"joint": "j2", "drive": ["free", "locked", {"stiffness": 2e3}][seed % 3]},
        },
        sections={
            "a": {"shape": "circle", "diameter": float(rng.uniform(0.015, 0.03))},
            "b": {"shape": "circle", "diameter": float(rng.uniform(0.010, 0.015))},
        },
        space=space,
        bodies={"load": {"at": f"{at}", "mass": float(rng.uniform(0.0, 1.0))}},
    )
    if design:
        tree["design"] = _design(tree, rng)
    return tree


def _beam(rng: np.random.Generator) -> Tree:
    section = [{"start": "a", "end": "b"}, "a"][int(rng.integers(2))]
    return {
        "length": float(rng.uniform(0.4, 0.9)),
        "material": "m",
        "section": section,
        "elements": int(rng.integers(6, 16)),
        "shear": bool(rng.integers(2)),
    }


def _frame(rng: np.random.Generator, space: str) -> Tree:
    """A chain of nodes with two braces."""
    n = 2 if space == "planar" else 3
    places = np.cumsum(rng.uniform(0.05, 0.25, (6, n)) * rng.choice([1, 1, -1], (6, n)), axis=0)
    places -= places[0]
    names = ["start", *(f"n{k}" for k in range(1, 6))]
    pairs = [*zip(range(5), range(1, 6), strict=True), (0, 2), (2, 5)]
    return {
        "type": "frame",
        "nodes": {name: p.tolist() for name, p in zip(names, places, strict=True)},
        "beams": {
            f"b{a}{b}": {
                "from": names[a],
                "to": names[b],
                "material": "m",
                "section": "b",
                "elements": int(rng.integers(1, 4)),
            }
            for a, b in pairs
        },
    }


def _design(tree: Tree, rng: np.random.Generator) -> Tree:
    """Two of: a length, a diameter, a density, a mass; each within its own wide bounds."""
    mechanism = tree["mechanism"]
    length, mass = mechanism["links"]["beam"]["length"], mechanism["bodies"]["load"]["mass"]
    d = mechanism["sections"]["b"]["diameter"]
    all_of = {
        "length": {"parameter": "links.beam.length", "min": 0.8 * length, "max": 1.2 * length},
        "thick": {"parameter": "sections.b.diameter", "min": 0.8 * d, "max": 1.25 * d},
        "dense": {"parameter": "materials.m.density", "min": 2000, "max": 4000},
        "mass": {"parameter": "bodies.load.mass", "min": 0.0, "max": mass + 1.0},
    }
    chosen = rng.permutation(list(all_of))[:2]
    return {name: all_of[name] for name in chosen}


def random_x(model: Built, rng: np.random.Generator) -> np.ndarray:
    """A pose, and a design anywhere within the bounds."""
    parameters = model.case.design.parameters.values()
    y = [rng.uniform(p.min, p.max) for p in parameters]
    return np.array([*rng.uniform(-2.0, 2.0, 2), *y])


def reduced_tree(tree: Tree, hertz: float, links: tuple[str, ...] = ("beam", "frame")) -> Tree:
    """The same mechanism with some links reduced."""
    out = copy.deepcopy(tree)
    for name in links:
        out["mechanism"]["links"][name]["reduce_to"] = hertz
    return out
