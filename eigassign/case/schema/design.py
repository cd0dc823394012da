"""The key `design`: parameters between bounds, lists of values and choices, and common limits.

Whatever its entries are, a design is one vector y (`Design.parameters`): a parameter is one column
of it, and `choices` make a column of each property that they set. `Design.catalogues` says which
columns only take listed values, and which of these belong together.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from functools import cached_property
from typing import Annotated, Any, ClassVar, TypeAlias

from pydantic import AfterValidator, Field, field_validator
from pydantic_core import core_schema

from eigassign.case.reader import listed, suggestion
from eigassign.case.schema.parts import (
    ByReference,
    Frozen,
    FrozenDict,
    Mistakes,
    Named,
    OneOrList,
    Part,
    Quantity,
    Told,
    ValueOr,
    distinct,
    must,
    needs_one_of,
    quantity,
    wrong,
)
from eigassign.case.units import QuantityError

YValue: TypeAlias = Annotated[
    float, Quantity(elsewhere="of the parameter's dimension, SI when bare")
]
_RATE = "for one SI unit when bare, or such as 3 / kg"
Price: TypeAlias = Annotated[float, Quantity(elsewhere=_RATE, rate=True)]
RESERVED = ("constraints", "mass", "torque")  # names under `design` that are no entries of it
PRICE = "price"  # beside the paths of a choice
MOST_CHOICES = 1000  # of an entry; a maker's whole list of profiles has some hundreds
_SHARE = quantity("fraction", above=0)
_AMOUNT = Quantity(above=0, elsewhere="share such as 2 %, or amount, SI when bare")


@dataclass(frozen=True)
class Tolerance:
    """How far a parameter may deviate either way: a share of its value, or an amount in SI units.

    In a file `2 %` is a share, everything else an amount.
    """

    amount: float
    relative: bool

    def deviation(self, value: float) -> float:
        """Half-width of the range about ``value``, in SI units."""
        return self.amount * abs(value) if self.relative else self.amount

    def written(self) -> str | float:
        """Text or number for a file; a share reads back as the very same number."""
        return f"{100 * Decimal(repr(self.amount)):f} %" if self.relative else self.amount

    @classmethod
    def _validate(cls, value: object) -> Tolerance:
        if isinstance(value, Tolerance):
            return value
        relative = isinstance(value, str) and value.rstrip().endswith("%")
        try:
            amount = (_SHARE if relative else _AMOUNT).read(value)
        except QuantityError as error:
            raise wrong(str(error)) from None
        if relative and amount >= 1.0:
            raise wrong(f"must be below 100 %, got {100 * amount:g} %")
        return cls(amount, relative)

    @classmethod
    def __get_pydantic_core_schema__(cls, _source: Any, _handler: Any) -> core_schema.CoreSchema:
        return core_schema.no_info_plain_validator_function(
            cls._validate,
            metadata={"pydantic_js_functions": [lambda _schema, _handler: _AMOUNT.json_schema()]},
        )


def _several(given: tuple[str | Mapping[str, float], ...]) -> tuple[str | Mapping[str, float], ...]:
    if not isinstance(given[0], str):
        raise wrong("the first is a path alone: its value is that of the parameter", 0)
    seen: set[str] = set()
    for k, each in enumerate(given):
        for path in (each,) if isinstance(each, str) else each:
            if path in seen:
                raise wrong(f"{path} is listed twice", k)
            seen.add(path)
    return given


Factor: TypeAlias = Annotated[
    float, Quantity(), must(bool, "must not be 0: leave out what stays as it is")
]
OneOfSeveral: TypeAlias = ValueOr[str, Annotated[Mapping[str, Factor], Field(min_length=1), Frozen]]


PropertyPaths: TypeAlias = OneOrList[
    str, Annotated[tuple[OneOfSeveral, ...], Field(min_length=2), AfterValidator(_several)]
]


class Parameter(Part):
    """One design parameter: a property of the mechanism between bounds, or of listed values.

    Its value in the file is the initial design.

    Keys:
        parameter: path of a real number in the file, such as `sections.<name>.diameter`,
            `bodies.<name>.mass`, `links.<name>.length`, `joints.<name>.position.0` or
            `coordinates.<name>.drive.stiffness`; or a list of paths, of which the first has the
            parameter's value, the others as well, or `{path: factor}` times it
        min: lower bound
        max: upper bound
        values: the values it may take, instead of bounds
        price: what a unit of it costs
        tolerance: how far it may deviate from the answer either way
    """

    model_config = needs_one_of(("min", "max"), ("values",))
    other_keys = ("choices",)
    group: ClassVar[str] = "design"  # the key of the file that it stands under

    parameter: PropertyPaths
    min: YValue | None = None
    max: YValue | None = None
    values: (
        Annotated[
            tuple[YValue, ...],
            Field(min_length=1, max_length=MOST_CHOICES),
            distinct("{} is listed twice"),
        ]
        | None
    ) = None
    price: Price | None = None
    tolerance: Tolerance | None = None

    def _mistakes(self, space: str | None) -> Mistakes:
        for key, bound in (("min", self.min), ("max", self.max)):
            if self.values is None and bound is None:
                yield wrong("required key is missing: give min and max, or values", key)
            if self.values is not None and bound is not None:
                yield wrong(f"values are given, and leave nothing to limit: leave {key} out", key)

    @property
    def factors(self) -> Mapping[str, float]:
        """Its properties by path, the first one first, each with its share of the value."""
        listed = (self.parameter,) if isinstance(self.parameter, str) else self.parameter
        each = (dict.fromkeys([p], 1.0) if isinstance(p, str) else p for p in listed)
        return FrozenDict({path: factor for own in each for path, factor in own.items()})

    @property
    def range(self) -> tuple[float, float]:
        """The bounds, or the smallest and the largest of the values."""
        bounds = self.values or [v for v in (self.min, self.max) if v is not None]
        return min(bounds), max(bounds)


class Choices(Part):
    """Properties that are set together: a list of sections, of motors.

    Each property is a part of y, called `<name>.<property>`, as in `boom.area`.

    Keys:
        choices: by name, each with values by path, and its `price` if all have one; all set the
            same properties
        price: for one unit of a property, by its path
        tolerance: how far a property may deviate from what is chosen either way, by its path
    """

    choices: Annotated[
        Mapping[str, Annotated[Mapping[str, YValue], Field(min_length=1), Frozen]],
        Field(min_length=1, max_length=MOST_CHOICES),
        Frozen,
    ]
    price: ByReference[Price] = FrozenDict()
    tolerance: ByReference[Tolerance] = FrozenDict()

    def _mistakes(self, space: str | None) -> Mistakes:
        (first, model), *others = self.choices.items()
        if not self.properties:
            yield wrong("sets no property", "choices", first)
        if PRICE in model and self.price:
            message = "each choice has a price of its own: leave these out, or those"
            yield wrong(message, "price")
        seen = {self._row(model): first}
        for name, choice in others:
            for path in choice:
                if path not in model:
                    message = f"choice {first!r} does not set it, and all must set the same"
                    yield wrong(message, "choices", name, path)
            if missing := [path for path in model if path not in choice]:
                message = f"choice {first!r} sets {listed(missing)} too, and all must set the same"
                yield wrong(message, "choices", name)
            if same := seen.get(self._row(choice)):
                yield wrong(f"has the same values as {same!r}", "choices", name)
            seen[self._row(choice)] = name
        for path in (*self.price, *self.tolerance):
            if path not in self.properties:
                known, key = listed(self.properties), "price" if path in self.price else "tolerance"
                yield wrong(f"the choices do not set it; they set {known}", key, path)

    @property
    def properties(self) -> tuple[str, ...]:
        """Paths of the properties that every choice sets, in the order of the first choice."""
        return tuple(path for path in next(iter(self.choices.values())) if path != PRICE)

    @property
    def prices(self) -> tuple[float, ...]:
        """What each choice costs, (n_choices,); nothing where none has a price of its own."""
        return tuple(choice[PRICE] for choice in self.choices.values() if PRICE in choice)

    @property
    def rows(self) -> tuple[tuple[float, ...], ...]:
        """The values of each choice, (n_choices, n_properties)."""
        return tuple(self._row(choice) for choice in self.choices.values())

    def _row(self, choice: Mapping[str, float]) -> tuple[float, ...]:
        return tuple(choice[path] for path in self.properties if path in choice)


class Constraint(Part):
    """A linear limit of several parameters.

    Keys:
        terms: coefficients by design parameter
        min: lower limit of the sum
        max: upper limit of the sum
    """

    terms: Annotated[Mapping[str, Annotated[float, Quantity()]], Field(min_length=1), Frozen]
    min: YValue | None = None
    max: YValue | None = None

    def _mistakes(self, space: str | None) -> Mistakes:
        if self.min is None and self.max is None:
            yield wrong("a constraint needs min, max or both")
        if not any(self.terms.values()):
            yield wrong("all coefficients are zero", "terms")


class MassLimits(Part):
    """Limits of the mass of the whole mechanism, and its price.

    Keys:
        min: at least
        max: at most
        price: what a kilogram costs, such as 4 / kg
    """

    min: Annotated[float, quantity("mass", above=0)] | None = None
    max: Annotated[float, quantity("mass", above=0)] | None = None
    price: Annotated[float, Quantity(above=0, elsewhere=_RATE, rate=True)] | None = None

    def _mistakes(self, space: str | None) -> Mistakes:
        if self.min is None and self.max is None and self.price is None:
            yield wrong("the mass needs min, max or both, or a price")


class TorqueLimit(Part):
    """Limit of what the drive of a coordinate exerts, at every sample of all trajectories.

    Keys:
        max: of its magnitude
    """

    max: Annotated[float, Quantity(above=0, elsewhere="torque, or force where the joint slides")]


def is_entry(value: object) -> bool:
    """True for what looks like a parameter or a list of choices, as it stands under `design`."""
    return isinstance(value, Mapping) and ("parameter" in value or "choices" in value)


Entry: TypeAlias = Annotated[
    Parameter | Choices,
    Told(lambda value: is_entry(value) and "parameter" not in value),
]


# --- The design as one vector y


@dataclass(frozen=True)
class DesignColumn:
    """One component of y: the properties that it is, and its bounds in SI units.

    ``factors`` are by path, that of the first is 1. Of a catalogue the bounds are the smallest and
    the largest value listed. ``price`` is for one SI unit.
    """

    factors: Mapping[str, float]
    min: float
    max: float
    price: float | None = None
    tolerance: Tolerance | None = None
    is_designed: bool = True  # no property that is not known

    @property
    def parameter(self) -> str:
        """Path of the property whose value it is: the first."""
        return next(iter(self.factors))

    @property
    def said(self) -> str:
        """All of its properties: `sections.upper.height, sections.fore.height (0.8 times that)`."""
        pairs = self.factors.items()
        return ", ".join(p if f == 1.0 else f"{p} ({f:.6g} times that)" for p, f in pairs)


@dataclass(frozen=True)
class Catalogue:
    """Columns of y that take one of the listed ``rows`` together, (n_choices, n_columns) in SI.

    ``prices`` (n_choices,) are those of whole choices, if they have any.
    """

    name: str
    columns: tuple[int, ...]
    choices: tuple[str, ...]
    rows: tuple[tuple[float, ...], ...]
    prices: tuple[float, ...] = ()


def column_names(entry: str, properties: Sequence[str]) -> list[str]:
    """Names in y of what the choices of an ``entry`` set: `boom.area` for `sections.boom.area`."""
    ends = [path.rpartition(".")[2] for path in properties]
    pairs = zip(properties, ends, strict=True)
    return [f"{entry}.{end if ends.count(end) == 1 else path}" for path, end in pairs]


class Design(Part):
    """Design parameters and choices in the order of the file, and limits that they share.

    Keys:
        entries: by name
        constraints: linear limits, min ≤ Σ coefficient · y ≤ max
        mass: of the whole mechanism
        torque: of drives, by coordinate
    """

    entries: Named[Entry] = FrozenDict()
    constraints: Named[Constraint] = FrozenDict()
    mass: MassLimits | None = None
    torque: Named[TorqueLimit] = FrozenDict()

    @field_validator("entries", mode="before")
    @classmethod
    def _has_no_misspelt_limits(cls, entries: Any) -> Any:
        for name, body in entries.items() if isinstance(entries, Mapping) else ():
            if (near := suggestion(name.lower(), RESERVED)) and not is_entry(body):
                raise wrong(f"no entry, which has a parameter{near}", name)
        return entries

    @cached_property
    def parameters(self) -> Mapping[str, DesignColumn]:
        """y by the names of its columns, in order."""
        found: dict[str, DesignColumn] = {}
        for name, entry in self.entries.items():
            if isinstance(entry, Choices):
                columns = zip(*entry.rows, strict=True)
                names = column_names(name, entry.properties)
                for column, path, values in zip(names, entry.properties, columns, strict=True):
                    more = entry.price.get(path), entry.tolerance.get(path)
                    own = FrozenDict({path: 1.0})
                    found[column] = DesignColumn(own, min(values), max(values), *more)
            else:
                low, high = entry.range
                more = entry.price, entry.tolerance
                chosen = entry.group == "design"
                found[name] = DesignColumn(entry.factors, low, high, *more, chosen)
        return FrozenDict(found)

    @property
    def chosen(self) -> tuple[str, ...]:
        """The names of those that a design chooses: without what is not known, which follow."""
        return tuple(name for name, column in self.parameters.items() if column.is_designed)

    @cached_property
    def varied(self) -> Mapping[str, tuple[tuple[int, float], ...]]:
        """Each property that varies, by path, with its column of y and its factor."""
        columns = enumerate(self.parameters.values())
        return {path: ((k, f),) for k, column in columns for path, f in column.factors.items()}

    @cached_property
    def catalogues(self) -> tuple[Catalogue, ...]:
        """Columns that can only take listed values, in the order of the file."""
        found, start = [], 0
        for name, entry in self.entries.items():
            if isinstance(entry, Choices):
                columns = tuple(range(start, start + len(entry.properties)))
                names = tuple(entry.choices)
                found.append(Catalogue(name, columns, names, entry.rows, entry.prices))
                start += len(columns)
                continue
            if entry.values is not None:
                values = sorted(entry.values)
                names = tuple(f"{value:g}" for value in values)
                found.append(Catalogue(name, (start,), names, tuple((v,) for v in values)))
            start += 1
        return tuple(found)
