"""The keys behind the trajectory: `design`, `expansion`, `targets`, `validation`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal, TypeAlias

from pydantic import Discriminator, Field, Tag, model_validator

from eigassign.case.schema.mechanism import Q_VALUE
from eigassign.case.schema.trajectory import Coordinates, Times, increasing
from eigassign.case.schema.vectors import one_or_list, word_or_number
from eigassign.case.units import Frozen, FrozenDict, Part, Quantity, quantity, wrong

FREQUENCY = quantity("frequency", above=0)
Q_SPAN = Quantity(at_least=0, elsewhere=Q_VALUE.elsewhere)
Y_VALUE = Quantity(elsewhere="quantity of the parameter's dimension (SI when bare)")
Parameters: TypeAlias = tuple[Annotated[float, Y_VALUE], ...]
Mode: TypeAlias = Annotated[int, Field(ge=1, le=1000)]
Modes: TypeAlias = Annotated[tuple[Mode, ...], Field(min_length=1)]


class Parameter(Part):
    """One design parameter y: path of a numeric property, and its bounds in SI units."""

    parameter: str
    min: Annotated[float, Y_VALUE]
    max: Annotated[float, Y_VALUE]

    @model_validator(mode="after")
    def _has_room(self) -> Parameter:
        if self.min > self.max:
            raise wrong(f"min {self.min:g} is above max {self.max:g} (SI units)", "min")
        return self


class Constraint(Part):
    """min ≤ Σ coefficient · y ≤ max over the named design parameters."""

    terms: Annotated[Mapping[str, Annotated[float, Quantity()]], Field(min_length=1), Frozen]
    min: Annotated[float, Y_VALUE] | None = None
    max: Annotated[float, Y_VALUE] | None = None

    @model_validator(mode="after")
    def _binds(self) -> Constraint:
        if self.min is None and self.max is None:
            raise wrong("a constraint needs min, max or both")
        if self.min is not None and self.max is not None and self.min > self.max:
            raise wrong(f"min {self.min:g} is above max {self.max:g} (SI units)", "min")
        if not any(self.terms.values()):
            raise wrong("all coefficients are zero", "terms")
        return self


class Design(Part):
    """Design parameters y in the order of the file, and linear constraints between them."""

    parameters: Annotated[Mapping[str, Parameter], Frozen] = FrozenDict()
    constraints: Annotated[Mapping[str, Constraint], Frozen] = FrozenDict()


_Auto: TypeAlias = Annotated[Literal["auto"], Tag("<one>")]
_WORD_OR_LIST = Discriminator(one_or_list)


class Expansion(Part):
    """Order of the power series, its point (q, y), and the modes expanded; or `auto`.

    `accuracy` (relative error in Hz) is what an `auto` order, and `auto` elements, have to meet.
    """

    order: Annotated[
        Annotated[Annotated[int, Field(ge=1, le=20)], Tag("<number>")]
        | Annotated[Literal["auto"], Tag("<auto>")],
        Discriminator(word_or_number),
    ] = 4
    accuracy: Annotated[float, quantity("fraction", above=0)] = 1e-3
    q: Annotated[_Auto | Annotated[Coordinates, Tag("<list>")], _WORD_OR_LIST] = "auto"
    y: Annotated[_Auto | Annotated[Parameters, Tag("<list>")], _WORD_OR_LIST] = "auto"
    modes: Annotated[_Auto | Annotated[Modes, Tag("<list>")], _WORD_OR_LIST] = "auto"


class FrequencyProfile(Part):
    """A wanted frequency (Hz) that changes in time (s), linear between the points given."""

    time: Times
    frequency: Annotated[tuple[Annotated[float, FREQUENCY], ...], Field(min_length=2)]

    @model_validator(mode="after")
    def _is_a_function(self) -> FrequencyProfile:
        if len(self.time) != len(self.frequency):
            raise wrong(f"{len(self.time)} times for {len(self.frequency)} frequencies", "time")
        increasing(self.time)
        return self


def _frequency_tag(value: object) -> str:
    return "<profile>" if isinstance(value, (Mapping, FrequencyProfile)) else "<constant>"


class Target(Part):
    """Wanted frequency (Hz) of one elastic mode (1 is the lowest), and its weight.

    It holds along every trajectory, or along the one that `trajectory` names.
    """

    mode: Mode
    frequency: Annotated[
        Annotated[Annotated[float, FREQUENCY], Tag("<constant>")]
        | Annotated[FrequencyProfile, Tag("<profile>")],
        Discriminator(_frequency_tag),
    ]
    weight: Annotated[float, Quantity(above=0)] = 1.0
    trajectory: str | None = None


class Validation(Part):
    """How far from exact is too far (fraction), and the box in q that is sampled at random."""

    max_error: Annotated[float, quantity("fraction", above=0)] = 0.02
    q_span: (
        Annotated[
            Annotated[Annotated[float, Q_SPAN], Tag("<one>")]
            | Annotated[tuple[Annotated[float, Q_SPAN], ...], Tag("<list>")],
            Discriminator(one_or_list),
        ]
        | None
    ) = None
    samples: Annotated[int, Field(ge=1, le=1_000_000)] = 200
