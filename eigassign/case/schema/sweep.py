"""The key `sweep`: values of other keys that `batch` runs the case with, one variant for each.

A grid takes each value of every key with each of all others, a list the first ones together, then
the second ones, and so on. Samples are spread over ranges: `latin_hypercube`, `sobol`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Annotated, Any, Literal, Self, TypeAlias

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from eigassign.case.schema.parts import ByReference, File, OneOrList, Part, wrong
from eigassign.case.suggestions import shown
from eigassign.case.units import QuantityError, number_and_unit

MOST = 10_000_000  # variants of one case: ten times what has been measured (benchmarks)


def _amount(value: Any) -> Any:
    try:
        number_and_unit(value)
    except QuantityError as error:
        raise wrong(str(error)) from None
    return value


Amount: TypeAlias = Annotated[
    Any, AfterValidator(_amount), Field(description="a number, or text with a unit")
]
Value: TypeAlias = Annotated[Any, Field(description="whatever the key may hold")]


def _listed(value: Any) -> Any:
    if not isinstance(value, (Mapping, list, tuple)):
        what = "a list of values or a range, {min: ..., max: ..., count: ...}"
        raise wrong(f"expected {what}, got {shown(value)}")
    return value


Count: TypeAlias = Annotated[int, Field(ge=1, le=MOST)]


class Range(Part):
    """Values from one to another.

    Keys:
        min: the least
        max: the largest, in the same unit
        count: of a grid or a list: how many values at equal distances, with both ends
    """

    min: Amount
    max: Amount
    count: Count | None = None

    @model_validator(mode="after")
    def _goes_up(self) -> Self:
        (low, unit), (high, other) = number_and_unit(self.min), number_and_unit(self.max)
        if unit != other and low and high:
            raise wrong(f"write both ends in the same unit, got {unit!r} and {other!r}", "max")
        if low >= high:
            raise wrong(f"max must be larger than min, got {shown(self.max)}", "max")
        if self.count == 1:
            raise wrong("a range has two ends: at least 2", "count")
        return self

    def value(self, share: Fraction | float) -> object:
        """The value this far from `min` (0) to `max` (1), in the unit of the range.

        Of an exact share it is rounded once: the third of 11 values from 0 to 1 is 0.2.
        """
        (low, unit), (high, other) = number_and_unit(self.min), number_and_unit(self.max)
        at = low + Fraction(share) * (high - low)
        number = int(at) if at.denominator == 1 else float(at)
        named = unit or other
        return f"{number!r} {named}" if named else number


@dataclass(frozen=True)
class Steps(Sequence[object]):
    """The values of a range at equal distances, with both ends; each is made when asked for."""

    span: Range

    def __len__(self) -> int:
        return self.span.count or 2

    def __getitem__(self, k: Any) -> Any:
        """The k-th of them."""
        return self.span.value(Fraction(range(len(self))[k], len(self) - 1))


def text_of(value: object) -> str:
    """A value as variants are told apart by: without the blanks of its text."""
    return (value if isinstance(value, str) else json.dumps(value)).replace(" ", "")


Values: TypeAlias = Annotated[tuple[Value, ...], Field(min_length=1, max_length=MOST)]
Body: TypeAlias = Annotated[OneOrList[Range, Values], BeforeValidator(_listed)]


class Sweep(Part):
    """Values that other keys have in the variants of the case, for `eigassign batch`.

    Keys:
        parameters: for each key, a dotted path such as `targets.0.frequency`, a list of values or a
            range
        sample: `grid` takes every value of every key with every other, the last key changing
            fastest; `list` the first values of all keys together, then the second ones;
            `latin_hypercube` and `sobol` are points spread over the ranges. `grid` unless given
        count: how many points of a sample
        seed: which sample; 0 unless given
        file: instead of `parameters`: a CSV file with a column for each key and a row for each
            variant
    """

    parameters: Annotated[ByReference[Body], Field(min_length=1)] | None = None
    sample: Literal["grid", "list", "latin_hypercube", "sobol"] | None = None
    count: Count | None = None
    seed: Annotated[int, Field(ge=0, le=2**32 - 1)] | None = None
    file: File | None = None

    @model_validator(mode="after")
    def _is_one_kind(self) -> Self:
        if (self.parameters is None) == (self.file is None):
            raise wrong("give either parameters or file")
        drawn = self.sample in ("latin_hypercube", "sobol")
        if drawn and self.count is None:
            raise wrong(f"required key is missing: how many variants {self.sample} has", "count")
        for key in ("count", "seed"):
            if not drawn and getattr(self, key) is not None:
                raise wrong("is for latin_hypercube and sobol only", key)
        if self.file is not None and self.sample is not None:
            raise wrong("is for parameters: the rows of a file are the variants", "sample")
        keys = len(self.parameters or ())
        if drawn and keys * (self.count or 0) > MOST:
            raise wrong(f"of {keys} parameters at most {MOST // keys} points can be drawn", "count")
        for key, body in (self.parameters or {}).items():
            self._check(key, body, drawn)
        counts = {len(axis) for axis in self.axes()} if self.sample == "list" else {1}
        if len(counts) > 1:
            some = ", ".join(map(str, sorted(counts)))
            raise wrong(f"of a list all keys have equally many values, got {some}", "parameters")
        return self

    def _check(self, key: str, body: Range | tuple[Any, ...], drawn: bool) -> None:
        place = ("parameters", key)
        if isinstance(body, Range):
            if drawn and body.count is not None:
                raise wrong(f"{self.sample} has one count, beside sample", *place, "count")
            if not drawn and body.count is None:
                raise wrong("required key is missing: how many values", *place, "count")
        elif drawn:
            raise wrong(f"{self.sample} needs a range, {{min: ..., max: ...}}", *place)
        elif self.sample != "list":
            seen: set[str] = set()
            for k, value in enumerate(body):
                if (written := text_of(value)) in seen:
                    raise wrong(f"{shown(value)} is given twice", *place, k)
                seen.add(written)

    def axes(self) -> tuple[Sequence[object], ...]:
        """The values of each key, in the order of the file; not of samples or a file."""
        bodies = (self.parameters or {}).values()
        return tuple(Steps(b) if isinstance(b, Range) else b for b in bodies)
