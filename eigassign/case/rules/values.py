"""Values whose unit another key decides (bounds of a parameter, entries of q and y) → SI numbers.

Comes before the schema, which then sees plain numbers there. Also gives the tree the shape of the
objects: `design` with its constraints apart, the trajectory file as an absolute path.

Values of the mechanism that other keys decide → SI numbers, absolute files, default vectors.

Which numeric property a design parameter's path names, and its value in the file.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import get_args, get_origin

from eigassign.case.reader import (
    Finding,
    KeyPath,
    Tree,
    at,
    items,
    names,
    parameters,
    text,
    trajectories,
)
from eigassign.case.rules.nodes import kind_of
from eigassign.case.schema.joints import ANY, coordinate_quantities, driven, freedoms, of_freedom
from eigassign.case.schema.links import LINKS, SHAPES, Material
from eigassign.case.schema.mechanism import Body, Spring
from eigassign.case.suggestions import listed, suggestion, unknown
from eigassign.case.units import Part, Quantity, QuantityError, quantity, si

# --- Values whose unit another key decides (bounds of a parameter, entries of q and y) → SI num


def in_context(tree: Tree, folder: Path) -> tuple[Tree, list[Finding]]:
    """``tree`` with such values in SI, and what is wrong with them."""
    findings: list[Finding] = []
    properties = _properties(tree, findings)
    changed: dict[str, object] = dict(tree)
    if isinstance(at(tree, "design"), Mapping):
        changed["design"] = _design(tree, properties, findings)
    _convert(changed, "expansion", _expansion(tree, properties, findings))
    if "trajectory" in tree:
        changed["trajectory"] = _trajectories(tree, folder, findings)
    _convert(changed, "validation", {"q_span": _span(tree, findings)})
    _convert(changed, "mechanism", mechanism(tree, folder, findings))
    if isinstance(at(tree, "coordinates"), Mapping):
        changed["coordinates"] = coordinates(tree, findings)
    return changed, findings


def _convert(tree: dict[str, object], key: str, converted: Mapping[str, object]) -> None:
    """Replace what the file gives below ``key`` by its converted value."""
    body = tree.get(key)
    if isinstance(body, Mapping):
        tree[key] = {k: converted.get(k, v) for k, v in body.items()}


def _properties(tree: Tree, findings: list[Finding]) -> dict[str, Property | None]:
    """Property of each design parameter, None where it is unknown."""
    found: dict[str, Property | None] = {}
    for name, body in parameters(tree):
        path = text(body, "parameter")
        try:
            found[name] = find(tree, path) if path is not None else None
        except NoPropertyError as error:
            found[name] = None
            findings.append((("design", name, "parameter"), str(error)))
    return found


def _design(
    tree: Tree, properties: Mapping[str, Property | None], findings: list[Finding]
) -> dict[str, object]:
    changed: dict[str, object] = {}
    for name, body in parameters(tree):
        prop, known = properties[name], len(findings)
        changed[name] = _bounds(body, prop.quantity if prop else ANY, ("design", name), findings)
        if prop and len(findings) == known:
            findings.extend(_outside(prop, changed[name], name, at(body, "parameter")))
    constraints = at(tree, "design", "constraints")
    if isinstance(constraints, Mapping):
        constraints = {
            name: _bounds(
                body, _of_sum(body, properties), ("design", "constraints", name), findings
            )
            for name, body in constraints.items()
        }
    apart = {"constraints": constraints} if "constraints" in names(tree, "design") else {}
    return {"parameters": changed, **apart}


def _bounds(
    body: object, quantity: Quantity | None, path: KeyPath, findings: list[Finding]
) -> object:
    """``body`` with `min` and `max` in SI; both zero (harmless to the schema) if one is wrong."""
    if not isinstance(body, Mapping):
        return body
    known = len(findings)
    pairs = [(key, body[key]) for key in ("min", "max") if key in body]
    values = {key: si(value, quantity, (*path, key), findings) for key, value in pairs}
    if len(findings) > known:
        values = dict.fromkeys(values, 0.0)
    return {**body, **values}


def _of_sum(body: object, properties: Mapping[str, Property | None]) -> Quantity | None:
    """What a sum of parameters is: their common dimension; None if they have none in common."""
    terms = [properties.get(name) for name, _ in items(body, "terms")]
    dimensions = {t.quantity.dimension for t in terms if t}
    if len(dimensions) > 1:
        return None
    return Quantity(dimensions.pop()) if dimensions else ANY


def _outside(prop: Property, body: object, name: str, path: object) -> Iterable[Finding]:
    initial, low, high = prop.initial(), at(body, "min"), at(body, "max")
    if initial is None or not isinstance(low, float) or not isinstance(high, float):
        return
    if low <= high and not low <= initial <= high:
        unit = prop.quantity.dimension.si if prop.quantity.dimension else ""
        message = (
            f"initial value {initial:g} {unit} of {path} is outside [{low:g}, {high:g}] {unit}"
        )
        yield ("design", name), message


def _expansion(
    tree: Tree, properties: Mapping[str, Property | None], findings: list[Finding]
) -> dict[str, object]:
    q, y = at(tree, "expansion", "q"), at(tree, "expansion", "y")
    if isinstance(y, tuple):
        known = [p.quantity if p else ANY for p in properties.values()]
        each = [*known, *[ANY] * len(y)]
        y = tuple(si(v, each[k], ("expansion", "y", k), findings) for k, v in enumerate(y))
    kinds = coordinate_quantities(tree)
    return {"q": _coordinates(q, kinds, ("expansion", "q"), findings), "y": y}


def _span(tree: Tree, findings: list[Finding]) -> object:
    span, path = at(tree, "validation", "q_span"), ("validation", "q_span")
    kinds = coordinate_quantities(tree)
    return _coordinates(si(span, _common(kinds), path, findings), kinds, path, findings)


def _trajectories(tree: Tree, folder: Path, findings: list[Finding]) -> object:
    converted = tuple(
        _trajectory(tree, body, path, folder, findings) for path, body in trajectories(tree)
    )
    return converted if isinstance(tree["trajectory"], tuple) else next(iter(converted), None)


def _trajectory(
    tree: Tree, body: object, path: KeyPath, folder: Path, findings: list[Finding]
) -> object:
    if not isinstance(body, Mapping):
        return body
    kinds, changed = coordinate_quantities(tree), dict(body)
    for key in ("q", "points", "start"):
        if key in body:
            changed[key] = _coordinates(body[key], kinds, (*path, key), findings)
    if isinstance(at(body, "branch"), Mapping):
        changed["branch"] = {
            joint: _coordinates(limits, _range(tree, joint), (*path, "branch", joint), findings)
            for joint, limits in items(body, "branch")
        }
    file = text(body, "file")
    if file is not None and at(body, "tip") is None:
        changed["file"] = found(file, folder, (*path, "file"), findings)
    return changed


def _range(tree: Tree, joint: str) -> list[Quantity]:
    """What both ends of a joint's range are."""
    known = freedoms(tree, joint) or ()
    return [of_freedom(known[0] if len(known) == 1 else None)] * 2


