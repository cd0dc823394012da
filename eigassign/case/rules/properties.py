"""Design parameters: which number of the mechanism a path names, and whether its bounds make sense.

A path is `materials.<name>.<property>` and the like below `mechanism`, or
`coordinates.<name>.drive.stiffness` (or `inertia`). What can vary follows from the models of the
schema: every field that is one real number.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, get_args, get_origin

from pydantic_core import PydanticUndefined

from eigassign.case.reader import Finding, KeyPath, Tree, at, names
from eigassign.case.rules.lookups import (
    ANY,
    columns,
    driven,
    is_spatial,
    trajectories,
    type_of,
)
from eigassign.case.schema.design import Choices, Design
from eigassign.case.schema.links import LINKS
from eigassign.case.schema.mechanism import Body, Spring
from eigassign.case.schema.parts import Part, Quantity, quantity
from eigassign.case.schema.sections import SHAPES, Material, Section
from eigassign.case.suggestions import listed, suggestion, unknown

_GROUPS = {
    "materials": "material",
    "sections": "section",
    "links": "link",
    "bodies": "body",
    "springs": "spring",
}
_FORMS = (
    "expected materials.<name>.<property>, sections.<name>.<property>, links.<name>.length, "
    "bodies.<name>.<property>, springs.<name>.<property>, coordinates.<name>.drive.stiffness or "
    "coordinates.<name>.drive.inertia"
)
DRIVEN = {  # of a drive: what it is where the joint turns, and where it slides
    "stiffness": (
        quantity("rotational stiffness", above=0),
        quantity("stiffness", above=0),
    ),
    "inertia": (quantity("rotary inertia", at_least=0), quantity("mass", at_least=0)),
}
_FIXED = {"roll", "reduce_to", "angle"}  # real numbers that the mechanism is built with


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
    if group not in _GROUPS or len(rest) != 2:
        raise NoPropertyError(f"{_FORMS}; got {path!r}{_meant(tree, group, path)}")
    return _of_part(tree, group, *rest)


def known_property(tree: Tree, path: str | None) -> Quantity | None:
    """Quantity of the property at ``path``, None where it is unknown."""
    try:
        return None if path is None else property_at(tree, path)
    except NoPropertyError:
        return None


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


def _of_part(tree: Tree, group: str, name: str, key: str) -> Quantity | None:
    known = at(tree, "mechanism", group)
    if known is None and group != "links":
        known = {}
    if isinstance(known, Mapping) and name not in known:
        raise NoPropertyError(unknown(_GROUPS[group], name, known))
    body, owner = at(known, name), f"{group}.{name}"
    model = _model(group, body)
    if model is None:
        return None
    real = quantities(model)
    if key not in real:
        message = f"{owner} has no property {key!r}{suggestion(key, real)}"
        if key in model.model_fields:
            message = f"{owner}.{key} is not a real number and cannot vary"
        raise NoPropertyError(f"{message}; can vary: {listed(real)}")
    if key == "inertia" and is_spatial(tree):
        raise NoPropertyError(f"{owner}.inertia is a tensor in space and cannot vary")
    written = at(body, key)
    if written is None:
        written = model.model_fields[key].get_default()
    if written is None or written is PydanticUndefined:
        raise NoPropertyError(f"{owner}.{key} has no value in this file: give it an initial value")
    if isinstance(written, tuple):
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
    models: dict[str, type[Part]] = {"materials": Material, "bodies": Body, "springs": Spring}
    return models[group]


def quantities(model: type[Part]) -> dict[str, Quantity]:
    """The real-valued properties that a mechanism can be built with as variables."""
    found = {k: _quantity(f.annotation, f.metadata) for k, f in model.model_fields.items()}
    return {key: q for key, q in found.items() if q is not None and key not in _FIXED}


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
    """Quantity of the stiffness or inertia of a coordinate's drive."""
    freedom = driven(tree, coordinate)
    if freedom is None:
        return ANY
    turning, sliding = DRIVEN[key]
    return sliding if freedom == "translation" else turning


# --- Rules


def parameters_name_properties(tree: Tree) -> Iterator[Finding]:
    """The path of a design parameter names a number that can vary."""
    for _, path, place in columns(tree):
        try:
            _ = path and property_at(tree, path)
        except NoPropertyError as error:
            yield place, str(error)


