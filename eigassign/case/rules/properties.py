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

from pydantic_core import PydanticUndefined

from eigassign.case.reader import Finding, KeyPath, Tree, at, items, names, text
from eigassign.case.rules.lookups import (
    ANY,
    columns,
    driven,
    is_spatial,
    links,
    trajectories,
    type_of,
)
from eigassign.case.schema.design import Choices, Design
from eigassign.case.schema.joints import JOINTS
from eigassign.case.schema.links import LINKS
from eigassign.case.schema.mechanism import Body, Spring
from eigassign.case.schema.parts import ANGLE, PLACE, Part, Quantity, quantity
from eigassign.case.schema.sections import SHAPES, Material, Section
from eigassign.case.suggestions import listed, suggestion, unknown
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


def property_at(tree: Tree, path: str) -> Quantity | None:
    """What the property at ``path`` may be (relative to `mechanism`, or from `coordinates` on).

    None where the path may be right but the file has another error there; raises NoPropertyError
    where it names nothing, or something that is not a real number.
    """
    group, *rest = path.split(".")
    if group == "mechanism" and rest and rest[0] in _GROUPS:
        raise NoPropertyError(f"paths start below mechanism: write {'.'.join(rest)!r}")
    if group == "coordinates" and len(rest) == 3 and rest[1] == "drive" and rest[2] in DRIVEN:
        return _of_drive(tree, rest[0], rest[2])
    if group == "coordinates" and len(rest) == 3 and rest[1] == "drive":
        wrong = f"a drive has no property {rest[2]!r}{suggestion(rest[2], DRIVEN)}"
        raise NoPropertyError(f"{wrong}; can vary: {listed(DRIVEN)}")
    if group in _VECTORS and len(rest) > 1 and rest[1] in _VECTORS[group]:
        return _of_component(tree, group, rest[0], rest[1], rest[2:])
    if group not in _GROUPS or len(rest) != 2:
        raise NoPropertyError(f"{_FORMS}; got {path!r}{_meant(tree, group, path)}")
    return _of_part(tree, group, *rest)


def known_property(tree: Tree, path: str | None) -> Quantity | None:
    """Quantity of the property at ``path``, None where it is unknown."""
    try:
        return None if path is None else property_at(tree, path)
    except NoPropertyError:
        return None


def properties_of(tree: Tree) -> Iterator[str]:
    """The paths of all numbers of a valid mechanism that can vary."""
    paths = [
        f"coordinates.{name}.drive.{key}" for name in names(tree, "coordinates") for key in DRIVEN
    ]
    for group in _GROUPS:
        for name, body in items(tree, "mechanism", group):
            model = _model(group, body)
            paths += [f"{group}.{name}.{key}" for key in (quantities(model) if model else ())]
            for key in _VECTORS.get(group, ()):
                own = f"{group}.{name}.{key}"
                each = [f"{own}.{node}" for node in names(body, key)] if key == "nodes" else [own]
                paths += [f"{place}.{k}" for place in each for k in range(3)]
    yield from (path for path in paths if known_property(tree, path) is not None)


def is_place(path: str) -> bool:
    """True where a property is a length, a place or an angle of the mechanism."""
    group, _, key, *_ = path.split(".")
    return key in ("length", "angle", *_VECTORS.get(group, ()))


def properties(tree: Tree) -> dict[str, Quantity | None]:
    """Quantity of each component of y, None where it is unknown."""
    return {column.name: known_property(tree, column.parameter) for column in columns(tree)}


def _meant(tree: Tree, group: str, path: str) -> str:
    """The group that was left out or misspelt, as a question."""
    if group in (*_GROUPS, "coordinates"):
        return ""
    for known in _GROUPS:
        named = at(tree, "mechanism", known)
        if isinstance(named, Mapping) and group in named:
            return f"; did you mean '{known}.{path}'?"
    return suggestion(group, (*_GROUPS, "coordinates"))


def _part(tree: Tree, group: str, name: str) -> object:
    known = at(tree, "mechanism", group)
    if known is None and group != "links":
        known = {}
    if isinstance(known, Mapping) and name not in known:
        raise NoPropertyError(unknown(_GROUPS[group], name, known))
    return at(known, name)


