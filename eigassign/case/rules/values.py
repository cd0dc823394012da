"""Values that depend on other keys → SI numbers, absolute files, written-out defaults.

The unit of a bound is that of its parameter, the unit of an entry of q that of its coordinate. The
schema, which sees one part at a time, cannot know it; so these values are put into SI first. One
that cannot be read is replaced by its QuantityError, which the schema reports at its place.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from eigassign.case.reader import KeyPath, Tree, at, entries, items, names
from eigassign.case.rules.files import named_files
from eigassign.case.rules.lookups import (
    ANY,
    choices,
    coordinate_lists,
    coordinate_quantities,
    design_entries,
    driven,
    followed_modes,
    freedoms,
    guessed,
    is_spatial,
    of_freedom,
    parameter,
    trajectories,
)
from eigassign.case.rules.properties import (
    DRIVEN,
    drive_quantity,
    known_property,
    properties,
)
from eigassign.case.schema.design import PRICE, is_entry
from eigassign.case.schema.parts import ANGLE, PLACE, Quantity, quantity
from eigassign.case.schema.targets import FREQUENCY
from eigassign.case.suggestions import shown
from eigassign.case.units import DIMENSIONS, QuantityError, read_quantity, read_rate

Undecided = tuple[KeyPath, object, Quantity | None]  # None: no unit can be meant


def completed(tree: Tree, folder: Path) -> Tree:
    """``tree`` with such values in SI, absolute files, and the defaults of joints and springs."""
    changes: dict[Any, Any] = {}
    for path, value in [
        *_numbers(tree),
        *_prices(tree),
        *((each.path, each.value) for each in named_files(tree, folder)),
        *_defaults(tree),
    ]:
        inner = changes
        for key in path[:-1]:
            inner = inner.setdefault(key, {})
        inner[path[-1]] = value
    whole: Tree = _changed(tree, changes)
    return whole


def _changed(node: Any, changes: Any) -> Any:
    """A copy of ``node`` with some values inside it replaced."""
    if not isinstance(changes, dict):
        return changes
    if isinstance(node, tuple):
        return tuple(_changed(v, changes[k]) if k in changes else v for k, v in enumerate(node))
    return {**node, **{key: _changed(node.get(key), inner) for key, inner in changes.items()}}


# --- Numbers


def _numbers(tree: Tree) -> Iterator[tuple[KeyPath, object]]:
    for path, value, kind in _undecided(tree):
        if isinstance(value, (str, int, float)) and not isinstance(value, bool):
            try:
                yield path, _in_si(value, kind)
            except QuantityError as error:
                yield path, error


def _prices(tree: Tree) -> Iterator[tuple[KeyPath, object]]:
    """Prices for one SI unit of their property, or of the mass of the whole."""
    price = at(tree, "design", "mass", "price")
    if isinstance(price, str) and not is_entry(at(tree, "design", "mass")):
        try:
            yield ("design", "mass", "price"), read_rate(price, DIMENSIONS["mass"])
        except QuantityError as error:
            yield ("design", "mass", "price"), error
    for name, body in design_entries(tree):
        of_choices = (((path,), path, price) for path, price in items(body, "price"))
        first = parameter(name, body).parameter
        for place, path, price in (((), first, at(body, "price")), *of_choices):
            if isinstance(price, str):
                prop = known_property(tree, path)
                try:
                    unit = prop.dimension if prop else None
                    yield ("design", name, "price", *place), read_rate(price, unit)
                except QuantityError as error:
                    yield ("design", name, "price", *place), error


def _in_si(value: object, quantity: Quantity | None) -> float:
    if quantity is ANY:
        return read_quantity(value, None)
    if quantity is not None:
        return quantity.read(value)
    if isinstance(value, str):
        raise QuantityError(
            f"terms of different dimensions: give a plain number in SI units, got {shown(value)}"
        )
    return read_quantity(value, None)


def _undecided(tree: Tree) -> Iterator[Undecided]:
    """Key path and value of every number whose unit another key decides, and what it is."""
    known, kinds = properties(tree), coordinate_quantities(tree)
    yield from _of_design(tree, known)
    for k, value in enumerate(entries(tree, "expansion", "y")):
        of_parameters = [p or ANY for p in known.values()]
        yield ("expansion", "y", k), value, of_parameters[k] if k < len(of_parameters) else ANY
    for path, listed in coordinate_lists(tree):
        yield from _in_list(listed, kinds, path)
    for path, body in trajectories(tree):
        for name, value in items(body, "set"):
            kind, more = known_property(tree, name), at(value, "add")
            yield (*path, "set", name), value, kind or ANY
            yield (*path, "set", name, "add"), more, Quantity(kind.dimension) if kind else ANY
        for joint, limits in items(body, "branch"):
            freedom = freedoms(tree, joint) or ()
            both = [of_freedom(freedom[0] if len(freedom) == 1 else None)] * 2
            yield from _in_list(limits, both, (*path, "branch", joint))
    for path, body in followed_modes(tree):
        for name, value in items(body, "design"):
            if name in known:
                yield (*path, "design", name), value, known[name] or ANY
    for k, body in enumerate(entries(tree, "measurements")):
        yield from _of_deviation(at(body, "deviation"), ("measurements", k, "deviation"))
    path = ("measurements", "deviation")
    yield from _of_deviation(at(tree, *path), path)
    yield from _of_assembly(tree)
    for name, body in items(tree, "coordinates"):
        for key in DRIVEN:
            path = ("coordinates", name, "drive", key)
            yield path, at(body, "drive", key), drive_quantity(tree, body, key)


def _of_design(tree: Tree, known: Mapping[str, Quantity | None]) -> Iterator[Undecided]:
    """Bounds of parameters, and of sums of parameters that have a dimension in common."""
    for name, body in design_entries(tree):
        for choice, values in choices(body) or ():
            for path, value in items(values):
                place = ("design", name, "choices", choice, path)
                if path != PRICE:
                    yield place, value, known_property(tree, path) or ANY
        prop = known.get(name)
        own = prop or ANY
        for key in ("min", "max"):
            yield ("design", name, key), at(body, key), own
        for k, value in enumerate(entries(body, "values")):
            yield ("design", name, "values", k), value, own
        of_choices = (((p,), known_property(tree, p), v) for p, v in items(body, "tolerance"))
        for below, of, amount in (((), prop, at(body, "tolerance")), *of_choices):
            if isinstance(amount, str) and not amount.rstrip().endswith("%"):
                either = Quantity(of.dimension, above=0) if of else ANY
                yield ("design", name, "tolerance", *below), amount, either
    drives = dict(zip(names(tree, "coordinates"), coordinate_quantities(tree), strict=True))
    for name, body in items(tree, "design", "torque"):
        kind = drives.get(name, ANY)
        exerted = {PLACE: quantity("force", above=0), ANGLE: quantity("torque or energy", above=0)}
        yield ("design", "torque", name, "max"), at(body, "max"), exerted.get(kind, ANY)
    for name, body in items(tree, "design", "constraints"):
        terms = [known.get(term) for term, _ in items(body, "terms")]
        dimensions = {term.dimension for term in terms if term}
        one = Quantity(dimensions.pop()) if len(dimensions) == 1 else None if dimensions else ANY
        for key in ("min", "max"):
            yield ("design", "constraints", name, key), at(body, key), one


def _of_deviation(value: object, path: KeyPath) -> Iterator[Undecided]:
    """A deviation that is no share of the frequency."""
    if isinstance(value, str) and not value.rstrip().endswith("%"):
        yield path, value, FREQUENCY


def _of_assembly(tree: Tree) -> Iterator[Undecided]:
    """Coordinates at which loops are put together, and guesses of their passive joints."""
    path: KeyPath = ("mechanism", "assembly")
    for name, value in items(tree, "mechanism", "assembly", "at"):
        quantity = of_freedom(driven(tree, at(tree, "coordinates", name)))
        yield (*path, "at", name), value, quantity
    for joint, value in items(tree, "mechanism", "assembly", "guess"):
        count = len(value) if isinstance(value, tuple) else 1
        kinds = [of_freedom(freedom) for freedom in guessed(tree, joint, count) or ()]
        yield (*path, "guess", joint), value, kinds[0] if len(kinds) == 1 else ANY
        yield from _in_list(value, kinds, (*path, "guess", joint))


def _in_list(value: object, kinds: Sequence[Quantity], path: KeyPath) -> Iterator[Undecided]:
    """Text among the entries of a list, or of a list of lists: bare numbers are SI already."""
    for k, v in enumerate(value if isinstance(value, tuple) else ()):
        if isinstance(v, str):
            yield (*path, k), v, kinds[k] if k < len(kinds) else ANY
        elif isinstance(v, tuple):
            yield from _in_list(v, kinds, (*path, k))


# --- Defaults


def _defaults(tree: Tree) -> Iterator[tuple[KeyPath, object]]:
    """Joints and bodies are at their node, and nothing is turned, where the file is silent."""
    n = 3 if is_spatial(tree) else 2
    for group in ("joints", "springs", "bodies"):
        for name, body in items(tree, "mechanism", group):
            if isinstance(body, Mapping):
                path: KeyPath = ("mechanism", group, name)
                place = {"joints": "position", "bodies": "offset"}.get(group)
                if place and place not in body:
                    yield (*path, place), (0.0,) * n
                if n == 3 and group != "bodies" and "orientation" not in body:
                    yield (*path, "orientation"), (0.0, 0.0, 0.0)
