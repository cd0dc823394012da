"""A case that is solved at once: one beam, one mass."""

TEXT = """\
title: A beam
mechanism:
  space: planar
  materials: {steel: {youngs_modulus: 210 GPa, density: 7850}}
  sections: {rod: {shape: circle, diameter: 20 mm}}
  links: {arm: {length: 0.5, material: steel, section: rod, elements: 2}}
  joints: {shoulder: {type: revolute, base: ground, follower: arm.start}}
  bodies: {tool: {at: arm.end, mass: 0.1}}
coordinates: {q1: {joint: shoulder}}
trajectory: {q: [[0], [1]], time: [0, 1]}
design: {m: {parameter: bodies.tool.mass, min: 0, max: 1}}
expansion: {order: 2, q: auto, y: auto, modes: [1]}
targets: [{mode: 1, frequency: 190 Hz}]
validation: {max_error: 50 %}
"""
