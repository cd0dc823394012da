"""Design parameters: which number of the mechanism a path names, and whether its bounds make sense.

A path is `materials.<name>.<property>` and the like below `mechanism`, or
`coordinates.<name>.drive.stiffness` (or another key of `DRIVEN`). What can vary follows from the
models of the schema: every field that is one real number, and components of places and of spatial
angles, such as `joints.<name>.position.0`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import reduce
from typing import Annotated, Any, get_args, get_origin

from eigassign.case.reader import Finding, KeyPath, listed, suggestion, unknown
from eigassign.case.rules.lookups import ANY, driven, places
from eigassign.case.schema.design import Choices, Design
from eigassign.case.schema.document import Document
from eigassign.case.schema.links import RigidLink, Section, SolidLink
from eigassign.case.schema.mechanism import Coordinate, Mechanism, NutJoint
from eigassign.case.schema.parts import ANGLE, PLACE, FrozenDict, Part, Quantity, quantity
from eigassign.case.schema.trajectory import Added, named_trajectories
from eigassign.case.units import QuantityError

_GROUPS = {
    "materials": "material",
    "sections": "section",
    "links": "link",
    "joints": "joint",
    "bodies": "body",
    "springs": "spring",
}
_FORMS = (
    "expected materials.<name>.<property>, or the same of sections, links, bodies and springs, "
    "coordinates.<name>.drive.stiffness or .inertia, joints.<name>.position.0 or .angle"
)
_VECTORS = {  # of which components can vary
    "joints": {"position": PLACE, "orientation": ANGLE},
    "bodies": {"offset": PLACE},
    "links": {"center": PLACE, "nodes": PLACE},  # of rigid ones
}
DRIVEN = {  # of a drive: what it is where the joint turns, and where it slides
    "stiffness": (
        quantity("rotational stiffness", above=0),
        quantity("stiffness", above=0),
    ),
    "inertia": (quantity("rotary inertia", at_least=0), quantity("mass", at_least=0)),
    "motor_inertia": (quantity("rotary inertia", at_least=0),) * 2,
    "ratio": (Quantity(above=0), quantity("transmission", above=0)),
}
# By what a bare number is in: the unit that is easily left out, and its size.
_MEANT = {
    "m": ("mm", 1e-3),
    "kg": ("g", 1e-3),
    "Pa": ("GPa", 1e9),
    "N/m": ("kN/m", 1e3),
    "N m/rad": ("kN m/rad", 1e3),
}
# real numbers that the mechanism is built with
_FIXED = {("links", "roll"), ("links", "reduce_to"), ("springs", "angle"), ("joints", "lead")}


class NoPropertyError(ValueError):
    """The path names nothing that can be varied; the message says why."""


def property_at(case: Any, path: str) -> Quantity:
    """What the property at ``path`` may be (relative to `mechanism`, or from `coordinates` on).

    ``case`` has a `mechanism` and `coordinates`. Raises NoPropertyError where the path names
    nothing, or something that is not a real number.
    """
    mechanism: Mechanism = case.mechanism
    group, *rest = path.split(".")
    if group == "mechanism" and rest and rest[0] in _GROUPS:
        raise NoPropertyError(f"paths start below mechanism: write {'.'.join(rest)!r}")
    if group == "coordinates" and len(rest) == 3 and rest[1] == "drive":
        return _of_drive(mechanism, case.coordinates, rest[0], rest[2])
    if group in _VECTORS and len(rest) > 1 and rest[1] in _VECTORS[group]:
        return _of_component(mechanism, group, rest[0], rest[1], rest[2:])
    if group not in _GROUPS or len(rest) != 2:
        raise NoPropertyError(f"{_FORMS}; got {path!r}{_meant(mechanism, group, path)}")
    return _of_part(mechanism, group, *rest)


def known_property(case: Any, path: str) -> Quantity | None:
    """Quantity of the property at ``path``, None where it is unknown."""
    try:
        return property_at(case, path)
    except NoPropertyError:
        return None


def is_place(path: str) -> bool:
    """True where a property is a length, a place or an angle of the mechanism."""
    group, _, key, *_ = path.split(".")
    return key in ("length", "angle", *_VECTORS.get(group, ()))


def _meant(mechanism: Mechanism, group: str, path: str) -> str:
    """The group that was left out or misspelt, as a question."""
    if group in (*_GROUPS, "coordinates"):
        return ""
    for known in _GROUPS:
        if group in getattr(mechanism, known):
            return f"; did you mean '{known}.{path}'?"
    return suggestion(group, (*_GROUPS, "coordinates"))


def _part(mechanism: Mechanism, group: str, name: str) -> Any:
    known = getattr(mechanism, group)
    if name not in known:
        raise NoPropertyError(unknown(_GROUPS[group], name, known))
    return known[name]


def _of_component(
    mechanism: Mechanism, group: str, name: str, key: str, inner: Sequence[str]
) -> Quantity:
    """What a component of a place, or of the angles in space, may be."""
    part, owner, axes = _part(mechanism, group, name), f"{group}.{name}.{key}", "xyz"
    if group == "links" and not isinstance(part, RigidLink):
        raise NoPropertyError(f"{owner} cannot vary: the places in a link can where it is rigid")
    if mechanism.space == "planar":
        axes = "xy"
        if key == "orientation":
            instead = f"vary joints.{name}.angle"
            raise NoPropertyError(f"{owner} is for spatial mechanisms: {instead}")
    if key == "position" and isinstance(part, NutJoint):
        axes = "x"  # it stands on the axis of its shaft
    value = getattr(part, key)
    if key == "nodes":
        if not inner or inner[0] not in value:
            raise NoPropertyError(unknown("node with a place", ".".join(inner[:1]), value))
        value, owner, inner = value[inner[0]], f"{owner}.{inner[0]}", inner[1:]
    if len(inner) != 1 or inner[0] not in [str(k) for k in range(len(axes))]:
        forms = listed([f"{owner}.{k}" for k in range(len(axes))])
        raise NoPropertyError(f"{owner} varies by component ({', '.join(axes)}): {forms}")
    if value is None and group == "links":  # joints and bodies are at their node, and not turned
        raise NoPropertyError(f"{owner} has no value in this file: give it an initial value")
    return _VECTORS[group][key]


def _of_part(mechanism: Mechanism, group: str, name: str, key: str) -> Quantity:
    part, owner = _part(mechanism, group, name), f"{group}.{name}"
    spatial = mechanism.space == "spatial"
    if (group, key) == ("joints", "angle") and spatial:
        raise NoPropertyError(f"{owner}.angle is for planar mechanisms: vary {owner}.orientation.2")
    real = {k: q for k, q in quantities(type(part)).items() if (group, k) not in _FIXED}
    if key not in real:
        message = f"{owner} has no property {key!r}{suggestion(key, real)}"
        if key in type(part).model_fields:
            message = f"{owner}.{key} is not a real number and cannot vary"
        raise NoPropertyError(f"{message}; can vary: {listed(real)}")
    if key == "inertia" and spatial:
        raise NoPropertyError(f"{owner}.inertia is a tensor in space and cannot vary")
    solids = [
        link
        for link, each in mechanism.links.items()
        if isinstance(each, SolidLink) and each.material == name
    ]
    if (group, key) == ("materials", "poissons_ratio") and solids:
        raise NoPropertyError(
            f"{owner}.{key} cannot vary: the matrices of the solid {solids[0]} are made for one; "
            f"vary {owner}.youngs_modulus or {owner}.density"
        )
    written = getattr(part, key)
    if written is None:
        raise NoPropertyError(f"{owner}.{key} has no value in this file: give it an initial value")
    if isinstance(written, tuple):
        raise NoPropertyError(
            f"{owner}.{key} is a list in this file and cannot vary: give one number"
        )
    return real[key]


def quantities(model: type[Part]) -> dict[str, Quantity]:
    """The real-valued properties that a mechanism can be built with as variables."""
    found = {k: _quantity(f.annotation, f.metadata) for k, f in model.model_fields.items()}
    return {key: q for key, q in found.items() if q is not None}


def _quantity(annotation: Any, metadata: Sequence[object]) -> Quantity | None:
    """Quantity of a field that is one number, or may be; not of the entries of a list."""
    for item in metadata:
        if isinstance(item, Quantity):
            return item
    if get_origin(annotation) in (tuple, Mapping):
        return None
    inner = (get_args(a) for a in get_args(annotation) if get_origin(a) is Annotated)
    return next((q for kind, *more in inner if (q := _quantity(kind, more)) is not None), None)


def _of_drive(
    mechanism: Mechanism, known: Mapping[str, Coordinate], name: str, key: str
) -> Quantity:
    if key not in DRIVEN:
        wrong = f"a drive has no property {key!r}{suggestion(key, DRIVEN)}"
        raise NoPropertyError(f"{wrong}; can vary: {listed(DRIVEN)}")
    if name not in known:
        raise NoPropertyError(unknown("coordinate", name, known))
    if getattr(known[name].drive, key, None) is None:
        raise NoPropertyError(
            f"coordinate {name!r} has no drive {key}: write drive: {{{key}: ...}}"
        )
    return drive_quantity(mechanism, known[name], key)


def drive_quantity(mechanism: Mechanism, coordinate: Coordinate, key: str) -> Quantity:
    """Quantity of a property of a coordinate's drive."""
    freedom = driven(mechanism, coordinate)
    if freedom is None:
        return ANY
    turning, sliding = DRIVEN[key]
    return sliding if freedom == "translation" else turning


