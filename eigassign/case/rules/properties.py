"""Which number of the mechanism a path names, what it may be, and values whose unit it decides.

A path is `materials.<name>.<property>` and the like below `mechanism`, or
`coordinates.<name>.drive.stiffness` (or another key of `DRIVEN`). What can vary follows from the
models of the schema: every field that is one real number, and components of places and of spatial
angles, such as `joints.<name>.position.0`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache, reduce
from typing import Annotated, Any, NamedTuple, get_args, get_origin

from eigassign.case.reader import Finding, KeyPath, listed, shown, suggestion, unknown, value_below
from eigassign.case.schema.design import RESERVED, Choices, Design, Tolerance, column_names
from eigassign.case.schema.document import Document
from eigassign.case.schema.links import RigidLink, SolidLink
from eigassign.case.schema.mechanism import FREEDOMS, Coordinate, Mechanism, NutJoint
from eigassign.case.schema.parts import ANGLE, PLACE, FrozenDict, Part, Quantity, Written, quantity
from eigassign.case.schema.targets import FREQUENCY, Antiresonance, FollowedMode, NamedMode
from eigassign.case.schema.trajectory import DURATION_PATH, Added, named_trajectories
from eigassign.case.units import DIMENSIONS, SI, QuantityError, read_quantity, read_rate, written

ANY = Quantity()  # dimension unknown because of an error elsewhere

_GROUPS = ("materials", "sections", "links", "joints", "bodies", "springs", "coordinates")
_FORMS = (
    "expected materials.<name>.<property>, or the same of sections, links, bodies and springs, "
    "coordinates.<name>.drive.stiffness or .inertia, joints.<name>.position.0 or .angle, or "
    "trajectory.duration, where there is one trajectory with a duration"
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


class NoPropertyError(ValueError):
    """The path names nothing that can be varied; the message says why."""


def property_at(case: Any, path: str) -> Quantity:
    """What the property at ``path`` may be (relative to `mechanism`, or from `coordinates` on).

    ``case`` has a `mechanism` and `coordinates`. Raises NoPropertyError where the path names
    nothing, or something that is not a real number.
    """
    if path == DURATION_PATH and getattr(case.trajectory, "duration", None) is not None:
        return Quantity(DIMENSIONS["time"], above=0)
    group, name, *keys = (*path.split("."), "", "")
    if group == "mechanism" and name in _GROUPS:
        raise NoPropertyError(f"paths start below mechanism: write {path.partition('.')[2]!r}")
    if group not in _GROUPS or not keys[0]:
        meant = suggestion(group, _GROUPS) if group not in _GROUPS else ""
        for known in _GROUPS:
            if group in _parts(case, known):
                meant = f"; did you mean '{known}.{path}'?"
        raise NoPropertyError(f"{_FORMS}; got {path!r}{meant}")
    parts, key = _parts(case, group), ".".join(keys).rstrip(".")
    if name not in parts:
        raise NoPropertyError(unknown("body" if group == "bodies" else group[:-1], name, parts))
    numbers = _numbers(case, group, name)
    if key not in numbers:
        own, near = f"{group}.{name}.{key}", suggestion(key, numbers)
        message = f"{group}.{name} has no property {key!r}{near}"
        if reduce(below, key.split("."), parts[name]) is not None:
            message = f"{own} cannot vary as it is in this file"
        elif key in type(parts[name]).model_fields or key in [f"drive.{each}" for each in DRIVEN]:
            message = f"{own} has no value in this file: give it an initial value"
        message += f"; can vary: {listed(numbers)}"
        raise NoPropertyError(message)
    return numbers[key]


def known_property(case: Any, path: str) -> Quantity | None:
    """Quantity of the property at ``path``, None where it is unknown."""
    try:
        return property_at(case, path)
    except NoPropertyError:
        return None


def _parts(case: Any, group: str) -> Mapping[str, Any]:
    owner = case if group == "coordinates" else case.mechanism
    parts: Mapping[str, Any] = getattr(owner, group)
    return parts


def _numbers(case: Any, group: str, name: str) -> dict[str, Quantity]:
    """The numbers of one part that can vary, by the keys that lead to them."""
    part, mechanism = _parts(case, group)[name], case.mechanism
    model: type[Part] = type(part)
    spatial = mechanism.space == "spatial"
    if group == "coordinates":
        given = [key for key in DRIVEN if getattr(part.drive, key, None) is not None]
        return {f"drive.{key}": drive_quantity(mechanism, part, key) for key in given}
    fixed = {"roll", "reduce_to", "lead"}  # which matrices are made for
    fixed |= {"angle"} if group == "springs" or spatial else {"orientation"}
    fixed |= {"inertia"} if spatial else set()  # a tensor
    solids = (link for link in mechanism.links.values() if isinstance(link, SolidLink))
    if group == "materials" and name in [solid.material for solid in solids]:
        fixed.add("poissons_ratio")
    found = {
        key: kind
        for key, kind in quantities(model).items()
        if key not in fixed and isinstance(getattr(part, key), float)
    }
    n = 3 if spatial else 2
    for key, kind in _VECTORS.get(group, {}).items():
        value: Any = getattr(part, key, None)
        if key in fixed or (group == "links" and not isinstance(part, RigidLink)):
            continue
        if key == "position" and isinstance(part, NutJoint):
            n = 1  # it stands on the axis of its shaft
        if group != "links":  # joints and bodies are at their node, and not turned
            found |= {f"{key}.{k}": kind for k in range(n)}
        elif value is not None:
            places = {f"nodes.{node}" for node in value} if key == "nodes" else {key}
            found |= {f"{place}.{k}": kind for place in sorted(places) for k in range(n)}
    return found


def properties_of(case: Any, places: bool) -> Iterator[str]:
    """The paths of all numbers of a mechanism that can vary, or without ``places``: lengths too."""
    for group in _GROUPS:
        fixed = () if places else ("length", "angle", *_VECTORS.get(group, ()))
        for name in _parts(case, group):
            keys = (k for k in _numbers(case, group, name) if k.partition(".")[0] not in fixed)
            yield from (f"{group}.{name}.{key}" for key in keys)


@cache
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


def drive_quantity(mechanism: Mechanism, coordinate: Coordinate, key: str) -> Quantity:
    """Quantity of a property of a coordinate's drive."""
    freedom = driven(mechanism, coordinate)
    if freedom is None:
        return ANY
    turning, sliding = DRIVEN[key]
    return sliding if freedom == "translation" else turning


