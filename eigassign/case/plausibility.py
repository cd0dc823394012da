"""Values that are allowed but look like a slip: wrong exponent, forgotten unit, misprint.

Warnings only. Each limit is wide enough that real mechanisms stay inside; the reasons stand beside
the limits.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from eigassign.case.document import Document
from eigassign.case.mechanism_parts import (
    BareSection,
    CircleSection,
    Section,
    TubeSection,
)
from eigassign.case.study_parts import FrequencyProfile, SampledTrajectory, TipTrajectory
from eigassign.case.yaml_reader import Finding, KeyPath

MODULUS = (1e6, 1.5e12)  # Pa: soft rubber … above diamond (1.2e12)
DENSITY = (1.0, 25_000.0)  # kg/m3: aerogel … above osmium (22 590)
LENGTH = (1e-3, 100.0)  # m: a link of 30 bare "mm" or of 1e-4 m is a slip
SLENDER = 10.0  # length / depth below which shear deformation moves the first modes by percents
LARGEST_ANGLE = 4 * math.pi  # rad: two turns; a bare 30 was meant in degrees
FREQUENCY = (1e-3, 1e6)  # Hz
LARGEST_ERROR = 0.5  # a tolerance of 2 was meant as 2 %
# I / A² has no dimension: 1/12 for a square, a/12 and 1/(12 a) for a flat bar of aspect a on edge
# and on its flat, D/(8π t) for a thin tube. The limits are a bar of aspect 1200 (or a tube of
# D/t = 2500) and a strip of aspect 830; rolled sections lie between 0.3 and 10.
STOUTNESS = (1e-4, 100.0)


def implausible(document: Document) -> Iterator[Finding]:
    """Everything in a valid document that is probably not meant."""
    yield from _materials(document)
    yield from _sections(document)
    yield from _links(document)
    yield from _unused(document)
    yield from _angles(document)
    yield from _goals(document)
    yield from _tube_walls(document)


def _outside(
    value: float, limits: tuple[float, float], path: KeyPath, what: str
) -> Iterator[Finding]:
    low, high = limits
    if not low <= value <= high:
        yield path, f"{value:g} {what} is outside {low:g} … {high:g}: is the unit right?"


def _materials(document: Document) -> Iterator[Finding]:
    for name, material in document.mechanism.materials.items():
        path: KeyPath = ("mechanism", "materials", name)
        yield from _outside(material.youngs_modulus, MODULUS, (*path, "youngs_modulus"), "Pa")
        if material.density == 0:
            yield (*path, "density"), "links of this material are massless"
        else:
            yield from _outside(material.density, DENSITY, (*path, "density"), "kg/m3")


def _sections(document: Document) -> Iterator[Finding]:
    for name, section in document.mechanism.sections.items():
        if not isinstance(section, BareSection):
            continue
        area, inertia = section.area, section.bending_inertia
        low, high = STOUTNESS
        # divided twice, since area² underflows where area itself does not
        if not low <= inertia / area / area <= high:
            yield (
                ("mechanism", "sections", name, "bending_inertia"),
                f"area {area:g} m2 and bending_inertia {inertia:g} m4 cannot belong to one "
                f"section: its radius of gyration would be {math.sqrt(inertia / area):.3g} m, and "
                f"a solid round bar of that area has {area * area / (4 * math.pi):.3g} m4; "
                "check the exponents",
            )


def depth(section: Section) -> float:
    """Depth in the plane of bending, m; for a bare section the least it can be.

    No section of depth h has a radius of gyration above h/2 (a mean square distance from the
    centroid over an interval of length h is at most h²/4), so h ≥ 2 √(I/A).
    """
    if isinstance(section, BareSection):
        return 2 * math.sqrt(section.bending_inertia / section.area)
    if isinstance(section, CircleSection):
        return section.diameter
    if isinstance(section, TubeSection):
        return section.outer_diameter
    return section.height


def _links(document: Document) -> Iterator[Finding]:
    for name, link in document.mechanism.links.items():
        path: KeyPath = ("mechanism", "links", name, "length")
        yield from _outside(link.length, LENGTH, path, "m")
        section = document.mechanism.sections[link.section]
        slenderness = link.length / depth(section)
        if slenderness < SLENDER:
            at_most = "at most " if isinstance(section, BareSection) else ""
            yield (
                path,
                f"length is {at_most}{slenderness:.2g} times the depth of section "
                f"{link.section!r}; below {SLENDER:g} the Euler–Bernoulli beam, which neglects "
                "shear, is doubtful",
            )


def _unused(document: Document) -> Iterator[Finding]:
    links = document.mechanism.links.values()
    used = {
        "materials": {link.material for link in links},
        "sections": {link.section for link in links},
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


def _angles(document: Document) -> Iterator[Finding]:
    for name, offset in document.mechanism.joints.items():
        yield from _turned([offset.angle], ("mechanism", "joints", name, "angle"))
    if document.expansion.q != "auto":
        yield from _turned(document.expansion.q, ("expansion", "q"))
    motion = document.trajectory
    if isinstance(motion, SampledTrajectory):
        yield from _turned((v for row in motion.q for v in row), ("trajectory", "q"))
    if isinstance(motion, TipTrajectory):
        yield from _turned(motion.start or (), ("trajectory", "start"))
        for joint, interval in motion.branch.items():
            yield from _turned(interval, ("trajectory", "branch", joint))


def _turned(angles: Iterable[float], path: KeyPath) -> Iterator[Finding]:
    worst = max((abs(angle) for angle in angles), default=0.0)
    if worst > LARGEST_ANGLE:
        yield path, f"{worst:g} rad is more than two turns: was it meant in deg?"


def _goals(document: Document) -> Iterator[Finding]:
    for k, target in enumerate(document.targets):
        wanted = target.frequency
        values = wanted.frequency if isinstance(wanted, FrequencyProfile) else (wanted,)
        for value in (min(values), max(values)):
            yield from _outside(value, FREQUENCY, ("targets", k, "frequency"), "Hz")
    if document.validation.max_error > LARGEST_ERROR:
        percent = 100 * document.validation.max_error
        yield ("validation", "max_error"), f"this is {percent:g} %; write the % if it was meant so"
    if document.expansion.y != "auto":
        bounds = document.design.parameters.items()
        for k, (value, (name, p)) in enumerate(zip(document.expansion.y, bounds, strict=True)):
            if not p.min <= value <= p.max:
                message = f"{value:g} is outside the bounds of {name!r}, [{p.min:g}, {p.max:g}]"
                yield ("expansion", "y", k), message


def _tube_walls(document: Document) -> Iterator[Finding]:
    """Bounds within which a tube's wall can vanish or overfill it."""
    reach = {p.parameter: (p.min, p.max) for p in document.design.parameters.values()}
    for name, tube in document.mechanism.sections.items():
        if not isinstance(tube, TubeSection):
            continue
        path = f"sections.{name}."
        outer, _ = reach.get(path + "outer_diameter", (tube.outer_diameter, 0.0))
        _, inner = reach.get(path + "inner_diameter", (0.0, tube.inner_diameter or 0.0))
        _, wall = reach.get(path + "thickness", (0.0, tube.thickness or 0.0))
        if 2 * wall > outer or inner >= outer:
            message = "within the design bounds this tube's wall can vanish or exceed its radius"
            yield ("mechanism", "sections", name), message
