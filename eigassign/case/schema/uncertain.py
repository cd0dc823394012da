"""The key `uncertain`: properties of the mechanism that are not known exactly, and how well.

A robust design has a column of y for each, behind those that are designed, which no step changes:
only deviations do. Several sets of values may explain what was measured: `others` has the further
ones, each with a covariance of its own.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, TypeAlias

from eigassign.case.schema.design import Parameter, PropertyPaths, Tolerance, YValue
from eigassign.case.schema.parts import (
    ByReference,
    File,
    FrozenDict,
    Mistakes,
    Named,
    Part,
    Quantity,
    wrong,
)
from eigassign.case.units import PLAIN

Correlation: TypeAlias = ByReference[ByReference[Annotated[float, Quantity(PLAIN)]]]
BESIDE = ("correlation", "others", "file")  # names under `uncertain` that are no properties
LEAST = 1e-12  # pivot of a correlation matrix: more digits than are known of any


class UnknownColumn(Parameter):
    """What a property that is not known is among the parameters of a robust design."""

    group = "uncertain"


class UncertainProperty(Part):
    """A property that is not known exactly.

    Keys:
        parameter: its path, or a list of paths, as of a design parameter
        value: the likeliest; that of the mechanism unless given
        standard_deviation: of the value; a share is one of the value
        interval: what the value is between with 95 %, as `update` found it; nothing reads it
        min: instead of a standard deviation: the least that it may be
        max: the largest
    """

    parameter: PropertyPaths
    value: YValue | None = None
    standard_deviation: Tolerance | None = None
    interval: tuple[YValue, YValue] | None = None
    min: YValue | None = None
    max: YValue | None = None

    one_of = ("standard_deviation", "min")

    def _mistakes(self, space: str | None) -> Mistakes:
        if self.min is not None and self.max is None:
            yield wrong("give both min and max", "min")
        if self.max is not None and (self.min is None or self.min >= self.max):
            yield wrong("must be larger than min", "max")

    def column(self, value: float) -> UnknownColumn:
        """What it is among the parameters of the design."""
        return UnknownColumn.model_construct(parameter=self.parameter, min=value, max=value)


class Explanation(Part):
    """A further set of values that explains the measurements.

    Keys:
        values: of each property with a standard deviation
        standard_deviation: of each
        correlation: of pairs of them, as beside `others`; 0 unless given
    """

    values: ByReference[YValue]
    standard_deviation: ByReference[Tolerance]
    correlation: Correlation = FrozenDict()


class Uncertain(Part):
    """Properties that are not known exactly, by name.

    Keys:
        entries: by name
        correlation: of pairs, `{k1: {k2: -0.3}}`; 0 unless given
        others: further sets of values that explain the measurements as well
        file: instead, or beside others: the folder of an update, whose values it are
    """

    entries: Named[UncertainProperty] = FrozenDict()
    correlation: Correlation = FrozenDict()
    others: tuple[Explanation, ...] = ()
    file: File | None = None

    def _mistakes(self, space: str | None) -> Mistakes:
        if not self.entries and self.file is not None:
            message = "has no key uncertain: give the folder of an update that explained something"
            yield wrong(message, "file")
        elif not self.entries:
            yield wrong("names no property: such as {k: {parameter: …, standard_deviation: 3 %}}")
        named = [*self.spread]
        for k, one in enumerate(self.others):
            if not {*named} == {*one.values} == {*one.standard_deviation}:
                message = f"needs values and standard deviations of {', '.join(named) or 'none'}"
                yield wrong(message, "others", k)
        whole: list[tuple[tuple[str | int, ...], Correlation]] = [((), self.correlation)]
        whole += [(("others", k), one.correlation) for k, one in enumerate(self.others)]
        for first, given in whole:
            place = (*first, "correlation")
            for a, row in given.items():
                for b, value in row.items():
                    if a not in named or b not in named:
                        message = f"{b if a in named else a} has no standard deviation here"
                        yield wrong(message, *place, a)
                    elif a == b or not abs(value) < 1.0:
                        message = "a correlation of two properties is between −1 and 1"
                        yield wrong(message, *place, a, b)
                    elif given.get(b, {}).get(a, value) != value:
                        yield wrong(f"is another than that of {b} and {a}", *place, a, b)
            if not _is_definite(_matrix(named, given)):
                message = "no properties can be correlated so: the matrix is not positive definite"
                yield wrong(message, *place)

    @property
    def spread(self) -> Mapping[str, UncertainProperty]:
        """Those with a standard deviation."""
        own = self.entries.items()
        return {name: one for name, one in own if one.standard_deviation is not None}

    def explained(
        self, values: Mapping[str, float]
    ) -> Iterator[tuple[list[float], list[list[float]]]]:
        """Yield each explanation: its values (n,), and their covariance (n, n), SI.

        Of properties with a standard deviation, in their order; ``values`` are the likeliest.
        """
        first = {n: one.standard_deviation for n, one in self.spread.items()}
        others = ((o.values, o.standard_deviation, o.correlation) for o in self.others)
        every: list[tuple[Any, Any, Correlation]] = [(values, first, self.correlation), *others]
        for p, deviations, correlation in every:
            own = [deviations[name].deviation(p[name]) for name in first]
            rows = zip(own, _matrix([*first], correlation), strict=True)
            yield (
                [p[name] for name in first],
                [[a * b * c for b, c in zip(own, row, strict=True)] for a, row in rows],
            )


def _matrix(names: list[str], given: Correlation) -> list[list[float]]:
    """The correlation matrix (n, n) of properties."""
    pairs = {frozenset((a, b)): value for a, row in given.items() for b, value in row.items()}
    return [[1.0 if a == b else pairs.get(frozenset((a, b)), 0.0) for b in names] for a in names]


def _is_definite(matrix: list[list[float]]) -> bool:
    """Whether all pivots of Gauss's elimination are positive."""
    if not matrix:
        return True
    (pivot, *first), *rest = matrix
    below = (
        [value - row[0] * own / pivot for value, own in zip(row[1:], first, strict=True)]
        for row in rest
    )
    return pivot > LEAST and _is_definite([*below])