def _of_component(
    tree: Tree, group: str, name: str, key: str, inner: Sequence[str]
) -> Quantity | None:
    """What a component of a place, or of the angles in space, may be."""
    body, owner, axes = _part(tree, group, name), f"{group}.{name}.{key}", "xyz"
    if group == "links" and type_of(body) != "rigid":
        raise NoPropertyError(f"{owner} cannot vary: the places in a link can where it is rigid")
    if key == "orientation" and not is_spatial(tree):
        raise NoPropertyError(f"{owner} is for spatial mechanisms: vary joints.{name}.angle")
    if not is_spatial(tree):
        axes = "xy"
    if key == "position" and text(body, "type") == "nut":
        axes = "x"  # it stands on the axis of its shaft
    value = at(body, key)
    if key == "nodes":
        nodes = names(body, key)
        if not inner or inner[0] not in nodes:
            raise NoPropertyError(unknown("node with a place", ".".join(inner[:1]), nodes))
        value, owner, inner = at(value, inner[0]), f"{owner}.{inner[0]}", inner[1:]
    if len(inner) != 1 or inner[0] not in [str(k) for k in range(len(axes))]:
        forms = listed([f"{owner}.{k}" for k in range(len(axes))])
        raise NoPropertyError(f"{owner} varies by component ({', '.join(axes)}): {forms}")
    if value is None and group == "links":  # joints and bodies are at their node, and not turned
        raise NoPropertyError(f"{owner} has no value in this file: give it an initial value")
    return _VECTORS[group][key]


def _of_part(tree: Tree, group: str, name: str, key: str) -> Quantity | None:
    body, owner = _part(tree, group, name), f"{group}.{name}"
    model = _model(group, body)
    if model is None:
        return None
    if (group, key) == ("joints", "angle") and is_spatial(tree):
        raise NoPropertyError(f"{owner}.angle is for planar mechanisms: vary {owner}.orientation.2")
    real = quantities(model)
    if key not in real or (group, key) in _FIXED:
        real = {each: q for each, q in real.items() if (group, each) not in _FIXED}
        message = f"{owner} has no property {key!r}{suggestion(key, real)}"
        if key in model.model_fields:
            message = f"{owner}.{key} is not a real number and cannot vary"
        raise NoPropertyError(f"{message}; can vary: {listed(real)}")
    if key == "inertia" and is_spatial(tree):
        raise NoPropertyError(f"{owner}.inertia is a tensor in space and cannot vary")
    solids = [link for link, _, each in links(tree, "solid") if text(each, "material") == name]
    if (group, key) == ("materials", "poissons_ratio") and solids:
        raise NoPropertyError(
            f"{owner}.{key} cannot vary: the matrices of the solid {solids[0]} are made for one; "
            f"vary {owner}.youngs_modulus or {owner}.density"
        )
    written = at(body, key)
    if written is None:
        written = model.model_fields[key].get_default()
    if written is None or written is PydanticUndefined:
        raise NoPropertyError(f"{owner}.{key} has no value in this file: give it an initial value")
    if isinstance(written, (tuple, list)):
        raise NoPropertyError(
            f"{owner}.{key} is a list in this file and cannot vary: give one number"
        )
    return real[key]


def _model(group: str, body: object) -> type[Part] | None:
    if not isinstance(body, Mapping):
        return None
    if group == "sections":
        shape = body.get("shape", "bare")
        return SHAPES.get(shape) if isinstance(shape, str) else None
    if group == "links":
        return LINKS.get(type_of(body) or "")
    if group == "joints":
        return JOINTS.get(text(body, "type") or "")
    models: dict[str, type[Part]] = {"materials": Material, "bodies": Body, "springs": Spring}
    return models[group]


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


def _of_drive(tree: Tree, name: str, key: str) -> Quantity:
    if name not in (known := names(tree, "coordinates")):
        raise NoPropertyError(unknown("coordinate", name, known))
    if at(tree, "coordinates", name, "drive", key) is None:
        raise NoPropertyError(
            f"coordinate {name!r} has no drive {key}: write drive: {{{key}: ...}}"
        )
    return drive_quantity(tree, at(tree, "coordinates", name), key)


def drive_quantity(tree: Tree, coordinate: object, key: str) -> Quantity:
    """Quantity of a property of a coordinate's drive."""
    freedom = driven(tree, coordinate)
    if freedom is None:
        return ANY
    turning, sliding = DRIVEN[key]
    return sliding if freedom == "translation" else turning


# --- Rules


def parameters_name_properties(tree: Tree) -> Iterator[Finding]:
    """The path of a design parameter names a number that can vary."""
    for column in columns(tree):
        for path, place in column.properties:
            try:
                property_at(tree, path)
            except NoPropertyError as error:
                yield place, str(error)


def properties_of_one_parameter_are_alike(tree: Tree) -> Iterator[Finding]:
    """A factor has no unit: what a parameter varies together has one dimension."""
    for column in columns(tree):
        first = known_property(tree, column.parameter)
        for path, place in column.properties[1:]:
            own = known_property(tree, path)
            if own and first and ANY not in (own, first) and own.dimension != first.dimension:
                kinds = [q.dimension.name if q.dimension else "number" for q in (own, first)]
                message = f"{path} is a {kinds[0]}, {column.parameter} a {kinds[1]}: a factor"
                yield place, f"{message} has no unit, so that they need parameters of their own"


