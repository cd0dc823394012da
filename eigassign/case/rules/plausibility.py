"""Bounds within which no mechanism exists; and warnings: what is allowed but looks like a slip.

Both judge a valid document. Each limit of a warning (wrong exponent, forgotten unit, misprint) is
wide enough that real mechanisms stay inside; the reasons stand beside the limits. `WARNINGS` is the
table of all.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

from eigassign.case.reader import Finding, KeyPath
from eigassign.case.rules.properties import (
    ANY,
    coordinate_lists,
    limits,
    property_at,
    value_at,
    walk,
)
from eigassign.case.schema.design import Choices
from eigassign.case.schema.document import Document
from eigassign.case.schema.links import BareSection, BeamLink, RigidLink, Taper
from eigassign.case.schema.mechanism import Body, freedom_of
from eigassign.case.schema.parts import semidefinite, spread
from eigassign.case.schema.trajectory import Added, named_trajectories
from eigassign.case.units import LEFT_OUT, SI, TWO_TURNS, Given, slip, written

LENGTH = (1e-3, 100.0)  # m: a link of 300 bare "mm" or of 1e-4 m is a slip
DEPTH = (1e-5, 5.0)  # m: a wire of 10 µm … the girder of a bridge
_ROUND_OFF = 1e-9  # of the terms of a limit
SLENDER = 10.0  # length / depth below which shear deformation moves the first modes by percents
# I / A² has no dimension: 1/12 for a square, a/12 and 1/(12 a) for a flat bar of aspect a on edge
# and on its flat, D/(8π t) for a thin tube. The limits are a bar of aspect 1200 (or a tube of
# D/t = 2500) and a strip of aspect 830; rolled sections lie between 0.3 and 10.
STOUTNESS = (1e-4, 100.0)
_FAR, _TURNS = (-LENGTH[1], LENGTH[1]), (-TWO_TURNS, TWO_TURNS)
SIZES = {  # of the properties of a group, by key
    ("materials", "youngs_modulus"): (1e6, 1.5e12, "Pa"),  # soft rubber … above diamond (1.2e12)
    ("materials", "density"): (1.0, 25_000.0, "kg/m3"),  # aerogel … above osmium (22 590)
    ("links", "length"): (*LENGTH, "m"),
    ("links", "nodes"): (*_FAR, "m"),
    ("joints", "position"): (*_FAR, "m"),
    ("joints", "angle"): (*_TURNS, "rad"),
    ("joints", "orientation"): (*_TURNS, "rad"),
    ("sections", "area"): (DEPTH[0] ** 2, DEPTH[1] ** 2, "m2"),
    ("sections", "shear_coefficient"): (0.05, 1.2, ""),  # thin-walled … solid (5/6, 9/10)
    **{
        ("sections", key): (*DEPTH, "m")
        for key in (
            *("diameter", "outer_diameter", "inner_diameter", "width", "height"),
            *("thickness", "flange_thickness", "web_thickness"),
        )
    },
    ("trajectory", "waypoints"): (*_FAR, "m"),
    ("trajectory", "angle"): (*_TURNS, "rad"),
    ("trajectory", "orientation"): (*_TURNS, "rad"),
}


def bounds_hold_nothing_impossible(case: Any) -> Iterator[Finding]:
    """Mechanisms exist at the bounds of the design, and with each of its choices and trajectories.

    A robust one may go further by its tolerances. Limits are linear, so that the least room of each
    entry, or of those that are chosen together, decides.
    """
    loads, columns = [*case.loads.values()], [*case.design.parameters.values()]
    n, ranges = len(loads), [*_ranges(case)]

    def least(k: int, factor: float, value: float) -> float:
        tolerance = columns[k - n].tolerance if case.assignment.robust and k >= n else None
        deviation = tolerance.deviation(value) if tolerance else 0.0
        kind = case.design_quantities[k - n] if tolerance else ANY
        if 0 in (kind.at_least, kind.above) and factor > 0.0:  # as masses are never below 0
            deviation = min(deviation, max(value, 0.0))
        return factor * value - abs(factor) * deviation

    for limit in limits(case):
        terms, blamed = [limit.offset], dict[int, KeyPath]()
        for rows in ranges:
            room, place = min(
                (sum(least(k, f, row[k]) for k, f in limit.factors.items() if k in row), place)
                for place, row in rows
            )
            terms.append(room)
            blamed |= dict.fromkeys(rows[0][1], place)
        slack = _ROUND_OFF * sum(map(abs, terms))
        if sum(terms) < -slack or (limit.strict and sum(terms) <= 0.0):
            first = next((k for k in limit.factors if k < n), next(iter(limit.factors)))
            place = blamed[first]
            if first < n:
                yield (*place, loads[first].path), f"with this {limit.words}"
                continue
            more = " with its tolerance" if case.assignment.robust else ""
            bound = "at this bound" if place[-1] in ("min", "max") else "with one of these"
            yield place, f"{bound}{more} {limit.words}; narrow the bounds"


def _ranges(case: Any) -> Iterator[list[tuple[KeyPath, dict[int, float]]]]:
    """Values that entries take together, each with its place in the file."""
    n, chosen = len(case.loads), set[int]()
    if n:
        loads = [*enumerate(case.loads.values())]
        paths = [(*path, "set") for path, *_ in named_trajectories(case.trajectory)]
        yield [(path, {k: load.along[t] for k, load in loads}) for t, path in enumerate(paths)]
    for each in case.design.catalogues:
        chosen |= set(each.columns)
        key = "choices" if isinstance(case.design.entries[each.name], Choices) else "values"
        entries, place = [n + k for k in each.columns], ("design", each.name, key)
        yield [(place, dict(zip(entries, row, strict=True))) for row in each.rows]
    for k, (name, column) in enumerate(case.design.parameters.items()):
        if k not in chosen:
            ends = (("min", column.min), ("max", column.max))
            yield [(("design", name, key), {n + k: value}) for key, value in ends]


# --- Warnings


def implausible(document: Document) -> Iterator[Finding]:
    """Everything in a valid document that is probably not meant."""
    for warning in WARNINGS:
        yield from warning(document)


def numbers_have_the_size_of_machines(document: Document) -> Iterator[Finding]:
    """Properties as written, as the design and load cases change them, and places of paths."""
    bare, found = dict(bare_lengths_are_of_machines(document)), dict[KeyPath, str]()
    for place, group, key, value in _given(document):
        low, high, unit = SIZES.get((group, key), (-math.inf, math.inf, ""))
        if not low <= value <= high and place not in bare:
            found.setdefault(place, _outside(value, low, high, unit))
    yield from found.items()


def _outside(value: float, low: float, high: float, unit: str) -> str:
    unit = SI(unit, value)
    if unit == "rad":
        meant = "" if unit.answered else ": was it meant in deg?"
        return f"{written(value, unit).lstrip('-')} is more than two turns{meant}"
    meant = " A bare number is in m2" if unit == "m2" and value > high else ""
    ends = f"{written(low, unit)} … {written(high, unit)}"
    return f"{written(value, unit)} is outside {ends}: is the unit right?{meant}"


def bare_lengths_are_of_machines(document: Document) -> Iterator[Finding]:
    """No bare number of 1 or more is longer than any machine, nor deeper than all links are long.

    Nor is it a length of ten times those that have a unit.
    """
    links = document.mechanism.links.values()
    lengths = [n for link in links if isinstance(n := getattr(link, "length", None), float)]
    longest = max([n for n in lengths if SI("", n).answered] or lengths, default=math.inf)
    most = {"sections": longest, "links": 10.0 * longest}
    found: dict[KeyPath, str] = {}
    for place, group, key, value in _given(document):
        _, high, unit = SIZES.get((group, key), (0.0, math.inf, ""))
        if unit == "m" and value > max(1.0, min(high, most.get(group, high))):
            found.setdefault(place, slip(value, unit).replace("; ", f"{place[-1]} ", 1))
    yield from ((place, why) for place, why in found.items() if why)


def _given(document: Document) -> Iterator[tuple[KeyPath, str, str, float]]:
    """Where the file gives a property, its group and key, and each number there."""
    for path, value in walk(document):
        place = path[:4]
        match [key for key in path if isinstance(key, str)]:
            case ["mechanism", group, _, key, *_]:
                pass
            case ["trajectory", "waypoints" | "angle" | "orientation" as key]:
                group, place = "trajectory", path[: path.index(key) + 1]
            case _:
                continue
        numbers = value if isinstance(value, tuple) else (value,)
        yield from ((place, group, key, n) for n in numbers if isinstance(n, float))
    joints, turning = document.mechanism.joints, []
    for k, c in enumerate(document.coordinates.values()):
        kind = joints[c.joint].type
        if kind != "screw" and freedom_of(kind, c.component) != "translation":
            turning.append(k)
    for place, row in coordinate_lists(document):  # screws turn many times
        angles = [row[k] for k in turning]
        place = place[:-1] if isinstance(place[-1], int) else place
        yield place, "trajectory", "angle", max(angles, key=abs, default=0.0)
    for place, varied, number in _varied(document):
        group, _, key, *_ = (*varied.split("."), "")
        yield place, group, key, number


def _varied(document: Document) -> Iterator[tuple[KeyPath, str, float]]:
    """Where the file varies a property, its path, and values that it then has."""
    for name, entry in document.design.entries.items():
        if isinstance(entry, Choices):
            for choice, values in entry.choices.items():
                for path in entry.properties:
                    yield ("design", name, "choices", choice, path), path, values[path]
            continue
        for key, end in zip(("min", "max"), entry.range, strict=True):
            key = key if entry.values is None else "values"
            for path, factor in entry.factors.items():
                own = Given(factor * end, getattr(end, "text", math.nan))
                yield ("design", name, key), path, own
    for place, _, motion in named_trajectories(document.trajectory):
        for path, value in motion.set.items():
            yield (*place, "set", path), path, value.add if isinstance(value, Added) else value


# --- Sections, links and bodies


def bare_sections_can_exist(document: Document) -> Iterator[Finding]:
    """Area and moments are those of one section."""
    for name, section in document.mechanism.sections.items():
        for key in ("bending_inertia", "inertia_z", "inertia_y"):
            inertia, A = getattr(section, key, None), getattr(section, "area", 0.0)
            # divided twice, since area² underflows where area itself does not
            if inertia is not None and not STOUTNESS[0] <= inertia / A / A <= STOUTNESS[1]:
                yield (
                    ("mechanism", "sections", name, key),
                    f"area {written(A, 'm2')} and {key} {written(inertia, 'm4')} cannot belong to "
                    f"one section: its radius of gyration would be {math.sqrt(inertia / A):.3g} m, "
                    f"and a solid round bar of that area has {A * A / (4 * math.pi):.3g} m4; check "
                    "the exponents",
                )


def beams_without_shear_are_slender(document: Document) -> Iterator[Finding]:
    """Euler–Bernoulli beams are much longer than deep."""
    spatial = document.mechanism.space == "spatial"
    sections = document.mechanism.sections
    for name, link in document.mechanism.links.items():
        if not isinstance(link, BeamLink) or link.shear:
            continue
        taper = link.section if isinstance(link.section, Taper) else None
        ends = (taper.start, taper.end) if taper else (str(link.section),)
        thick = max(ends, key=lambda name: sections[name].depth(spatial))
        slenderness = link.length / sections[thick].depth(spatial)
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


# --- What is asked


def starts_outside(document: Document) -> Iterator[Finding]:
    """The design that the file has is inside its bounds; a list need not have it."""
    design = document.design
    chosen = {k for catalogue in design.catalogues for k in catalogue.columns}
    for k, (name, column) in enumerate(design.parameters.items()):
        unit, ends = property_at(document, column.parameter).si, (column.min, column.max)
        value, bare = value_at(document, column.parameter), not SI("", *ends).answered
        meant, size = LEFT_OUT.get(unit, ("", 0.0))
        slipped = bare and size * column.min <= value <= size * column.max
        if column.min <= value <= column.max or (k in chosen and not slipped):
            continue
        low, high = (written(end, "" if bare else unit, *ends) for end in ends)
        bounds, why = f"[{low}, {high}]", "; the optimum will lie inside"
        if slipped:
            why = f"; a bare number is in {unit}: was {bounds} {meant} meant?"
        elif column.min <= size * value <= column.max:
            why = slip(value, unit) or why
        bounds += f" {unit}" * bare
        message = f"initial value {written(value, unit)} of {column.parameter} is outside "
        yield ("design", name), f"{message}{bounds}{why}"


def uncertain_counts_where_it_is_asked(document: Document) -> Iterator[Finding]:
    """What is not known exactly is for robust designs."""
    if document.uncertain and document.targets and not document.assignment.robust:
        yield ("uncertain",), "does not count: write assignment: {robust: true} where it is to"


WARNINGS: tuple[Callable[[Document], Iterator[Finding]], ...] = (
    numbers_have_the_size_of_machines,
    bare_lengths_are_of_machines,
    bare_sections_can_exist,
    beams_without_shear_are_slender,
    inertias_are_those_of_bodies,
    starts_outside,
    uncertain_counts_where_it_is_asked,
)
