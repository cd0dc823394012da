"""One value of the file → SI number, where the schema cannot know its dimension."""

from __future__ import annotations

from eigassign.case.quantity import Quantity
from eigassign.case.suggest import shown
from eigassign.case.units import QuantityError, read
from eigassign.case.yaml_reader import Finding, KeyPath


def si(
    value: object,
    quantity: Quantity | None,
    path: KeyPath,
    findings: list[Finding],
    harmless: float = 0.0,
) -> object:
    """``value`` in SI; ``harmless``, and a finding, if it is not such a quantity.

    Lists and mappings are left as they are. None as quantity: no unit can be meant.
    """
    if isinstance(value, bool) or not isinstance(value, (str, int, float)):
        return value
    try:
        if quantity is None:
            return _bare(value)
        return quantity.checked(read(value, quantity.dimension), shown(value))
    except QuantityError as error:
        findings.append((path, str(error)))
        return harmless


def _bare(value: object) -> float:
    if isinstance(value, str):
        raise QuantityError(
            f"terms of different dimensions: give a plain number in SI units, got {shown(value)}"
        )
    return read(value, None)
