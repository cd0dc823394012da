# ruff: noqa: E501  (a table)
"""Mistakes in links, joints, springs, loops and spatial parts: each told once, at its place."""

from pathlib import Path

import pytest
from mistakes import Wrong, problems_of
from small_case import unmarked
from wide_cases import PLANAR, SPATIAL, changed, write

# fmt: off
LINKS = [
    Wrong("hinge", "A: {type: revolute, base: ground", "A: {¦type: hinge, base: ground", "mechanism.joints.A.type", "unknown type 'hinge'; did you mean 'revolute'?"),
    Wrong("world", "A: {type: revolute, base: ground", "A: {type: revolute, ¦base: world", "mechanism.joints.A.base", "unknown link 'world'; did you mean 'ground'?"),
    Wrong("unknown link type", "{type: rigid, length: 0.2, mass: 5}", "{¦type: rigit, length: 0.2, mass: 5}", "mechanism.links.cart.type", "did you mean 'rigid'"),
    Wrong("link type is a number", "{type: rigid, length: 0.2, mass: 5}", "{¦type: 5, length: 0.2, mass: 5}", "mechanism.links.cart.type", "expected one of beam, rigid, frame, superelement"),
    Wrong("elements of a rigid link", "{type: rigid, length: 0.2, mass: 5}", "{type: rigid, length: 0.2, mass: 5, ¦elements: 3}", "mechanism.links.cart.elements", "allowed: type, nodes, length, mass, inertia, center"),
    Wrong("beam without length", "rail: {type: beam, length: 2, ", "¦rail: {type: beam, ", "mechanism.links.rail.length", "required key is missing: length"),
    Wrong("shear is a word", "elements: 4, shear: true", "elements: 4, ¦shear: yes", "mechanism.links.rod.shear", "expected true or false, got 'yes'"),
    Wrong("roll in a plane", "elements: 4, shear: true", "elements: 4, ¦roll: 90 deg", "mechanism.links.rod.roll", "is for spatial mechanisms"),
    Wrong("taper without end", "section: {start: bar, end: thin}", "¦section: {start: bar}", "mechanism.links.rod.section.end", "required key is missing"),
    Wrong("taper to nothing", "section: {start: bar, end: thin}", "section: {start: bar, ¦end: thinn}", "mechanism.links.rod.section.end", "did you mean 'thin'"),
    Wrong("taper between shapes", "section: {start: bar, end: thin}", "¦section: {start: bar, end: profile}", "mechanism.links.rod.section", "sections of one shape, given by the same keys: 'bar' and 'profile' are not"),
    Wrong("section is a list", "section: {start: bar, end: thin}", "¦section: [bar, thin]", "mechanism.links.rod.section", "expected text"),
    Wrong("flanges that meet", "flange_thickness: 5 mm", "¦flange_thickness: 40 mm", "mechanism.sections.profile.flange_thickness", "less than half of height"),
    Wrong("web wider than its flanges", "web_thickness: 3 mm", "¦web_thickness: 41 mm", "mechanism.sections.profile.web_thickness", "at most width, which is 0.04 m"),
    Wrong("profile without web", ", web_thickness: 3 mm", "", "mechanism.sections.profile.web_thickness", "required key is missing: length"),
    Wrong("Poisson's ratio of a liquid", "poissons_ratio: 0.3", "¦poissons_ratio: 0.5", "mechanism.materials.steel.poissons_ratio", "must be < 0.5, got 0.5"),
    Wrong("impossible Poisson's ratio", "poissons_ratio: 0.3", "¦poissons_ratio: -1", "mechanism.materials.steel.poissons_ratio", "must be > -1"),
    Wrong("bound of a Poisson's ratio with a unit", "coordinates.place.drive.stiffness, min: 1 kN/m, max: 4 kN/m", "materials.steel.poissons_ratio, ¦min: 0.1 mm, max: 0.4", "design.d.min", "expected a number without unit, got text '0.1 mm'"),
    Wrong("Poisson's ratio with a unit", "poissons_ratio: 0.3", "¦poissons_ratio: 30 %", "mechanism.materials.steel.poissons_ratio", "expected a number without unit"),
    Wrong("both shear constants", "poissons_ratio: 0.3", "poissons_ratio: 0.3, ¦shear_modulus: 80 GPa", "mechanism.materials.steel.shear_modulus", "not both"),
    Wrong("shear without its modulus", "steel: {youngs_modulus: 210 GPa, density: 7850, poissons_ratio: 0.3}", "¦steel: {youngs_modulus: 210 GPa, density: 7850}", "mechanism.materials.steel", "a beam with shear: true uses it"),
    Wrong("node in space", "pin: [0, 10 mm]}", "¦pin: [0, 10 mm, 0]}", "mechanism.links.slider.nodes.pin", "planar: needs 2 components (x, y), got 3"),
    Wrong("node that is a number", "pin: [0, 10 mm]}", "¦pin: 10 mm}", "mechanism.links.slider.nodes.pin", "expected a list, got '10 mm'"),
    Wrong("node in kilograms", "pin: [0, 10 mm]}", "pin: [0, ¦10 kg]}", "mechanism.links.slider.nodes.pin[1]", "expected a length"),
    Wrong("node with a dot", "{type: rigid, length: 0.2, mass: 5}", "{type: rigid, length: 0.2, mass: 5, nodes: {¦a.b: [0, 0]}}", "mechanism.links.cart.nodes.a.b", "not a usable name"),
    Wrong("end given twice", "{type: rigid, length: 0.2, mass: 5}", "{type: rigid, length: 0.2, mass: 5, nodes: {¦end: [0, 0]}}", "mechanism.links.cart.nodes.end", "given by length already"),
    Wrong("centre in space", "center: [5 mm, 0]", "¦center: [5 mm, 0, 0]", "mechanism.links.slider.center", "needs 2 components"),
    Wrong("tensor in a plane", "inertia: 0.1,", "¦inertia: [1, 1, 1],", "mechanism.links.slider.inertia", "planar: one number, about the axis out of the plane"),
    Wrong("negative mass of a rigid link", "length: 0.2, mass: 5", "length: 0.2, ¦mass: -5", "mechanism.links.cart.mass", "must be >= 0 kg"),
    Wrong("frame without start", "nodes: {start: [0, 0], tip: [0.2, 0]", "¦nodes: {foot: [0, 0], tip: [0.2, 0]", "mechanism.links.bracket.nodes", "a frame needs a node 'start'"),
    Wrong("beam from nowhere", "{from: start, to: tip,", "{¦from: strat, to: tip,", "mechanism.links.bracket.beams.lower.from", "did you mean 'start'"),
    Wrong("beam without an end", "lower: {from: start, to: tip,", "¦lower: {from: start,", "mechanism.links.bracket.beams.lower.to", "required key is missing"),
    Wrong("beam of no length", "{from: start, to: tip,", "{from: start, to: tip,", "mechanism.links.bracket.beams.lower", "the same place"),
    Wrong("beam to itself", "brace: {from: tip, to: top,", "brace: {from: tip, to: top, material: steel, section: bar}\n        ¦loop: {from: top, to: top,", "mechanism.links.bracket.beams.loop", "has no length: 'top' and 'top'"),
    Wrong("loose frame node", "top: [0, 200 mm]}", "top: [0, 200 mm], ¦extra: [1, 1]}", "mechanism.links.bracket.nodes.extra", "no beams connect extra with 'start'"),
    Wrong("frame beam of no material", "to: tip, material: steel", "to: tip, ¦material: stel", "mechanism.links.bracket.beams.lower.material", "did you mean 'steel'"),
    Wrong("frame beam of no section", "to: tip, material: steel, section: bar", "to: tip, material: steel, ¦section: barr", "mechanism.links.bracket.beams.lower.section", "did you mean 'bar'"),
    Wrong("misspelt key of a frame beam", "to: top, material: steel, section: bar, elements: 2}", "to: top, material: steel, section: bar, ¦element: 2}", "mechanism.links.bracket.beams.brace.element", "allowed: from, to, material, section, elements, shear, roll"),
    Wrong("half an element of a frame", "to: top, material: steel, section: bar, elements: 2}", "to: top, material: steel, section: bar, ¦elements: 0.5}", "mechanism.links.bracket.beams.brace.elements", "expected a whole number"),
    Wrong("missing matrix", "stiffness: K.mtx", "¦stiffness: N.mtx", "mechanism.links.plate.stiffness", "no such file"),
    Wrong("part without mass", "    plate:\n      type: superelement\n      stiffness: K.mtx\n      mass: M.npz\n", "    ¦plate:\n      type: superelement\n      stiffness: K.mtx\n", "mechanism.links.plate.mass", "required key is missing: mass, or file, which holds both"),
    Wrong("mass beside a file of both", "      stiffness: K.mtx\n      mass: M.npz", "      file: K.mtx\n      ¦mass: M.npz", "mechanism.links.plate.mass", "stands beside file, which holds both"),
    Wrong("units of no system", "reduce_to: 2 kHz", "reduce_to: 2 kHz\n      ¦units: mm-kg-s", "mechanism.links.plate.units", "expected"),
    Wrong("file of nodes that is not there", "reduce_to: 2 kHz", "reduce_to: 2 kHz\n      ¦nodes_file: gone.inp", "mechanism.links.plate.nodes_file", "no such file"),
    Wrong("files of nodes of which one is not there", "reduce_to: 2 kHz", "reduce_to: 2 kHz\n      nodes_file: [K.mtx, ¦gone.inp]", "mechanism.links.plate.nodes_file[1]", "no such file"),
    Wrong("node without number and rows", "left: {position: [0, 0], dofs: [0, 1, 2]}", "¦left: {position: [0, 0]}", "mechanism.links.plate.nodes.left.dofs", "required key is missing: dofs, or id"),
    Wrong("number of a node in words", "left: {position: [0, 0], dofs: [0, 1, 2]}", "left: {¦id: bore}", "mechanism.links.plate.nodes.left.id", "expected a whole number"),
    Wrong("one number of two nodes", "{left: {position: [0, 0], dofs: [0, 1, 2]}, right: {position: [0.3, 0], dofs: [9, 10, 11]}}", "{left: {id: 7}, right: {¦id: 7}}", "mechanism.links.plate.nodes.right.id", "node 7 is 'left' already"),
    Wrong("variable of a file that is not there", "mass: M.npz", "¦mass: gone.mat:M", "mechanism.links.plate.mass", "no such file"),
    Wrong("too few rows of a node", "dofs: [0, 1, 2]", "¦dofs: [0, 1]", "mechanism.links.plate.nodes.left.dofs", "needs at least 3 entries, got 2"),
    Wrong("spatial rows in a plane", "dofs: [0, 1, 2]", "¦dofs: [0, 1, 2, 3, 4, 5]", "mechanism.links.plate.nodes.left.dofs", "needs 3 entries, the rows of u_x, u_y, θ_z; got 6"),
    Wrong("row of two nodes", "dofs: [9, 10, 11]", "dofs: [9, 10, ¦2]", "mechanism.links.plate.nodes.right.dofs[2]", "row 2 belongs to node 'left' already"),
    Wrong("row before the first", "dofs: [9, 10, 11]", "dofs: [9, 10, ¦-1]", "mechanism.links.plate.nodes.right.dofs[2]", "must be >= 0"),
    Wrong("interface node in space", "position: [0.3, 0]", "¦position: [0.3, 0, 0]", "mechanism.links.plate.nodes.right.position", "needs 2 components"),
    Wrong("reduction in rad/s", "reduce_to: 2 kHz", "¦reduce_to: 2000 rad/s", "mechanism.links.plate.reduce_to", "divide by 2π"),
]
JOINTS = [
    Wrong("spatial joint in a plane", "hung: {type: fixed,", "hung: {¦type: spherical,", "mechanism.joints.hung.type", "a spherical joint is spatial; planar mechanisms have revolute, prismatic, fixed, carriage"),
    Wrong("axis in a plane", "A: {type: revolute, base: ground,", "A: {type: revolute, base: ground, ¦axis: [0, 0, 1],", "mechanism.joints.A.axis", "turns about z: leave the axis out"),
    Wrong("axis without direction", "axis: [1, 0.1]", "¦axis: [0, 0]", "mechanism.joints.guide.axis", "all components are zero"),
    Wrong("axis in metres", "axis: [1, 0.1]", "axis: [1, ¦0.1 m]", "mechanism.joints.guide.axis[1]", "expected a number without unit"),
    Wrong("axis of three components", "axis: [1, 0.1]", "¦axis: [1, 0.1, 0]", "mechanism.joints.guide.axis", "planar: needs 2 components (x, y), got 3"),
    Wrong("orientation in a plane", "angle: 90 deg", "¦orientation: [0, 0, 0]", "mechanism.joints.wall.orientation", "in a plane write angle"),
    Wrong("axis of a fixed joint", "hung: {type: fixed,", "hung: {type: fixed, ¦axis: [1, 0],", "mechanism.joints.hung.axis", "allowed: type, base, follower, position, angle, orientation"),
    Wrong("unknown node", "follower: slider.pin", "¦follower: slider.pinn", "mechanism.joints.pin.follower", "expected 'slider.start' or 'slider.pin', got 'slider.pinn'; did you mean 'pin'"),
    Wrong("node of a frame that is not there", "base: bracket.tip", "¦base: bracket.end", "mechanism.joints.hung.base", "expected ground or 'bracket.start' or 'bracket.tip' or 'bracket.top'"),
    Wrong("end of a rigid link without length", "follower: slider.start", "¦follower: slider.end", "mechanism.joints.guide.follower", "expected 'slider.start' or 'slider.pin'"),
    Wrong("carriage on a node", "base: rail,", "¦base: rail.start,", "mechanism.joints.ride.base", "rides along a beam: expected one of crank, rod, rail, got 'rail.start'; did you mean 'rail'"),
    Wrong("two carriages on a beam", "    ride: {type: carriage, base: rail, follower: cart.start}", "    ride: {type: carriage, base: rail, follower: cart.start}\n    hunt: {type: carriage, ¦base: rail, follower: cart.end}", "mechanism.joints.hunt.base", "'ride' travels along 'rail' already"),
    Wrong("carriage on a rigid link", "base: rail,", "¦base: slider,", "mechanism.joints.ride.base", "rides along a beam"),
    Wrong("joint within a link", "base: crank.end, follower: rod.start", "base: rod.end, follower: rod.start", "mechanism.joints.B", "the same link: a joint connects two"),
    Wrong("link without joint", "    cart: {type", "    ¦idle: {type: rigid, mass: 1}\n    cart: {type", "mechanism.links.idle", "no joint holds this link: add one with follower: idle.<node>"),
    Wrong("spring of no stiffness", "translational: [1 kN/m, 2 kN/m], rotational: 5, angle", "angle", "mechanism.springs.stop", "needs translational, rotational or both"),
    Wrong("negative spring", "translational: 100", "¦translational: -100", "mechanism.springs.soft.translational", "must be >= 0 N/m"),
    Wrong("spring in N", "translational: 100", "¦translational: 100 N", "mechanism.springs.soft.translational", "got '100 N', which is force"),
    Wrong("turning spring in N/m", "rotational: 5,", "¦rotational: 5 N/m,", "mechanism.springs.stop.rotational", "which is stiffness"),
    Wrong("spring list of another length", "translational: [1 kN/m, 2 kN/m]", "¦translational: [1, 2, 3]", "mechanism.springs.stop.translational", "needs 2 components"),
    Wrong("turning springs in a plane", "rotational: 5,", "¦rotational: [5, 5],", "mechanism.springs.stop.rotational", "planar: one number, about z"),
    Wrong("spring on one node", "between: [slider.pin, bracket.tip]", "¦between: [slider.pin, slider.pin]", "mechanism.springs.stop.between", "both ends are the same node"),
    Wrong("spring from nowhere", "between: [slider.pin, bracket.tip]", "between: [¦slidr.pin, bracket.tip]", "mechanism.springs.stop.between[0]", "did you mean 'slider'"),
    Wrong("spring with one end", "between: [plate.right, ground]", "¦between: [plate.right]", "mechanism.springs.soft.between[1]", "entry 2 is missing"),
    Wrong("body offset of one number", "offset: [0, 50 mm]", "¦offset: [50 mm]", "mechanism.bodies.weight.offset", "needs 2 components"),
]
STUDY = [
    Wrong("guess of nothing", "pin: 0}", "¦pinn: 0}", "mechanism.assembly.guess.pinn", "did you mean 'pin'"),
    Wrong("guess of a fixed joint", "pin: 0}", "¦wall: 0}", "mechanism.assembly.guess.wall", "is fixed: there is nothing to guess"),
    Wrong("guess list for one freedom", "pin: 0}", "¦pin: [0]}", "mechanism.assembly.guess.pin", "has one freedom: expected a number"),
    Wrong("guess of a slide in degrees", "guide: 500 mm", "¦guide: 5 deg", "mechanism.assembly.guess.guide", "expected a length"),
    Wrong("assembly at nothing", "at: {turn: 60 deg}", "at: {¦turm: 60 deg}", "mechanism.assembly.at.turm", "did you mean 'turn'"),
    Wrong("assembly angle in mm", "at: {turn: 60 deg}", "at: {¦turn: 60 mm}", "mechanism.assembly.at.turn", "expected an angle"),
    Wrong("component of another joint", "component: rotation}", "¦component: translation}", "coordinates.turn.component", "joint 'A' is revolute: expected rotation, got 'translation'"),
    Wrong("component that is no word", "component: rotation}", "¦component: spin}", "coordinates.turn.component", "expected 1, 2, 3, 'rotation' or 'translation', got 'spin'"),
    Wrong("component that is true", "component: rotation}", "¦component: true}", "coordinates.turn.component", "got true"),
    Wrong("absolute stroke", "place: {joint: ride,", "place: {joint: ride, ¦angle: absolute,", "coordinates.place.angle", "only the angle of a revolute joint can be absolute"),
    Wrong("drive of a slide in N m/rad", "stiffness: 3 kN/m,", "¦stiffness: 3 N m/rad,", "coordinates.place.drive.stiffness", "expected a stiffness (in N/m when bare"),
    Wrong("inertia of a slide's drive in kg m2", "inertia: 200 g}", "¦inertia: 1 kg m2}", "coordinates.place.drive.inertia", "expected a mass"),
    Wrong("slack drive of a slide", "stiffness: 3 kN/m,", "¦stiffness: 0,", "coordinates.place.drive.stiffness", "must be > 0 N/m, got 0"),
    Wrong("stroke in degrees", "[20 deg, 0.4]", "[20 deg, ¦4 deg]", "trajectory.q[1][1]", "expected a length"),
    Wrong("angle in millimetres", "[20 deg, 0.4]", "[¦20 mm, 0.4]", "trajectory.q[1][0]", "expected an angle"),
    Wrong("expansion stroke in degrees", "q: [15 deg, 35 cm]", "q: [15 deg, ¦35 deg]", "expansion.q[1]", "expected a length"),
    Wrong("list as design parameter", "springs.soft.translational, min: 50 N/m, max: 0.2 N/mm", "springs.stop.translational, min: 50 N/m, max: 0.2 N/mm", "design.k.parameter", "is a list in this file and cannot vary"),
    Wrong("spring angle as design parameter", "parameter: springs.soft.translational, min: 50 N/m, max: 0.2 N/mm", "¦parameter: springs.stop.angle, min: 0, max: 1", "design.k.parameter", "not a real number and cannot vary; can vary: translational, rotational"),
    Wrong("length of a frame", "parameter: links.slider.mass,", "¦parameter: links.bracket.length,", "design.m.parameter", "has no property 'length'"),
    Wrong("mass file as design parameter", "parameter: links.slider.mass,", "¦parameter: links.plate.mass,", "design.m.parameter", "not a real number"),
    Wrong("reduction as design parameter", "parameter: links.slider.mass,", "¦parameter: links.plate.reduce_to,", "design.m.parameter", "cannot vary; can vary: none"),
    Wrong("length that is not given", "parameter: links.slider.mass,", "¦parameter: links.slider.length,", "design.m.parameter", "has no value in this file"),
    Wrong("bounds of a slide's drive in N m/rad", "min: 1 kN/m, max: 4 kN/m", "¦min: 1 N m/rad, max: 4 kN/m", "design.d.min", "expected a stiffness"),
    Wrong("spring parameter of nothing", "parameter: springs.soft.translational,", "¦parameter: springs.sofd.translational,", "design.k.parameter", "unknown spring 'sofd'; did you mean 'soft'"),
]
IN_SPACE = [
    Wrong("vector of two components", "position: [0.1, 0, 0]", "¦position: [0.1, 0]", "mechanism.joints.ball.position", "spatial: needs 3 components (x, y, z), got 2"),
    Wrong("angle in space", "position: [0.1, 0, 0]", "¦angle: 10 deg", "mechanism.joints.ball.angle", "in space write orientation: [rx, ry, rz]"),
    Wrong("orientation of two angles", "orientation: [0, -90 deg, 0]", "¦orientation: [0, -90 deg]", "mechanism.joints.slip.orientation[2]", "entry 3 is missing"),
    Wrong("orientation in metres", "orientation: [0, -90 deg, 0]", "orientation: [0, ¦-90 mm, 0]", "mechanism.joints.slip.orientation[1]", "expected an angle"),
    Wrong("zero axis", "axis: [0, 0, 1], orientation", "¦axis: [0, 0, 0], orientation", "mechanism.joints.slip.axis", "all components are zero"),
    Wrong("planar axis", "axis: [0, 0, 1], orientation", "¦axis: [0, 1], orientation", "mechanism.joints.slip.axis", "needs 3 components"),
    Wrong("planar axis of a revolute joint", "follower: shaft.start, axis: [1, 0, 0]", "follower: shaft.start, ¦axis: [1, 0]", "mechanism.joints.motor.axis", "needs 3 components"),
    Wrong("universal joint with one axis", "axes: [[0, 1, 0], [0, 0, 1]]", "¦axes: [[0, 1, 0]]", "mechanism.joints.cross.axes[1]", "entry 2 is missing"),
    Wrong("universal joint without axes", "cross: {type: universal, base: one.end, follower: two.start, axes: [[0, 1, 0], [0, 0, 1]]}", "¦cross: {type: universal, base: one.end, follower: two.start}", "mechanism.joints.cross.axes", "required key is missing"),
    Wrong("parallel axes", "axes: [[0, 1, 0], [0, 0, 1]]", "¦axes: [[0, 1, 0], [0, -2, 0]]", "mechanism.joints.cross.axes", "the two axes are parallel"),
    Wrong("second axis zero", "axes: [[0, 1, 0], [0, 0, 1]]", "axes: [[0, 1, 0], ¦[0, 0, 0]]", "mechanism.joints.cross.axes[1]", "all components are zero"),
    Wrong("screw without lead", ", lead: 5 mm}", "}", "mechanism.joints.thread.lead", "required key is missing: length"),
    Wrong("screw that does not travel", "lead: 5 mm", "¦lead: 0", "mechanism.joints.thread.lead", "a screw travels as it turns"),
    Wrong("nut of no lead", "lead: 10 mm", "¦lead: 0 mm", "mechanism.joints.nut.lead", "must not be 0 m"),
    Wrong("lead in degrees", "lead: 5 mm", "¦lead: 5 deg", "mechanism.joints.thread.lead", "expected a length"),
    Wrong("nut beside its shaft", "lead: 10 mm}", "lead: 10 mm, ¦position: [0, 0, 5 mm]}", "mechanism.joints.nut.position", "a nut stands on the axis of its shaft"),
    Wrong("nut on a node of its shaft", "base: shaft, follower", "¦base: shaft.end, follower", "mechanism.joints.nut.base", "rides along a beam"),
    Wrong("no shear modulus in space", "steel: {youngs_modulus: 210 GPa, density: 7850, shear_modulus: 80 GPa}", "¦steel: {youngs_modulus: 210 GPa, density: 7850}", "mechanism.materials.steel", "beams in space twist"),
    Wrong("planar inertia in space", "inertia_z: 1 cm4,", "¦bending_inertia: 1 cm4,", "mechanism.sections.bare.bending_inertia", "in space write inertia_z"),
    Wrong("section that does not twist", " torsion_constant: 2 cm4,", "", "mechanism.sections.bare.torsion_constant", "required key is missing: second moment of area"),
    Wrong("both names of one inertia", "inertia_z: 1 cm4,", "¦inertia_z: 1 cm4, bending_inertia: 1 cm4,", "mechanism.sections.bare.inertia_z", "give one of them"),
    Wrong("no shear area", "shear_coefficient: 0.85", "¦shear_coefficient: 0", "mechanism.sections.bare.shear_coefficient", "must be > 0"),
    Wrong("one number as tensor", "inertia: [0.01, 0.02, 0.02]", "¦inertia: 0.01", "mechanism.bodies.load.inertia", "spatial: needs [Ixx, Iyy, Izz] or"),
    Wrong("tensor of four numbers", "inertia: [0.01, 0.02, 0.02]", "¦inertia: [1, 1, 1, 0]", "mechanism.bodies.load.inertia", "expected 3 (Ixx, Iyy, Izz) or 6"),
    Wrong("negative moment", "inertia: [0.01, 0.02, 0.02]", "¦inertia: [-0.01, 0.02, 0.02]", "mechanism.bodies.load.inertia", "not positive"),
    Wrong("products beyond the moments", "inertia: [1, 1, 1, 0, 0, 0.1]", "¦inertia: [1, 1, 1, 1.1, 0, 0]", "mechanism.links.three.inertia", "not positive"),
    Wrong("joint of many freedoms without component", "u1: {joint: cross, component: 1}", "¦u1: {joint: cross}", "coordinates.u1", "joint 'cross' is universal: say which of its freedoms this is, component: 1 or 2"),
    Wrong("third axis of a universal joint", "u1: {joint: cross, component: 1}", "u1: {joint: cross, ¦component: 3}", "coordinates.u1.component", "expected 1 or 2, got 3"),
    Wrong("component driven twice", "b2: {joint: ball, component: 2}", "b2: {¦joint: ball, component: 1}", "coordinates.b2.joint", "1 of joint 'ball' has a coordinate already: 'b1'"),
    Wrong("absolute angle in space", "t: {joint: thread}", "t: {joint: thread, ¦angle: absolute}", "coordinates.t.angle", "in space angles are relative"),
    Wrong("guess of a joint with many freedoms", "guess: {motor: -251.327, way: 0.4}", "guess: {motor: -251.327, way: 0.4, ¦slip: 1}", "mechanism.assembly.guess.slip", "needs a list of 2: translation, rotation; or of those without a coordinate"),
    Wrong("tensor as design parameter", "trajectory:", "design: {I: {¦parameter: bodies.load.inertia, min: 0, max: 1}}\ntrajectory:", "design.I.parameter", "is a tensor in space and cannot vary"),
    Wrong("roll as design parameter", "trajectory:", "design: {r: {¦parameter: links.one.roll, min: 0, max: 1}}\ntrajectory:", "design.r.parameter", "cannot vary; can vary: length"),
    Wrong("spring list of two in space", "rotational: [10, 0, 0]", "¦rotational: [10, 0]", "mechanism.springs.mount.rotational", "needs 3 components"),
    Wrong("spring angle in space", "orientation: [0, 0, 90 deg]", "¦angle: 90 deg", "mechanism.springs.mount.angle", "in space write orientation"),
]
# fmt: on
LATER = {  # the place of a mistake that the table cannot mark, or that another line shows
    "profile without web": "profile: {shape",
    "beam of no length": "lower: {from",
    "joint within a link": "B: {type",
    "base and follower exchanged": "hung: {type",
    "spring of no stiffness": "stop: {between",
    "list as design parameter": "parameter: springs.stop",
    "screw without lead": "thread: {type",
    "section that does not twist": "bare: {area",
}
ALSO = {  # what must change besides
    "beam of no length": [("tip: [0.2, 0]", "tip: [0 mm, 0]")],
    "frame without start": [("from: start", "from: foot"), ("bracket.start", "bracket.foot")],
}