def value_at(case: Any, path: str) -> float:
    """The number at ``path`` in the parts of a valid case, in SI."""
    owner = case if path.startswith("coordinates.") else case.mechanism
    value = reduce(below, path.split("."), owner)
    return 0.0 if value is None else float(value)  # it is at its node, and not turned


def below(part: Any, key: str) -> Any:
    """What stands below a part, a mapping of parts or a list; None where nothing does."""
    if isinstance(part, Mapping):
        return part.get(key)
    if isinstance(part, tuple):
        return part[int(key)] if key.isdecimal() and int(key) < len(part) else None
    return getattr(part, key, None)


def with_value(part: Any, path: Sequence[str | int], value: float) -> Any:
    """A copy of a part, or of a mapping or list of parts, with one number below it replaced."""
    if not path:
        return value
    key, *rest = path
    if isinstance(part, Mapping):
        return FrozenDict({**part, str(key): with_value(part[str(key)], rest, value)})
    if isinstance(part, tuple):
        k = int(key)
        return (*part[:k], with_value(part[k], rest, value), *part[k + 1 :])
    return part.model_copy(update={key: with_value(getattr(part, str(key)), rest, value)})


# --- Rules


def parameters_name_properties(document: Document) -> Iterator[Finding]:
    """The path of a design parameter names a number that can vary."""
    for own in places(document.design).values():
        yield from _no_properties(document, own)


