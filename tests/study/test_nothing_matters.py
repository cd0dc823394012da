"""Where no frequency depends on any variable, automatic orders are still orders."""

from __future__ import annotations

import numpy as np

from eigassign.case import parse
from eigassign.modal import discretisation_error, raise_order
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


def test_a_link_at_rest_has_no_share_in_the_error_of_the_mesh() -> None:
    """A slack post on the ground, of one element, does not move in the modes of the arm."""
    post = "post: {length: 0.6, material: steel, section: rod, elements: 1}"
    foot = "foot: {type: fixed, base: ground, follower: post.start}"
    text = TEXT.replace("elements: 4}}", f"elements: 4}}, {post}}}")
    text = text.replace("follower: arm.start}}", f"follower: arm.start}}, {foot}}}")
    case = BuiltCase(parse(text.encode(), "case.yaml"))
    model = case.model()
    x = model.x(case.trajectory.q, case.initial_design)
    for mode in (1, 2, 3, 4):
        found = discretisation_error(model.meshed, x, (mode,))
        assert not any(np.isnan(share).any() for share in found.links.values())
        assert 0.0 in (found.links["post"][0, 0], found.links["arm"][0, 0])