@pytest.mark.parametrize("wrong", [*LINKS, *JOINTS, *STUDY], ids=lambda wrong: wrong.name)
def test_a_mistake_in_a_plane_is_told_once_where_it_is(wrong: Wrong, tmp_path: Path) -> None:
    text = changed(PLANAR, wrong.old, wrong.new)
    for old, new in ALSO.get(wrong.name, ()):
        text = changed(text, old, new)
    told_once(wrong, text, tmp_path)


@pytest.mark.parametrize("wrong", IN_SPACE, ids=lambda wrong: wrong.name)
def test_a_mistake_in_space_is_told_once_where_it_is(wrong: Wrong, tmp_path: Path) -> None:
    told_once(wrong, changed(SPATIAL, wrong.old, wrong.new), tmp_path)


def told_once(wrong: Wrong, text: str, folder: Path) -> None:
    if wrong.name in LATER:
        place = LATER[wrong.name]
        assert text.count(place) == 1
        text = text.replace(place, "¦" + place)
    text, places = unmarked(text)
    found = problems_of(text, write(folder, text))
    assert [(line, column, path) for line, column, path, _ in found] == [
        (*places[0], wrong.path)
    ], found
    assert wrong.message in found[0][3]


def test_an_open_mechanism_needs_a_coordinate_for_every_freedom(tmp_path: Path) -> None:
    text = SPATIAL.replace(
        "    nut: {type: nut, base: shaft, follower: table.start, lead: 10 mm}\n", ""
    )
    text = text.replace("  assembly: {at: {x: 400 mm}, guess: {motor: -251.327, way: 0.4}}\n", "")
    text = text.replace("  x: {joint: nut, drive: {stiffness: 1 N/um}}\n", "  m: {joint: motor}\n")
    text = text.replace("  b2: {joint: ball, component: 2}\n", "  w: {joint: way}\n")
    text = text.partition("trajectory:")[0]
    found = problems_of(text, write(tmp_path, text))
    assert [(path, message) for *_, path, message in found] == [
        (
            "mechanism.joints.ball",
            "no coordinate: add one under coordinates, e.g. q10: {joint: ball, component: 2}",
        )
    ]


