"""Mechanisms whose joints, bodies and nodes the design moves and turns."""

import re
from typing import Any

import numpy as np
from chains import case_of
from redesigned_arms import CASES, TIPS
from spatial_random import random_closed, random_open
from yaml import safe_load

from eigassign import Case
from eigassign.errors import CaseError

Tree = dict[str, Any]


def shipped_tree(name: str) -> Tree:
    """A shipped case as a tree, without what its design and expansion ask for."""
    tree = safe_load((CASES / f"{name}.yaml").read_text(encoding="utf-8"))
    return {key: tree[key] for key in ("mechanism", "coordinates", "trajectory") if key in tree}


def places(tree: Tree) -> list[str]:
    """Paths of all places and angles that can vary, written or not where they need not be."""
    m, found = tree["mechanism"], []
    planar = m["space"] == "planar"
    axes = range(2 if planar else 3)
    absolute = any(c.get("angle") == "absolute" for c in tree["coordinates"].values())
    for name, joint in m["joints"].items():
        n = 1 if joint["type"] == "nut" else len(axes)
        found += [f"joints.{name}.position.{k}" for k in range(n)]
        turned = [f"joints.{name}.angle"] if planar else []
        turned += [] if planar else [f"joints.{name}.orientation.{k}" for k in range(3)]
        found += [] if absolute else turned
    for name, body in m.get("bodies", {}).items():
        found += [f"bodies.{name}.offset.{k}" for k in axes if "offset" in body]
    for name, link in m["links"].items():
        if link.get("type") == "rigid":
            found += [f"links.{name}.center.{k}" for k in axes if "center" in link]
            nodes = link.get("nodes", {})
            found += [f"links.{name}.nodes.{node}.{k}" for node in nodes for k in axes]
    return found


def moved(tree: Tree, seed: int, count: int = 3) -> Case | None:
    """The tree with ``count`` of its places as design; None where loops do not let them move."""
    rng = np.random.default_rng(seed)
    every = places(tree)
    chosen = rng.choice(every, min(count, len(every)), replace=False).tolist()
    design = {f"p{k}": {"parameter": p, "min": -7, "max": 7} for k, p in enumerate(chosen)}
    case = case_of(tree | {"design": design})
    try:
        case.model()
    except CaseError as error:
        if not re.search("cannot change|closes a loop that has no passive", str(error)):
            raise
        return None
    return case


def along_a_tip(name: str, seed: int) -> Case | None:
    """A shipped case along a path of its tip, three of its places as design."""
    case = moved(shipped_tree(name) | {"trajectory": {**TIPS[name], "samples": 8}}, seed)
    if case is not None:
        try:
            _ = case.trajectory
        except CaseError as error:
            if "moves the tip where no coordinate can bring it back" not in str(error):
                raise
            return None
    return case


def drawn(seed: int) -> tuple[Case, np.ndarray | None] | None:
    """A random mechanism, and a pose q; None where what was drawn cannot move."""
    space, kind = ("planar", "spatial")[seed % 2], seed // 2 % 2
    if kind:
        tree, _, q = random_closed(seed // 4, space, 1, seed % 8 > 3)
    else:
        tree, q = random_open(seed, space, seed % 8 > 3)
    if seed % 3 == 0 and "free" not in str(tree["coordinates"]):
        down = [0.0, -9.81] if space == "planar" else [0.0, 0.0, -9.81]
        tree["mechanism"]["gravity"] = down
    case = moved(tree, seed)
    return None if case is None else (case, q)
