"""Values that are allowed but look like a slip: wrong exponent, forgotten unit, misprint.

Warnings only. Each limit is wide enough that real mechanisms stay inside; the reasons stand beside
the limits.

Parts of a mechanism that are allowed but look like a slip: wrong exponent, forgotten unit.

Warnings only. Each limit is wide enough that real mechanisms stay inside; the reasons stand beside
the limits.

Dimensions that a design may move past one another: refused wherever in its bounds they could.

Each condition is linear in dimensions that vary independently, so the worst corner of the bounds
decides for all of them; along a taper the conditions hold between ends at which they hold.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from eigassign.case.reader import Finding, KeyPath
from eigassign.case.schema.document import Document
from eigassign.case.schema.joints import freedom_of
from eigassign.case.schema.links import BeamLink, FrameBeam, FrameLink, RigidLink, Taper
from eigassign.case.schema.mechanism import Body, Coordinate, Mechanism
from eigassign.case.schema.sections import BareSection
from eigassign.case.schema.study import FrequencyProfile
from eigassign.case.schema.trajectory import (
    PointTrajectory,
    SampledTrajectory,
    TipTrajectory,
    Trajectory,
    named_trajectories,
)
from eigassign.case.schema.vectors import semidefinite, spread

# --- Values that are allowed but look like a slip: wrong exponent, forgotten unit, misprint

LARGEST_ANGLE = 4 * math.pi  # rad: two turns; a bare 30 was meant in degrees
FREQUENCY = (1e-3, 1e6)  # Hz
LARGEST_ERROR = 0.5  # a tolerance of 2 was meant as 2 %


def implausible(document: Document) -> Iterator[Finding]:
    """Everything in a valid document that is probably not meant."""
    yield from implausible_parts(document)
    yield from _angles(document)
    yield from _idle_mountings(document)
    yield from joined_twice(document.mechanism.joints)
    yield from _goals(document)


def _angles(document: Document) -> Iterator[Finding]:
    for name, joint in document.mechanism.joints.items():
        yield from _turned([joint.angle], ("mechanism", "joints", name, "angle"))
        turn = joint.orientation or ()
        yield from _turned(turn, ("mechanism", "joints", name, "orientation"))
    if document.expansion.q != "auto":
        yield from _turned(_angular(document, document.expansion.q), ("expansion", "q"))
    for path, _, motion in named_trajectories(document.trajectory):
        yield from _along(document, motion, path)


def _along(document: Document, motion: Trajectory, path: KeyPath) -> Iterator[Finding]:
    if isinstance(motion, SampledTrajectory):
        samples = (v for row in motion.q for v in _angular(document, row))
        yield from _turned(samples, (*path, "q"))
    if isinstance(motion, PointTrajectory):
        points = (v for row in motion.points for v in _angular(document, row))
        yield from _turned(points, (*path, "points"))
    if isinstance(motion, TipTrajectory):
        yield from _turned(_flat(motion.angle), (*path, "angle"))
        yield from _turned(_flat(motion.orientation), (*path, "orientation"))
        if motion.start is not None:
            yield from _turned(_angular(document, motion.start), (*path, "start"))
        for name, interval in motion.branch.items():
            if document.mechanism.joints[name].type == "revolute":
                yield from _turned(interval, (*path, "branch", name))


def _idle_mountings(document: Document) -> Iterator[Finding]:
    """An absolute angle is counted from the x axis, wherever the joint's own zero is."""
    for name, coordinate in document.coordinates.items():
        if coordinate.angle == "absolute" and document.mechanism.joints[coordinate.joint].angle:
            message = f"has no effect: coordinate {name!r} is absolute, counted from the x axis"
            yield ("mechanism", "joints", coordinate.joint, "angle"), message


def _angular(document: Document, q: Sequence[float]) -> list[float]:
    """The entries of q that are angles, screws apart: those turn many times."""
    kinds = [_is_angle(document.mechanism, c) for c in document.coordinates.values()]
    return [value for value, angle in zip(q, kinds, strict=True) if angle]


def _is_angle(mechanism: Mechanism, coordinate: Coordinate) -> bool:
    kind = mechanism.joints[coordinate.joint].type
    return kind != "screw" and freedom_of(kind, coordinate.component) != "translation"


def _flat(value: object) -> Iterator[float]:
    """The numbers of a nest of tuples."""
    if isinstance(value, tuple):
        for inner in value:
            yield from _flat(inner)
    elif isinstance(value, (int, float)):
        yield value


def _turned(angles: Iterable[float], path: KeyPath) -> Iterator[Finding]:
    worst = max((abs(angle) for angle in angles), default=0.0)
    if worst > LARGEST_ANGLE:
        yield path, f"{worst:g} rad is more than two turns: was it meant in deg?"


