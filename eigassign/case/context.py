"""Values whose unit another key decides (bounds of a parameter, entries of q and y) → SI numbers.

Comes before the schema, which then sees plain numbers there. Also gives the tree the shape of the
objects: `design` with its constraints apart, the trajectory file as an absolute path.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from eigassign.case.freedoms import ANY, coordinate_quantities, freedoms, of_freedom
from eigassign.case.mechanism_context import coordinates, found, mechanism
from eigassign.case.properties import NoPropertyError, Property, find
from eigassign.case.quantity import Quantity
from eigassign.case.si import si
from eigassign.case.tree import Tree, at, items, names, parameters, text, trajectories
from eigassign.case.yaml_reader import Finding, KeyPath


def in_context(tree: Tree, folder: Path) -> tuple[Tree, list[Finding]]:
    """``tree`` with such values in SI, and what is wrong with them."""
    findings: list[Finding] = []
    properties = _properties(tree, findings)
    changed: dict[str, object] = dict(tree)
    if isinstance(at(tree, "design"), Mapping):
        changed["design"] = _design(tree, properties, findings)
    _convert(changed, "expansion", _expansion(tree, properties, folder, findings))
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
    tree: Tree, properties: Mapping[str, Property | None], folder: Path, findings: list[Finding]
) -> dict[str, object]:
    q, y = at(tree, "expansion", "q"), at(tree, "expansion", "y")
    if isinstance(y, tuple):
        known = [p.quantity if p else ANY for p in properties.values()]
        each = [*known, *[ANY] * len(y)]
        y = tuple(si(v, each[k], ("expansion", "y", k), findings) for k, v in enumerate(y))
    kinds = coordinate_quantities(tree)
    changed = {"q": _coordinates(q, kinds, ("expansion", "q"), findings), "y": y}
    chart, path = text(tree, "expansion", "chart"), ("expansion", "chart")
    if chart is None:
        return changed
    hint = "; `eigassign chart`, on the case without this key, makes it"
    return {**changed, "chart": found(chart, folder, path, findings, hint)}


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