def _no_properties(document: Document, own: Mapping[str, KeyPath]) -> Iterator[Finding]:
    for path, place in own.items():
        try:
            property_at(document, path)
        except NoPropertyError as error:
            yield place, str(error)


def properties_of_one_parameter_are_alike(document: Document) -> Iterator[Finding]:
    """A factor has no unit: what a parameter varies together has one dimension."""
    for own in places(document.design).values():
        name, *others = own
        first = known_property(document, name)
        for path in others:
            kind = known_property(document, path)
            if kind and first and ANY not in (kind, first) and kind.dimension != first.dimension:
                kinds = [q.dimension.name if q.dimension else "number" for q in (kind, first)]
                message = f"{path} is a {kinds[0]}, {name} a {kinds[1]}: a factor"
                yield own[path], f"{message} has no unit, so that they need parameters of their own"


def load_cases_set_properties(document: Document) -> Iterator[Finding]:
    """Trajectories set numbers that can vary; to design parameters they can only add."""
    owner = {path: name for name, own in places(document.design).items() for path in own}
    for place, _, motion in named_trajectories(document.trajectory):
        yield from _no_properties(document, {path: (*place, "set", path) for path in motion.set})
        for path, value in motion.set.items():
            if path in owner and not isinstance(value, Added):
                message = f"is the design parameter {owner[path]!r}, which a trajectory cannot set"
                yield (*place, "set", path), message + ": write {add: …} for what it adds"


