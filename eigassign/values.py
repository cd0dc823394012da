"""``--q`` and ``--y`` of the command line: text → SI numbers of the case's dimensions."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from eigassign.case import CaseFile, load
from eigassign.case.feasible import impossible
from eigassign.case.properties import find
from eigassign.case.quantity import Quantity, quantity
from eigassign.case.resolved import plain
from eigassign.case.units import QuantityError
from eigassign.errors import UsageError

Numbers = list[float] | None


def point(case: Path, q: str | None, y: str | None) -> tuple[Numbers, Numbers]:
    """--q and --y in the units of the case; None where not given. Raises UsageError."""
    if q is None and y is None:
        return None, None
    file = load(case)
    return coordinates(file, q), design(file, y)


def coordinates(case: CaseFile, text: str | None) -> Numbers:
    """q in rad or m, one value per coordinate of the case; raises UsageError."""
    kinds = {"rad": quantity("angle"), "m": quantity("length")}
    quantities = [kinds[unit] for unit in case.coordinate_units]
    return None if text is None else _read(text, "--q", list(case.coordinates), quantities)


def design(case: CaseFile, text: str | None) -> Numbers:
    """y in SI units, one value per design parameter of the case; raises UsageError."""
    if text is None:
        return None
    tree = {"mechanism": plain(case.mechanism), "coordinates": plain(case.coordinates)}
    properties = {name: find(tree, p.parameter) for name, p in case.design.parameters.items()}
    quantities = [p.quantity if p else Quantity() for p in properties.values()]
    values = _read(text, "--y", list(properties), quantities)
    paths = [p.parameter for p in case.design.parameters.values()]
    point = {path: (value, value) for path, value in zip(paths, values, strict=True)}
    for *_, message in impossible(case.mechanism.sections, point):
        raise UsageError(f"--y: {message.removesuffix('; narrow the bounds')}")
    return values


def _read(
    text: str, option: str, names: Sequence[str], quantities: Sequence[Quantity]
) -> list[float]:
    parts = split(text)
    if len(parts) != len(names):
        wanted = f"{len(names)} ({', '.join(names)})" if names else "none"
        raise UsageError(f"{option}: expected {wanted} values, got {len(parts)} in {text!r}")
    values = []
    for name, part, each in zip(names, parts, quantities, strict=True):
        try:
            values.append(each.read(part))
        except QuantityError as error:
            raise UsageError(f"{option}: {name}: {error}") from None
    return values


def split(text: str) -> list[str]:
    """``"104 deg, 5.3"`` → ``["104 deg", "5.3"]``; spaces, commas or semicolons in between.

    A word behind a space that does not begin like a number is the unit of the number before it.
    """
    values: list[str] = []
    for part in re.split("[,;]", text):
        for k, word in enumerate(part.split()):
            if k and word[0] not in "+-.0123456789":
                values[-1] += f" {word}"
            else:
                values.append(word)
    return values
