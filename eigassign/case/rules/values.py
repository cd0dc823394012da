"""Values whose unit another key decides: the schema, which sees one part at a time, cannot know it.

The unit of a bound is that of its parameter, the unit of an entry of q that of its coordinate.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from eigassign.case.reader import Finding, KeyPath, shown
from eigassign.case.rules.lookups import (
    ANY,
    coordinate_lists,
    driven,
    followed_modes,
    freedoms,
    guessed,
    of_freedom,
)
from eigassign.case.rules.properties import DRIVEN, drive_quantity, known_property
from eigassign.case.schema.design import PRICE, Choices, Tolerance
from eigassign.case.schema.document import Document
from eigassign.case.schema.mechanism import Drive
from eigassign.case.schema.parts import ANGLE, PLACE, Quantity, Written, quantity
from eigassign.case.schema.study import MeasurementFile
from eigassign.case.schema.targets import FREQUENCY
from eigassign.case.schema.trajectory import Added, TipTrajectory, named_trajectories
from eigassign.case.units import DIMENSIONS, QuantityError, read_quantity, read_rate

Undecided = tuple[KeyPath, object, Quantity | None]  # None: no unit can be meant


def values_are_what_they_are_of(document: Document) -> Iterator[Finding]:
    """Each has the dimension, and keeps the limits, that the other key gives it."""
    for path, value, kind in _undecided(document):
        try:
            _read(value, kind)
        except QuantityError as error:
            yield path, str(error)


def _read(value: object, kind: Quantity | None) -> float:
    given = value.text if isinstance(value, Written) else value
    if isinstance(given, float) and given.is_integer() and abs(given) < 1e9:
        given = int(given)  # as people write it
    if kind is None and isinstance(given, str):
        message = "terms of different dimensions: give a plain number in SI units, got "
        raise QuantityError(message + shown(given))
    if kind is not None and kind.rate:
        return replace(kind, dimension=None).checked(read_rate(given, kind.dimension), shown(given))
    if kind is not None and kind is not ANY:
        return kind.read(given)
    si = read_quantity(given, None)
    if isinstance(value, float) and math.isnan(value):
        raise QuantityError(f"out of reach: {shown(given)}")
    return si


def followed_designs(document: Document) -> Iterator[tuple[KeyPath, float]]:
    """The values, in SI, of parameters where a mode is named by its shape; not those of choices."""
    design = document.design
    for path, mode in followed_modes(document):
        for name, value in mode.design.items():
            if name in design.entries and not isinstance(design.entries[name], Choices):
                kind = known_property(document, design.parameters[name].parameter) or ANY
                yield (*path, "design", name), _read(value, kind)


def _undecided(document: Document) -> Iterator[Undecided]:
    """Key path and value of every number whose unit another key decides, and what it is."""
    mechanism, moved = document.mechanism, document.coordinates
    columns = document.design.parameters
    known = {name: known_property(document, c.parameter) or ANY for name, c in columns.items()}
    kinds = {name: of_freedom(driven(mechanism, body)) for name, body in moved.items()}
    yield from _of_design(document, known, kinds)
    if isinstance(document.expansion.y, tuple):
        for k, (value, kind) in enumerate(zip(document.expansion.y, known.values(), strict=False)):
            yield ("expansion", "y", k), value, kind
    for path, row in coordinate_lists(document):
        yield from _in_list(row, [*kinds.values()], path)
    for path, _, motion in named_trajectories(document.trajectory):
        for name, given in motion.set.items():
            kind = known_property(document, name) or ANY
            if isinstance(given, Added):
                amount = ANY if kind is ANY else Quantity(kind.dimension)
                yield (*path, "set", name, "add"), given.add, amount
            else:
                yield (*path, "set", name), given, kind
        for joint, ends in motion.branch.items() if isinstance(motion, TipTrajectory) else ():
            freedom = freedoms(mechanism, joint) or ()
            both = [of_freedom(freedom[0] if len(freedom) == 1 else None)] * 2
            yield from _in_list(ends, both, (*path, "branch", joint))
    for path, mode in followed_modes(document):
        for name, there in mode.design.items():
            if name in known and name in document.design.entries:
                yield (*path, "design", name), there, known[name]
    measured = document.measurements
    if isinstance(measured, MeasurementFile):
        yield from _of_tolerance(("measurements", "deviation"), measured.deviation, FREQUENCY)
    else:
        for k, each in enumerate(measured or ()):
            yield from _of_tolerance(("measurements", k, "deviation"), each.deviation, FREQUENCY)
    yield from _of_assembly(document, kinds)
    for name, body in moved.items():
        for key in DRIVEN if isinstance(body.drive, Drive) else ():
            if (value := getattr(body.drive, key)) is not None:
                path = ("coordinates", name, "drive", key)
                yield path, value, drive_quantity(mechanism, body, key)


def _of_design(
    document: Document, known: Mapping[str, Quantity], moved: Mapping[str, Quantity]
) -> Iterator[Undecided]:
    """Bounds of parameters, and of sums of parameters that have a dimension in common."""
    design = document.design
    if design.mass and design.mass.price is not None:
        kind = Quantity(DIMENSIONS["mass"], above=0, rate=True)
        yield ("design", "mass", "price"), design.mass.price, kind
    for name, entry in design.entries.items():
        path: KeyPath = ("design", name)
        prices: Iterable[tuple[KeyPath, str, float | None]]
        if isinstance(entry, Choices):
            prices = [((*path, "price", key), key, price) for key, price in entry.price.items()]
        else:
            prices = [((*path, "price"), next(iter(entry.factors)), entry.price)]
        for place, priced, price in prices:
            kind = known_property(document, priced) or ANY
            if price is not None:
                yield place, price, Quantity(kind.dimension, rate=True)
        if isinstance(entry, Choices):
            for choice, values in entry.choices.items():
                for key, value in values.items():
                    kind = Quantity() if key == PRICE else known_property(document, key) or ANY
                    yield (*path, "choices", choice, key), value, kind
            for key, tolerance in entry.tolerance.items():
                own = known_property(document, key) or ANY
                yield from _of_tolerance((*path, "tolerance", key), tolerance, own)
            continue
        bounds = [((*path, key), getattr(entry, key)) for key in ("min", "max")]
        bounds += [((*path, "values", k), value) for k, value in enumerate(entry.values or ())]
        yield from ((place, value, known[name]) for place, value in bounds if value is not None)
        yield from _of_tolerance((*path, "tolerance"), entry.tolerance, known[name])
    exerted = {PLACE: quantity("force", above=0), ANGLE: quantity("torque or energy", above=0)}
    for name, torque in design.torque.items():
        kind = exerted.get(moved.get(name, ANY), ANY)
        yield ("design", "torque", name, "max"), torque.max, kind
    for name, constraint in design.constraints.items():
        kinds = [known[term] for term in constraint.terms if known.get(term, ANY) is not ANY]
        dimensions = {kind.dimension for kind in kinds}
        one = Quantity(dimensions.pop()) if len(dimensions) == 1 else None if dimensions else ANY
        for key in ("min", "max"):
            if (value := getattr(constraint, key)) is not None:
                yield ("design", "constraints", name, key), value, one


def _of_tolerance(
    path: KeyPath, tolerance: Tolerance | None, kind: Quantity
) -> Iterator[Undecided]:
    """A deviation that is no share."""
    if tolerance is not None and isinstance(tolerance.amount, Written):
        yield path, tolerance.amount, ANY if kind is ANY else Quantity(kind.dimension, above=0)


def _of_assembly(document: Document, kinds: Mapping[str, Quantity]) -> Iterator[Undecided]:
    """Coordinates at which loops are put together, and guesses of their passive joints."""
    assembly, path = document.mechanism.assembly, ("mechanism", "assembly")
    for name, value in assembly.at.items() if assembly else ():
        yield (*path, "at", name), value, kinds.get(name, ANY)
    for joint, guess in assembly.guess.items() if assembly else ():
        values = guess if isinstance(guess, tuple) else (guess,)
        known = [of_freedom(f) for f in guessed(document, joint, len(values)) or ()]
        place = (*path, "guess", joint)
        if isinstance(guess, tuple):
            yield from _in_list(guess, known, place)
        else:
            yield place, guess, known[0] if len(known) == 1 else ANY


def _in_list(row: Sequence[float], kinds: Sequence[Quantity], path: KeyPath) -> Iterator[Undecided]:
    """Text among the entries of a list: bare numbers are SI already."""
    for k, value in enumerate(row):
        if isinstance(value, Written):
            yield (*path, k), value, kinds[k] if k < len(kinds) else ANY
