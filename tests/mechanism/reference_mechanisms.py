# ruff: noqa: E501  (case files)
"""Case files of mechanisms whose frequencies an independent frame program computed."""

from __future__ import annotations

import math

AREA = math.sqrt(4.0 * math.pi * 3.97e-8)  # of a solid rod; printed as 7.0632e-4 m2
TWO_LINK = """\
title: Two links
mechanism:
  space: planar
  materials: {aluminium: {youngs_modulus: 69e9, density: DENSITY}}
  sections: {rod: {area: AREA, bending_inertia: 3.97e-8}}
  links:
    upper: {length: 0.6, material: aluminium, section: rod, elements: 4}
    fore: {length: 0.45, material: aluminium, section: rod, elements: 3}
  joints:
    shoulder: {type: revolute, base: ground, follower: upper.start}
    elbow: {type: revolute, base: upper.end, follower: fore.start}
  bodies: {elbow: {at: upper.end, mass: MASS_1}, tip: {at: fore.end, mass: MASS_2, inertia: INERTIA}}
coordinates:
  q1: {joint: shoulder, angle: absolute, drive: DRIVE}
  q2: {joint: elbow, angle: absolute, drive: DRIVE}
""".replace("AREA", f"{AREA!r}").replace("DENSITY", f"{1.9 / AREA!r}")

FOUR_BAR = """\
title: Four-bar
mechanism:
  space: planar
  materials: {steel: {youngs_modulus: 200 GPa, density: 7800}}
  sections: {flat: {shape: rectangle, width: 20 mm, height: 4 mm}}
  links:
    crank: {length: 0.12, material: steel, section: flat, elements: 2}
    coupler: {length: 0.45, material: steel, section: flat, elements: 4}
    follower: {length: 0.4, material: steel, section: flat, elements: 4}
  joints:
    A: {type: revolute, base: ground, follower: crank.start}
    B: {type: revolute, base: crank.end, follower: coupler.start}
    D: {type: revolute, base: ground, follower: follower.start, position: [0.5, 0]}
    C: {type: revolute, base: coupler.end, follower: follower.end}
  assembly: {at: {crank: 30 deg}, guess: {B: 17 deg, D: 103 deg, C: 56 deg}}
coordinates: {crank: {joint: A, drive: DRIVE}}
"""

SLIDER_CRANK = """\
title: Slider-crank
mechanism:
  space: planar
  materials: {steel: {youngs_modulus: 200 GPa, density: 7800}}
  sections: {round: {shape: circle, diameter: 12 mm}}
  links:
    crank: {length: 0.15, material: steel, section: round, elements: 2}
    rod: {length: 0.45, material: steel, section: round, elements: 6}
    slider: {type: rigid, mass: 0.5}
  joints:
    bearing: {type: revolute, base: ground, follower: crank.start}
    crank_pin: {type: revolute, base: crank.end, follower: rod.start}
    guide: {type: prismatic, base: ground, follower: slider.start, axis: [1, 0]}
    wrist_pin: {type: revolute, base: rod.end, follower: slider.start}
  assembly: {guess: {guide: 0.6, crank_pin: 0, wrist_pin: 0}}
coordinates: {crank: {joint: bearing, drive: DRIVE}}
"""

ARM_3R = """\
title: Spatial 3R
mechanism:
  space: spatial
  materials: {aluminium: {youngs_modulus: 70 GPa, density: 2700, poissons_ratio: 0.33}}
  sections: {tube: {shape: tube, outer_diameter: 40 mm, inner_diameter: 34 mm}}
  links:
    column: {length: 0.3, material: aluminium, section: tube, elements: 2}
    upper: {length: 0.5, material: aluminium, section: tube, elements: 4}
    fore: {length: 0.4, material: aluminium, section: tube, elements: 4}
  joints:
    yaw: {type: revolute, base: ground, follower: column.start, axis: [2, 0, 0], orientation: [0, -90 deg, 0]}
    shoulder: {type: revolute, base: column.end, follower: upper.start, axis: [0, -1, 0], orientation: [0, 90 deg, 0]}
    elbow: {type: revolute, base: upper.end, follower: fore.start, axis: [0, -1, 0]}
  bodies: {tip: {at: fore.end, mass: 1}}
coordinates:
  q1: {joint: yaw, drive: DRIVE}
  q2: {joint: shoulder, drive: DRIVE}
  q3: {joint: elbow, drive: DRIVE}
"""

GANTRY = """\
title: Gantry
mechanism:
  space: planar
  materials: {steel: {youngs_modulus: 210 GPa, density: 7850}}
  sections: {square: {shape: rectangle, width: 50 mm, height: 50 mm}}
  links:
    left: {length: 0.8, material: steel, section: square, elements: 6}
    girder: {length: 1.6, material: steel, section: square, elements: 12}
    right: {length: 0.8, material: steel, section: square, elements: 6}
    carriage: {type: rigid, mass: 3}
  joints:
    left_foot: {type: fixed, base: ground, follower: left.start, angle: 90 deg}
    left_corner: {type: fixed, base: left.end, follower: girder.start, angle: -90 deg}
    right_corner: {type: fixed, base: girder.end, follower: right.start, angle: -90 deg}
    right_foot: {type: fixed, base: ground, follower: right.end, position: [1.6, 0], angle: -90 deg}
    rail: {type: carriage, base: girder, follower: carriage.start}
coordinates: {x: {joint: rail, drive: DRIVE}}
"""


def two_link(drive: str, masses: tuple[float, float] = (0.0, 0.0), inertia: float = 0.0) -> str:
    """The two-link arm with added masses at elbow and tip, and a rotary inertia at the tip."""
    text = TWO_LINK.replace("MASS_1", f"{masses[0]}").replace("MASS_2", f"{masses[1]}")
    return text.replace("INERTIA", f"{inertia}").replace("DRIVE", drive)