def load_cases_set_properties(tree: Tree) -> Iterator[Finding]:
    """Trajectories set numbers that can vary; to design parameters they can only add."""
    owner = {path: column.name for column in columns(tree) for path, _ in column.properties}
    for place, body in trajectories(tree):
        for path, value in items(body, "set"):
            try:
                property_at(tree, path)
            except NoPropertyError as error:
                yield (*place, "set", path), str(error)
            if path in owner and not isinstance(value, Mapping):
                message = f"is the design parameter {owner[path]!r}, which a trajectory cannot set"
                yield (*place, "set", path), message + ": write {add: …} for what it adds"


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


def parameters_agree_with_the_file(tree: Tree, case: Any) -> Iterator[Finding]:
    """What one parameter varies together is in its proportion where the mechanism is written."""
    placed = {column.name: column.properties[1:] for column in columns(tree)}
    for name, column in case.design.parameters.items():
        known = all(known_property(tree, path) for path in column.factors)
        first = value_at(case, column.parameter) if known else 0.0
        for path, place in placed[name] if known else ():
            value, wanted = value_at(case, path), column.factors[path] * first
            # digits that a product has and no file: 0.8 × 0.04 is not 0.032 to the last one
            if abs(value - wanted) > 1e-9 * abs(wanted):
                prop = known_property(tree, path)
                unit = f" {prop.dimension.si}".rstrip() if prop and prop.dimension else ""
                yield (
                    place,
                    f"is {value:.12g}{unit} in this file, where {column.factors[path]:.12g} × "
                    f"{column.parameter} is {wanted:.12g}{unit}: write that, or another factor",
                )


def starts_outside(tree: Tree, case: Any) -> Iterator[Finding]:
    """Warnings where what the file has as design is outside its bounds, or none of those listed.

    Bounds and lists say where the answer may be, so that the start need not be there.
    """
    design = case.design
    found = [known_property(tree, column.parameter) for column in design.parameters.values()]
    units = [p.dimension.si if p and p.dimension else "" for p in found]
    start = [value_at(case, column.parameter) for column in design.parameters.values()]
    listed_only = {k for catalogue in design.catalogues for k in catalogue.columns}
    slips = set[int]()
    for k, (name, column) in enumerate(design.parameters.items()):
        value, unit, bounds = start[k], units[k], f"[{column.min:g}, {column.max:g}]"
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


def bounds_hold_nothing_impossible(tree: Tree, document: Any) -> Iterator[Finding]:
    """Mechanisms exist wherever the design may go; each problem is at the bound to narrow.

    A robust one may go further by its tolerances.
    """
    design: Design = document.design
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
            prop = known_property(tree, column.parameter)
            if prop and 0 in (prop.at_least, prop.above):  # as masses are never below 0
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
    for path, side, message in _outside(tree, together, box):
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


def load_cases_set_nothing_impossible(
    tree: Tree, document: Any, motions: Sequence[tuple[KeyPath, str, Any]]
) -> Iterator[Finding]:
    """Mechanisms exist along each trajectory that sets or adds something."""
    design: Design = document.design
    bounds = [(column.min, column.max) for column in design.parameters.values()]
    for place, _, motion in motions:
        varied, box = dict(design.varied), list(bounds)
        for path, value in motion.set.items():
            more = getattr(value, "add", None)
            amount = value if more is None else more
            if more is not None and path not in varied and known_property(tree, path):
                amount = more + value_at(document, path)
            varied[path] = (*varied.get(path, ()), (len(box), 1.0))
            box.append((amount, amount))
        paths = list(motion.set)
        for row, message in impossible(document.mechanism.sections, varied, box):
            for k in [k for k in row if k >= len(bounds)][:1]:
                yield (*place, "set", paths[k - len(bounds)]), message
        added = {p: varied[p] for p in paths if getattr(motion.set[p], "add", None) is not None}
        for path, _, message in _outside(tree, added, box):
            yield (*place, "set", path), f"with this {message}"


def _outside(tree: Tree, varied: Varied, box: Box) -> Iterator[tuple[str, int, str]]:
    """Path, end (0 least, 1 largest) and what is wrong of properties beyond what they may be."""
    for path, terms in varied.items():
        prop = known_property(tree, path)
        for side, value in enumerate(least_and_largest(terms, box)):
            try:
                _ = prop and prop.checked(value, f"{value:g}")
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
