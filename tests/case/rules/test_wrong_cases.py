# ruff: noqa: E501  (a table)
"""Every mistake has its own message, at its own key, in its own line and column; and only one."""

from pathlib import Path

import pytest
from mistakes import Wrong, problems_of
from small_case import edited, unmarked

# fmt: off
MECHANISM = [
    Wrong("misspelt top key", "validation:", "¦validaton:", "validaton", "did you mean 'validation'"),
    Wrong("unknown key without neighbour", "title: Arm", "title: Arm\n¦zzz: 1", "zzz", "allowed: title"),
    Wrong("missing title", "title: Arm\n", "¦", "title", "required key is missing"),
    Wrong("empty title", "title: Arm", '¦title: ""', "title", "expected some text"),
    Wrong("number as title", "title: Arm", "¦title: 12", "title", "expected text"),
    Wrong("title of two lines", "title: Arm", '¦title: "a\\nb"', "title", "one line of printable"),
    Wrong("endless title", "title: Arm", "¦title: " + "x" * 201, "title", "longer than 200"),
    Wrong("misspelt space", "space: planar", "¦space: plannar", "mechanism.space", "did you mean 'planar'"),
    Wrong("group that is text", "bodies:\n    tool: {at: hand.end, mass: 0.1}", "¦bodies: none", "mechanism.bodies", "expected a mapping"),
    Wrong("empty group", "coordinates:\n  q1: {joint: shoulder}", "coordinates:\n  ¦q0:\n  q1: {joint: shoulder}", "coordinates.q0", "has no value"),
    Wrong("misspelt material property", "density: 2700", "density: 2700, ¦densty: 1", "mechanism.materials.alu.densty", "did you mean 'density'"),
    Wrong("missing modulus", "alu: {youngs_modulus: 69 GPa, ", "¦alu: {", "mechanism.materials.alu.youngs_modulus", "missing: pressure or modulus (in Pa"),
    Wrong("wrong dimension", "youngs_modulus: 69 GPa", "¦youngs_modulus: 69 mm", "mechanism.materials.alu.youngs_modulus", "got '69 mm', which is length"),
    Wrong("zero modulus", "youngs_modulus: 69 GPa", "¦youngs_modulus: 0", "mechanism.materials.alu.youngs_modulus", "must be > 0 Pa"),
    Wrong("negative density", "density: 2700", "¦density: -2700", "mechanism.materials.alu.density", "must be >= 0 kg/m3"),
    Wrong("NaN", "density: 2700", "¦density: .nan", "mechanism.materials.alu.density", "must be a finite number, got .nan"),
    Wrong("minus infinity", "density: 2700", "¦density: -.inf", "mechanism.materials.alu.density", "must be a finite number, got -.inf"),
    Wrong("overflow", "density: 2700", "¦density: 1e999", "mechanism.materials.alu.density", "must be a finite number"),
    Wrong("overflow through its unit", "density: 2700", "¦density: 1e308 g/mm3", "mechanism.materials.alu.density", "must be a finite number"),
    Wrong("number of 500 digits", "density: 2700", "¦density: " + "9" * 500, "mechanism.materials.alu.density", "must be a finite number"),
    Wrong("boolean as number", "density: 2700", "¦density: true", "mechanism.materials.alu.density", "expected a density (in kg/m3 when bare; or g/cm3), got true"),
    Wrong("list as number", "density: 2700", "¦density: [2700]", "mechanism.materials.alu.density", "got a list"),
    Wrong("underscores in a number", "density: 2700", "¦density: 2_700", "mechanism.materials.alu.density", "unknown unit '_700'"),
    Wrong("decimal comma", "diameter: 30 mm", "¦diameter: '0,03 m'", "mechanism.sections.rod.diameter", "decimals take a point"),
    Wrong("unknown unit", "diameter: 30 mm", "¦diameter: 30 Mm", "mechanism.sections.rod.diameter", "did you mean 'mm'"),
    Wrong("unknown shape", "shape: circle", "¦shape: cirlce", "mechanism.sections.rod.shape", "did you mean 'circle'"),
    Wrong("shape is a list", "shape: circle", "¦shape: [circle]", "mechanism.sections.rod.shape", "expected one of bare, circle"),
    Wrong("section is a number", "rod: {shape: circle, diameter: 30 mm}", "¦rod: 30 mm", "mechanism.sections.rod", "expected a mapping"),
    Wrong("key of another shape", "shape: circle, diameter: 30 mm", "shape: circle, diameter: 30 mm, ¦width: 1 mm", "mechanism.sections.rod.width", "allowed: shape, diameter"),
    Wrong("zero area", "area: 7.0632e-4", "¦area: 0", "mechanism.sections.bar.area", "must be > 0 m2"),
    Wrong("bare section without inertia", "bar: {area: 7.0632e-4, bending_inertia: 3.97e-8}", "¦bar: {area: 7.0632e-4}", "mechanism.sections.bar.bending_inertia", "missing: second moment of area"),
    Wrong("tube without wall", "pipe: {shape: tube, outer_diameter: 40 mm, thickness: 2 mm}", "¦pipe: {shape: tube, outer_diameter: 40 mm}", "mechanism.sections.pipe", "either inner_diameter or thickness"),
    Wrong("tube with two walls", "pipe: {shape: tube,", "¦pipe: {shape: tube, inner_diameter: 36 mm,", "mechanism.sections.pipe", "and not both"),
    Wrong("wall over the radius", "thickness: 2 mm", "¦thickness: 21 mm", "mechanism.sections.pipe.thickness", "at most half of outer_diameter, which is 0.02 m"),
    Wrong("inside out tube", "thickness: 2 mm", "¦inner_diameter: 40 mm", "mechanism.sections.pipe.inner_diameter", "less than outer_diameter, which is 0.04 m"),
    Wrong("negative length", "length: 0.45", "¦length: -0.45", "mechanism.links.fore.length", "must be > 0 m, got -0.45"),
    Wrong("no elements", "elements: 3", "¦elements: 0", "mechanism.links.fore.elements", "must be >= 1, got 0"),
    Wrong("half an element", "elements: 3", "¦elements: 3.5", "mechanism.links.fore.elements", "expected a whole number, got 3.5"),
    Wrong("boolean elements", "elements: 3", "¦elements: true", "mechanism.links.fore.elements", "expected a whole number, got true"),
    Wrong("too many elements", "elements: 3", "¦elements: 100001", "mechanism.links.fore.elements", "must be <= 100000"),
    Wrong("too many elements in all", "elements: 3", "¦elements: 20000", "mechanism.links.fore.elements", "the mechanism has 20005 elements: more than 20000 take minutes"),
    Wrong("unknown material", "material: alu, section: pipe", "¦material: allu, section: pipe", "mechanism.links.fore.material", "did you mean 'alu'"),
    Wrong("unknown section", "section: pipe", "¦section: pip", "mechanism.links.fore.section", "did you mean 'pipe'"),
    Wrong("material is a number", "material: alu, section: pipe", "¦material: 5, section: pipe", "mechanism.links.fore.material", "expected text"),
    Wrong("loose link", "links:\n", "links:\n    ¦lose: {length: 1, material: alu, section: rod, elements: 1}\n", "mechanism.links.lose", "no joint holds this link"),
    Wrong("link named ground", "links:\n", "links:\n    ¦ground: {length: 1, material: alu, section: rod, elements: 1}\n", "mechanism.links.ground", "is the fixed frame"),
    Wrong("name with a dot", "bodies:\n", "bodies:\n    ¦a.b: {at: fore.end}\n", "mechanism.bodies.a.b", "not a usable name"),
    Wrong("unknown joint type", "wrist: {type: fixed", "wrist: {¦type: fixd", "mechanism.joints.wrist.type", "did you mean 'fixed'"),
    Wrong("joint without type", "wrist: {type: fixed, ", "¦wrist: {", "mechanism.joints.wrist.type", "missing: one of revolute, prismatic"),
    Wrong("unknown base", "base: ground", "¦base: gruond", "mechanism.joints.shoulder.base", "did you mean 'ground'"),
    Wrong("base without end", "base: fore.end", "¦base: fore", "mechanism.joints.wrist.base", "expected ground or 'fore.start' or 'fore.end', got 'fore'"),
    Wrong("unknown follower", "follower: hand.start", "¦follower: hnd.start", "mechanism.joints.wrist.follower", "did you mean 'hand'"),
    Wrong("ground as follower", "follower: hand.start", "¦follower: ground", "mechanism.joints.wrist.follower", "make it the base"),
    Wrong("position of one number", "base: ground,", "base: ground, ¦position: [1],", "mechanism.joints.shoulder.position", "planar: needs 2 components (x, y), got 1"),
    Wrong("ring", "shoulder: {type: revolute, base: ground", "¦shoulder: {type: revolute, base: hand.end", "mechanism.joints.shoulder", "shoulder, elbow, wrist join upper, fore, hand, but no joint connects these to the ground"),
    Wrong("body off its link", "at: hand.end", "¦at: hand", "mechanism.bodies.tool.at", "expected 'hand.start' or 'hand.end'"),
    Wrong("body on nothing", "at: hand.end", "¦at: haand.end", "mechanism.bodies.tool.at", "did you mean 'hand'"),
    Wrong("negative mass", "mass: 0.1", "¦mass: -0.1", "mechanism.bodies.tool.mass", "must be >= 0 kg"),
]
STUDY = [
    Wrong("unknown joint", "joint: shoulder", "¦joint: sholder", "coordinates.q1.joint", "did you mean 'shoulder'"),
    Wrong("coordinate of a fixed joint", "coordinates:", "coordinates:\n  q0: {¦joint: wrist}", "coordinates.q0.joint", "is fixed and has no coordinate; joints that move: shoulder, elbow"),
    Wrong("joint with two coordinates", "coordinates:\n  q1: {joint: shoulder}\n  q2: {joint: elbow", "coordinates:\n  q0: {joint: elbow}\n  q1: {joint: shoulder}\n  q2: {¦joint: elbow", "coordinates.q2.joint", "has a coordinate already: 'q0'"),
    Wrong("joint without coordinate", "wrist: {type: fixed", "¦wrist: {type: revolute", "mechanism.joints.wrist", "no coordinate: add one under coordinates, e.g. q3: {joint: wrist}"),
    Wrong("misspelt drive", "joint: shoulder", "joint: shoulder, ¦drive: loked", "coordinates.q1.drive", "did you mean 'locked'"),
    Wrong("slack drive", "stiffness: 100", "¦stiffness: 0", "coordinates.q2.drive.stiffness", "must be > 0 N m/rad"),
    Wrong("torque as stiffness", "stiffness: 100", "¦stiffness: 100 N m", "coordinates.q2.drive.stiffness", "which is torque or energy"),
    Wrong("drive that does nothing", "drive: {stiffness: 100}", "¦drive: {}", "coordinates.q2.drive", "needs stiffness, inertia or both"),
    Wrong("inertia of a drive as mass", "stiffness: 100", "¦inertia: 100 g", "coordinates.q2.drive.inertia", "expected a rotary inertia"),
    Wrong("ratio without a motor", "stiffness: 100", "stiffness: 100, ¦ratio: 100", "coordinates.q2.drive.ratio", "has no effect without motor_inertia"),
    Wrong("ratio of zero", "stiffness: 100", "motor_inertia: 1 kg cm2, ¦ratio: 0", "coordinates.q2.drive.ratio", "must be > 0"),
    Wrong("ratio with a unit", "stiffness: 100", "motor_inertia: 1 kg cm2, ¦ratio: 100 rad/m", "coordinates.q2.drive.ratio", "expected a number without unit"),
    Wrong("inertia of a motor twice", "stiffness: 100", "inertia: 1, ¦motor_inertia: 1 kg cm2", "coordinates.q2.drive.motor_inertia", "give it or inertia, not both"),
    Wrong("inertia of a motor as mass", "stiffness: 100", "¦motor_inertia: 1 kg", "coordinates.q2.drive.motor_inertia", "expected a rotary inertia"),
    Wrong("ratio of a drive without one", "parameter: sections.rod.diameter, min: 20 mm", "¦parameter: coordinates.q2.drive.ratio, min: 20 mm", "design.d.parameter", "has no drive ratio: write drive"),
    Wrong("negative inertia of a drive", "stiffness: 100", "stiffness: 100, ¦inertia: -1", "coordinates.q2.drive.inertia", "must be >= 0 kg m2"),
    Wrong("misspelt angle", "angle: absolute", "¦angle: absolut", "coordinates.q2.angle", "did you mean 'absolute'"),
    Wrong("tip off the arm", "tip: hand.end", "¦tip: hand", "trajectory.tip", "expected 'hand.start' or 'hand.end'"),
    Wrong("motion of no kind", "trajectory:\n  tip: hand.end", "¦trajectory:\n  tp: hand.end", "trajectory", "expected one of the keys tip"),
    Wrong("one waypoint", "waypoints: [[0.3, 0.1], [0.2, 0.2]]", "¦waypoints: [[0.3, 0.1]]", "trajectory.waypoints", "needs at least 2 entries, got 1"),
    Wrong("waypoint in space", "[0.2, 0.2]", "¦[0.2, 0.2, 0.2]", "trajectory.waypoints[1]", "planar: needs 2 components (x, y), got 3"),
    Wrong("waypoint twice", "[0.2, 0.2]", "¦[0.3, 0.1]", "trajectory.waypoints[1]", "the same point as the one before"),
    Wrong("misspelt timing", "tip: hand.end", "tip: hand.end\n  ¦timing: quintik", "trajectory.timing", "did you mean 'quintic'"),
    Wrong("angles for fewer waypoints", "tip: hand.end", "tip: hand.end\n  ¦angle: [0, 1, 2]", "trajectory.angle", "3 for 2 waypoints"),
    Wrong("angle in metres", "tip: hand.end", "tip: hand.end\n  angle: [0, ¦2 m]", "trajectory.angle[1]", "angle"),
    Wrong("orientation in a plane", "tip: hand.end", "tip: hand.end\n  ¦orientation: [0, 0, 1]", "trajectory.orientation", "in a plane write angle"),
    Wrong("all acceleration", "tip: hand.end", "tip: hand.end\n  timing: trapezoidal\n  ¦acceleration_share: 0.6", "trajectory.acceleration_share", "must be <= 0.5"),
    Wrong("share of a quintic", "tip: hand.end", "tip: hand.end\n  ¦acceleration_share: 0.3", "trajectory.acceleration_share", "quintic has no such share"),
    Wrong("motion without time", "tip: hand.end", "tip: hand.end\n  ¦duration: 0 s", "trajectory.duration", "must be > 0 s"),
    Wrong("a single sample", "tip: hand.end", "tip: hand.end\n  ¦samples: 1", "trajectory.samples", "must be >= 2"),
    Wrong("start of another length", "tip: hand.end", "tip: hand.end\n  ¦start: [1]", "trajectory.start", "needs 2 entries, one for each coordinate (q1, q2); got 1"),
    Wrong("branch of no joint", "branch: {elbow:", "branch: {¦elbo:", "trajectory.branch.elbo", "did you mean 'elbow'"),
    Wrong("branch of a fixed joint", "branch: {elbow:", "branch: {¦wrist:", "trajectory.branch.wrist", "unknown joint with one freedom 'wrist'"),
    Wrong("branch upside down", "elbow: [10 deg, 170 deg]", "¦elbow: [170 deg, 10 deg]", "trajectory.branch.elbow", "low must be below high"),
    Wrong("branch in bare degrees", "elbow: [10 deg, 170 deg]", "¦elbow: [10, 170]", "trajectory.branch.elbow", "in rad when bare"),
    Wrong("parameter of nothing", "parameter: bodies.tool.mass", "¦parameter: bodies.tol.mass", "design.m.parameter", "did you mean 'tool'"),
    Wrong("parameter that is no property", "parameter: bodies.tool.mass", "¦parameter: bodies.tool.mas", "design.m.parameter", "did you mean 'mass'"),
    Wrong("parameter of no group", "parameter: bodies.tool.mass", "¦parameter: body.tool.mass", "design.m.parameter", "did you mean 'bodies'"),
    Wrong("parameter without its group", "parameter: bodies.tool.mass", "¦parameter: tool.mass", "design.m.parameter", "did you mean 'bodies.tool.mass'?"),
    Wrong("drive with a misspelt property", "parameter: sections.rod.diameter, min: 20 mm", "¦parameter: coordinates.q2.drive.stifness, min: 20 mm", "design.d.parameter", "did you mean 'stiffness'"),
    Wrong("parameter below mechanism", "parameter: bodies.tool.mass", "¦parameter: mechanism.bodies.tool.mass", "design.m.parameter", "write 'bodies.tool.mass'"),
    Wrong("whole number as parameter", "parameter: bodies.tool.mass", "¦parameter: links.fore.elements", "design.m.parameter", "not a real number and cannot vary; can vary: length"),
    Wrong("text as parameter", "parameter: bodies.tool.mass", "¦parameter: links.fore.material", "design.m.parameter", "not a real number"),
    Wrong("parameter without value", "parameter: sections.rod.diameter, min: 20 mm", "¦parameter: sections.pipe.inner_diameter, min: 20 mm", "design.d.parameter", "has no value in this file"),
    Wrong("stiffness of a free joint", "parameter: sections.rod.diameter, min: 20 mm", "¦parameter: coordinates.q1.drive.stiffness, min: 20 mm", "design.d.parameter", "has no drive stiffness: write drive"),
    Wrong("inertia of a drive without one", "parameter: sections.rod.diameter, min: 20 mm", "¦parameter: coordinates.q2.drive.inertia, min: 20 mm", "design.d.parameter", "has no drive inertia: write drive"),
    Wrong("stiffness of no coordinate", "parameter: sections.rod.diameter, min: 20 mm", "¦parameter: coordinates.q7.drive.stiffness, min: 20 mm", "design.d.parameter", "unknown coordinate 'q7'"),
    Wrong("parameter twice", "parameter: sections.rod.diameter, min: 20 mm, max: 40 mm", "¦parameter: bodies.tool.mass, min: 0, max: 1", "design.d.parameter", "is a design parameter already: 'm'"),
    Wrong("min above max", "min: 20 mm", "¦min: 50 mm", "design.d.min", "min 0.05 is above max 0.04"),
    Wrong("bound the property cannot have", "min: 20 mm", "¦min: 0", "design.d.min", "must be > 0 m"),
    Wrong("bound in another unit", "min: 20 mm", "¦min: 20 g", "design.d.min", "which is mass"),
    Wrong("missing bound", "d: {parameter: sections.rod.diameter, min: 20 mm,", "¦d: {parameter: sections.rod.diameter,", "design.d.min", "required key is missing"),
    Wrong("NaN bound", "min: 20 mm", "¦min: .nan", "design.d.min", "must be a finite number, got .nan"),
    Wrong("constraint on nothing", "terms: {m: 1}", "terms: {¦mm: 1}", "design.constraints.budget.terms.mm", "did you mean 'm'"),
    Wrong("constraint without bounds", "budget: {terms: {m: 1}, max: 200 g}", "¦budget: {terms: {m: 1}}", "design.constraints.budget", "needs min, max or both"),
    Wrong("constraint upside down", "max: 200 g}", "max: 200 g, ¦min: 1 kg}", "design.constraints.budget.min", "is above max"),
    Wrong("constraint without weight", "terms: {m: 1}", "¦terms: {m: 0}", "design.constraints.budget.terms", "all coefficients are zero"),
    Wrong("constraint without terms", "terms: {m: 1}", "¦terms: {}", "design.constraints.budget.terms", "needs at least 1 entries, got 0"),
    Wrong("coefficient with a unit", "terms: {m: 1}", "terms: {¦m: 1 kg}", "design.constraints.budget.terms.m", "expected a number without unit"),
    Wrong("sum of unlike things", "terms: {m: 1}, max: 200 g", "terms: {m: 1, d: 1}, ¦max: 200 g", "design.constraints.budget.max", "terms of different dimensions"),
    Wrong("order 0", "order: 4", "¦order: 0", "expansion.order", "must be >= 1, got 0"),
    Wrong("order 40", "order: 4", "¦order: 40", "expansion.order", "must be <= 20, got 40"),
    Wrong("order as text", "order: 4", "¦order: four", "expansion.order", "expected 'auto', or a whole number, got 'four'"),
    Wrong("expansion point too short", "order: 4", "order: 4, ¦q: [1.8]", "expansion.q", "needs 2 entries, one for each coordinate (q1, q2); got 1"),
    Wrong("expansion point in Hz", "order: 4", "order: 4, q: [1.8, ¦2 Hz]", "expansion.q[1]", "expected an angle"),
    Wrong("misspelt auto", "order: 4", "order: 4, ¦q: atuo", "expansion.q", "did you mean 'auto'"),
    Wrong("design point too long", "order: 4", "order: 4, ¦y: [0, 0.03, 0]", "expansion.y", "one for each design parameter (m, d); got 3"),
    Wrong("design point in another unit", "order: 4", "order: 4, y: [0.1, ¦3 g]", "expansion.y[1]", "expected a length"),
    Wrong("mode 0", "modes: [1, 2]", "modes: [1, ¦0]", "expansion.modes[1]", "must be >= 1"),
    Wrong("mode twice", "modes: [1, 2]", "modes: [1, ¦1]", "expansion.modes[1]", "is listed twice"),
    Wrong("no modes", "modes: [1, 2]", "¦modes: []", "expansion.modes", "needs at least 1 entries"),
    Wrong("two targets for a mode", "- {mode: 1, frequency: 190 Hz}", "- {mode: 1, frequency: 190 Hz}\n  - {¦mode: 1, frequency: 200 Hz}", "targets[1].mode", "has a target already"),
    Wrong("empty entry of a list", "{mode: 1, frequency: 190 Hz}", "¦~", "targets[0]", "has no value: give one, or leave the key out"),
    Wrong("body where none is", "parameter: bodies.tool.mass", "¦parameter: bodies.hand.mass", "design.m.parameter", "unknown body 'hand'; known: tool"),
    Wrong("targets without list", "targets:\n  - {mode: 1, frequency: 190 Hz}", "¦targets: {mode: 1, frequency: 190 Hz}", "targets", "expected a list, got a mapping; of one entry it is [{...}]"),
    Wrong("all modes as one", "{mode: 1, frequency: 190 Hz}", "{¦mode: all, frequency: 190 Hz}", "targets[0].mode", "got 'all': write modes: all"),
    Wrong("target in rad/s", "frequency: 190 Hz", "¦frequency: 190 rad/s", "targets[0].frequency", "divide by 2π and write Hz"),
    Wrong("target in rpm", "frequency: 190 Hz", "¦frequency: 190 rpm", "targets[0].frequency", "rpm and turns are not converted"),
    Wrong("target of zero", "frequency: 190 Hz", "¦frequency: 0", "targets[0].frequency", "must be > 0 Hz"),
    Wrong("time standing still", "frequency: 190 Hz", "frequency: {time: [0, 1, ¦1], frequency: [1, 2, 3]}", "targets[0].frequency.time[2]", "time must increase"),
    Wrong("profile of unequal lists", "frequency: 190 Hz", "frequency: {¦time: [0, 1], frequency: [1, 2, 3]}", "targets[0].frequency.time", "2 times for 3 frequencies"),
    Wrong("profile that ends early", "frequency: 190 Hz", "frequency: {¦time: [0, 0.5], frequency: [1, 2]}", "targets[0].frequency.time", "covers 0 … 0.5 s only; the trajectory lasts from 0 to 1 s"),
    Wrong("weightless target", "frequency: 190 Hz", "frequency: 190 Hz, ¦weight: 0", "targets[0].weight", "must be > 0"),
    Wrong("no tolerance", "max_error: 2 %", "¦max_error: 0 %", "validation.max_error", "must be > 0"),
    Wrong("measurement of no mode", "validation:", "measurements:\n  - ¦{time: 0, frequency: 1, deviation: 1}\nvalidation:", "measurements[0].mode", "required key is missing"),
    Wrong("range of a sweep without an end", "validation:", "sweep: {parameters: {¦title: {min: 1, count: 2}}}\nvalidation:", "sweep.parameters.title.max", "required key is missing"),
]
MOTION = """\
  tip: hand.end
  waypoints: [[0.3, 0.1], [0.2, 0.2]]
  branch: {elbow: [10 deg, 170 deg]}
"""
SAMPLED = [
    Wrong("no clock", "trajectory:\n" + MOTION, "¦trajectory:\n  q: [[0, 0], [1, 1]]\n", "trajectory", "either time (one per sample) or duration"),
    Wrong("two clocks", "trajectory:\n" + MOTION, "¦trajectory:\n  q: [[0, 0], [1, 1]]\n  time: [0, 1]\n  duration: 1\n", "trajectory", "and not both"),
    Wrong("no sample", MOTION, "  ¦q: []\n  duration: 1\n", "trajectory.q", "needs at least 1 entries"),
    Wrong("time of a pose", MOTION, "  q: [[0, 0]]\n  ¦duration: 1\n", "trajectory.duration", "one sample is a pose at rest"),
    Wrong("times of a pose", MOTION, "  q: [[0, 0]]\n  ¦time: [0]\n", "trajectory.time", "got 1: one pose alone has no time"),
    Wrong("points of a pose", MOTION, "  ¦points: [[0, 0]]\n", "trajectory.points", "one pose is q: [[...]], alone"),
    Wrong("short row", MOTION, "  q: [[0, 0], ¦[1]]\n  duration: 1\n", "trajectory.q[1]", "needs 2 entries"),
    Wrong("text in a row", MOTION, "  q: [[0, 0], [1, ¦x]]\n  duration: 1\n", "trajectory.q[1][1]", "expected an angle"),
    Wrong("NaN in a row", MOTION, "  q: [[0, 0], [1, ¦.nan]]\n  duration: 1\n", "trajectory.q[1][1]", "must be a finite number"),
    Wrong("row that is no list", MOTION, "  q: [[0, 0], ¦1]\n  duration: 1\n", "trajectory.q[1]", "expected a list, got 1; of one entry it is [1]"),
    Wrong("fewer times than samples", MOTION, "  q: [[0, 0], [1, 1], [2, 2]]\n  ¦time: [0, 1]\n", "trajectory.time", "2 times for 3 samples"),
    Wrong("time running back", MOTION, "  q: [[0, 0], [1, 1]]\n  time: [1, ¦0]\n", "trajectory.time[1]", "time must increase: 0 s after 1 s"),
    Wrong("points without a clock", "trajectory:\n" + MOTION, "¦trajectory:\n  points: [[0, 0], [1, 1]]\n", "trajectory", "either times (one per point) or duration"),
    Wrong("short point", MOTION, "  points: [[0, 0], ¦[1]]\n  duration: 1\n", "trajectory.points[1]", "needs 2 entries"),
    Wrong("point in metres", MOTION, "  points: [[0, 0], [1, ¦2 m]]\n  duration: 1\n", "trajectory.points[1][1]", "angle"),
    Wrong("point twice", MOTION, "  points: [[0, 0], ¦[0, 0]]\n  duration: 1\n", "trajectory.points[1]", "give times instead"),
    Wrong("fewer times than points", MOTION, "  points: [[0, 0], [1, 1], [2, 2]]\n  ¦times: [0, 1]\n", "trajectory.times", "2 times for 3 points"),
    Wrong("times running back", MOTION, "  points: [[0, 0], [1, 1]]\n  times: [1, ¦0]\n", "trajectory.times[1]", "time must increase: 0 s after 1 s"),
    Wrong("missing file", MOTION, "  ¦file: nowhere.csv\n", "trajectory.file", "no such file"),
    Wrong("file and tip", MOTION, "  tip: hand.end\n  waypoints: [[0, 1], [1, 0]]\n  ¦file: nowhere.csv\n", "trajectory.file", "unknown key"),
]
# fmt: on


