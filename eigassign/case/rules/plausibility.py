"""Warnings: values that are allowed but look like a slip: wrong exponent, forgotten unit, misprint.

The warnings judge a valid document. Each limit is wide enough that real mechanisms stay inside;
the reasons stand beside the limits. `WARNINGS` is the table of all.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence

from eigassign.case.reader import Finding, KeyPath, listed
from eigassign.case.rules.properties import is_place
from eigassign.case.schema.design import Choices, Parameter
from eigassign.case.schema.document import Document
from eigassign.case.schema.links import (
    BareSection,
    BeamLink,
    CircleSection,
    FrameBeam,
    FrameLink,
    RigidLink,
    Section,
    SolidLink,
    Taper,
    TubeSection,
)
from eigassign.case.schema.mechanism import Body, freedom_of
from eigassign.case.schema.parts import semidefinite, spread
from eigassign.case.schema.targets import (
    AtLeastTarget,
    AtMostTarget,
    FrequencyFile,
    FrequencyProfile,
)
from eigassign.case.schema.trajectory import (
    Added,
    PointTrajectory,
    SampledTrajectory,
    TipTrajectory,
    named_trajectories,
)
from eigassign.case.units import TWO_TURNS

MODULUS = (1e6, 1.5e12)  # Pa: soft rubber … above diamond (1.2e12)
DENSITY = (1.0, 25_000.0)  # kg/m3: aerogel … above osmium (22 590)
LENGTH = (1e-3, 100.0)  # m: a link of 300 bare "mm" or of 1e-4 m is a slip
DEPTH = (1e-5, 5.0)  # m: a wire of 10 µm … the girder of a bridge
# Of the outermost fibre, with the load at the end of its beam: structural steel yields at 0.0011.
STRAIN = 0.001
HEAVY = 30.0  # times the beam: the load of the shipped lift is 12 times its platform
FREQUENCY = (1e-3, 1e6)  # Hz
ROUND_OFF = 1e-9  # of the terms of a sum
LARGEST_ERROR = 0.5  # a tolerance of 2 was meant as 2 %
SLENDER = 10.0  # length / depth below which shear deformation moves the first modes by percents
SLENDEREST = (
    2500.0  # the same ratio of a wire; a link of 30 bare "mm" with a depth of 10 mm is 3000
)
SHEAR = (0.05, 1.2)  # κ: thin-walled profiles … solid ones (5/6, 9/10), with a margin
# I / A² has no dimension: 1/12 for a square, a/12 and 1/(12 a) for a flat bar of aspect a on edge
# and on its flat, D/(8π t) for a thin tube. The limits are a bar of aspect 1200 (or a tube of
# D/t = 2500) and a strip of aspect 830; rolled sections lie between 0.3 and 10.
STOUTNESS = (1e-4, 100.0)
# E / G = 2 (1 + ν) lies between 2 and 3 for ν from 0 to 0.5; fibres along the beam raise it.
MODULI = (1.9, 60.0)


SIZES = {  # of properties, by their keys
    "youngs_modulus": (MODULUS, "Pa"),
    "density": (DENSITY, "kg/m3"),
    "length": (LENGTH, "m"),
}


def implausible(document: Document) -> Iterator[Finding]:
    """Everything in a valid document that is probably not meant."""
    for warning in WARNINGS:
        yield from warning(document)


def _outside(
    value: float, limits: tuple[float, float], path: KeyPath, what: str
) -> Iterator[Finding]:
    low, high = limits
    if not low <= value <= high:
        bare = what == "m" and value > high
        meant = f" A bare number is in m: write {value:g} mm if that was meant" if bare else ""
        yield path, f"{value:g} {what} is outside {low:g} … {high:g}: is the unit right?{meant}"


# --- Materials and sections


def materials_are_of_this_world(document: Document) -> Iterator[Finding]:
    """Materials have mass, and two moduli that belong together."""
    for name, material in document.mechanism.materials.items():
        path: KeyPath = ("mechanism", "materials", name)
        E, G = material.youngs_modulus, material.shear_modulus
        if material.density == 0:
            yield (*path, "density"), "links of this material are massless"
        if G is not None and not MODULI[0] <= E / G <= MODULI[1]:
            message = f"E / G is {E / G:.3g}; isotropic materials have 2 (1 + ν), from 2 to 3"
            yield (*path, "shear_modulus"), message


def bare_sections_can_exist(document: Document) -> Iterator[Finding]:
    """Area and moments are those of one section."""
    for name, section in document.mechanism.sections.items():
        if not isinstance(section, BareSection):
            continue
        path: KeyPath = ("mechanism", "sections", name)
        A = section.area
        for key in ("bending_inertia", "inertia_z", "inertia_y"):
            inertia = getattr(section, key)
            # divided twice, since area² underflows where area itself does not
            if inertia is not None and not STOUTNESS[0] <= inertia / A / A <= STOUTNESS[1]:
                yield (
                    (*path, key),
                    f"area {A:g} m2 and {key} {inertia:g} m4 cannot belong to one section: its "
                    f"radius of gyration would be {math.sqrt(inertia / A):.3g} m, and a solid "
                    f"round bar of that area has {A * A / (4 * math.pi):.3g} m4; check the "
                    "exponents",
                )
        J, polar = section.torsion_constant, section.in_plane + (section.inertia_y or 0.0)
        # Saint-Venant: J ≤ I_y + I_z, with equality for round sections; three printed digits
        if J is not None and section.inertia_y is not None and 1.001 * polar < J:
            message = f"torsion_constant {J:g} m4 is above inertia_y + inertia_z = {polar:g} m4"
            yield (*path, "torsion_constant"), f"{message}, which no section can have"
        if section.shear_coefficient is not None:
            yield from _outside(section.shear_coefficient, SHEAR, (*path, "shear_coefficient"), "")


def sections_have_the_size_of_beams(document: Document) -> Iterator[Finding]:
    """Sections of a shape are from a wire's to a girder's; those of a bare area are as deep."""
    spatial = document.mechanism.space == "spatial"
    for name, section in document.mechanism.sections.items():
        path: KeyPath = ("mechanism", "sections", name)
        if isinstance(section, BareSection):
            if section.area > DEPTH[1] ** 2:
                message = f"{section.area:g} m2 is more than {DEPTH[1] ** 2:g}: is the unit right?"
                yield (*path, "area"), f"{message} A bare number is in m2"
        else:
            yield from _outside(section.depth(spatial), DEPTH, path, "m")


def materials_and_sections_are_used(document: Document) -> Iterator[Finding]:
    """Beams use every material and section, and so those that the design varies."""
    beams: list[BeamLink | FrameBeam] = []
    for link in document.mechanism.links.values():
        beams += [link] if isinstance(link, BeamLink) else []
        beams += link.beams.values() if isinstance(link, FrameLink) else []
    used = {("materials", beam.material) for beam in beams}
    solids = (link for link in document.mechanism.links.values() if isinstance(link, SolidLink))
    used |= {("materials", solid.material) for solid in solids}
    used |= {("sections", name) for beam in beams for name in _ends(beam.section)}
    given = [
        (g, name) for g in ("materials", "sections") for name in getattr(document.mechanism, g)
    ]
    unused = [each for each in given if each not in used]
    for group, name in unused:
        yield ("mechanism", group, name), "no link uses it"
    for name, column in document.design.parameters.items():
        if all(tuple(path.split(".")[:2]) in unused for path in column.factors):
            yield ("design", name, "parameter"), "has no effect: no link uses it"


def _ends(section: str | Taper) -> tuple[str, ...]:
    return (section,) if isinstance(section, str) else (section.start, section.end)


# --- Links and bodies


def frames_have_the_size_of_machines(document: Document) -> Iterator[Finding]:
    """Beams of frames are from a millimetre to a hundred metres long."""
    for name, link in document.mechanism.links.items():
        if isinstance(link, FrameLink):
            for beam, inner in link.beams.items():
                length = math.dist(link.nodes[inner.from_node], link.nodes[inner.to_node])
                path = ("mechanism", "links", name, "beams", beam)
                yield from _outside(length, LENGTH, path, "m of length")


def beams_without_shear_are_slender(document: Document) -> Iterator[Finding]:
    """Euler–Bernoulli beams are much longer than deep, but no beam is a thread."""
    spatial = document.mechanism.space == "spatial"
    sections = document.mechanism.sections
    for name, link in document.mechanism.links.items():
        if not isinstance(link, BeamLink) or link.shear:
            continue
        thick = max(_ends(link.section), key=lambda n: sections[n].depth(spatial))
        slenderness = link.length / sections[thick].depth(spatial)
        if slenderness > SLENDEREST and 1.0 < link.length <= LENGTH[1]:
            yield (
                ("mechanism", "links", name, "length"),
                f"length {link.length:g} m is {slenderness:.0f} times the depth of section "
                f"{thick!r}: a bare number is in m; was {link.length:g} mm meant?",
            )
        if slenderness < SLENDER:
            at_most = "at most " if isinstance(sections[thick], BareSection) else ""
            yield (
                ("mechanism", "links", name, "length"),
                f"length is {at_most}{slenderness:.2g} times the depth of section {thick!r}: below "
                f"{SLENDER:g} shear matters, which Euler–Bernoulli beams lack: write shear: true",
            )


def inertias_are_those_of_bodies(document: Document) -> Iterator[Finding]:
    """Principal moments of a body obey the triangle inequality."""
    groups = {"bodies": document.mechanism.bodies, "links": document.mechanism.links}
    for group, parts in groups.items():
        for name, part in parts.items():
            if not isinstance(part, (Body, RigidLink)) or isinstance(part.inertia, float):
                continue
            if not semidefinite(spread(part.inertia)):
                message = "no body has this inertia: a principal moment exceeds the other two's sum"
                yield ("mechanism", group, name, "inertia"), message


def payloads_can_be_held(document: Document) -> Iterator[Finding]:
    """No body would bend the beam that carries it beyond what materials bear, lying flat."""
    mechanism = document.mechanism
    for place, path, mass in _given(document):
        group, body, key = path.split(".")[:3]
        name, _, end = mechanism.bodies[body].at.partition(".") if group == "bodies" else ("",) * 3
        beam = mechanism.links.get(name)
        if key != "mass" or not isinstance(beam, BeamLink) or end == "start":
            continue
        ends = (_bar(mechanism.sections[section]) for section in _ends(beam.section))
        area, modulus = map(max, zip(*ends, strict=True))
        material = mechanism.materials[beam.material]
        strain = 9.81 * mass * beam.length / (material.youngs_modulus * modulus)
        if strain > STRAIN and mass > HEAVY * material.density * area * beam.length:
            yield (
                place,
                f"{mass:g} kg would strain the beam {name!r} that carries it by {100 * strain:.2g} "
                "% (steel yields at 0.1 %): check the mass (in kg when bare) and the section",
            )


def _bar(section: Section) -> tuple[float, float]:
    """Area and section modulus, m2 and m3; of what is not round the largest that are possible."""
    depth = section.depth(True)
    if isinstance(section, BareSection):
        return section.area, max(section.in_plane, section.inertia_y or 0.0) / (0.5 * depth)
    if isinstance(section, (CircleSection, TubeSection)):
        wall = getattr(section, "thickness", None) or 0.5 * depth
        bore = getattr(section, "inner_diameter", None) or depth - 2.0 * wall
        return math.pi / 4 * (depth**2 - bore**2), math.pi / 32 * (depth**4 - bore**4) / depth
    return depth**2, depth**3 / 6.0


# --- Properties, as written and as the design and load cases change them


def _given(document: Document) -> Iterator[tuple[KeyPath, str, float]]:
    """Where the file gives a property, its path, and the value there, or at the ends of a range."""
    for group in ("materials", "links", "bodies"):
        for name, part in getattr(document.mechanism, group).items():
            for key in (*SIZES, "mass"):
                if isinstance(value := getattr(part, key, None), float):
                    yield ("mechanism", group, name, key), f"{group}.{name}.{key}", value
    for name, entry in document.design.entries.items():
        if isinstance(entry, Choices):
            for choice, values in entry.choices.items():
                for path in entry.properties:
                    yield ("design", name, "choices", choice, path), path, values[path]
            continue
        for key, end in zip(("min", "max"), entry.range, strict=True):
            key = key if entry.values is None else "values"
            for path, factor in entry.factors.items():
                yield ("design", name, key), path, factor * end
    for place, _, motion in named_trajectories(document.trajectory):
        for path, value in motion.set.items():
            yield (*place, "set", path), path, value.add if isinstance(value, Added) else value


def properties_have_the_size_of_machines(document: Document) -> Iterator[Finding]:
    """Moduli, densities and lengths, and what dimensions of sections may become."""
    found: dict[KeyPath, Finding] = {}  # one for an entry of the design
    for place, path, value in _given(document):
        group, name, key = path.split(".")[:3]
        limits, unit = SIZES.get(key, ((-math.inf, math.inf), ""))
        if group == "sections" and not isinstance(document.mechanism.sections[name], BareSection):
            limits, unit = DEPTH, "m"
        for finding in _outside(value, limits, place, unit) if value or key != "density" else ():
            found.setdefault(place[:2] if place[0] == "design" else place, finding)
    yield from found.values()


# --- Joints and places


def places_are_in_metres(document: Document) -> Iterator[Finding]:
    """Joints, nodes of rigid links and waypoints are no farther apart than a machine is large."""
    for name, joint in document.mechanism.joints.items():
        place = max(map(abs, joint.position or ()), default=0.0)
        yield from _far(place, ("mechanism", "joints", name, "position"))
    for name, link in document.mechanism.links.items():
        for node, at in link.nodes.items() if isinstance(link, RigidLink) else ():
            place = max(map(abs, at), default=0.0)
            yield from _far(place, ("mechanism", "links", name, "nodes", node))
    for path, _, motion in named_trajectories(document.trajectory):
        if isinstance(motion, TipTrajectory):
            yield from _far(max(map(abs, _flat(motion.waypoints))), (*path, "waypoints"))


def _far(place: float, path: KeyPath) -> Iterator[Finding]:
    yield from _outside(place, (0.0, LENGTH[1]), path, "m")


def angles_are_in_radians(document: Document) -> Iterator[Finding]:
    """No angle is larger than two turns."""
    for path, angles in _angles(document):
        worst = max((abs(angle) for angle in _flat(angles)), default=0.0)
        if worst > TWO_TURNS:
            yield path, f"{worst:g} rad is more than two turns: was it meant in deg?"


def _angles(document: Document) -> Iterator[tuple[KeyPath, object]]:
    """Angles of the file, or nests of them, by key path."""
    joints = document.mechanism.joints
    for name, joint in joints.items():
        yield ("mechanism", "joints", name, "angle"), joint.angle
        yield ("mechanism", "joints", name, "orientation"), joint.orientation
    turned = []  # by coordinate: whether it is an angle, screws apart, which turn many times
    for c in document.coordinates.values():
        kind = joints[c.joint].type
        turned.append(kind != "screw" and freedom_of(kind, c.component) != "translation")

    def of(q: Sequence[float]) -> list[float]:
        return [value for value, angle in zip(q, turned, strict=True) if angle]

    if document.expansion.q != "auto":
        yield ("expansion", "q"), of(document.expansion.q)
    for path, _, motion in named_trajectories(document.trajectory):
        if isinstance(motion, SampledTrajectory):
            yield (*path, "q"), [of(row) for row in motion.q]
        if isinstance(motion, PointTrajectory):
            yield (*path, "points"), [of(row) for row in motion.points]
        if isinstance(motion, TipTrajectory):
            yield (*path, "angle"), motion.angle
            yield (*path, "orientation"), motion.orientation
            yield (*path, "start"), of(motion.start) if motion.start is not None else ()
            for name, interval in motion.branch.items():
                if joints[name].type == "revolute":
                    yield (*path, "branch", name), interval


def _flat(value: object) -> Iterator[float]:
    """The numbers of a nest of lists."""
    if isinstance(value, (tuple, list)):
        for inner in value:
            yield from _flat(inner)
    elif isinstance(value, (int, float)):
        yield value


def angles_of_joints_have_an_effect(document: Document) -> Iterator[Finding]:
    """An absolute angle is counted from the x axis, wherever the joint's own zero is."""
    for name, coordinate in document.coordinates.items():
        if coordinate.angle == "absolute" and document.mechanism.joints[coordinate.joint].angle:
            message = f"has no effect: coordinate {name!r} is absolute, counted from the x axis"
            yield ("mechanism", "joints", coordinate.joint, "angle"), message