def value_at(case: Any, path: str) -> float:
    """The number at ``path`` in the parts of a valid case, in SI."""
    owner = case if path.startswith(("coordinates.", "trajectory.")) else case.mechanism
    value = reduce(below, path.split("."), owner)
    found: float = 0.0 if value is None else value  # it is at its node, and not turned
    return found


def below(part: Any, key: str) -> Any:
    """What stands below a part, a mapping of parts or a list; None where nothing does."""
    if isinstance(part, Mapping | tuple):
        return value_below(part, int(key) if isinstance(part, tuple) and key.isdecimal() else key)
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


def with_properties(case: Any, values: Mapping[str, float]) -> dict[str, Any]:
    """Parts of a case, by their keys, with numbers (SI) by their paths in them."""
    found = {name: getattr(case, name) for name in ("mechanism", "coordinates", "trajectory")}
    for path, value in values.items():
        head, *rest = path.split(".")
        own = head in found
        owner = head if own else "mechanism"
        found[owner] = with_value(found[owner], rest if own else [head, *rest], value)
    return found


# --- Looking into a document


def walk(part: object, path: KeyPath = ()) -> list[tuple[KeyPath, object]]:
    """Key path and content of everything from ``part`` down, but for bare numbers."""
    found: list[tuple[KeyPath, object]] = []
    _walk(part, path, found)
    return found