@pytest.mark.parametrize("wrong", [*MECHANISM, *STUDY, *SAMPLED], ids=lambda wrong: wrong.name)
def test_a_mistake_is_told_once_where_it_is_and_what_is_allowed(
    wrong: Wrong, tmp_path: Path
) -> None:
    text, places = unmarked(edited(wrong.old, wrong.new))
    found = problems_of(text, tmp_path / "case.yaml")
    assert [(line, column, path) for line, column, path, _ in found] == [
        (*places[0], wrong.path)
    ], found
    assert wrong.message in found[0][3]


def test_names_of_the_table_are_unique() -> None:
    names = [wrong.name for wrong in (*MECHANISM, *STUDY, *SAMPLED)]
    assert len(names) == len(set(names)) > 100


def messages(old: str, new: str, path: Path) -> list[str]:
    return [message for *_, message in problems_of(edited(old, new), path / "case.yaml")]


def test_a_decimal_comma_between_braces_is_recognised(tmp_path: Path) -> None:
    for number in ("0,03", "0,03 m"):
        found = messages("diameter: 30 mm", f"diameter: {number}", tmp_path)
        assert any("decimals take a point, not a comma" in message for message in found)


def test_misspelt_constraints_are_recognised(tmp_path: Path) -> None:
    found = messages("  constraints:", "  constraint:", tmp_path)
    assert "did you mean the reserved key 'constraints'?" in found


def test_bodies_that_no_file_has_are_unknown(tmp_path: Path) -> None:
    found = messages("  bodies:\n    tool: {at: hand.end, mass: 0.1}\n", "", tmp_path)
    assert "unknown body 'tool'; known: none" in found


def test_a_bound_that_is_wrong_is_not_compared_with_the_other(tmp_path: Path) -> None:
    (found,) = messages("min: 20 mm", "min: 20 Hz", tmp_path)
    assert "which is frequency" in found


def test_long_lists_of_names_are_cut_short(tmp_path: Path) -> None:
    many = "".join(f"    s{k}: {{shape: circle, diameter: 1}}\n" for k in range(40))
    text = edited("sections:\n", "sections:\n" + many).replace("section: pipe", "section: zzz")
    ((*_, message),) = problems_of(text, tmp_path / "case.yaml")
    assert message.endswith("s18, s19, …")
