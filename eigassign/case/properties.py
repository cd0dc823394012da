"""Which numeric property a design parameter's path names, and its value in the file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import get_args

from eigassign.case.mechanism_parts import SHAPES, Body, Drive, Link, Material
from eigassign.case.quantity import Part, Quantity
from eigassign.case.suggest import listed, suggestion, unknown
from eigassign.case.tree import at, names
from eigassign.case.units import QuantityError

_GROUPS = ("materials", "sections", "links", "bodies")
_FORMS = (
    "expected materials.<name>.<property>, sections.<name>.<property>, links.<name>.length, "
    "bodies.<name>.<property> or coordinates.<name>.drive.stiffness"
)


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


def find(tree: object, path: str) -> Property | None:
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


def _property(tree: object, group: str, name: str, key: str) -> Property | None:
    known = at(tree, "mechanism", group)
    if known is None and group == "bodies":
        known = {}
    if isinstance(known, Mapping) and name not in known:
        raise NoPropertyError(unknown(_singular(group), name, known))
    body = at(known, name)
    model = _model(group, body)
    if model is None:
        return None
    if key not in _quantities(model):
        raise NoPropertyError(_not_real(model, key, f"{group}.{name}"))
    return _written(model, key, body, f"{group}.{name}.{key}")


def _model(group: str, body: object) -> type[Part] | None:
    if not isinstance(body, Mapping):
        return None
    if group == "sections":
        shape = body.get("shape", "bare")
        return SHAPES.get(shape) if isinstance(shape, str) else None
    models: dict[str, type[Part]] = {"materials": Material, "links": Link, "bodies": Body}
    return models[group]


def _quantities(model: type[Part]) -> dict[str, Quantity]:
    return {
        key: quantity
        for key, field in model.model_fields.items()
        for quantity in _in_metadata(field.metadata, field.annotation)
    }


def _in_metadata(metadata: object, annotation: object) -> Iterator[Quantity]:
    for item in metadata if isinstance(metadata, (list, tuple)) else ():
        if isinstance(item, Quantity):
            yield item
    for argument in get_args(annotation):
        yield from _in_metadata(getattr(argument, "__metadata__", ()), None)


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
    return Property(_quantities(model)[key], field.default if written is None else written)


def _stiffness(tree: object, name: str) -> Property:
    known = names(tree, "coordinates")
    if name not in known:
        raise NoPropertyError(unknown("coordinate", name, known))
    drive = at(tree, "coordinates", name, "drive")
    if at(drive, "stiffness") is None:
        raise NoPropertyError(
            f"coordinate {name!r} has no drive stiffness: write drive: {{stiffness: ... N m/rad}}"
        )
    return _written(Drive, "stiffness", drive, f"coordinates.{name}.drive.stiffness")


def _singular(group: str) -> str:
    return "body" if group == "bodies" else group.removesuffix("s")