def _walk(part: object, path: KeyPath, found: list[tuple[KeyPath, object]]) -> None:
    found.append((path, part))
    if isinstance(part, Part):
        for key, field in type(part).model_fields.items():
            inner = path if key == "entries" else (*path, field.alias or key)  # they stand in it
            _walk(getattr(part, key), inner, found)
    elif isinstance(part, dict):
        for key, each in part.items():
            _walk(each, (*path, key), found)
    elif isinstance(part, tuple):
        for k, each in enumerate(part):
            if type(each) is not float:
                _walk(each, (*path, k), found)


def followed_modes(document: Document) -> list[tuple[KeyPath, NamedMode]]:
    """Key path and content of every mode named by its shape, and of every antiresonance."""
    found = walk(document.targets, ("targets",))
    return [(path, mode) for path, mode in found if isinstance(mode, FollowedMode | Antiresonance)]


def coordinate_lists(document: Any) -> Iterator[tuple[KeyPath, Sequence[float]]]:
    """Key path and content of whatever has an entry for each coordinate."""
    for group in ("trajectory", "expansion", "measurements", "targets"):
        for path, row in walk(getattr(document, group), (group,)):
            if not isinstance(row, tuple) or any(isinstance(each, tuple) for each in row):
                continue
            match [key for key in path if isinstance(key, str)]:
                case (
                    ["expansion" | "measurements", "q"]
                    | ["trajectory", "q" | "points" | "start"]
                    | ["targets", *_, "at", "q"]
                ):
                    yield path, row


def freedoms(mechanism: Mechanism, joint: str) -> tuple[str, ...]:
    """Names of a joint's freedoms, in order; none if there is no such joint."""
    return FREEDOMS[mechanism.joints[joint].type] if joint in mechanism.joints else ()


def driven(mechanism: Mechanism, coordinate: Coordinate) -> str | None:
    """The freedom of its joint that a coordinate is; None where that cannot be told."""
    known, component = freedoms(mechanism, coordinate.joint), coordinate.component
    if component is None:
        return known[0] if len(known) == 1 else None
    return str(component) if str(component) in known else None


def guessed(document: Document, joint: str, count: int) -> tuple[str, ...]:
    """The freedoms that a list of ``count`` guesses of a joint gives: all of them, or the passive.

    None of them if there is no such joint, or no list of this length can be meant.
    """
    known = freedoms(document.mechanism, joint)
    own = [body for body in document.coordinates.values() if body.joint == joint]
    taken = {driven(document.mechanism, body) for body in own}
    passive = tuple(freedom for freedom in known if freedom not in taken)
    return next((each for each in (known, passive) if len(each) == count), ())


def _of_freedom(*known: str | None) -> Quantity:
    """Angle or length; anything where the freedom is unknown, or one of several."""
    if len(known) != 1 or known[0] is None:
        return ANY
    return PLACE if known[0] == "translation" else ANGLE


def places(design: Design) -> dict[str, dict[str, KeyPath]]:
    """Where the file names the properties of each component of y, by their paths."""
    found: dict[str, dict[str, KeyPath]] = {}
    for name, entry in design.entries.items():
        if isinstance(entry, Choices):
            first: KeyPath = ("design", name, "choices", next(iter(entry.choices)))
            columns = column_names(name, entry.properties)
            for column, path in zip(columns, entry.properties, strict=True):
                found[column] = {path: (*first, path)}
        elif isinstance(entry.parameter, str):
            found[name] = {entry.parameter: (entry.group, name, "parameter")}
        else:
            found[name] = {}
            for k, own in enumerate(entry.parameter):
                place: KeyPath = (entry.group, name, "parameter", k)
                found[name] |= (
                    {own: place} if isinstance(own, str) else {p: (*place, p) for p in own}
                )
    return found


# --- Values whose unit another key decides: the schema, which sees one part at a time, cannot know


def values_are_what_they_are_of(document: Document) -> Iterator[Finding]:
    """Each has the dimension, and keeps the limits, that the other key gives it."""
    amounts = ((path, v.amount if isinstance(v, Tolerance) else v) for path, v in walk(document))
    written = [(path, value) for path, value in amounts if isinstance(value, Written)]
    told = document.uncertain.entries if document.uncertain else {}  # their columns repeat it
    for path, value in written:
        if path[0] == "design" and path[1] in told:
            continue
        try:
            _read(value, _kind_at(document, path))
        except QuantityError as error:
            yield path, str(error)


