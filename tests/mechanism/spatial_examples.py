"""Well-known mechanisms in the language of a case file: those of the reference program."""

import copy
from typing import Any

import numpy as np
from spatial_cases import Tree, linkage

STEEL = {"youngs_modulus": 200e9, "density": 7800.0, "poissons_ratio": 0.3}
MASS, INERTIA = 1.3, 0.02  # of a rigid link
TUBE = {"shape": "tube", "outer_diameter": 0.04, "inner_diameter": 0.034}


def straight(length: float, elements: int, section: str = "s", material: str = "m") -> Tree:
    return {"length": length, "elements": elements, "section": section, "material": material}


def four_bar(drive: Any) -> Tree:
    return linkage(
        {"crank": straight(0.12, 2), "coupler": straight(0.45, 4), "rocker": straight(0.4, 4)},
        {
            "A": {"type": "revolute", "base": "ground", "follower": "crank.start"},
            "B": {"type": "revolute", "base": "crank.end", "follower": "coupler.start"},
            "D": {"type": "revolute", "base": "ground", "follower": "rocker.start",
                  "position": [0.5, 0.0]},
            "E": {"type": "revolute", "base": "coupler.end", "follower": "rocker.end"},
        },
        {"th": {"joint": "A", "drive": drive}},
        section={"shape": "rectangle", "height": 0.004, "width": 0.02},
        material=STEEL,
        assembly={"guess": {"B": 1.0, "D": 2.0, "E": 0.0}},
    )  # fmt: skip


def slider_crank(drive: Any) -> Tree:
    slider = {"type": "rigid", "mass": 0.5}
    return linkage(
        {"crank": straight(0.15, 2), "rod": straight(0.45, 6), "slider": slider},
        {
            "A": {"type": "revolute", "base": "ground", "follower": "crank.start"},
            "B": {"type": "revolute", "base": "crank.end", "follower": "rod.start"},
            "P": {"type": "prismatic", "base": "ground", "follower": "slider.start",
                  "axis": [1.0, 0.0]},
            "E": {"type": "revolute", "base": "rod.end", "follower": "slider.start"},
        },
        {"th": {"joint": "A", "drive": drive}},
        section={"shape": "circle", "diameter": 0.012},
        material=STEEL,
        assembly={"guess": {"P": 0.6}},
    )  # fmt: skip


def arm3r(drive: Any) -> Tree:
    return linkage(
        {"col": straight(0.3, 2), "up": straight(0.5, 4), "fo": straight(0.4, 4)},
        {
            "yaw": {"type": "revolute", "base": "ground", "follower": "col.start",
                    "axis": [1.0, 0.0, 0.0], "orientation": [0.0, -np.pi / 2, 0.0]},
            "pitch": {"type": "revolute", "base": "col.end", "follower": "up.start",
                      "axis": [0.0, -1.0, 0.0], "orientation": [0.0, np.pi / 2, 0.0]},
            "elbow": {"type": "revolute", "base": "up.end", "follower": "fo.start",
                      "axis": [0.0, -1.0, 0.0]},
        },
        {n: {"joint": n, "drive": drive} for n in ("yaw", "pitch", "elbow")},
        section=TUBE,
        material={"youngs_modulus": 70e9, "density": 2700.0, "poissons_ratio": 0.33},
        space="spatial",
        bodies={"tip": {"at": "fo.end", "mass": 1.0}},
    )  # fmt: skip


def gantry(drive: Any) -> Tree:
    legs, trolley = straight(0.8, 6), {"type": "rigid", "mass": 3.0}
    corner = {"type": "fixed", "angle": -np.pi / 2}
    return linkage(
        {"left": legs, "girder": straight(1.6, 12), "right": {**legs}, "trolley": trolley},
        {
            "f1": {**corner, "base": "ground", "follower": "left.start", "angle": np.pi / 2},
            "f2": {**corner, "base": "left.end", "follower": "girder.start"},
            "f3": {**corner, "base": "girder.end", "follower": "right.start"},
            "f4": {**corner, "base": "ground", "follower": "right.end", "position": [1.6, 0.0]},
            "car": {"type": "carriage", "base": "girder", "follower": "trolley.start"},
        },
        {"x": {"joint": "car", "drive": drive}},
        section={"shape": "rectangle", "height": 0.05, "width": 0.05},
        material={"youngs_modulus": 210e9, "density": 7850.0},
    )


def slotted_lever(drive: Any) -> Tree:
    """A crank whose block rides, passively, along a flexible lever (quick return)."""
    tree = four_bar(drive)
    m = tree["mechanism"]
    m["links"] = {"crank": straight(0.12, 2), "block": {"type": "rigid", "mass": 0.1,
                  "inertia": 1e-4}, "lever": straight(0.7, 6)}  # fmt: skip
    m["joints"] = {
        "A": {"type": "revolute", "base": "ground", "follower": "crank.start"},
        "L": {"type": "revolute", "base": "ground", "follower": "lever.start",
              "position": [0.0, -0.3]},
        "S": {"type": "carriage", "base": "lever", "follower": "block.start"},
        "B": {"type": "revolute", "base": "crank.end", "follower": "block.start"},
    }  # fmt: skip
    m["assembly"] = {"at": {"th": 0.0}, "guess": {"L": 1.2, "S": 0.3, "B": 1.0}}
    return tree


def ball_screw(orientation: list[float]) -> Tree:
    """A screw shaft with a travelling nut that carries a table's arm."""
    nut = {"type": "nut", "base": "shaft", "follower": "arm.start", "lead": 0.05}
    return linkage(
        {"shaft": straight(1.0, 4), "arm": straight(0.2, 2)},
        {
            "bearing": {"type": "fixed", "base": "ground", "follower": "shaft.start"},
            "nut": {**nut, "orientation": orientation},
        },
        {"s": {"joint": "nut", "drive": {"stiffness": 1e7}}},
        material={"youngs_modulus": 210e9, "density": 7850.0, "poissons_ratio": 0.3},
        space="spatial",
        bodies={"table": {"at": "arm.end", "mass": 2.0, "inertia": [0.01, 0.02, 0.02]}},
    )


def rigid(tree: Tree, *links: str) -> Tree:
    """The tree with these links rigid, of one mass and inertia each, centred on their axis."""
    out = copy.deepcopy(tree)
    for name in links or tuple(tree["mechanism"]["links"]):
        length = tree["mechanism"]["links"][name]["length"]
        out["mechanism"]["links"][name] = {
            "type": "rigid", "length": length, "mass": MASS, "inertia": INERTIA,
            "center": [0.5 * length, 0.0],
        }  # fmt: skip
    return out
