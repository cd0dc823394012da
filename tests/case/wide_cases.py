# ruff: noqa: E501  (case files)
"""Two valid case files that use every key of a mechanism between them."""

from __future__ import annotations

from pathlib import Path

PLANAR = """\
title: Planar mechanism of many parts
mechanism:
  space: planar
  materials:
    steel: {youngs_modulus: 210 GPa, density: 7850, poissons_ratio: 0.3}
  sections:
    bar: {shape: rectangle, width: 20 mm, height: 10 mm}
    thin: {shape: rectangle, width: 20 mm, height: 8 mm}
    profile: {shape: i_profile, height: 80 mm, width: 40 mm, flange_thickness: 5 mm, web_thickness: 3 mm}
  links:
    crank: {length: 0.15, material: steel, section: bar, elements: 2}
    rod: {length: 0.5, material: steel, section: {start: bar, end: thin}, elements: 4, shear: true}
    slider: {type: rigid, nodes: {pin: [0, 10 mm]}, mass: 2, inertia: 0.1, center: [5 mm, 0]}
    bracket:
      type: frame
      nodes: {start: [0, 0], tip: [0.2, 0], top: [0, 200 mm]}
      beams:
        lower: {from: start, to: tip, material: steel, section: bar}
        brace: {from: tip, to: top, material: steel, section: bar, elements: 2}
    plate:
      type: superelement
      stiffness: K.mtx
      mass: M.npz
      nodes: {left: {position: [0, 0], dofs: [0, 1, 2]}, right: {position: [0.3, 0], dofs: [9, 10, 11]}}
      reduce_to: 2 kHz
    rail: {type: beam, length: 2, material: steel, section: profile, elements: 6}
    cart: {type: rigid, length: 0.2, mass: 5}
  joints:
    A: {type: revolute, base: ground, follower: crank.start}
    B: {type: revolute, base: crank.end, follower: rod.start}
    guide: {type: prismatic, base: ground, follower: slider.start, axis: [1, 0.1]}
    pin: {type: revolute, base: rod.end, follower: slider.pin}
    wall: {type: fixed, base: ground, follower: bracket.start, position: [0, 1], angle: 90 deg}
    hung: {type: fixed, base: bracket.tip, follower: plate.left}
    track: {type: fixed, base: ground, follower: rail.start, position: [0, -1]}
    ride: {type: carriage, base: rail, follower: cart.start}
  bodies:
    weight: {at: cart.end, mass: 1, inertia: 0.01, offset: [0, 50 mm]}
  springs:
    stop: {between: [slider.pin, bracket.tip], translational: [1 kN/m, 2 kN/m], rotational: 5, angle: 30 deg}
    soft: {between: [plate.right, ground], translational: 100}
  assembly:
    at: {turn: 60 deg}
    guess: {B: -75 deg, guide: 500 mm, pin: 0}
coordinates:
  turn: {joint: A, component: rotation}
  place: {joint: ride, drive: {stiffness: 3 kN/m, inertia: 200 g}}
trajectory:
  q: [[10 deg, 300 mm], [20 deg, 0.4]]
  duration: 1
design:
  k: {parameter: springs.soft.translational, min: 50 N/m, max: 0.2 N/mm}
  m: {parameter: links.slider.mass, min: 1, max: 3}
  d: {parameter: coordinates.place.drive.stiffness, min: 1 kN/m, max: 4 kN/m}
expansion: {q: [15 deg, 35 cm]}
validation: {q_span: [5 deg, 5 cm]}
"""

SPATIAL = """\
title: Spatial mechanism of many parts
mechanism:
  space: spatial
  materials:
    steel: {youngs_modulus: 210 GPa, density: 7850, shear_modulus: 80 GPa}
  sections:
    bare: {area: 4 cm2, inertia_y: 2 cm4, inertia_z: 1 cm4, torsion_constant: 2 cm4, polar_inertia: 3 cm4, shear_coefficient: 0.85}
    round: {shape: circle, diameter: 25 mm}
  links:
    one: {length: 1, material: steel, section: bare, elements: 2, roll: 30 deg}
    two: {length: 1, material: steel, section: round, elements: 2}
    three: {type: rigid, nodes: {far: [0, 0, 0.2]}, mass: 1, inertia: [1, 1, 1, 0, 0, 0.1]}
    four: {length: 1, material: steel, section: round, elements: 2}
    shaft: {length: 0.8, material: steel, section: round, elements: 4}
    table: {type: rigid, mass: 20, inertia: [1, 1, 1], center: [0, 0, 0.1]}
  joints:
    slip: {type: cylindrical, base: ground, follower: one.start, axis: [0, 0, 1], orientation: [0, -90 deg, 0]}
    cross: {type: universal, base: one.end, follower: two.start, axes: [[0, 1, 0], [0, 0, 1]]}
    ball: {type: spherical, base: two.end, follower: three.start, position: [0.1, 0, 0]}
    thread: {type: screw, base: three.far, follower: four.start, axis: [1, 0, 0], lead: 5 mm}
    motor: {type: revolute, base: ground, follower: shaft.start, axis: [1, 0, 0], position: [0, 3, 0]}
    way: {type: prismatic, base: ground, follower: table.start, axis: [1, 0, 0], position: [0, 3, 0]}
    nut: {type: nut, base: shaft, follower: table.start, lead: 10 mm}
  bodies:
    load: {at: four.end, mass: 1, inertia: [0.01, 0.02, 0.02], offset: [0, 0, 0.1]}
  springs:
    mount: {between: [shaft.start, ground], rotational: [10, 0, 0], orientation: [0, 0, 90 deg]}
  assembly: {at: {x: 400 mm}, guess: {motor: -251.327, way: 0.4}}
coordinates:
  s: {joint: slip, component: translation}
  r: {joint: slip, component: rotation}
  u1: {joint: cross, component: 1}
  u2: {joint: cross, component: 2, drive: locked}
  b1: {joint: ball, component: 1}
  b2: {joint: ball, component: 2}
  b3: {joint: ball, component: 3}
  t: {joint: thread}
  x: {joint: nut, drive: {stiffness: 1 N/um}}
trajectory:
  q: [[0, 0, 0, 0, 0, 0, 0, 0, 300 mm], [10 mm, 1 deg, 0, 0, 0, 0, 0, 100, 0.4]]
  time: [0, 1]
"""


def write(folder: Path, text: str) -> Path:
    """A file with the text, beside the matrix files that it names."""
    for name in ("K.mtx", "M.npz"):
        (folder / name).touch()
    path = folder / "case.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def changed(text: str, old: str, new: str) -> str:
    """``text`` with its only ``old`` replaced by ``new``."""
    assert text.count(old) == 1, f"{old!r} stands {text.count(old)} times"
    return text.replace(old, new)
