"""The keys behind the trajectory: `design`, `expansion`, `targets`, `validation`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal, Self, TypeAlias

from pydantic import Field, model_validator

from eigassign.case.schema.mechanism import Q_VALUE
from eigassign.case.schema.parts import (
    Frozen,
    FrozenDict,
    Named,
    NumberOr,
    OneOrList,
    Part,
    Quantity,
    ValueOr,
    quantity,
    wrong,
)
from eigassign.case.schema.trajectory import Coordinates, Times

QSpan: TypeAlias = Annotated[float, Quantity(at_least=0, elsewhere=Q_VALUE.elsewhere)]
YValue: TypeAlias = Annotated[
    float, Quantity(elsewhere="quantity of the parameter's dimension (SI when bare)")
]
Frequency: TypeAlias = Annotated[float, quantity("frequency", above=0)]
Auto: TypeAlias = Literal["auto"]
Mode: TypeAlias = Annotated[int, Field(ge=1, le=1000)]
Modes: TypeAlias = Annotated[tuple[Mode, ...], Field(min_length=1)]


class Parameter(Part):
    """One design parameter y: path of a numeric property, and its bounds in SI units."""

    parameter: str
    min: YValue
    max: YValue

    @model_validator(mode="after")
    def _has_room(self) -> Self:
        if self.min > self.max:
            raise wrong(f"min {self.min:g} is above max {self.max:g} (SI units)", "min")
        return self


class Constraint(Part):
    """min ≤ Σ coefficient · y ≤ max over the named design parameters."""

    terms: Annotated[Mapping[str, Annotated[float, Quantity()]], Field(min_length=1), Frozen]
    min: YValue | None = None
    max: YValue | None = None

    @model_validator(mode="after")
    def _binds(self) -> Self:
        if self.min is None and self.max is None:
            raise wrong("a constraint needs min, max or both")
        if self.min is not None and self.max is not None and self.min > self.max:
            raise wrong(f"min {self.min:g} is above max {self.max:g} (SI units)", "min")
        if not any(self.terms.values()):
            raise wrong("all coefficients are zero", "terms")
        return self


class Design(Part):
    """Design parameters y in the order of the file, and linear constraints between them."""

    parameters: Named[Parameter] = FrozenDict()
    constraints: Named[Constraint] = FrozenDict()


class ExpansionKeys(Part):
    """Order of the power series, its point (q, y), and the modes expanded; or `auto`.

    `accuracy` (relative error in Hz) is what an `auto` order, and `auto` elements, have to meet.
    """

    order: NumberOr[Annotated[int, Field(ge=1, le=20)], Auto] = 4
    accuracy: Annotated[float, quantity("fraction", above=0)] = 1e-3
    q: OneOrList[Auto, Coordinates] = "auto"
    y: OneOrList[Auto, tuple[YValue, ...]] = "auto"
    modes: OneOrList[Auto, Modes] = "auto"


class FrequencyProfile(Part):
    """A wanted frequency (Hz) that changes in time (s), linear between the points given."""

    time: Times
    frequency: Annotated[tuple[Frequency, ...], Field(min_length=2)]

    @model_validator(mode="after")
    def _is_a_function(self) -> Self:
        if len(self.time) != len(self.frequency):
            raise wrong(f"{len(self.time)} times for {len(self.frequency)} frequencies", "time")
        return self


class Target(Part):
    """Wanted frequency (Hz) of one elastic mode (1 is the lowest), and its weight.

    It holds along every trajectory, or along the one that `trajectory` names.
    """

    mode: Mode
    frequency: ValueOr[Frequency, FrequencyProfile]
    weight: Annotated[float, Quantity(above=0)] = 1.0
    trajectory: str | None = None


class ValidationKeys(Part):
    """How far from exact is too far (fraction), and the box in q that is sampled at random."""

    max_error: Annotated[float, quantity("fraction", above=0)] = 0.02
    q_span: OneOrList[QSpan, tuple[QSpan, ...]] | None = None
    samples: Annotated[int, Field(ge=1, le=1_000_000)] = 200