def parameters_agree_with_the_file(document: Document) -> Iterator[Finding]:
    """What one parameter varies together is in its proportion where the mechanism is written."""
    placed = places(document.design)
    for name, column in document.design.parameters.items():
        first = value_at(document, column.parameter)
        for path, factor in [*column.factors.items()][1:]:
            value, wanted = value_at(document, path), factor * first
            # digits that a product has and no file: 0.8 × 0.04 is not 0.032 to the last one
            if abs(value - wanted) > 1e-9 * abs(wanted):
                dimension = property_at(document, path).dimension
                unit = f" {dimension.si}".rstrip() if dimension else ""
                yield (
                    placed[name][path],
                    f"is {value:.12g}{unit} in this file, where {factor:.12g} × "
                    f"{column.parameter} is {wanted:.12g}{unit}: write that, or another factor",
                )


def starts_outside(document: Document) -> Iterator[Finding]:
    """Warnings where what the file has as design is outside its bounds, or none of those listed.

    Bounds and lists say where the answer may be, so that the start need not be there.
    """
    design = document.design
    start = [value_at(document, column.parameter) for column in design.parameters.values()]
    listed_only = {k for catalogue in design.catalogues for k in catalogue.columns}
    slips = set[int]()
    for k, (name, column) in enumerate(design.parameters.items()):
        dimension = property_at(document, column.parameter).dimension
        unit, bounds = dimension.si if dimension else "", f"[{column.min:g}, {column.max:g}]"
        value = start[k]
        if column.min <= value <= column.max:
            continue
        why, (meant, size) = "the optimum will lie inside", _MEANT.get(unit, ("", 0.0))
        if size * column.min <= value <= size * column.max:
            why = f"a bare number is in {unit}: was {bounds} {meant} meant?"
            slips.add(k)
        elif k in listed_only:
            continue
        message = f"initial value {value:g} {unit} of {column.parameter} is outside "
        yield ("design", name), f"{message}{bounds} {unit}; {why}"
    for catalogue in design.catalogues:
        own = tuple(start[k] for k in catalogue.columns)
        if own not in catalogue.rows and not slips.intersection(catalogue.columns):
            message = f"the initial value is none of those listed: {listed(catalogue.choices)}"
            yield ("design", catalogue.name), message


# --- What a design, or a trajectory with it, could break

Varied = Mapping[str, Sequence[tuple[int, float]]]  # properties by path: Σ factor · entry
Box = Sequence[tuple[float, float]]  # SI: the least and the largest value of each entry


def bounds_hold_nothing_impossible(document: Document) -> Iterator[Finding]:
    """Mechanisms exist wherever the design may go; each problem is at the bound to narrow.

    A robust one may go further by its tolerances.
    """
    design = document.design
    columns = list(design.parameters.values())
    owner = [
        name
        for name, e in design.entries.items()
        for _ in (e.properties if isinstance(e, Choices) else (name,))
    ]
    varied, box = design.varied, [(column.min, column.max) for column in columns]
    for k, column in enumerate(columns):
        if document.assignment.robust and column.tolerance is not None:
            low, high = (column.tolerance.deviation(end) for end in box[k])
            prop = property_at(document, column.parameter)
            if 0 in (prop.at_least, prop.above):  # as masses are never below 0
                low = min(low, max(column.min, 0.0))
            box[k] = column.min - low, column.max + high
    for row, message in impossible(document.mechanism.sections, varied, box):
        k, factor = next(iter(row.items()))
        body = design.entries[owner[k]]
        if isinstance(body, Choices):
            advice = "give the choices by dimensions that can be combined, such as thickness"
            yield ("design", owner[k], "choices"), f"between these choices {message}; {advice}"
        else:
            place = _bound(design, owner[k], factor > 0.0)
            yield place, f"at this bound {message}; narrow the bounds"
    # A bound itself was read, what deviates from it was not.
    deviates = [document.assignment.robust and bool(column.tolerance) for column in columns]
    first = {column.parameter for column, more in zip(columns, deviates, strict=True) if not more}
    together = {path: terms for path, terms in varied.items() if path not in first}
    for path, side, message in _outside(document, together, box):
        ((k, factor),) = varied[path]
        place = _bound(design, owner[k], (side == 0) == (factor > 0.0))
        where = "at this bound with its tolerance" if deviates[k] else "at this bound"
        yield place, f"{where} {message}; narrow the bounds"