def _goals(document: Document) -> Iterator[Finding]:
    for k, target in enumerate(document.targets):
        wanted = target.frequency
        values = wanted.frequency if isinstance(wanted, FrequencyProfile) else (wanted,)
        for value in (min(values), max(values)):
            yield from outside(value, FREQUENCY, ("targets", k, "frequency"), "Hz")
    if document.validation.max_error > LARGEST_ERROR:
        percent = 100 * document.validation.max_error
        yield ("validation", "max_error"), f"this is {percent:g} %; write the % if it was meant so"
    if document.expansion.y != "auto":
        bounds = document.design.parameters.items()
        for k, (value, (name, p)) in enumerate(zip(document.expansion.y, bounds, strict=True)):
            if not p.min <= value <= p.max:
                message = f"{value:g} is outside the bounds of {name!r}, [{p.min:g}, {p.max:g}]"
                yield ("expansion", "y", k), message


# --- Parts of a mechanism that are allowed but look like a slip: wrong exponent, forgotten unit

MODULUS = (1e6, 1.5e12)  # Pa: soft rubber … above diamond (1.2e12)
DENSITY = (1.0, 25_000.0)  # kg/m3: aerogel … above osmium (22 590)
LENGTH = (1e-3, 100.0)  # m: a link of 30 bare "mm" or of 1e-4 m is a slip
SLENDER = 10.0  # length / depth below which shear deformation moves the first modes by percents
SHEAR = (0.05, 1.2)  # κ: thin-walled profiles … solid ones (5/6, 9/10), with a margin
# I / A² has no dimension: 1/12 for a square, a/12 and 1/(12 a) for a flat bar of aspect a on edge
# and on its flat, D/(8π t) for a thin tube. The limits are a bar of aspect 1200 (or a tube of
# D/t = 2500) and a strip of aspect 830; rolled sections lie between 0.3 and 10.
STOUTNESS = (1e-4, 100.0)


def implausible_parts(document: Document) -> Iterator[Finding]:
    """Everything in a valid mechanism that is probably not meant."""
    yield from _materials(document)
    yield from _sections(document)
    yield from _links(document)
    yield from _inertias(document)
    yield from _unused(document)


def outside(
    value: float, limits: tuple[float, float], path: KeyPath, what: str
) -> Iterator[Finding]:
    """A warning if ``value`` lies outside ``limits``."""
    low, high = limits
    if not low <= value <= high:
        yield path, f"{value:g} {what} is outside {low:g} … {high:g}: is the unit right?"


def _materials(document: Document) -> Iterator[Finding]:
    for name, material in document.mechanism.materials.items():
        path: KeyPath = ("mechanism", "materials", name)
        yield from outside(material.youngs_modulus, MODULUS, (*path, "youngs_modulus"), "Pa")
        if material.density == 0:
            yield (*path, "density"), "links of this material are massless"
        else:
            yield from outside(material.density, DENSITY, (*path, "density"), "kg/m3")
        if material.shear_modulus is not None:
            yield from _auxetic(material.youngs_modulus / material.shear_modulus, path)


def _auxetic(ratio: float, path: KeyPath) -> Iterator[Finding]:
    """E/G = 2 (1 + ν) lies between 2 and 3 for ν from 0 to 0.5; fibres along the beam raise it."""
    if not 1.9 <= ratio <= 60.0:
        message = f"E / G is {ratio:.3g}; isotropic materials have 2 (1 + ν), from 2 to 3"
        yield (*path, "shear_modulus"), message


def _sections(document: Document) -> Iterator[Finding]:
    for name, section in document.mechanism.sections.items():
        if not isinstance(section, BareSection):
            continue
        path: KeyPath = ("mechanism", "sections", name)
        for key in ("bending_inertia", "inertia_z", "inertia_y"):
            inertia = getattr(section, key)
            if inertia is not None:
                yield from _stoutness(section.area, inertia, (*path, key))
        yield from _twist(section, path)
        if section.shear_coefficient is not None:
            yield from outside(section.shear_coefficient, SHEAR, (*path, "shear_coefficient"), "")


def _stoutness(area: float, inertia: float, path: KeyPath) -> Iterator[Finding]:
    low, high = STOUTNESS
    # divided twice, since area² underflows where area itself does not
    if not low <= inertia / area / area <= high:
        yield (
            path,
            f"area {area:g} m2 and {path[-1]} {inertia:g} m4 cannot belong to one "
            f"section: its radius of gyration would be {math.sqrt(inertia / area):.3g} m, and "
            f"a solid round bar of that area has {area * area / (4 * math.pi):.3g} m4; "
            "check the exponents",
        )


def _twist(section: BareSection, path: KeyPath) -> Iterator[Finding]:
    """Saint-Venant: J ≤ I_y + I_z, with equality for round sections."""
    if section.torsion_constant is None or section.inertia_y is None:
        return
    polar = section.inertia_y + section.in_plane
    if section.torsion_constant > 1.001 * polar:  # three printed digits
        message = f"torsion_constant {section.torsion_constant:g} m4 is above inertia_y + inertia_z"
        yield (*path, "torsion_constant"), f"{message} = {polar:g} m4, which no section can have"


