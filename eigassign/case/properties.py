"""Which numeric property a design parameter's path names, and its value in the file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import get_args, get_origin

from eigassign.case.freedoms import driven
from eigassign.case.link_parts import LINKS
from eigassign.case.mechanism_parts import Body, Spring
from eigassign.case.nodes import kind_of
from eigassign.case.quantity import Part, Quantity, quantity
from eigassign.case.section_parts import SHAPES, Material
from eigassign.case.suggest import listed, suggestion, unknown
from eigassign.case.tree import Tree, at, names, text
from eigassign.case.units import QuantityError

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
