"""What the models of all parts share: immutable, strict, with quantities and names as field types.

A part is a pydantic model; its fields say which keys it may have and what they may hold. The field
types here are physical quantities, names, immutable mappings, and values of several kinds, each
told from the others by its looks, so that only the errors of the kind that was meant are reported.

What a key is for stands in the docstring of its model, in the list `Keys:`. From there it goes into
the JSON Schema, for editors, and into the reference of the manual.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, TypeAlias, TypeVar, Union, get_args

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    GetJsonSchemaHandler,
    Tag,
)
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError, core_schema

from eigassign.case.suggestions import shown
from eigassign.case.units import DIMENSIONS, PLAIN, Dimension, QuantityError, read_quantity

T = TypeVar("T")
L = TypeVar("L")
P = TypeVar("P", bound="Part")
V = TypeVar("V")
_NOTHING = 1e-60  # of what may be negative, in any unit; round-off of places near 0 is 1e-17


class Part(BaseModel):
    """Base of everything in a case file: frozen, strict, no unknown keys, built with its parent."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, defer_build=True)

    @classmethod
    def __get_pydantic_json_schema__(
        cls, core: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """The docstring, its list of keys at the keys: what each is for, then what it holds."""
        schema = handler(core)
        whole = handler.resolve_ref_schema(schema)
        whole["description"], texts = _docstring(cls)
        for key, node in whole["properties"].items():
            options = [node, *node.get("anyOf", ())]
            holds = next((o["description"] for o in options if "description" in o), None)
            if key in texts:
                node["description"] = texts[key] + (f"\n\n{holds}" if holds else "")
        return schema


def _docstring(model: type[Part]) -> tuple[str, dict[str, str]]:
    """Docstring of a model up to its list `Keys:`, and the entries of that and its bases' lists."""
    prose, texts = "", dict[str, str]()
    for each in reversed(model.__mro__):
        prose, _, listed = inspect.cleandoc(each.__doc__ or "").partition("Keys:\n")
        for entry in re.split(r"^    (?=\S)", listed, flags=re.MULTILINE)[1:]:
            key, _, text = entry.partition(": ")
            texts[key] = " ".join(text.split())
    return prose.strip(), texts


def needs_one_of(*groups: Sequence[str]) -> ConfigDict:
    """A ``model_config``: one of the groups of keys is needed, which a validator sees to."""
    options: list[Any] = [{"required": list(group)} for group in groups]
    return ConfigDict(json_schema_extra={"anyOf": options})


def keys_of(model: type[Part]) -> dict[str, FieldInfo]:
    """Fields of a model by the key a file gives them with."""
    return {field.alias or name: field for name, field in model.model_fields.items()}


def wrong(message: str, *keys: str | int) -> PydanticCustomError:
    """Error of a validator, to be shown at ``keys`` below the value it validates."""
    return PydanticCustomError("at_key", "{text}", {"text": message, "keys": keys})


def must(hold: Callable[[Any], object], message: str) -> AfterValidator:
    """Validator of values for which this has to ``hold``."""

    def checked(value: T) -> T:
        if not hold(value):
            raise wrong(message)
        return value

    return AfterValidator(checked)


# --- Quantities


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
        """SI value within the limits. Raises QuantityError, or the one that ``value`` is."""
        if isinstance(value, QuantityError):
            raise value
        if self.dimension is None and isinstance(value, str):
            raise QuantityError(f"expected a number without unit, got text {shown(value)}")
        return self.checked(read_quantity(value, self.dimension), shown(value))

    def checked(self, si: float, given: str) -> float:
        """``si`` if it is within the limits. Raises QuantityError.

        Nothing but 0 may be too small to calculate with.
        """
        unit = f" {self.dimension.si}" if self.dimension and self.dimension.si else ""
        for sign, limit, holds in (
            (">", self.above, self.above is None or si > self.above),
            (">=", self.at_least, self.at_least is None or si >= self.at_least),
            ("<", self.below, self.below is None or si < self.below),
            ("<=", self.at_most, self.at_most is None or si <= self.at_most),
        ):
            if not holds:
                raise QuantityError(f"must be {sign} {limit:g}{unit}, got {given}")
        known, positive = self.dimension or PLAIN, 0 in (self.above, self.at_least)
        least = known.smallest if positive else _NOTHING
        if 0 < abs(si) < least:
            zero = "" if self.above == 0 else "0 or "
            message = f"too small to calculate with, got {given}; {zero}at least {least:g}{unit}"
            raise QuantityError(message)
        return si

    def _validate(self, value: object) -> float:
        try:
            return self.read(value)
        except QuantityError as error:
            raise wrong(str(error)) from None

    def __get_pydantic_core_schema__(self, _source: Any, _handler: Any) -> core_schema.CoreSchema:
        return core_schema.no_info_plain_validator_function(
            self._validate,
            metadata={"pydantic_js_functions": [lambda _schema, _handler: self.json_schema()]},
        )

    def json_schema(self) -> dict[str, Any]:
        """JSON Schema: a number (SI), or text with a unit where there is a dimension."""
        limits = {
            "exclusiveMinimum": self.above,
            "minimum": self.at_least,
            "exclusiveMaximum": self.below,
            "maximum": self.at_most or (self.dimension or PLAIN).largest,
        }
        number = {"type": "number", **{k: v for k, v in limits.items() if v is not None}}
        if self.dimension is None and not self.elsewhere:
            return number
        text = {"type": "string", "pattern": r"^\s*[-+]?(\.\d|\d).*$"}
        return {"anyOf": [number, text], "description": self.elsewhere or str(self.dimension)}


def quantity(dimension: str, above: float | None = None, at_least: float | None = None) -> Quantity:
    """Quantity of a named dimension (a key of ``units.DIMENSIONS``)."""
    return Quantity(DIMENSIONS[dimension], above=above, at_least=at_least)


# --- Names, files, and immutable mappings

_NAME = re.compile(r"[^\W\d][\w-]{0,63}")


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
Name: TypeAlias = Annotated[
    str,
    must(
        _NAME.fullmatch,
        "not a usable name: names start with a letter and hold letters, digits, _ and - only "
        "(at most 64)",
    ),
]
File: TypeAlias = str  # absolute; `rules.files` looks at it
Named: TypeAlias = Annotated[Mapping[Name, T], Frozen]  # parts by the names that a file gives them
OneOrMoreNamed: TypeAlias = Annotated[Mapping[Name, T], Field(min_length=1), Frozen]
ByReference: TypeAlias = Annotated[Mapping[str, T], Frozen]  # values by the names of other parts


# --- Values of several kinds


OneOrList: TypeAlias = Annotated[
    Annotated[T, Tag("<one>")] | Annotated[L, Tag("<list>")],
    Discriminator(lambda value: "<list>" if isinstance(value, (tuple, list)) else "<one>"),
]
NumberOr: TypeAlias = Annotated[  # a number or a word, such as auto
    Annotated[T, Tag("<number>")] | Annotated[L, Tag("<auto>")],
    Discriminator(lambda value: "<auto>" if isinstance(value, str) else "<number>"),
]
ValueOr: TypeAlias = Annotated[
    Annotated[T, Tag("<value>")] | Annotated[P, Tag("<part>")],
    Discriminator(lambda value: "<part>" if isinstance(value, (Mapping, Part)) else "<value>"),
]


@dataclass(frozen=True)
class KindBy:
    """Tells the models of a union apart by one key: ``Annotated[A | B, KindBy("type", "link")]``.

    The kinds are the words that the models allow for that key: a new kind is a new model in the
    union, and nothing else.
    """

    key: str
    what: str  # they all are, in the type of the error where none is named: ``no_joint``
    default: str | None = None

    def kinds(self, union: object) -> dict[str, type[Part]]:
        """Models of the union by the word that stands for each."""
        return {get_args(m.model_fields[self.key].annotation)[0]: m for m in get_args(union)}

    def kind_of(self, value: object) -> object:
        """Word of a mapping as read, or of an object built in Python."""
        if isinstance(value, Mapping):
            return value.get(self.key, self.default)
        return getattr(value, self.key, self.default)

    def __get_pydantic_core_schema__(self, union: Any, handler: Any) -> core_schema.CoreSchema:
        kinds = self.kinds(union)

        def tag(value: object) -> str | None:
            kind = self.kind_of(value)
            return f"<{kind}>" if isinstance(kind, str) and kind in kinds else None

        tagged = tuple(Annotated[model, Tag(f"<{kind}>")] for kind, model in kinds.items())
        by_tag = Discriminator(tag, f"no_{self.what}", f"no such {self.what}")
        schema: core_schema.CoreSchema = handler.generate_schema(
            Annotated[Union[tagged], by_tag]  # noqa: UP007
        )
        return schema


@dataclass(frozen=True)
class OrFile:
    """The JSON Schema of what may also stand in a CSV file, which is read before the schema.

    ``most`` keys say which file, and what of it.
    """

    most: int

    def __get_pydantic_json_schema__(self, core: Any, handler: Any) -> dict[str, Any]:
        """As it is, or texts with the key `file`."""
        file = {"type": "object", "additionalProperties": {"type": "string"}, "required": ["file"]}
        return {"anyOf": [handler(core), {**file, "maxProperties": self.most}]}


def kinds(union: Any) -> dict[str, type[Part]]:
    """Models of a union annotated with ``KindBy``, by the word that stands for each."""
    models, by_key = get_args(union)
    known: dict[str, type[Part]] = by_key.kinds(models)
    return known
