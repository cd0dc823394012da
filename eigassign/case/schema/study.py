"""The keys that say how the work is done: `assignment`, `expansion`, `validation`, `measurements`.

Measurements are frequencies that were measured, listed or in a CSV file. The key `sweep` holds
values of other keys that `batch` runs the case with, one variant for each.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from fractions import Fraction
from typing import Annotated, Any, Literal, TypeAlias, get_args

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from eigassign.case.reader import shown
from eigassign.case.schema.design import Tolerance, YValue
from eigassign.case.schema.parts import (
    ByReference,
    File,
    FrozenDict,
    Mistakes,
    NumberOr,
    OneOrList,
    Part,
    Quantity,
    Share,
    ShareOrRange,
    ShareRange,
    Told,
    ValueOr,
    quantity,
    wrong,
)
from eigassign.case.schema.targets import Frequency, HighestTarget, Mode, Modes
from eigassign.case.schema.trajectory import DURATION, TIME, Coordinates
from eigassign.case.units import PLAIN, QuantityError, number_and_unit

Auto: TypeAlias = Literal["auto"]
MaxError: TypeAlias = Annotated[float, Quantity(PLAIN, above=0, at_most=1)]  # 2 is meant as 2 %
Word: TypeAlias = Literal["least_squares", "worst_case", "lightest", "widest", "fastest"]
MOST_MEASUREMENTS = 10_000  # of one case


class Damping(Part):
    """Damping ratios of modes.

    Keys:
        ratio: ζ of every mode that `modes` does not list; or the least and the most, which all
            ranges have together
        modes: those of modes 1, 2, …
    """

    ratio: ShareOrRange
    modes: Annotated[tuple[ShareOrRange, ...], Field(min_length=1)] | None = None


DampingForm: TypeAlias = Annotated[
    Share | ShareRange | Damping,
    Told(lambda v: 2 if isinstance(v, Mapping) else int(isinstance(v, (list, tuple)))),
]


class HighestMode(Part):
    """A mode along one trajectory, or along all.

    Keys:
        mode: its number
        trajectory: name of the only trajectory that counts; all unless given
    """

    mode: Mode
    trajectory: str | None = None


class Highest(Part):
    """The objective that a mode's least frequency along the trajectories be as high as can be.

    Keys:
        highest: number of the mode, or the mode and a trajectory
    """

    highest: ValueOr[Mode, HighestMode]

    @model_validator(mode="before")
    @classmethod
    def _is_of_a_mode(cls, given: Any) -> Any:
        for word in set(get_args(Word)).intersection(given if isinstance(given, Mapping) else ()):
            raise wrong(f"stands alone: write objective: {word}", word)
        return given

    @property
    def target(self) -> HighestTarget:
        """The mode as a target."""
        if isinstance(self.highest, HighestMode):
            return HighestTarget(mode=self.highest.mode, trajectory=self.highest.trajectory)
        return HighestTarget(mode=self.highest)


class AssignmentKeys(Part):
    """How the optimal design is looked for, and how good it has to be.

    Keys:
        method: `sequential` goes on to the optimum of the exact problem; `one_shot` is the paper's
            single quadratic program, for frequency targets of numbered modes, bounds and linear
            limits
        objective: what is made small or large: `least_squares` the mean square error, `worst_case`
            the largest weighted error, `lightest` the mass, `{highest: 1}` the least frequency of a
            mode, `widest` the least relative room of all bands and gaps, of numbered modes,
            `fastest` the design parameter `trajectory.duration`
        starts: number of designs to start from; the first are the initial design and the one shot,
            the others by turns the most promising of a sample and spread ones. `auto` goes on
            while more than half an optimum is expected unseen, to 100 starts at most
        steps: at most so many from each start
        seconds: at most so long; no limit unless given
        max_error: how far a frequency may be from its target; 2 % unless given. If it is given, a
            larger error sets the exit code
        robust: whether all that is asked holds for every deviation within the tolerances of the
            parameters, not only for the design itself, and for what is `uncertain`
        probability: with which all limits hold together, of what is `uncertain` with a deviation
    """

    method: Literal["sequential", "one_shot"] = "sequential"
    objective: ValueOr[Word, Highest] = "least_squares"
    starts: NumberOr[Annotated[int, Field(ge=1, le=1000)], Auto] = "auto"
    steps: Annotated[int, Field(ge=1, le=1_000_000)] = 100
    seconds: Annotated[float, DURATION] | None = None
    max_error: MaxError | None = None
    robust: bool = False
    probability: Annotated[float, Quantity(PLAIN, above=0, below=1)] = 0.95

    @property
    def named_objective(self) -> str:
        """The objective in one word: that of a mode is ``highest``."""
        return self.objective if isinstance(self.objective, str) else "highest"


class ExpansionKeys(Part):
    """Order of the power series, its point, and the modes expanded.

    Keys:
        order: `auto` doubles it until it meets `accuracy`
        accuracy: relative error in Hz that `order`, `elements` and `reduce_to` meet where they are
            `auto`
        q: the point; `auto` takes the most central sample of the trajectory
        y: the point; `auto` takes the middle of the bounds, or the initial design where the
            mechanism falls or buckles there
        modes: to expand beside those of the targets
    """

    order: NumberOr[Annotated[int, Field(ge=1, le=20)], Auto] = 4
    accuracy: Annotated[float, quantity("fraction", above=0)] = 1e-3
    q: OneOrList[Auto, Coordinates] = "auto"
    y: OneOrList[Auto, tuple[YValue, ...]] = "auto"
    modes: OneOrList[Auto, Modes] = "auto"


class ValidationKeys(Part):
    """What `eigassign validate` compares, and how far from exact is too far.

    Keys:
        max_error: how far an expansion may be from exact, relative in Hz
    """

    max_error: MaxError = 0.02


class Measurement(Part):
    """A measured frequency.

    Keys:
        time: of the trajectory when it was measured, at a sample or between. Along a path of a tip
            q is that of the mechanism as it is written, whatever design explains the measurements:
            give `q` where the machine followed the path with another one
        q: instead of the time: one value of each coordinate
        trajectory: name of the trajectory, where there are several
        mode: its number, counted from the lowest elastic one; without it that of the model as it is
            written whose frequency is nearest, no two of a pose alike
        frequency: what was measured, or `[10.1 Hz, 10.4 Hz]`, what it lies between: in all or none
        deviation: its standard deviation; a share is one of the frequency
    """

    time: Annotated[float, TIME] | None = None
    q: Coordinates | None = None
    trajectory: str | None = None
    mode: Mode | None = None
    frequency: OneOrList[Frequency, tuple[Frequency, Frequency]]
    deviation: Tolerance | None = None
    one_of = ("time", "q")

    def _mistakes(self, space: str | None) -> Mistakes:
        if isinstance(self.frequency, tuple):
            if self.frequency[0] >= self.frequency[1]:
                yield wrong("is not below the second", "frequency", 0)
            if self.deviation is not None:
                yield wrong("a range has none: leave it out", "deviation")
        elif self.deviation is None:
            message = "required key is missing: give one, or a range such as [10.1 Hz, 10.4 Hz]"
            yield wrong(message, "deviation")


class MeasurementFile(Part):
    """Measurements in a CSV file.

    Keys:
        file: relative to the case file; columns of the same names, and one for each coordinate
            instead of `q`; of ranges `lower` and `upper` instead of the frequency
        columns: what the header calls them, where that is something else
        deviation: of rows for which the file gives none
    """

    file: File
    columns: ByReference[str] = FrozenDict()
    deviation: Tolerance | None = None


Measurements: TypeAlias = OneOrList[
    MeasurementFile,
    Annotated[tuple[Measurement, ...], Field(min_length=1, max_length=MOST_MEASUREMENTS)],
]


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


class Range(Part):
    """Values at equal distances from one to another, with both ends.

    Keys:
        min: the least
        max: the largest, in the same unit
        count: how many
    """

    min: Amount
    max: Amount
    count: Annotated[int, Field(ge=2, le=100_000)]

    def _mistakes(self, space: str | None) -> Mistakes:
        (low, unit), (high, other) = number_and_unit(self.min), number_and_unit(self.max)
        if unit != other and low and high:
            yield wrong(f"write both ends in the same unit, got {unit!r} and {other!r}", "max")
        if low >= high:
            yield wrong(f"max must be larger than min, got {shown(self.max)}", "max")

    @property
    def values(self) -> tuple[object, ...]:
        """The values in the unit of the range, rounded once: of 0 to 1 the third of 11 is 0.2."""
        (low, unit), (high, other) = number_and_unit(self.min), number_and_unit(self.max)
        shares = (Fraction(k, self.count - 1) for k in range(self.count))
        exact = (low + share * (high - low) for share in shares)
        numbers = (int(at) if at.denominator == 1 else float(at) for at in exact)
        named = unit or other
        return tuple(f"{number!r} {named}" if named else number for number in numbers)


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
            fastest; `list` the first of each, then the second, and so on
        file: instead of `parameters`: a CSV file with a column for each key and a row for each
            variant
    """

    parameters: Annotated[ByReference[Body], Field(min_length=1)] | None = None
    sample: Literal["grid", "list"] = "grid"
    file: File | None = None

    one_of = ("parameters", "file")

    def _mistakes(self, space: str | None) -> Mistakes:
        for key, body in (self.parameters or {}).items() if self.sample == "grid" else ():
            seen: set[str] = set()
            for k, value in enumerate(body if isinstance(body, tuple) else ()):
                if (written := text_of(value)) in seen:
                    yield wrong(f"{shown(value)} is given twice", "parameters", key, k)
                seen.add(written)
        bodies = (self.parameters or {}).items()
        counts = {key: len(b.values if isinstance(b, Range) else b) for key, b in bodies}
        if self.sample == "list" and len(set(counts.values())) > 1:
            told = ", ".join(f"{key} has {count}" for key, count in counts.items())
            yield wrong(f"a list takes equally many values of each key, but {told}", "sample")