def _coordinates(
    value: object, kinds: Sequence[Quantity], path: KeyPath, findings: list[Finding]
) -> object:
    """Text among the coordinates of a list, or of a list of lists, in SI; the rest untouched."""
    if not isinstance(value, tuple):
        return value
    return tuple(
        si(v, kinds[k] if k < len(kinds) else ANY, (*path, k), findings)
        if isinstance(v, str)
        else _coordinates(v, kinds, (*path, k), findings)
        for k, v in enumerate(value)
    )


def _common(kinds: Sequence[Quantity]) -> Quantity | None:
    """What one number for all coordinates is; None if they are not alike."""
    if len({kind.dimension for kind in kinds}) > 1:
        return None
    return kinds[0] if kinds else ANY


# --- Values of the mechanism that other keys decide → SI numbers, absolute files, default vecto


def mechanism(tree: Tree, folder: Path, findings: list[Finding]) -> dict[str, object]:
    """What is to replace `mechanism.joints`, `.links` and `.assembly`."""
    groups = {
        "joints": _joints(tree),
        "springs": _springs(tree),
        "links": _links(tree, folder, findings),
    }
    changed: dict[str, object] = {k: v for k, v in groups.items() if v}
    given = at(tree, "mechanism", "assembly")
    if isinstance(given, Mapping):
        changed["assembly"] = {**given, **_assembly(tree, findings)}
    return changed


def coordinates(tree: Tree, findings: list[Finding]) -> dict[str, object]:
    """`coordinates` with drive stiffnesses in SI."""
    changed: dict[str, object] = {}
    for name, body in items(tree, "coordinates"):
        changed[name] = body
        stiffness = at(body, "drive", "stiffness")
        if isinstance(body, Mapping) and stiffness is not None:
            path: KeyPath = ("coordinates", name, "drive", "stiffness")
            value = si(stiffness, held(tree, body), path, findings, harmless=1.0)
            changed[name] = {**body, "drive": {**body["drive"], "stiffness": value}}
    return changed


