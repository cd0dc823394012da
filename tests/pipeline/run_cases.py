"""Case files made from the shipped one, and chains of any length."""

from pathlib import Path

from scenes import automatic, changed

from eigassign import Case, load_case
from eigassign.case import parse
from eigassign.pipeline import Options, Result, solve_case
from eigassign.study import AssignmentRow

SHIPPED = Path(__file__).parents[2] / "cases" / "two_link.yaml"
UNCACHED = Options(use_cache=False)
__all__ = ["automatic", "changed"]  # of other tests' too
shipped = changed
TOOL_MASS = "m2: {parameter: bodies.tool_mass.mass, min: 0, max: 250 g}"
TARGET = "{mode: 1, frequency: 190 Hz}"
DESIGN = """\
design:
  m1: {parameter: bodies.elbow_mass.mass, min: 0, max: 250 g}
  m2: {parameter: bodies.tool_mass.mass, min: 0, max: 250 g}
"""
TAIL = "\nexpansion: {order: 2, q: [1.817, 5.312], y: auto, modes: [1]}\ntargets:\n"
ONE_SHOT = "\nassignment: {method: one_shot}\n"


def without(text: str, *keys: str) -> str:
    """The text without some of its top-level keys."""
    kept, skipping = [], False
    for line in text.splitlines():
        if line and not line[0].isspace() and not line.startswith("#"):
            skipping = line.split(":")[0] in keys
        if not skipping:
            kept.append(line)
    return "\n".join(kept) + "\n"


def moving(*poses: tuple[float, ...], text: str) -> str:
    """The text with joint samples for a trajectory, over one second."""
    rows = ", ".join(str(list(pose)) for pose in poses)
    return without(text, "trajectory") + f"trajectory: {{q: [{rows}], duration: 1 s}}\n"


def held(text: str) -> str:
    """The shipped case on geared drives, under its weight."""
    return changed(
        ("{joint: shoulder}", "{joint: shoulder, drive: {stiffness: 2e5}}"),
        ("absolute}", "absolute, drive: {stiffness: 1e5, inertia: 0.02}}"),
        ("  space: planar", "  space: planar\n  gravity: [0, -9.81]"),
        text=text,
    )


def answered(text: str) -> tuple[Result, AssignmentRow]:
    result = solve_case(Case(parse(text.encode(), "case.yaml")))
    return result, result.results.assignment


def written(folder: Path, text: str, name: str = "case.yaml") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def case_of(folder: Path, text: str) -> Case:
    return load_case(written(folder, text))


def solved(folder: Path, text: str) -> Result:
    """The solution of a case, computed once for each text that names no other files."""
    if "file:" in text:
        return solve_case(case_of(folder, text), UNCACHED)
    if text not in _SOLVED:
        _SOLVED[text] = solve_case(case_of(folder, text), UNCACHED)
    return _SOLVED[text]


_SOLVED: dict[str, Result] = {}


def chain(n: int, drive: str = "free", angle: str = "relative", target: float = 200.0) -> str:
    """A planar chain of n tapering links with a designed mass at each end, gently moving."""
    sections = [f"s{i}: {{shape: circle, diameter: {30 - 3 * i} mm}}" for i in range(n)]
    links = [
        f"l{i}: {{length: {0.5 - 0.07 * i}, material: al, section: s{i}, elements: 3}}"
        for i in range(n)
    ]
    bases = ["ground", *(f"l{i}.end" for i in range(n - 1))]
    joints = [f"j{i}: {{type: revolute, base: {bases[i]}, follower: l{i}.start}}" for i in range(n)]
    bodies = [f"b{i}: {{at: l{i}.end, mass: 0.05, inertia: 1e-5}}" for i in range(n)]
    drives = [drive, *["free"] * (n - 1)]
    coordinates = [f"q{i}: {{joint: j{i}, angle: {angle}, drive: {drives[i]}}}" for i in range(n)]
    design = [f"m{i}: {{parameter: bodies.b{i}.mass, min: 0, max: 100 g}}" for i in range(n)]
    poses = [
        [round(0.3 + 0.2 * i + 0.1 * k / 10 * (1 + i), 9) for i in range(n)] for k in range(11)
    ]
    return f"""
title: Chain of {n}
mechanism:
  space: planar
  materials:
    al: {{youngs_modulus: 69 GPa, density: 2690}}
  sections:{_lines(sections, 4)}
  links:{_lines(links, 4)}
  joints:{_lines(joints, 4)}
  bodies:{_lines(bodies, 4)}
coordinates:{_lines(coordinates, 2)}
design:{_lines(design, 2)}
trajectory: {{duration: 1 s, q: {poses}}}
targets:
  - {{mode: 1, frequency: {target} Hz}}
"""


def _lines(entries: list[str], indent: int) -> str:
    return "".join("\n" + " " * indent + entry for entry in entries)
