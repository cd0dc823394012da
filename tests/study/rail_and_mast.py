"""A rail with a carriage beside a mast: decoupled, so that each half is an oracle of its own."""

import copy
from typing import Any

from chains import Tree, case_of
from spatial_cases import linkage

from eigassign import Case

HEIGHT = {"parameter": "sections.rail.height", "min": 0.02, "max": 0.05}
LAMP = {"parameter": "bodies.lamp.mass", "min": 0.2, "max": 3.0}
OUT = {"points": [[0.2], [0.9]], "duration": 1.0, "samples": 31}


def tree(targets: list[Tree] | None = None, coupled: float = 0.0, **more: Any) -> Tree:
    """Both on the ground, or at the end of a foot of that length in m."""
    beam = {"material": "steel", "elements": 6}
    found: Tree = linkage(
        {
            "rail": {**beam, "length": 1.0, "section": "rail"},
            "mast": {**beam, "length": 0.7, "section": "mast", "elements": 3},
            "carriage": {"type": "rigid", "mass": 1.0},
        },
        {
            "rail_foot": {"type": "fixed", "base": "ground", "follower": "rail.start"},
            "mast_foot": {"type": "fixed", "base": "ground", "follower": "mast.start"},
            "slide": {"type": "carriage", "base": "rail", "follower": "carriage.start"},
        },
        {"x": {"joint": "slide", "drive": "locked"}},
        materials={"steel": {"youngs_modulus": 210e9, "density": 7800.0}},
        sections={
            name: {"shape": "rectangle", "width": 0.02, "height": 0.03} for name in ("rail", "mast")
        },
        bodies={"lamp": {"at": "mast.end", "mass": 0.9}, "end": {"at": "rail.end", "mass": 0.2}},
    )
    found |= {"trajectory": OUT, "design": {"height": HEIGHT, "lamp": LAMP}}
    found |= {} if targets is None else {"targets": targets}
    if coupled:
        mechanism = found["mechanism"]
        mechanism["sections"]["foot"] = {"shape": "rectangle", "width": 0.1, "height": 0.1}
        beam = {"length": coupled, "material": "steel", "section": "foot", "elements": 1}
        mechanism["links"]["foot"] = beam
        foot = {"type": "fixed", "base": "ground", "follower": "foot.start"}
        mechanism["joints"] |= {
            name: {"type": "fixed", "base": "foot.end", "follower": f"{half}.start"}
            for name, half in (("rail_foot", "rail"), ("mast_foot", "mast"))
        } | {"foot": foot}
    return found | more


def case(targets: list[Tree], coupled: float = 0.0, **more: Any) -> Case:
    return case_of(tree(targets, coupled, **more))


def alone(half: str) -> Case:
    """The rail with its carriage, or the mast: of the mast the frequencies do not depend on x."""
    found = copy.deepcopy(tree())
    mechanism = found["mechanism"]
    for gone in ("rail", "mast"):
        if gone != half:
            if gone == "mast":
                del mechanism["links"][gone], mechanism["bodies"]["lamp"]
            else:
                del mechanism["links"][gone], mechanism["links"]["carriage"]
                del mechanism["bodies"]["end"], mechanism["joints"]["slide"]
            del mechanism["joints"][f"{gone}_foot"], mechanism["sections"][gone]
    if half == "mast":
        found |= {"coordinates": {}, "design": {"lamp": LAMP}}
        del found["trajectory"]
    else:
        found |= {"design": {"height": HEIGHT}}
    return case_of(found)
