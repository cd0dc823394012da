"""A geared two-link arm with trajectories that set properties, and the files of each by itself."""

import copy
import json
from typing import Any

from chains import Tree, two_link

from eigassign import Case
from eigassign.case import parse

MASS, INERTIA = "bodies.payload.mass", "bodies.payload.inertia"
PICK = {"points": [[0.3, 1.2], [1.0, 2.2]], "duration": 1.0, "samples": 11}
BACK = {"points": [[1.0, 2.2], [0.3, 1.2]], "duration": 0.6, "samples": 9}
IDLE = {"points": [[0.2, 1.4], [0.3, 1.2]], "duration": 0.5, "samples": 5}
LOADED = ({MASS: 3.0, INERTIA: 5e-3}, {MASS: 0.0}, {})


def arm(*sets: Tree, **more: Any) -> Tree:
    """The arm with the given settings along its three trajectories, and further keys."""
    tree = two_link(
        drives=({"stiffness": 4e4, "inertia": 0.3}, {"stiffness": 2e4}), masses=(0.1, 0.05)
    )
    tree["mechanism"]["bodies"]["payload"] = {"at": "fore.end", "mass": 0.5, "inertia": 1e-3}
    motions = zip(("pick", "return", "idle"), (PICK, BACK, IDLE), sets, strict=False)
    tree["trajectory"] = [{"name": n, **motion, "set": own} for n, motion, own in motions]
    return tree | more


def alone(tree: Tree, k: int) -> Tree:
    """The file of trajectory k alone, with what it sets written into the mechanism."""
    one = copy.deepcopy(tree)
    one["trajectory"] = one["trajectory"][k]
    for path, value in one["trajectory"].pop("set").items():
        *keys, last = path.split(".")
        at = one if keys[0] == "coordinates" else one["mechanism"]
        for key in keys:
            at = at[key]
        at[last] = value
    return one


def case(tree: Tree) -> Case:
    return Case(parse(text(tree).encode(), "load_cases.yaml"))


def text(tree: Tree) -> str:
    return json.dumps({"title": "load cases", **tree})