def _read(value: object, kind: Quantity | None) -> float:
    """In SI what is of that ``kind``; None: it can have no unit. Raises QuantityError."""
    given = value.text if isinstance(value, Written) else value
    if isinstance(given, float) and given.is_integer() and abs(given) < 1e9:
        given = int(given)  # as people write it
    if kind is None and isinstance(given, str):
        message = "terms of different dimensions: give a plain number in SI units, got "
        raise QuantityError(message + shown(given))
    if kind is not None and kind.rate:
        return replace(kind, dimension=None).checked(read_rate(given, kind.dimension), given)
    if kind is not None and kind is not ANY:
        return kind.read(given)
    return read_quantity(given, None)


_EXERTED = {PLACE: quantity("force", above=0), ANGLE: quantity("torque or energy", above=0)}


def _kind_at(document: Document, path: KeyPath) -> Quantity | None:
    """What the value at a path is; ANY where that is not known, None where no unit can be meant."""
    design, moved = document.design, document.coordinates
    keys = [key for key in path if isinstance(key, str)]

    def of(property_path: str) -> Quantity:
        return known_property(document, property_path) or ANY

    def parameter(name: str) -> Quantity:
        column = design.parameters.get(name)
        return of(column.parameter) if column else ANY

    def amount(kind: Quantity, *, rate: bool = False, above: float | None = None) -> Quantity:
        return ANY if kind is ANY else Quantity(kind.dimension, rate=rate, above=above)

    def coordinate(name: str) -> Quantity:
        known = moved.get(name)
        return _of_freedom(driven(document.mechanism, known)) if known else ANY

    match keys:
        case ["design", "mass", "price"] if design.mass is not None:
            return Quantity(DIMENSIONS["mass"], above=0, rate=True)
        case ["design", "torque", name, "max"]:
            return _EXERTED.get(coordinate(name), ANY)
        case ["design", "constraints", name, "min" | "max"]:
            kinds = {parameter(term) for term in design.constraints[name].terms} - {ANY}
            dimensions = [*{kind.dimension for kind in kinds}]
            return None if dimensions[1:] else Quantity(dimensions[0]) if dimensions else ANY
        case ["design", _, "choices", _, "price"]:
            return Quantity()
        case ["design", _, "choices", _, own]:
            return of(own)
        case ["design", name, "price", *own]:
            return amount(of(own[0]) if own else parameter(name), rate=True)
        case ["design", name, "tolerance", *own]:
            return amount(of(own[0]) if own else parameter(name), above=0)
        case ["uncertain", name, "standard_deviation"]:
            return amount(parameter(name), above=0)
        case ["uncertain", "others", key, name]:
            kind = parameter(name)
            return kind if key == "values" else amount(kind, above=0)
        case ["design" | "uncertain", name, _]:
            return parameter(name)
        case ["measurements", "deviation"]:
            return amount(FREQUENCY, above=0)
        case ["expansion", "y"]:
            columns = [*design.parameters]
            return parameter(columns[int(path[-1])]) if int(path[-1]) < len(columns) else ANY
        case ["trajectory", "set", own]:
            return of(own)
        case ["trajectory", "set", own, "add"]:
            return amount(of(own))
        case ["trajectory", "branch", joint]:
            return _of_freedom(*freedoms(document.mechanism, joint))
        case ["mechanism", "assembly", "at", name]:
            return coordinate(name)
        case ["mechanism", "assembly", "guess", joint]:
            guess = document.mechanism.assembly.guess[joint]  # type: ignore[union-attr]
            known = guessed(document, joint, len(guess) if isinstance(guess, tuple) else 1)
            several = isinstance(guess, tuple) and known
            return _of_freedom(known[int(path[-1])]) if several else _of_freedom(*known)
        case ["coordinates", name, "drive", key]:
            return drive_quantity(document.mechanism, moved[name], key)
    names, k = [*moved], int(path[-1])
    return coordinate(names[k]) if k < len(names) else ANY


