"""Cases for tests, written as plain trees: the paper's arm, and bars."""

import json
from typing import Any

import numpy as np
from spatial_cases import linkage
from spatial_examples import straight

from eigassign import Case
from eigassign.case import parse
from eigassign.modal import Model

Tree = dict[str, Any]
I_PAPER = 3.97e-8  # m4
# The reference frequencies belong to a solid rod of 1.9 kg/m; its area is only printed rounded.
A_PAPER = float(np.sqrt(4.0 * np.pi * I_PAPER))


def case_of(tree: Tree) -> Case:
    """A tree as a case file would hold it (JSON is YAML)."""
    return Case(parse(json.dumps({"title": "test", **tree}).encode(), "test.yaml"))


def model_of(tree: Tree) -> Model:
    return case_of(tree).model()


def two_link(
    elements: tuple[int, int] = (4, 3),
    drives: tuple[Any, Any] = ("free", "free"),
    angles: tuple[str, str] = ("relative", "absolute"),
    masses: tuple[float, float] = (0.0, 0.0),
    tip_inertia: float = 0.0,
    design: Tree | None = None,
) -> Tree:
    """The paper's arm; by default m1 and m2 are its design parameters."""
    at, end = "bodies.elbow_mass.mass", "bodies.tool_mass.mass"
    box = {
        "m1": {"parameter": at, "min": 0.0, "max": 0.25},
        "m2": {"parameter": end, "min": 0.0, "max": 0.25},
    }
    return linkage(
        {
            "upper": straight(0.6, elements[0], "rod", "al"),
            "fore": straight(0.45, elements[1], "rod", "al"),
        },
        {
            "shoulder": {"type": "revolute", "base": "ground", "follower": "upper.start"},
            "elbow": {"type": "revolute", "base": "upper.end", "follower": "fore.start"},
        },
        {
            "q1": {"joint": "shoulder", "angle": angles[0], "drive": drives[0]},
            "q2": {"joint": "elbow", "angle": angles[1], "drive": drives[1]},
        },
        sections={"rod": {"area": A_PAPER, "bending_inertia": I_PAPER}},
        materials={"al": {"youngs_modulus": 69e9, "density": 1.9 / A_PAPER}},
        bodies={
            "elbow_mass": {"at": "upper.end", "mass": masses[0]},
            "tool_mass": {"at": "fore.end", "mass": masses[1], "inertia": tip_inertia},
        },
    ) | {"design": box if design is None else design}


def bar(
    elements: int,
    length: float,
    E: float,
    density: float,
    section: Tree,
    root: str = "fixed",
    drive: Any = "free",
) -> Tree:
    """One straight link on the ground, clamped (``fixed``) or on a revolute joint."""
    tree: Tree = linkage(
        {"bar": {"length": length, "material": "m", "section": "s", "elements": elements}},
        {"root": {"type": root, "base": "ground", "follower": "bar.start"}},
        section=section,
        material={"youngs_modulus": E, "density": density},
    )
    if root == "revolute":
        tree["coordinates"] = {"q1": {"joint": "root", "drive": drive}}
    return tree
