"""Charts of shipped cases with a small effort, each made once; random arms."""

import re
from functools import cache
from pathlib import Path

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


def random_arm(motion: str, design: str, seed: int) -> str:
    """Two rods; the elbow turns once or twice, or the tip moves; a mass or a length varies."""
    draw = np.random.default_rng(seed).uniform
    text = (CASES.parent / "benchmarks" / "small_arm.yaml").read_text()
    text = text.partition("trajectory:")[0].replace("0.5", f"{draw(0.5, 0.7)}")
    angles = [np.sort(draw(20.0, 160.0, 5)) for _ in range(2)]
    q = [", ".join(f"[0, {angle} deg]" for angle in own) for own in angles]
    (x, y), end = draw([0.4, 0.3], [0.5, 0.35]), "samples: 6, branch: {elbow: [0, 180 deg]}}"
    ranges = {"mass": "bodies.tool.mass, min: 0.1", "length": "links.fore.length, min: 0.4"}
    paths = {
        "none": "expansion: {q: [0, 1]}",
        "one": f"trajectory: {{q: [{q[0]}], duration: 1}}",
        "several": "trajectory: [" + ", ".join(
            f"{{name: n{k}, q: [{own}], duration: 1}}" for k, own in enumerate(q)) + "]",
        "tip": f"trajectory: {{tip: fore.end, waypoints: [[{x}, {y}], [{x - 0.1}, {y}]], {end}",
    }  # fmt: skip
    if design in ranges:
        text += f"design: {{v: {{parameter: {ranges[design]}, max: {draw(0.5, 0.7)}}}}}\n"
    return text + paths[motion]
