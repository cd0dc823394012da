"""Charts of shipped cases with a small effort, each made once; random arms."""

import re
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from eigassign import load_case
from eigassign.chart import Chart, ChartPoint, Effort, Finding, compare_methods

CASES = Path(__file__).parents[2] / "cases"
SMALL = Effort(
    designs=4, instants=8, coefficients=700, learnt=(25,), kriged=(), elements=(1, 2, 4, 8),
    boxes=4, repeats=1,
)  # fmt: skip
CANTILEVER = """title: Cantilever
mechanism:
  space: planar
  materials: {m: {youngs_modulus: 70 GPa, density: 2700}}
  sections: {s: {shape: circle, diameter: 20 mm}}
  links: {l: {length: 0.5, material: m, section: s, elements: 1}}
  joints: {j: {type: fixed, base: ground, follower: l.start}}
coordinates: {}
design: {E: {parameter: materials.m.youngs_modulus, min: 60 GPa, max: 80 GPa}}
"""


@cache
def charted(name: str | Path, accuracy: float = 1e-2) -> Chart:
    return compare_methods(load_case((CASES / name).with_suffix(".yaml")), SMALL, accuracy)


def rows_of(chart: Chart, curve: str) -> dict[str, ChartPoint]:
    """The points of a curve by the number in their size."""
    sizes = ((re.search(r"\d+", p.size), p) for p in chart.points if p.curve == curve)
    return {size[0]: p for size, p in sizes if size}


def found(chart: Chart, kind: str) -> Finding:
    (one,) = [each for each in chart.findings if each.kind == kind]
    return one


def random_arm(motion: str, design: str, seed: int) -> dict[str, Any]:
    """Two rods; the elbow turns, or both joints, so that the tip moves; lengths or masses vary."""
    draw = np.random.default_rng(seed).uniform
    lengths, room = draw(0.4, 0.7, 2), draw(0.05, 0.3)
    upper = {"length": lengths[0], "material": "m", "section": "s", "elements": 1}
    varied = {
        "none": {},
        "mass": {"m": {"parameter": "bodies.tool.mass", "min": 0.1, "max": 0.1 + room}},
        "length": {"l": {"parameter": "links.fore.length", "min": 0.5, "max": 0.5 + room}},
    }
    angles = {name: np.sort(draw(20.0, 160.0, 5)) for name in ("there", "more")}
    paths = {
        name: {"q": [[0, f"{a} deg"] for a in own], "duration": 1} for name, own in angles.items()
    }
    start = np.array([0.45, 0.3]) + draw(-0.05, 0.05, 2)
    moved = [list(start + k * np.array([-0.05, 0.04])) for k in range(3)]
    tip = {
        "tip": "fore.end",
        "waypoints": moved,
        "samples": 6,
        "duration": 1,
        "branch": {"elbow": [0, "180 deg"]},
    }
    trajectory = {
        "one": paths["there"], "several": [{"name": k, **own} for k, own in paths.items()],
        "tip": tip,
    }  # fmt: skip
    case = {
        "title": "Arm",
        "mechanism": {
            "space": "planar",
            "materials": {"m": {"youngs_modulus": draw(5e10, 2e11), "density": 2700}},
            "sections": {"s": {"shape": "circle", "diameter": 0.02}},
            "links": {"upper": upper, "fore": {**upper, "length": lengths[1]}},
            "joints": {
                "shoulder": {"type": "revolute", "base": "ground", "follower": "upper.start"},
                "elbow": {"type": "revolute", "base": "upper.end", "follower": "fore.start"},
            },
            "bodies": {"tool": {"at": "fore.end", "mass": 0.1}},
        },
        "coordinates": {"q1": {"joint": "shoulder"}, "q2": {"joint": "elbow"}},
        "design": varied[design],
    }
    given = trajectory.get(motion)
    return {**case, "trajectory": given} if given else {**case, "expansion": {"q": [0, 1.0]}}
