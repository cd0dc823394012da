"""Where no frequency depends on any variable, automatic orders are still orders."""

from __future__ import annotations

from eigassign.case import parse
from eigassign.modal import raise_order
from eigassign.study import BuiltCase

TEXT = """
title: A locked arm and a material that no link is made of
mechanism:
  space: planar
  materials:
    steel: {youngs_modulus: 210 GPa, density: 7850}
    spare: {youngs_modulus: 70 GPa, density: 2700}
  sections: {rod: {shape: circle, diameter: 20 mm}}
  links: {arm: {length: 0.5, material: steel, section: rod, elements: 4}}
  joints: {base: {type: revolute, base: ground, follower: arm.start}}
coordinates: {q1: {joint: base, drive: locked}}
trajectory: {q: [[0], [0.5], [1.0]], duration: 1 s}
design: {rho: {parameter: materials.spare.density, min: 2000, max: 3000}}
expansion: {order: auto}
targets: [{mode: 1, frequency: 60 Hz}]
"""


def test_the_order_is_at_least_one() -> None:
    case = BuiltCase(parse(TEXT.encode(), "case.yaml"))
    model = case.model()
    x = model.x(case.trajectory.q, case.initial_design)
    chosen = raise_order(model.pencil, x, 1e-3)
    assert not model.pencil.active.any()
    assert chosen.order == 1