def load_cases_set_properties(tree: Tree) -> Iterator[Finding]:
    """Trajectories set numbers that can vary, and no design parameters."""
    owner = {column.parameter: column.name for column in columns(tree)}
    for place, body in trajectories(tree):
        for path in names(body, "set"):
            try:
                property_at(tree, path)
            except NoPropertyError as error:
                yield (*place, "set", path), str(error)
            if path in owner:
                message = f"is the design parameter {owner[path]!r}: one of them can have it"
                yield (*place, "set", path), message


def value_at(case: Any, path: str) -> float:
    """The number at ``path`` in the parts of a valid case, in SI."""
    head, name, *keys = path.split(".")
    value: Any = (case.coordinates if head == "coordinates" else getattr(case.mechanism, head))[
        name
    ]
    for key in keys:
        value = getattr(value, key)
    return float(value)


def starts_outside(tree: Tree, case: Any) -> Iterator[Finding]:
    """Warnings where what the file has as design is outside its bounds, or none of those listed.

    Bounds and lists say where the answer may be, so that the start need not be there.
    """
    design = case.design
    found = [property_at(tree, column.parameter) for column in design.parameters.values()]
    units = [p.dimension.si if p and p.dimension else "" for p in found]
    start = [value_at(case, column.parameter) for column in design.parameters.values()]
    catalogued = {k for catalogue in design.catalogues for k in catalogue.columns}
    why = "; the optimum will lie inside"
    for k, (name, column) in enumerate(design.parameters.items()):
        value, unit = start[k], units[k]
        if k in catalogued or column.min <= value <= column.max:
            continue
        message = f"initial value {value:g} {unit} of {column.parameter} is outside "
        bounds = f"[{column.min:g}, {column.max:g}] {unit}"
        small = {"m": "mm", "kg": "g"}.get(unit)
        if small and column.min <= 1e3 * value <= column.max:
            bare = (
                f"; a bare number is in {unit}: was [{column.min:g}, {column.max:g}] {small} meant?"
            )
            yield ("design", name), message + bounds + bare
        else:
            yield ("design", name), message + bounds + why
    for catalogue in design.catalogues:
        own = tuple(start[k] for k in catalogue.columns)
        if own not in catalogue.rows:
            message = f"the initial value is none of those listed, {listed(catalogue.choices)}"
            yield ("design", catalogue.name), message


# --- Sections that a design could break

Ranges = Mapping[str, tuple[float, float]]  # SI, by path of the parameter


def bounds_hold_no_impossible_section(mechanism: Any, design: Design) -> Iterator[Finding]:
    """Sections exist wherever the design may go; each problem is at the bound to narrow."""
    ranges = {p.parameter: (p.min, p.max) for p in design.parameters.values()}
    entry = {
        path: name
        for name, e in design.entries.items()
        for path in (e.properties if isinstance(e, Choices) else (e.parameter,))
    }
    for path, bound, message in impossible(mechanism.sections, ranges):
        body = design.entries[name := entry[path]]
        if isinstance(body, Choices):
            advice = "give the choices by dimensions that can be combined, such as thickness"
            yield ("design", name, "choices"), f"between these choices {message}; {advice}"
        else:
            key = bound if body.values is None else "values"
            yield ("design", name, key), f"at this bound {message}; narrow the bounds"


def load_cases_have_possible_sections(
    mechanism: Any, design: Any, motions: Sequence[tuple[KeyPath, str, Any]]
) -> Iterator[Finding]:
    """Sections exist along each trajectory that sets one of their dimensions."""
    ranges = {p.parameter: (p.min, p.max) for p in design.parameters.values()}
    for place, _, motion in motions:
        own = {path: (value, value) for path, value in motion.set.items()}
        for path, _, message in impossible(mechanism.sections, ranges | own):
            if path in own:
                yield (*place, "set", path), message


def impossible(sections: Mapping[str, Section], ranges: Ranges) -> Iterator[tuple[str, str, str]]:
    """(path, "min" or "max", what is wrong there) of parameters that can break a section.

    Each limit is linear in dimensions that vary independently, so the worst corner of the bounds
    decides for all of them; along a taper the limits hold between ends at which they hold.
    """
    for name, section in sections.items():
        for limit in section.limits():
            small, large = f"sections.{name}.{limit.small}", f"sections.{name}.{limit.large}"
            a = ranges[small][1] if small in ranges else getattr(section, limit.small)
            b = ranges[large][0] if large in ranges else getattr(section, limit.large)
            if not limit.holds(a, b) and (small in ranges or large in ranges):
                path, bound = (small, "max") if small in ranges else (large, "min")
                message = f"section {name!r} cannot exist: {limit.small} {a:g} m {limit}, "
                yield path, bound, f"{message}which can be {b / limit.factor:g} m"
