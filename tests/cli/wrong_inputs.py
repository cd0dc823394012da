"""Wrong case files: a name, the file's bytes, what must be said, and which command finds it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

GOOD = """\
title: A small arm
mechanism:
  space: planar
  materials:
    steel: {youngs_modulus: 210 GPa, density: 7850}
  sections:
    rod: {shape: circle, diameter: 20 mm}
  links:
    upper: {length: 0.5, material: steel, section: rod, elements: 2}
    fore: {length: 0.4, material: steel, section: rod, elements: 2}
  joints:
    shoulder: {type: revolute, base: ground, follower: upper.start}
    elbow: {type: revolute, base: upper.end, follower: fore.start}
  bodies:
    tool: {at: fore.end, mass: 0.1}
coordinates:
  q1: {joint: shoulder}
  q2: {joint: elbow}
trajectory:
  tip: fore.end
  waypoints: [[0.5, 0.3], [0.4, 0.4], [0.3, 0.5]]
  samples: 5
  branch: {elbow: [0 deg, 180 deg]}
design:
  m: {parameter: bodies.tool.mass, min: 0, max: 1}
expansion: {order: 3, q: auto, y: auto, modes: [1]}
targets:
  - {mode: 1, frequency: 180 Hz}
validation: {max_error: 50 %}
"""


@dataclass(frozen=True)
class Wrong:
    """One wrong case file."""

    name: str
    content: bytes
    says: str
    command: str = "check"


def _edited(*changes: tuple[str, str]) -> bytes:
    text = GOOD
    for old, new in changes:
        assert text.count(old) == 1, (old, text.count(old))
        text = text.replace(old, new)
    return text.encode()


def _without(key: str) -> bytes:
    """GOOD without a top-level key and what is below it."""
    lines, skipping = [], False
    for line in GOOD.splitlines(keepends=True):
        skipping = line.startswith(f"{key}:") or (skipping and line[0] in " -")
        lines.append("" if skipping else line)
    return "".join(lines).encode()


def _bomb() -> bytes:
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{k}: &a{k} [" + ", ".join([f"*a{k - 1}"] * 9) + "]" for k in range(1, 12)]
    return "\n".join(lines).encode()


def wrong_inputs() -> Iterator[Wrong]:
    """The table."""
    STEEL = "{youngs_modulus: 210 GPa, density: 7850}"
    UPPER = "upper: {length: 0.5,"
    TOOL = "tool: {at: fore.end, mass: 0.1}"
    M = "{parameter: bodies.tool.mass, min: 0, max: 1}"
    yield Wrong("empty file", b"", "1:1: the file is empty")
    yield Wrong("only a comment", b"# nothing\n", "1:1: the file is empty")
    yield Wrong(
        "two documents",
        GOOD.encode() + b"---\n" + GOOD.encode(),
        "30:1: a second document starts here",
    )
    yield Wrong(
        "tabs",
        GOOD.replace("  space", "\tspace").encode(),
        "a tab cannot indent YAML: use spaces",
    )
    yield Wrong("binary", bytes(range(256)) * 4, "not UTF-8 text (byte 0x80)")
    yield Wrong(
        "not UTF-8",
        GOOD.replace("small", "sm\u00e4ll").encode("latin-1"),
        "1:12: not UTF-8 text (byte 0xe4)",
    )
    yield Wrong("deep nesting", b"title: " + b"[" * 10_000, "nested more than 50 levels deep")
    yield Wrong("alias bomb", _bomb(), "anchors (&) and aliases (*) are refused")
    yield Wrong(
        "a tag",
        _edited(("A small arm", "!!python/object:os.system x")),
        "1:8: title: tags (!) are refused",
    )
    yield Wrong(
        "a list at the top", b"- title\n- mechanism\n", "the file holds a list: expected keys"
    )
    yield Wrong(
        "broken YAML",
        _edited(("links:", "links: {")),
        "10:5: not valid YAML: while parsing a flow mapping",
    )
    yield Wrong(
        "a duplicate key",
        _edited(("  space: planar", "  space: planar\n  space: planar")),
        "mechanism.space: 'space' is given twice",
    )
    yield Wrong(
        "a misspelt top key",
        _edited(("targets:", "target:")),
        "target: unknown key; did you mean 'targets'?",
    )
    yield Wrong(
        "a misspelt property",
        _edited(("youngs_modulus", "young_modulus")),
        "young_modulus: unknown key; did you mean 'youngs_modulus'?",
    )
    yield Wrong("no mechanism", _without("mechanism"), "mechanism: required key is missing")
    yield Wrong("no title", _edited(("title: A small arm\n", "")), "title: required key is missing")
    yield Wrong(
        "text for a number",
        _edited((UPPER, "upper: {length: long,")),
        "links.upper.length: expected a length (in m when bare; or mm, cm, km), got text 'long'",
    )
    yield Wrong(
        "a boolean for a number",
        _edited((UPPER, "upper: {length: true,")),
        "links.upper.length: expected a length (in m when bare; or mm, cm, km), got true",
    )
    yield Wrong(
        "a list for a number",
        _edited((UPPER, "upper: {length: [1, 2],")),
        "links.upper.length: expected a length (in m when bare; or mm, cm, km), got a list",
    )
    yield Wrong(
        "a decimal comma",
        _edited((UPPER, "upper: {length: '0,5',")),
        "decimals take a point, not a comma: '0,5'",
    )
    yield Wrong(
        "not a number",
        _edited((UPPER, "upper: {length: .nan,")),
        "links.upper.length: must be a finite number, got .nan",
    )
    yield Wrong(
        "infinity",
        _edited((STEEL, "{youngs_modulus: .inf, density: 7850}")),
        "youngs_modulus: must be a finite number, got .inf",
    )
    yield Wrong(
        "a negative length",
        _edited((UPPER, "upper: {length: -0.5,")),
        "links.upper.length: must be > 0 m, got -0.5",
    )
    yield Wrong(
        "a length in kilograms",
        _edited((UPPER, "upper: {length: 0.5 kg,")),
        "got '0.5 kg', which is mass",
    )
    yield Wrong(
        "an unknown unit", _edited((UPPER, "upper: {length: 2 cubits,")), "unknown unit 'cubits'"
    )
    yield Wrong("rpm for hertz", _edited(("180 Hz", "180 rpm")), "targets[0].frequency: rpm")
    yield Wrong(
        "a zero area",
        _edited(("{shape: circle, diameter: 20 mm}", "{area: 0, bending_inertia: 1e-8}")),
        "sections.rod.area: must be > 0 m2, got 0",
    )
    yield Wrong(
        "an unknown shape",
        _edited(("shape: circle", "shape: triangle")),
        "unknown shape 'triangle'",
    )
    yield Wrong(
        "a tube without bore",
        _edited(
            (
                "{shape: circle, diameter: 20 mm}",
                "{shape: tube, outer_diameter: 20 mm, inner_diameter: 30 mm}",
            )
        ),
        "inner_diameter: must be less than outer_diameter, which is 0.02 m",
    )
    yield Wrong(
        "half an element",
        _edited(
            (
                "0.5, material: steel, section: rod, elements: 2",
                "0.5, material: steel, section: rod, elements: 2.5",
            )
        ),
        "elements: expected a whole number, got 2.5",
    )
    yield Wrong(
        "no elements",
        _edited(
            (
                "0.4, material: steel, section: rod, elements: 2",
                "0.4, material: steel, section: rod, elements: 0",
            )
        ),
        "elements: must be >= 1, got 0",
    )
    yield Wrong(
        "an unknown material",
        _edited(("0.4, material: steel", "0.4, material: steal")),
        "unknown material 'steal'; did you mean 'steel'?",
    )
    yield Wrong(
        "a joint on an unknown link",
        _edited(("base: upper.end", "base: uper.end")),
        "unknown link 'uper'; did you mean 'upper'?",
    )
    yield Wrong(
        "a joint without coordinate",
        _edited(("  q2: {joint: elbow}\n", "")),
        "joints.elbow: no coordinate",
    )
    yield Wrong(
        "a loop of links",
        _edited(("base: ground", "base: fore.end")),
        "but no joint connects these to the ground",
    )
    yield Wrong(
        "a spatial mechanism",
        _edited(("space: planar", "space: spatial")),
        "needs 3 components (x, y, z), got 2",
    )
    yield Wrong(
        "a body nowhere",
        _edited(("at: fore.end", "at: fore.middle")),
        "expected 'fore.start' or 'fore.end', got 'fore.middle'",
    )
    yield Wrong(
        "a negative mass",
        _edited((TOOL, "tool: {at: fore.end, mass: -1}")),
        "bodies.tool.mass: must be >= 0 kg, got -1",
    )
    yield Wrong(
        "no mass that moves",
        _edited((STEEL, "{youngs_modulus: 210 GPa, density: 0}"), ("mass: 0.1", "mass: 0")),
        "moves no mass",
    )
    yield Wrong(
        "an unreachable path",
        _edited(("[0.4, 0.4]", "[4.0, 0.4]")),
        "trajectory.waypoints: sample 1 (t = 0.25 s",
    )
    yield Wrong(
        "a branch never taken",
        _edited(("[0 deg, 180 deg]", "[1 deg, 2 deg]")),
        "trajectory.branch.elbow: sample 0",
    )
    yield Wrong(
        "one waypoint",
        _edited(("[[0.5, 0.3], [0.4, 0.4], [0.3, 0.5]]", "[[0.5, 0.3]]")),
        "waypoints: needs at least 2 entries, got 1",
    )
    yield Wrong(
        "a missing CSV file",
        _without("trajectory") + b"trajectory: {file: gone.csv}\n",
        "trajectory.file: no such file",
    )
    yield Wrong(
        "samples of the wrong width",
        _without("trajectory") + b"trajectory: {q: [[1, 2], [1]], duration: 1}\n",
        "trajectory.q[1]: needs 2 entries, one for each coordinate (q1, q2); got 1",
    )
    yield Wrong(
        "time that stands still",
        _without("trajectory") + b"trajectory: {q: [[1, 2], [1, 3]], time: [0, 0]}\n",
        "time must increase: 0 s after 0 s",
    )
    yield Wrong(
        "min above max",
        _edited((M, "{parameter: bodies.tool.mass, min: 2, max: 1}")),
        "min 2 is above max 1",
    )
    yield Wrong(
        "a parameter that is not there",
        _edited((M, "{parameter: bodies.tol.mass, min: 0, max: 1}")),
        "unknown body 'tol'; did you mean 'tool'?",
    )
    yield Wrong(
        "a parameter that is no real number",
        _edited((M, "{parameter: links.fore.elements, min: 1, max: 9}")),
        "links.fore.elements is not a real number",
    )
    yield Wrong(
        "a constraint on nothing",
        _edited((M, M + "\n  constraints: {sum: {terms: {n: 1}, max: 1}}")),
        "unknown design parameter 'n'",
    )
    yield Wrong(
        "order 0", _edited(("order: 3", "order: 0")), "expansion.order: must be >= 1, got 0"
    )
    yield Wrong(
        "order 40", _edited(("order: 3", "order: 40")), "expansion.order: must be <= 20, got 40"
    )
    yield Wrong(
        "an expansion point too short",
        _edited(("q: auto", "q: [1]")),
        "expansion.q: needs 2 entries",
    )
    yield Wrong("mode 0", _edited(("mode: 1,", "mode: 0,")), "targets[0].mode: must be >= 1, got 0")
    yield Wrong(
        "a mode beyond the model",
        _edited(("mode: 1,", "mode: 500,"), ("modes: [1]", "modes: [500]")),
        "the model has 12",
        "optimize",
    )
    yield Wrong(
        "a negative frequency",
        _edited(("180 Hz", "-180 Hz")),
        "targets[0].frequency: must be > 0 Hz, got '-180 Hz'",
    )
    yield Wrong(
        "a target that ends early",
        _edited(("180 Hz", "{time: [0, 0.5], frequency: [90, 95]}")),
        "targets[0].frequency.time: covers 0 … 0.5 s only",
    )
    yield Wrong(
        "a tolerance of nothing",
        _edited(("50 %", "0 %")),
        "validation.max_error: must be > 0, got '0 %'",
    )
    yield Wrong(
        "no targets", _without("targets"), "targets: is missing, and optimize needs it", "optimize"
    )
    yield Wrong(
        "no trajectory",
        _without("trajectory"),
        "trajectory: is missing, and optimize needs it",
        "optimize",
    )
    yield Wrong(
        "no design", _without("design"), "design: is missing, and optimize needs it", "optimize"
    )