def _bound(design: Design, name: str, lower: bool) -> KeyPath:
    """Where the file gives a bound of a parameter, or its values."""
    entry = design.entries[name]
    if isinstance(entry, Choices):
        return "design", name, "choices"
    return ("design", name, "values" if entry.values is not None else "min" if lower else "max")


def load_cases_set_nothing_impossible(document: Document) -> Iterator[Finding]:
    """Mechanisms exist along each trajectory that sets or adds something."""
    design = document.design
    bounds = [(column.min, column.max) for column in design.parameters.values()]
    for place, _, motion in named_trajectories(document.trajectory):
        varied, box = dict(design.varied), list(bounds)
        for path, value in motion.set.items():
            amount = value.add if isinstance(value, Added) else value
            if isinstance(value, Added) and path not in varied:
                amount += value_at(document, path)
            varied[path] = (*varied.get(path, ()), (len(box), 1.0))
            box.append((amount, amount))
        paths = list(motion.set)
        for row, message in impossible(document.mechanism.sections, varied, box):
            for k in [k for k in row if k >= len(bounds)][:1]:
                yield (*place, "set", paths[k - len(bounds)]), message
        added = {p: varied[p] for p in paths if isinstance(motion.set[p], Added)}
        for path, _, message in _outside(document, added, box):
            yield (*place, "set", path), f"with this {message}"


def _outside(document: Document, varied: Varied, box: Box) -> Iterator[tuple[str, int, str]]:
    """Path, end (0 least, 1 largest) and what is wrong of properties beyond what they may be."""
    for path, terms in varied.items():
        prop = property_at(document, path)
        for side, value in enumerate(least_and_largest(terms, box)):
            try:
                prop.checked(value, f"{value:g}")
            except QuantityError as error:
                yield path, side, f"{path} {error}"
                break


def least_and_largest(terms: Sequence[tuple[int, float]], box: Box) -> tuple[float, float]:
    """The least and the largest value of Σ factor · entry with each entry in its range."""
    ends = [sorted((factor * box[k][0], factor * box[k][1])) for k, factor in terms]
    return sum(low for low, _ in ends), sum(high for _, high in ends)


def impossible(
    sections: Mapping[str, Section], varied: Varied, box: Box
) -> Iterator[tuple[dict[int, float], str]]:
    """(factors by entry, what is wrong) of entries that can break a section.

    Each limit is linear in the entries, so the worst corner of their box decides; along a taper the
    limits hold between ends at which they hold. The factors are of the room that the limit leaves,
    those of what must be smaller first.
    """
    for name, section in sections.items():
        for limit in section.limits():
            row, terms, at_worst = dict[int, float](), {}, {}
            for key, factor in ((limit.small, -float(limit.factor)), (limit.large, 1.0)):
                terms[key] = varied.get(f"sections.{name}.{key}", ())
                for k, own in terms[key]:
                    row[k] = row.get(k, 0.0) + factor * own
            for key, parts in terms.items():
                corner = [factor * box[k][row[k] < 0.0] for k, factor in parts]
                at_worst[key] = sum(corner) if parts else getattr(section, key)
            a, b = at_worst[limit.small], at_worst[limit.large]
            row = {k: factor for k, factor in row.items() if factor}
            if row and not limit.holds(a, b):
                message = f"section {name!r} {limit.beyond}: {limit.small} {a:g} m {limit}, "
                yield row, f"{message}which can be {b / limit.factor:g} m"