def test_an_assembly_without_loops_has_nothing_to_choose(tmp_path: Path) -> None:
    text = changed(PLANAR, "    pin: {type: revolute, base: rod.end, follower: slider.pin}\n", "")
    found = problems_of(text, write(tmp_path, text))
    assert ("mechanism.assembly", "no joint closes a loop: there is nothing to choose") in [
        (path, message) for *_, path, message in found
    ]


def test_every_mistake_of_form_is_told_at_once_and_then_every_other(tmp_path: Path) -> None:
    form = {
        ("stiffness: K.mtx", "stiffness: N.mtx"): "mechanism.links.plate.stiffness",
        ("axis: [1, 0.1]", "axis: [0, 0]"): "mechanism.joints.guide.axis",
        ("translational: 100", "translational: 100 N"): "mechanism.springs.soft.translational",
    }
    other = {
        (
            "{from: start, to: tip,",
            "{from: strat, to: tip,",
        ): "mechanism.links.bracket.beams.lower.from",
        ("at: {turn: 60 deg}", "at: {turm: 60 deg}"): "mechanism.assembly.at.turm",
        ("stiffness: 3 kN/m,", "stiffness: 3 N m/rad,"): "coordinates.place.drive.stiffness",
    }
    text = PLANAR
    for mistakes in (other, form):
        for old, new in mistakes:
            text = changed(text, old, new)
        paths = {path for *_, path, _ in problems_of(text, write(tmp_path, text))}
        assert paths >= set(mistakes.values())


def test_names_of_the_tables_are_unique() -> None:
    names = [wrong.name for wrong in (*LINKS, *JOINTS, *STUDY, *IN_SPACE)]
    assert len(names) == len(set(names)) > 100
