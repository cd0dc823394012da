"""Two beams on elastic drives with a motor and a tool, as a mapping that `load_case` reads."""

from typing import Any

from spatial_cases import linkage

ALLOY = {"youngs_modulus": 70e9, "density": 2700}
TWO_LINKS: dict[str, Any] = linkage(
    {
        "a": {"length": 0.6, "material": "alloy", "section": "tube", "elements": 2},
        "b": {"length": 0.5, "material": "alloy", "section": "rod", "elements": 2},
    },
    {
        "shoulder": {"type": "revolute", "base": "ground", "follower": "a.start"},
        "elbow": {"type": "revolute", "base": "a.end", "follower": "b.start"},
    },
    {
        "q1": {"joint": "shoulder", "drive": {"stiffness": 20000}},
        "q2": {"joint": "elbow", "drive": {"stiffness": 8000}},
    },
    sections={
        "tube": {"shape": "tube", "outer_diameter": 0.04, "inner_diameter": 0.03},
        "rod": {"shape": "circle", "diameter": 0.03},
    },
    materials={"alloy": ALLOY},
    bodies={"motor": {"at": "a.end", "mass": 0.5}, "tool": {"at": "b.end", "mass": 1.0}},
) | {
    "title": "two links on elastic drives",
    "trajectory": {"q": [[0.0, 0.2], [0.3, 0.8], [0.5, 1.4], [0.7, 2.0]], "duration": 1},
}
