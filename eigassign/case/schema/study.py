"""The keys that say how the work is done: `assignment`, `expansion`, `validation`."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from pydantic import Field

from eigassign.case.schema.design import YValue
from eigassign.case.schema.mechanism import Q_VALUE
from eigassign.case.schema.parts import NumberOr, OneOrList, Part, Quantity, quantity
from eigassign.case.schema.targets import Modes
from eigassign.case.schema.trajectory import DURATION, Coordinates

QSpan: TypeAlias = Annotated[float, Quantity(at_least=0, elsewhere=Q_VALUE.elsewhere)]
Auto: TypeAlias = Literal["auto"]


class AssignmentKeys(Part):
    """How the optimal design is looked for, and how good it has to be.

    `starts`, `steps` and `seconds` limit the work; `max_error` (relative, in Hz) is how far a
    frequency may be from its target (2 %; if it is given, a larger error sets the exit code).
    """

    method: Literal["sequential", "one_shot"] = "sequential"
    objective: Literal["least_squares", "worst_case"] = "least_squares"
    starts: NumberOr[Annotated[int, Field(ge=1, le=1000)], Auto] = "auto"
    steps: Annotated[int, Field(ge=1, le=1_000_000)] = 100
    seconds: Annotated[float, DURATION] | None = None
    max_error: Annotated[float, quantity("fraction", above=0)] | None = None


class ExpansionKeys(Part):
    """Order of the power series, its point (q, y), and the modes expanded; or `auto`.

    `accuracy` (relative error in Hz) is what an `auto` order, and `auto` elements, have to meet.
    """

    order: NumberOr[Annotated[int, Field(ge=1, le=20)], Auto] = 4
    accuracy: Annotated[float, quantity("fraction", above=0)] = 1e-3
    q: OneOrList[Auto, Coordinates] = "auto"
    y: OneOrList[Auto, tuple[YValue, ...]] = "auto"
    modes: OneOrList[Auto, Modes] = "auto"


class ValidationKeys(Part):
    """How far from exact is too far (fraction), and the box in q that is sampled at random."""

    max_error: Annotated[float, quantity("fraction", above=0)] = 0.02
    q_span: OneOrList[QSpan, tuple[QSpan, ...]] | None = None
    samples: Annotated[int, Field(ge=1, le=1_000_000)] = 200