Node = tuple[str, tuple[float, ...]]  # a node, and how far from it


def joints_hold_something_new(document: Document) -> Iterator[Finding]:
    """No joint joins two nodes that earlier joints join already: several on one pin.

    A loop has the breadth of the links in it. Where joints alone lead from a node back to it, as
    with two joints between the same two nodes, or three among three links on one pin, all of them
    hold the same place, and the last adds nothing as long as it allows what the others allow. Loops
    that are overconstrained otherwise (hinges side by side, a planar linkage in space, a frame
    clamped at both ends) hold flexible links in different places, and are none of this.
    """
    joined: dict[Node, dict[Node, str]] = {}
    for name, joint in document.mechanism.joints.items():
        position = joint.position or ()
        base: Node = (joint.base, position if any(position) else ())
        follower: Node = (joint.follower, ())
        if others := _way(joined, base, follower):
            held = " and ".join(repr(other) for other in others)
            verb = "joins" if len(others) == 1 else "join"
            yield (
                ("mechanism", "joints", name),
                f"is redundant: {held} {verb} {joint.base} and {joint.follower} already. Leave it "
                "out, or was another node meant?",
            )
        else:
            joined.setdefault(base, {})[follower] = name
            joined.setdefault(follower, {})[base] = name


def _way(joined: Mapping[Node, Mapping[Node, str]], start: Node, end: Node) -> list[str]:
    """The joints on the way from one node to another; none where there is no way."""
    ways: dict[Node, list[str]] = {start: []}
    queue = [start]
    for here in queue:
        for there, joint in joined.get(here, {}).items():
            if there not in ways:
                ways[there] = [*ways[here], joint]
                queue.append(there)
    return ways.get(end, [])