# --- What is not known


def with_uncertain(document: Document) -> Document:
    """The document with the likeliest values of what is not known, and a column of y for each."""
    known, own = document, document.uncertain
    if own is None:
        return document
    entries: dict[str, Any] = {**document.design.entries}
    for name, one in own.entries.items():
        factors = one.column(0.0).factors
        value, first = one.value, next(iter(factors))
        if value is None:  # of an unknown property a rule says so
            value = 0.0 if known_property(document, first) is None else value_at(document, first)
        elif all(known_property(document, path) for path in factors):
            values = {path: factor * value for path, factor in factors.items()}
            known = known.model_copy(update=with_properties(known, values))
        entries[name] = one.column(value)
    limits = {key: getattr(document.design, key) for key in RESERVED}
    given = document.design.model_fields_set
    design = Design.model_construct(given, entries=FrozenDict(entries), **limits)
    return known.model_copy(update={"design": design})


# --- Rules


def parameters_name_properties(document: Document) -> Iterator[Finding]:
    """The paths of design parameters, and of what trajectories set, name numbers that can vary."""
    groups = [*places(document.design).values()]
    for place, _, motion in named_trajectories(document.trajectory):
        groups += [{path: (*place, "set", path)} for path in motion.set]
    for own in groups:
        first, *_ = kinds = [known_property(document, path) for path in own]
        for (path, place), kind in zip(own.items(), kinds, strict=True):
            try:
                property_at(document, path)
            except NoPropertyError as error:
                yield place, str(error)
            if kind and first and ANY not in (kind, first) and kind.dimension != first.dimension:
                a, b = (q.dimension.name if q.dimension else "number" for q in (kind, first))
                message = f"{path} is a {a}, {next(iter(own))} a {b}: a factor has no unit, so that"
                yield place, f"{message} they need parameters of their own"


def each_property_has_one_owner(document: Document) -> Iterator[Finding]:
    """Components of the design have properties of their own; to them trajectories can only add."""
    owner: dict[str, str] = {}
    for name, own in places(document.design).items():
        for path, place in own.items():
            if path in owner:
                yield place, f"{path} is a design parameter already: {owner[path]!r}"
            owner.setdefault(path, name)
    for place, _, motion in named_trajectories(document.trajectory):
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
                unit = SI(property_at(document, path).si, value, first)
                yield (
                    placed[name][path],
                    f"is {written(value, unit)} in this file, where {factor:.12g} × "
                    f"{column.parameter} is {written(wanted, unit)}: write that, or another factor",
                )


# --- What properties that vary may be


class Limit(NamedTuple):
    """Σ factor · entry of the loads and the design + ``offset`` ≥ 0, or > 0 where ``strict``."""

    factors: Mapping[int, float]
    offset: float
    strict: bool
    words: str  # what must be


def limits(case: Any) -> Iterator[Limit]:
    """What the properties that vary in a case may be, and what dimensions of its sections."""

    def limit(terms: Mapping[str, float], offset: float, strict: bool, words: str) -> Limit:
        factors = dict[int, float]()
        for path, factor in terms.items():
            for k, own in case.varied.get(path, ()):
                factors[k] = factors.get(k, 0.0) + factor * own
            offset += 0.0 if path in case.varied else factor * case.value_at(path)
        return Limit({k: f for k, f in factors.items() if f}, offset, strict, words)

    for path, kind in zip(case.varied, case.quantities(case.varied), strict=True):
        own = [case.value_at(path)]
        for sign, value, factor in kind.edges:
            words = f"{path} must be {sign} {written(value, kind.si, *own)}"
            yield limit({path: factor}, -factor * value, sign in "<>", words)
    for name, section in case.mechanism.sections.items():
        for own in section.limits():
            small, large = (f"sections.{name}.{key}" for key in (own.small, own.large))
            if {small, large} & set(case.varied):
                words = f"section {name!r} {own.beyond}: {own.small} {own}"
                yield limit({small: -own.factor, large: 1.0}, 0.0, not own.may_meet, words)