def _joints(tree: Tree) -> dict[str, object]:
    """Joints with their place written out: zeros where the file is silent."""
    spatial = text(tree, "mechanism", "space") == "spatial"
    default: dict[str, object] = {"position": (0.0,) * (3 if spatial else 2)}
    if spatial:
        default["orientation"] = (0.0, 0.0, 0.0)
    joints = items(tree, "mechanism", "joints")
    return {n: {**default, **b} if isinstance(b, Mapping) else b for n, b in joints}


def _springs(tree: Tree) -> dict[str, object]:
    """Springs with their spatial orientation written out."""
    spatial = text(tree, "mechanism", "space") == "spatial"
    default: dict[str, object] = {"orientation": (0.0, 0.0, 0.0)} if spatial else {}
    springs = items(tree, "mechanism", "springs")
    return {n: {**default, **b} if isinstance(b, Mapping) else b for n, b in springs}


def _links(tree: Tree, folder: Path, findings: list[Finding]) -> dict[str, object]:
    """Links with the files of superelements as absolute paths."""
    changed: dict[str, object] = {}
    for name, body in items(tree, "mechanism", "links"):
        changed[name] = body
        if isinstance(body, Mapping) and kind_of(body) == "superelement":
            path = ("mechanism", "links", name)
            files = {
                key: found(text(body, key), folder, (*path, key), findings)
                for key in ("stiffness", "mass")
                if text(body, key) is not None
            }
            changed[name] = {**body, **files}
    return changed


def found(
    file: str | None, folder: Path, path: KeyPath, findings: list[Finding], hint: str = ""
) -> str:
    """The absolute path of ``file``; a finding, with a ``hint``, if there is no such file."""
    absolute = os.path.abspath(folder / (file or ""))
    if not os.path.isfile(absolute):
        named = absolute if absolute.isprintable() else ascii(absolute)
        findings.append((path, f"no such file: {named}{hint}"))
    return absolute


def _assembly(tree: Tree, findings: list[Finding]) -> dict[str, object]:
    path: KeyPath = ("mechanism", "assembly")
    changed: dict[str, object] = {}
    given = at(tree, "mechanism", "assembly")
    if isinstance(at(given, "at"), Mapping):
        changed["at"] = {
            name: si(
                value,
                of_freedom(driven(tree, at(tree, "coordinates", name))),
                (*path, "at", name),
                findings,
            )
            for name, value in items(given, "at")
        }
    if isinstance(at(given, "guess"), Mapping):
        changed["guess"] = {
            joint: _guess(tree, joint, value, (*path, "guess", joint), findings)
            for joint, value in items(given, "guess")
        }
    return changed


def _guess(tree: Tree, joint: str, value: object, path: KeyPath, findings: list[Finding]) -> object:
    kinds = [of_freedom(freedom) for freedom in freedoms(tree, joint) or ()]
    if not isinstance(value, tuple):
        return si(value, kinds[0] if len(kinds) == 1 else ANY, path, findings)
    kinds += [ANY] * len(value)
    return tuple(si(v, kinds[k], (*path, k), findings) for k, v in enumerate(value))


# --- Which numeric property a design parameter's path names, and its value in the file

_GROUPS = ("materials", "sections", "links", "bodies", "springs")
_OPTIONAL = ("materials", "sections", "bodies", "springs")
_FORMS = (
    "expected materials.<name>.<property>, sections.<name>.<property>, links.<name>.length, "
    "bodies.<name>.<property>, springs.<name>.<property> or coordinates.<name>.drive.stiffness"
)
_FIXED = {"roll", "reduce_to", "angle"}  # real numbers that the mechanism is built with
_HELD = quantity("rotational stiffness", above=0)
_HELD_SLIDE = quantity("stiffness", above=0)


class NoPropertyError(ValueError):
    """The path names nothing that can be varied; the message says why."""


@dataclass(frozen=True)
class Property:
    """A real-valued property: what it may be, and what the file says it is (not yet SI)."""

    quantity: Quantity
    written: object

    def initial(self) -> float | None:
        """SI value in the file; None if it cannot be read (the schema says why)."""
        try:
            return self.quantity.read(self.written)
        except QuantityError:
            return None