# --- What is asked


def goals_can_be_meant(document: Document) -> Iterator[Finding]:
    """Targets are frequencies, tolerances are small, the expansion point is a possible design."""
    for k, target in enumerate(document.targets):
        for keys, curve in target.frequencies:
            if isinstance(curve, FrequencyFile):
                continue
            values = curve.frequency if isinstance(curve, FrequencyProfile) else (curve,)
            for value in (min(values), max(values)):
                yield from _outside(value, FREQUENCY, ("targets", k, *keys), "Hz")
    for part in ("assignment", "validation"):
        accepted = getattr(document, part).max_error
        if accepted is not None and accepted > LARGEST_ERROR:
            message = f"{100 * accepted:g} % accepts nearly anything: usual is 2 %, which is 0.02"
            yield (part, "max_error"), message
    for name, entry in document.design.entries.items():
        if isinstance(entry, Parameter) and entry.tolerance and entry.tolerance.relative:
            least, most = entry.range
            if is_place(next(iter(entry.factors))) and least <= 0.0 <= most:
                message = "is a share of a value that may be 0, where nothing deviates: give an "
                yield ("design", name, "tolerance"), f"{message}amount, such as 0.1 mm or 0.1 deg"
    if document.expansion.y != "auto":
        bounds = document.design.parameters.items()
        for k, (value, (name, p)) in enumerate(zip(document.expansion.y, bounds, strict=True)):
            if not p.min <= value <= p.max:
                message = f"{value:g} is outside the bounds of {name!r}, [{p.min:g}, {p.max:g}]"
                yield ("expansion", "y", k), message