def _links(document: Document) -> Iterator[Finding]:
    for name, link in document.mechanism.links.items():
        path: KeyPath = ("mechanism", "links", name)
        if isinstance(link, BeamLink):
            yield from outside(link.length, LENGTH, (*path, "length"), "m")
            yield from _slenderness(document, link, (*path, "length"))
        elif isinstance(link, RigidLink) and link.length is not None:
            yield from outside(link.length, LENGTH, (*path, "length"), "m")
        elif isinstance(link, FrameLink):
            for beam, inner in link.beams.items():
                ends = (link.nodes[inner.from_node], link.nodes[inner.to_node])
                place = (*path, "beams", beam)
                yield from outside(math.dist(*ends), LENGTH, place, "m of length")


def _slenderness(document: Document, link: BeamLink, path: KeyPath) -> Iterator[Finding]:
    if link.shear:
        return
    spatial = document.mechanism.space == "spatial"
    sections = document.mechanism.sections
    name = max(_ends(link.section), key=lambda n: sections[n].depth(spatial))
    slenderness = link.length / sections[name].depth(spatial)
    if slenderness < SLENDER:
        at_most = "at most " if isinstance(sections[name], BareSection) else ""
        yield (
            path,
            f"length is {at_most}{slenderness:.2g} times the depth of section "
            f"{name!r}; below {SLENDER:g} the Euler–Bernoulli beam, which neglects "
            "shear, is doubtful; write shear: true",
        )


def _ends(section: str | Taper) -> tuple[str, ...]:
    return (section,) if isinstance(section, str) else (section.start, section.end)


def _inertias(document: Document) -> Iterator[Finding]:
    """Principal moments of a body obey the triangle inequality; a point has none without mass."""
    groups = {"bodies": document.mechanism.bodies, "links": document.mechanism.links}
    for group, parts in groups.items():
        for name, part in parts.items():
            if not isinstance(part, (Body, RigidLink)) or isinstance(part.inertia, float):
                continue
            path: KeyPath = ("mechanism", group, name, "inertia")
            if not semidefinite(spread(part.inertia)):
                message = "no body has this inertia: a principal moment exceeds the other two's sum"
                yield path, message


def _unused(document: Document) -> Iterator[Finding]:
    beams = list(_beams(document))
    used = {
        "materials": {beam.material for beam in beams},
        "sections": {name for beam in beams for name in _ends(beam.section)},
    }
    unused = [
        (group, name)
        for group, names in used.items()
        for name in getattr(document.mechanism, group)
        if name not in names
    ]
    for group, name in unused:
        yield ("mechanism", group, name), "no link uses it"
    for name, parameter in document.design.parameters.items():
        if tuple(parameter.parameter.split(".")[:2]) in unused:
            yield ("design", name, "parameter"), "has no effect: no link uses it"


def _beams(document: Document) -> Iterator[BeamLink | FrameBeam]:
    for link in document.mechanism.links.values():
        if isinstance(link, BeamLink):
            yield link
        elif isinstance(link, FrameLink):
            yield from link.beams.values()


# --- Joints that close a loop without any link in it: several on one pin, of which one is too many

Node = tuple[str, tuple[float, ...]]  # a node, and how far from it


def joined_twice(joints: Mapping[str, Any]) -> Iterator[Finding]:
    """A warning for each joint whose two nodes earlier joints join already."""
    led: dict[Node, dict[Node, str]] = {}
    for name, joint in joints.items():
        base, follower = _node(joint.base, joint), (joint.follower, ())
        others = _path(led, base, follower)
        if others:
            yield ("mechanism", "joints", name), _message(joint, others)
        else:
            led.setdefault(base, {})[follower] = name
            led.setdefault(follower, {})[base] = name


def _node(name: str, joint: Any) -> Node:
    """The base's node, or a place beside it."""
    position = tuple(float(x) for x in getattr(joint, "position", None) or ())
    return name, position if any(position) else ()


def _path(led: Mapping[Node, Mapping[Node, str]], start: Node, end: Node) -> list[str]:
    """The joints on the way from one node to another; none where there is no way."""
    ways: dict[Node, list[str]] = {start: []}
    queue = [start]
    for here in queue:
        for there, joint in led.get(here, {}).items():
            if there not in ways:
                ways[there] = [*ways[here], joint]
                queue.append(there)
    return ways.get(end, [])


def _message(joint: Any, others: list[str]) -> str:
    held = " and ".join(repr(name) for name in others)
    verb = "joins" if len(others) == 1 else "join"
    return (
        f"is redundant: {held} {verb} {joint.base} and {joint.follower} already, so that it holds "
        "nothing new where it allows the same motion; leave it out, or was another node meant?"
    )