def find(tree: Tree, path: str) -> Property | None:
    """Property at ``path`` (relative to `mechanism`, or from `coordinates` on).

    None where the path may be right but the file has another error there; raises NoPropertyError
    where it names nothing, or something that is not a real number.
    """
    group, *rest = path.split(".")
    if group == "mechanism" and rest and rest[0] in _GROUPS:
        raise NoPropertyError(f"paths start below mechanism: write {'.'.join(rest)!r}")
    if group == "coordinates" and len(rest) == 3 and rest[1:] == ["drive", "stiffness"]:
        return _stiffness(tree, rest[0])
    if group not in _GROUPS or len(rest) != 2:
        hint = suggestion(group, (*_GROUPS, "coordinates")) if group not in _GROUPS else ""
        raise NoPropertyError(f"{_FORMS}; got {path!r}{hint}")
    return _property(tree, group, *rest)


def _property(tree: Tree, group: str, name: str, key: str) -> Property | None:
    known = at(tree, "mechanism", group)
    if known is None and group in _OPTIONAL:
        known = {}
    if isinstance(known, Mapping) and name not in known:
        raise NoPropertyError(unknown(_singular(group), name, known))
    body = at(known, name)
    model = _model(group, body)
    if model is None:
        return None
    if key not in _quantities(model):
        raise NoPropertyError(_not_real(model, key, f"{group}.{name}"))
    if key == "inertia" and text(tree, "mechanism", "space") == "spatial":
        raise NoPropertyError(f"{group}.{name}.inertia is a tensor in space and cannot vary")
    return _written(model, key, body, f"{group}.{name}.{key}")


def _model(group: str, body: object) -> type[Part] | None:
    if not isinstance(body, Mapping):
        return None
    if group == "sections":
        shape = body.get("shape", "bare")
        return SHAPES.get(shape) if isinstance(shape, str) else None
    if group == "links":
        return LINKS.get(kind_of(body) or "")
    models: dict[str, type[Part]] = {"materials": Material, "bodies": Body, "springs": Spring}
    return models[group]


def _quantities(model: type[Part]) -> dict[str, Quantity]:
    """The real-valued properties that a mechanism can be built with as variables."""
    return {
        key: quantity
        for key, field in model.model_fields.items()
        for quantity in _in_metadata(field.metadata, field.annotation)
        if key not in _FIXED
    }


def _in_metadata(metadata: object, annotation: object) -> Iterator[Quantity]:
    """Quantities of one number; those of the entries of a list are left out."""
    for item in metadata if isinstance(metadata, (list, tuple)) else ():
        if isinstance(item, Quantity):
            yield item
    if get_origin(annotation) in (tuple, Mapping):
        return
    for argument in get_args(annotation):
        yield from _in_metadata(getattr(argument, "__metadata__", ()), _bare(argument))


def _bare(annotation: object) -> object:
    """The type within any ``Annotated``."""
    return getattr(annotation, "__origin__", annotation) if _annotated(annotation) else annotation


def _annotated(annotation: object) -> bool:
    return hasattr(annotation, "__metadata__")


def _not_real(model: type[Part], key: str, owner: str) -> str:
    real = list(_quantities(model))
    if key in model.model_fields:
        return f"{owner}.{key} is not a real number and cannot vary; can vary: {listed(real)}"
    return f"{owner} has no property {key!r}{suggestion(key, real)}; can vary: {listed(real)}"


def _written(model: type[Part], key: str, body: object, path: str) -> Property:
    field = model.model_fields[key]
    written = at(body, key)
    if written is None and (field.is_required() or field.default is None):
        raise NoPropertyError(f"{path} has no value in this file: give it an initial value")
    if isinstance(written, tuple):
        raise NoPropertyError(f"{path} is a list in this file and cannot vary: give one number")
    return Property(_quantities(model)[key], field.default if written is None else written)


def held(tree: Tree, coordinate: object) -> Quantity:
    """What the drive stiffness of a coordinate is."""
    freedom = driven(tree, coordinate)
    if freedom is None:
        return Quantity(above=0)
    return _HELD_SLIDE if freedom == "translation" else _HELD


def _stiffness(tree: Tree, name: str) -> Property:
    known = names(tree, "coordinates")
    if name not in known:
        raise NoPropertyError(unknown("coordinate", name, known))
    written = at(tree, "coordinates", name, "drive", "stiffness")
    if written is None:
        raise NoPropertyError(
            f"coordinate {name!r} has no drive stiffness: write drive: {{stiffness: ... N m/rad}}"
        )
    return Property(held(tree, at(tree, "coordinates", name)), written)


def _singular(group: str) -> str:
    return "body" if group == "bodies" else group.removesuffix("s")