def limits_leave_room(document: Document) -> Iterator[Finding]:
    """No mode is to lie above one frequency and, or a higher one, below a lesser one."""
    limits = [
        (k, type(target), mode, target.curve, (target.trajectory, target.during))
        for k, target in enumerate(document.targets)
        if isinstance(target, (AtLeastTarget, AtMostTarget)) and isinstance(target.curve, float)
        for mode in (() if target.followed else target.numbers)
    ]
    for k, _, upper, most, when in (one for one in limits if one[1] is AtMostTarget):
        for _, _, lower, least, also in (one for one in limits if one[1] is AtLeastTarget):
            if lower <= upper and least > most and (when == also or (None, None) in (when, also)):
                other = "" if lower == upper else f"mode {lower} below it "
                message = f"mode {upper} is to be at most {most:g} Hz and {other}at least {least:g}"
                yield ("targets", k, "at_most"), f"{message} Hz: no design meets both"
                break


def constraints_can_be_met(document: Document) -> Iterator[Finding]:
    """Somewhere within the bounds each constraint is met."""
    columns = document.design.parameters
    for name, constraint in document.design.constraints.items():
        ends = [
            sorted((factor * columns[term].min, factor * columns[term].max))
            for term, factor in constraint.terms.items()
        ]
        low, high = (math.fsum(end[k] for end in ends) for k in (0, 1))
        slack = ROUND_OFF * math.fsum(max(map(abs, end)) for end in ends)
        for key, beyond in (
            ("min", constraint.min is not None and constraint.min > high + slack),
            ("max", constraint.max is not None and constraint.max < low - slack),
        ):
            if beyond:
                limit = getattr(constraint, key)
                message = (
                    f"no design meets this: within the bounds of {listed(constraint.terms)} the "
                    f"sum is from {low:g} to {high:g}, and {limit:g} is its {key}"
                )
                yield ("design", "constraints", name, key), message


WARNINGS: tuple[Callable[[Document], Iterator[Finding]], ...] = (
    materials_are_of_this_world,
    bare_sections_can_exist,
    sections_have_the_size_of_beams,
    materials_and_sections_are_used,
    properties_have_the_size_of_machines,
    frames_have_the_size_of_machines,
    beams_without_shear_are_slender,
    inertias_are_those_of_bodies,
    payloads_can_be_held,
    places_are_in_metres,
    angles_are_in_radians,
    angles_of_joints_have_an_effect,
    joints_hold_something_new,
    goals_can_be_meant,
    limits_leave_room,
    constraints_can_be_met,
)
