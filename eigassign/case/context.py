"""Values whose unit another key decides (bounds of a parameter, entries of q and y) → SI numbers.

Comes before the schema, which then sees plain numbers there. Also gives the tree the shape of the
objects: `design` with its constraints apart, the trajectory file as an absolute path.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path

from eigassign.case.mechanism_parts import ANGLE
from eigassign.case.properties import NoPropertyError, Property, find
from eigassign.case.quantity import Quantity
from eigassign.case.suggest import shown
from eigassign.case.tree import Tree, at, items, names, parameters, text
from eigassign.case.units import QuantityError, read
from eigassign.case.yaml_reader import Finding, KeyPath

_ANY = Quantity()  # dimension unknown because of an error elsewhere


def in_context(tree: Tree, folder: Path) -> tuple[Tree, list[Finding]]:
    """``tree`` with such values in SI, and what is wrong with them."""
    findings: list[Finding] = []
    properties = _properties(tree, findings)
    changed: dict[str, object] = dict(tree)
    if isinstance(at(tree, "design"), Mapping):
        changed["design"] = _design(tree, properties, findings)
    _convert(changed, "expansion", _expansion(tree, properties, findings))
    _convert(changed, "trajectory", _trajectory(tree, folder, findings))
    span, path = at(tree, "validation", "q_span"), ("validation", "q_span")
    scalar = _si(span, ANGLE, path, findings)
    _convert(changed, "validation", {"q_span": _angles(scalar, path, findings)})
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
        changed[name] = _bounds(body, prop.quantity if prop else _ANY, ("design", name), findings)
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
    values = {key: _si(value, quantity, (*path, key), findings) for key, value in pairs}
    if len(findings) > known:
        values = dict.fromkeys(values, 0.0)
    return {**body, **values}


def _of_sum(body: object, properties: Mapping[str, Property | None]) -> Quantity | None:
    """What a sum of parameters is: their common dimension; None if they have none in common."""
    terms = [properties.get(name) for name, _ in items(body, "terms")]
    dimensions = {t.quantity.dimension for t in terms if t}
    if len(dimensions) > 1:
        return None
    return Quantity(dimensions.pop()) if dimensions else _ANY


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
        known = [p.quantity if p else _ANY for p in properties.values()]
        each = [*known, *[_ANY] * len(y)]
        y = tuple(_si(v, each[k], ("expansion", "y", k), findings) for k, v in enumerate(y))
    return {"q": _angles(q, ("expansion", "q"), findings), "y": y}


def _trajectory(tree: Tree, folder: Path, findings: list[Finding]) -> dict[str, object]:
    body = at(tree, "trajectory")
    changed = {k: _angles(at(body, k), ("trajectory", k), findings) for k in ("q", "start")}
    file = text(body, "file")
    if file is not None and at(body, "tip") is None:
        path = os.path.abspath(folder / file)
        changed["file"] = path
        if not os.path.isfile(path):
            named = path if path.isprintable() else ascii(path)
            findings.append((("trajectory", "file"), f"no such file: {named}"))
    return changed


def _angles(value: object, path: KeyPath, findings: list[Finding]) -> object:
    """Coordinates of revolute joints, in lists of any depth, in rad; anything else untouched."""
    if not isinstance(value, tuple):
        return value
    return tuple(
        _si(v, ANGLE, (*path, k), findings)
        if isinstance(v, str)
        else _angles(v, (*path, k), findings)
        for k, v in enumerate(value)
    )


def _si(value: object, quantity: Quantity | None, path: KeyPath, findings: list[Finding]) -> object:
    """``value`` in SI; zero, and a finding, if it is not such a quantity; non-scalars untouched."""
    if isinstance(value, bool) or not isinstance(value, (str, int, float)):
        return value
    try:
        if quantity is None:
            return _bare(value)
        return quantity.checked(read(value, quantity.dimension), shown(value))
    except QuantityError as error:
        findings.append((path, str(error)))
        return 0.0


def _bare(value: object) -> float:
    if isinstance(value, str):
        raise QuantityError(
            f"terms of different dimensions: give a plain number in SI units, got {shown(value)}"
        )
    return read(value, None)
