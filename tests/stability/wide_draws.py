"""Random trees, mechanisms with loops, and arms whose bending modes nearly coincide.

Of each a mechanism, a design box, and poses around one point.
"""

from collections.abc import Callable
from functools import partial

import numpy as np
from calibration import SPAN, Drawn, Floats, with_box
from chains import Tree, model_of
from spatial_cases import ALLOY, STEEL, linkage
from spatial_random import random_closed, random_open

from eigassign.errors import EigassignError
from eigassign.modal import Model

SLIDE = 0.1  # m: a sliding joint is drawn within this of its place at q0
LOOP_SPAN = 0.5  # rad: a loop seldom closes over more
LENGTHS = 0.05  # a loop's links are drawn within this share of their lengths
EQUAL = (0.0, 1e-8, 1e-5, 1e-3, 1e-2, 5e-2)  # by how much height and width of a section differ


def tree(space: str, seed: int, samples: int) -> Drawn | None:
    """One to four links, in space with joints of every kind."""
    return _drawn(*random_open(seed, space), seed, samples, SPAN, 0.5)


def loop(space: str, seed: int, samples: int) -> Drawn | None:
    """One or two loops in a plane, at least one coordinate left, or one in space."""
    count = 1 + seed % 2 if space == "planar" else 1
    return _drawn(*random_closed(seed, space, count)[:2], seed, samples, LOOP_SPAN, LENGTHS)


def hanging_arm(seed: int) -> tuple[Tree, Floats]:
    """One to four links with sections (nearly) alike in both directions of bending, and a pose."""
    rng = np.random.default_rng([seed, 7])
    tree: Tree = linkage(
        {},
        {},
        sections={
            "round": {"shape": "circle", "diameter": float(rng.uniform(0.02, 0.04))},
            "pipe": {"shape": "tube", "outer_diameter": 0.05, "thickness": 0.005},
        },
        materials={"steel": STEEL, "alloy": ALLOY},
        space="spatial",
        bodies={},
    )
    n = int(rng.integers(1, 5))
    q0 = [_hang(tree, k, rng) for k in range(n)]
    return tree, np.array(q0)


FAMILIES: dict[str, Callable[[int, int], Drawn | None]] = {
    "planar trees": partial(tree, "planar"),
    "spatial trees": partial(tree, "spatial"),
    "planar loops": partial(loop, "planar"),
    "spatial loops": partial(loop, "spatial"),
    "equal bending": lambda seed, n: _drawn(*hanging_arm(seed), seed, n, SPAN, 0.5),
}


def _hang(tree: Tree, k: int, rng: np.random.Generator) -> float:
    """The next link of an arm, on a revolute joint; its angle."""
    m, width = tree["mechanism"], float(rng.uniform(0.02, 0.04))
    m["sections"][f"square{k}"] = {
        "shape": "rectangle",
        "width": width,
        "height": width * (1.0 + float(rng.choice(EQUAL))),
    }
    m["links"][f"l{k}"] = {
        "length": float(rng.uniform(0.3, 0.8)),
        "material": str(rng.choice(["steel", "alloy"])),
        "section": str(rng.choice(["round", "pipe", f"square{k}"])),
        "elements": int(rng.integers(1, 4)),
    }
    axis = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], rng.normal(size=3).tolist()]
    m["joints"][f"j{k}"] = {
        "type": "revolute",
        "base": f"l{k - 1}.end" if k else "ground",
        "follower": f"l{k}.start",
        "axis": axis[rng.integers(4)],
    }
    if rng.random() < 0.5:
        mass = float(rng.uniform(0.1, 2.0))
        m["bodies"][f"b{k}"] = {"at": f"l{k}.end", "mass": mass, "inertia": [3e-3, 4e-3, 4e-3]}
    drives = ["free", "locked", "locked", {"stiffness": float(10 ** rng.uniform(3, 5))}]
    tree["coordinates"][f"q{k}"] = {"joint": f"j{k}", "drive": drives[rng.integers(4)]}
    return float(rng.uniform(-1.2, 1.2))


def _drawn(
    tree: Tree, q0: Floats, seed: int, samples: int, span: float, lengths: float
) -> Drawn | None:
    """The poses that the mechanism can take of ``samples``; None where it has none, or no mode."""
    rng = np.random.default_rng([seed, 1])
    tree["design"] = with_box(candidates(tree), rng, {"length": lengths})
    try:
        model = model_of(tree)
    except EigassignError:
        return None
    box = np.array([[p["min"], p["max"]] for p in tree["design"].values()]).reshape(-1, 2)
    y0 = box.mean(axis=1)
    y = rng.uniform(box[:, 0], box[:, 1], (samples, len(box)))
    q = q0 + rng.uniform(-1.0, 1.0, (samples, len(q0))) * _spans(tree, span)
    modes = _modes(model, rng)
    if not (len(q0) or len(y0)) or not _vibrates(model, q0, y0, modes):
        return None
    inside = [_vibrates(model, *at, modes) for at in zip(q, y, strict=True)]
    return Drawn(model, q0, y0, q[inside], y[inside], modes)


def _modes(model: Model, rng: np.random.Generator) -> tuple[int, ...]:
    """The lowest few, or one of them."""
    elastic = model.n_dof - model.n_rigid
    modes = tuple(range(1, 1 + int(rng.integers(1, max(2, min(4, elastic + 1))))))
    return modes[-1:] if rng.random() < 0.5 else modes


def _vibrates(model: Model, q: Floats, y: Floats, modes: tuple[int, ...]) -> bool:
    """Whether there is an exact answer: no dead point, the carriage on its beam, a mode at all."""
    try:
        model.frequencies(q, y, max(modes))
    except EigassignError:
        return False
    return True


def _spans(tree: Tree, angle: float) -> Floats:
    joints, found = tree["mechanism"]["joints"], []
    for data in tree["coordinates"].values():
        kind = joints[data["joint"]]["type"]
        slides = kind in ("prismatic", "carriage", "nut") or data.get("component") == "translation"
        found.append(SLIDE if slides else angle)
    return np.array(found)


def candidates(tree: Tree) -> list[tuple[str, float]]:
    """Every number that may be a design parameter, by itself and whatever the others are."""
    m, found = tree["mechanism"], []
    for n, d in m["links"].items():
        own = {"beam": ["length"], "rigid": ["mass"]}.get(d.get("type", "beam"), [])
        found += [(f"links.{n}.{k}", d[k]) for k in own]
    found += [(f"bodies.{n}.mass", d["mass"]) for n, d in m["bodies"].items()]
    for n, data in m["materials"].items():
        found += [(f"materials.{n}.{k}", data[k]) for k in ("youngs_modulus", "density")]
    keys = ("diameter", "thickness", "bending_inertia", "inertia_y", "inertia_z", "width")
    for n, data in m["sections"].items():
        plain = data.get("shape") != "i_profile"
        found += [(f"sections.{n}.{k}", data[k]) for k in keys if plain and k in data]
    for n, data in m.get("springs", {}).items():
        for k in ("translational", "rotational"):
            if isinstance(data.get(k), float):
                found.append((f"springs.{n}.{k}", data[k]))
    for n, data in tree["coordinates"].items():
        if isinstance(data["drive"], dict):
            found.append((f"coordinates.{n}.drive.stiffness", data["drive"]["stiffness"]))
    return found
