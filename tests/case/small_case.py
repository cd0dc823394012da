"""A small valid case file, and edits of it in which ``¦`` marks where a problem is expected."""

from __future__ import annotations

TEXT = """\
title: Arm
mechanism:
  space: planar
  materials:
    alu: {youngs_modulus: 69 GPa, density: 2700}
  sections:
    rod: {shape: circle, diameter: 30 mm}
    pipe: {shape: tube, outer_diameter: 40 mm, thickness: 2 mm}
    bar: {area: 7.0632e-4, bending_inertia: 3.97e-8}
  links:
    upper: {length: 0.6, material: alu, section: rod, elements: 4}
    fore: {length: 0.45, material: alu, section: pipe, elements: 3}
    hand: {length: 0.3, material: alu, section: bar, elements: 1}
  joints:
    shoulder: {type: revolute, base: ground, follower: upper.start}
    elbow: {type: revolute, base: upper.end, follower: fore.start}
    wrist: {type: fixed, base: fore.end, follower: hand.start, angle: 10 deg}
  bodies:
    tool: {at: hand.end, mass: 0.1}
coordinates:
  q1: {joint: shoulder}
  q2: {joint: elbow, angle: absolute, drive: {stiffness: 100}}
trajectory:
  tip: hand.end
  waypoints: [[0.3, 0.1], [0.2, 0.2]]
  branch: {elbow: [10 deg, 170 deg]}
design:
  m: {parameter: bodies.tool.mass, min: 0, max: 250 g}
  d: {parameter: sections.rod.diameter, min: 20 mm, max: 40 mm}
  constraints:
    budget: {terms: {m: 1}, max: 200 g}
expansion: {order: 4, modes: [1, 2]}
targets:
  - {mode: 1, frequency: 190 Hz}
validation: {max_error: 2 %}
"""


def edited(old: str, new: str) -> str:
    """``TEXT`` with its only ``old`` replaced by ``new``."""
    assert TEXT.count(old) == 1, f"{old!r} stands {TEXT.count(old)} times in the small case"
    return TEXT.replace(old, new)


def unmarked(text: str) -> tuple[str, list[tuple[int, int]]]:
    """``text`` without its ``¦`` marks, and the (1-based) line and column of each."""
    places = []
    while (i := text.find("¦")) >= 0:
        before = text[:i]
        places.append((before.count("\n") + 1, len(before.rpartition("\n")[2]) + 1))
        text = before + text[i + 1 :]
    return text, places
