"""Field types of the case file: physical quantities, names, and immutable mappings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError, core_schema

from eigassign.case.suggest import shown
from eigassign.case.units import DIMENSIONS, Dimension, QuantityError, read

V = TypeVar("V")


class Part(BaseModel):
    """Base of everything in a case file: frozen, strict, no unknown keys, built with its parent."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, defer_build=True)


def keys_of(model: type[Part]) -> dict[str, FieldInfo]:
    """Fields of a model by the key a file gives them with."""
    return {field.alias or name: field for name, field in model.model_fields.items()}


class FrozenDict(Mapping[str, V]):
    """An immutable, hashable, picklable mapping that keeps the order of the file."""

    __slots__ = ("_items",)
    _items: dict[str, V]

    def __init__(self, items: Mapping[str, V] | None = None) -> None:
        object.__setattr__(self, "_items", dict(items or {}))

    def __setattr__(self, name: str, value: object) -> None:
        raise TypeError("a case file's mapping is immutable")

    __delattr__ = None  # type: ignore[assignment]

    def __getitem__(self, key: str) -> V:
        return self._items[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self._items)

    def __len__(self) -> int:
        return len(self._items)

    def __hash__(self) -> int:
        return hash(tuple(self._items.items()))

    def __eq__(self, other: object) -> bool:
        """Equal when keys, values *and order* agree: the order of q and y carries meaning."""
        if not isinstance(other, Mapping):
            return NotImplemented
        return list(self.items()) == list(other.items())

    def __reduce__(self) -> tuple[type[FrozenDict[V]], tuple[dict[str, V]]]:
        return type(self), (self._items,)

    def __repr__(self) -> str:
        return repr(self._items)


Frozen = AfterValidator(FrozenDict)


@dataclass(frozen=True)
class Quantity:
    """A real number with a dimension and limits, as pydantic annotation: ``Annotated[float, ...]``.

    Accepts a bare number (SI) or text with a unit; the validated value is SI. ``elsewhere`` says
    where the dimension comes from when it is another key that decides it (documentation only: such
    values are SI numbers already when the schema sees them).
    """

    dimension: Dimension | None = None
    above: float | None = None
    at_least: float | None = None
    below: float | None = None
    at_most: float | None = None
    elsewhere: str = ""

    def read(self, value: object) -> float:
        """SI value within the limits. Raises QuantityError."""
        if self.dimension is None and isinstance(value, str):
            raise QuantityError(f"expected a number without unit, got text {shown(value)}")
        si = read(value, self.dimension)
        return self.checked(si, shown(value))

    def checked(self, si: float, given: str) -> float:
        """``si`` if it is within the limits. Raises QuantityError."""
        if self.above is not None and not si > self.above:
            raise QuantityError(f"must be > {self._limit(self.above)}, got {given}")
        if self.at_least is not None and not si >= self.at_least:
            raise QuantityError(f"must be >= {self._limit(self.at_least)}, got {given}")
        if self.below is not None and not si < self.below:
            raise QuantityError(f"must be < {self._limit(self.below)}, got {given}")
        if self.at_most is not None and not si <= self.at_most:
            raise QuantityError(f"must be <= {self._limit(self.at_most)}, got {given}")
        return si

    def _limit(self, value: float) -> str:
        unit = self.dimension.si if self.dimension else ""
        return f"{value:g} {unit}".rstrip()

    def _validate(self, value: object) -> float:
        try:
            return self.read(value)
        except QuantityError as error:
            raise PydanticCustomError("quantity", "{text}", {"text": str(error)}) from None

    def __get_pydantic_core_schema__(self, _source: Any, _handler: Any) -> core_schema.CoreSchema:
        return core_schema.no_info_plain_validator_function(
            self._validate,
            metadata={"pydantic_js_functions": [lambda _schema, _handler: self.json_schema()]},
        )

    def json_schema(self) -> dict[str, Any]:
        """JSON Schema: a number (SI), or text with a unit where there is a dimension."""
        number: dict[str, Any] = {"type": "number"}
        if self.above is not None:
            number["exclusiveMinimum"] = self.above
        if self.at_least is not None:
            number["minimum"] = self.at_least
        if self.below is not None:
            number["exclusiveMaximum"] = self.below
        if self.at_most is not None:
            number["maximum"] = self.at_most
        if self.dimension is None and not self.elsewhere:
            return number
        text = {"type": "string", "pattern": r"^\s*[-+]?(\.\d|\d).*$"}
        return {"anyOf": [number, text], "description": self.elsewhere or str(self.dimension)}


def quantity(dimension: str, above: float | None = None, at_least: float | None = None) -> Quantity:
    """Quantity of a named dimension (a key of ``units.DIMENSIONS``)."""
    return Quantity(DIMENSIONS[dimension], above=above, at_least=at_least)


def wrong(message: str, *keys: str | int) -> PydanticCustomError:
    """Error of a model validator, to be shown at ``keys`` below the model."""
    return PydanticCustomError("at_key", "{text}", {"text": message, "keys": keys})
