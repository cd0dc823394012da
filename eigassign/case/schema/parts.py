"""Quantities, names and vectors that the parts of a case file share.

A part is a pydantic model; its fields say which keys it may have and what they may hold. The field
types here are physical quantities, names, immutable mappings, and values of several kinds, each
told from the others by its looks, so that only the errors of the kind that was meant are reported.

What a key is for stands in the docstring of its model, in the list `Keys:`. From there it goes into
the JSON Schema, for editors, and into the reference of the manual.

Vectors have two components in a plane and three in space, and some keys belong to one space only.
The space of the mechanism and the folder of the file are the context of a validation, {"space":
"planar", "folder": Path(...)}; without one, as of parts built in Python, every space is right.
"""

from __future__ import annotations

import inspect
import math
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Annotated, Any, ClassVar, NoReturn, Self, TypeAlias, TypeVar, get_args

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    ValidationError,
    ValidationInfo,
    model_validator,
)
from pydantic_core import InitErrorDetails, PydanticCustomError, core_schema

from eigassign.case.reader import COMMA, listed, shown, suggestion, unknown, unspaced
from eigassign.case.units import (
    DIMENSIONS,
    PLAIN,
    Dimension,
    Given,
    QuantityError,
    read_quantity,
    read_rate,
    written,
)

TAG = "\0"  # in what pydantic adds to the place of an error: no key of a file has it
T = TypeVar("T")
Mistakes: TypeAlias = Iterator[PydanticCustomError]
L = TypeVar("L")
V = TypeVar("V")
_NOTHING = 1e-60  # of what may be negative, in any unit; round-off of places near 0 is 1e-17


class Part(BaseModel):
    """Base of everything in a case file: frozen, strict, no unknown keys, built with its parent."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, defer_build=True)
    other_keys: ClassVar[tuple[str, ...]] = ()  # of another kind that may stand in its place
    one_of: ClassVar[tuple[str, ...]] = ()  # two keys, one of which is needed
    one_at_most: ClassVar[tuple[str, ...]] = ()  # two keys, one of which excludes the other

    @model_validator(mode="wrap")
    @classmethod
    def _explained(cls, value: Any, handler: Callable[[Any], Self], info: ValidationInfo) -> Self:
        """Keys that are missing or unknown are named with what they hold, or what there is."""
        try:
            part = handler(value)
        except ValidationError as error:
            each = map(cls._in_words, error.errors(include_url=False))
            raise ValidationError.from_exception_data(cls.__name__, [*each]) from None
        for mistake in chain(part._choices(), part._mistakes(space_of(info))):
            raise mistake
        return part

    def _choices(self) -> Mistakes:
        for keys, needed in ((self.one_of, True), (self.one_at_most, False)):
            given = [key for key in keys if getattr(self, key) is not None]
            either = " or ".join(keys)
            if keys and needed and len(given) != 1:
                yield wrong(f"give either {either}" + ", and not both" * bool(given))
            elif len(given) > 1:
                yield wrong(f"give {either}, not both", given[-1])

    def _mistakes(self, space: str | None) -> Mistakes:
        """What its keys do not agree on, each good by itself; the first is told."""
        yield from ()

    @classmethod
    def _in_words(cls, error: Any) -> InitErrorDetails:
        kind, (key, *below) = error["type"], error["loc"] or ("",)
        known = {field.alias or name: field for name, field in cls.model_fields.items()}
        if kind == "at_key":
            kind = PydanticCustomError(kind, "{text}", error["ctx"])
        elif kind == "missing" and not below:
            held = [m.dimension for m in known[key].metadata if isinstance(m, Quantity)]
            kind = wrong("required key is missing" + "".join(f": {d}" for d in held if d))
        elif kind == "extra_forbidden" and not below:
            names = [*known, *cls.other_keys]
            kind = wrong(f"unknown key{suggestion(key, names)}; allowed: {listed(names)}")
        place, given, more = error["loc"], error["input"], error.get("ctx", {})
        return InitErrorDetails(type=kind, loc=place, input=given, ctx=more)

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


def distinct(text: str) -> AfterValidator:
    """Validator of a list without repeats, the ``text`` of which is formatted with the entry."""

    def checked(values: tuple[T, ...]) -> tuple[T, ...]:
        for k, value in enumerate(values):
            if value in values[:k]:
                raise wrong(text.format(written(value) if isinstance(value, float) else value), k)
        return values

    return AfterValidator(checked)


# --- Quantities


class Written(Given):
    """One whose dimension another key decides; NaN where it cannot be read: rules say why."""

    __slots__ = ()


@dataclass(frozen=True)
class Quantity:
    """A real number with a dimension and limits, as pydantic annotation: ``Annotated[float, ...]``.

    Accepts a bare number (SI) or text with a unit; the validated value is SI. ``elsewhere`` says
    where the dimension comes from when it is another key that decides it: that is then for
    rules, and it becomes a `Written`. ``rate``: it is an amount for one unit of that, such as
    `3 / kg`.
    """

    dimension: Dimension | None = None
    above: float | None = None
    at_least: float | None = None
    below: float | None = None
    at_most: float | None = None
    elsewhere: str = ""
    rate: bool = False

    @property
    def si(self) -> str:
        """SI unit; empty for a plain number."""
        return self.dimension.si if self.dimension else ""

    @property
    def edges(self) -> tuple[tuple[str, float, float], ...]:
        """Its limits as `>`, `>=`, `<` or `<=`, in SI, with 1 for a lower and −1 for an upper."""
        lower = (">", self.above, 1.0), (">=", self.at_least, 1.0)
        upper = ("<", self.below, -1.0), ("<=", self.at_most, -1.0)
        return tuple((sign, v, way) for sign, v, way in (*lower, *upper) if v is not None)

    def read(self, value: object) -> float:
        """SI value within the limits. Raises QuantityError."""
        if isinstance(value, Given):
            value = value.text
        if self.elsewhere and isinstance(value, (str, int, float)) and not isinstance(value, bool):
            try:
                si = (read_rate if self.rate else read_quantity)(value, None)
                self.checked(si, value)
            except QuantityError:
                return Written(math.nan, value)
            bare = self.at_most is not None and not isinstance(value, str)
            return si if bare else Written(si, value)
        if self.dimension is None and isinstance(value, str):
            raise QuantityError(f"expected a number without unit, got text {shown(value)}")
        si = self.checked(read_quantity(value, self.dimension), value)
        return Given(si, value) if isinstance(value, str) else si

    def checked(self, si: float, given: object) -> float:
        """``si`` if it is within the limits. Raises QuantityError.

        Nothing but 0 may be too small to calculate with.
        """
        known = self.dimension or PLAIN
        own = [Given(si, given)] if known.si and isinstance(given, str) else []
        for sign, limit, way in self.edges:
            if not (way * si > way * limit or ("=" in sign and si == limit)):
                edge = written(limit, known.si, *own)
                raise QuantityError(f"must be {sign} {edge}, got {shown(given)}")
        positive = 0 in (self.above, self.at_least)
        least = known.smallest if positive else _NOTHING
        if 0 < abs(si) < least:
            zero = "" if self.above == 0 else "0 or "
            message = f"too small to calculate with, got {shown(given)}; {zero}at least "
            raise QuantityError(f"{message}{written(least, known.si)}")
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


class FrozenDict(dict[str, V]):
    """An immutable, hashable, picklable mapping that keeps the order of the file."""

    __slots__ = ()

    def _refuse(self, *_: object, **__: object) -> NoReturn:
        raise TypeError("a case file's mapping is immutable")

    __setitem__ = __delitem__ = __ior__ = __setattr__ = _refuse
    clear = pop = popitem = setdefault = update = property()  # it has none

    def __hash__(self) -> int:  # type: ignore[override]
        return hash(tuple(self.items()))

    def __eq__(self, other: object) -> bool:
        """Equal when keys, values *and order* agree: the order of q and y carries meaning."""
        if not isinstance(other, Mapping):
            return NotImplemented
        return list(self.items()) == list(other.items())

    def __ne__(self, other: object) -> bool:
        return not self == other

    def __reduce__(self) -> tuple[type[FrozenDict[V]], tuple[dict[str, V]]]:
        return type(self), (dict(self),)


Frozen = AfterValidator(FrozenDict)
Name: TypeAlias = Annotated[
    str,
    must(
        _NAME.fullmatch,
        "not a usable name: names start with a letter and hold letters, digits, _ and - only "
        "(at most 64)",
    ),
]


def _absolute(file: str, info: ValidationInfo) -> str:
    folder = info.context and info.context["folder"]
    return file if folder is None else os.path.abspath(os.path.join(folder, file))


File: TypeAlias = Annotated[str, AfterValidator(_absolute)]  # rules look at it
Named: TypeAlias = Annotated[Mapping[Name, T], Frozen]  # parts by the names that a file gives them
OneOrMoreNamed: TypeAlias = Annotated[Mapping[Name, T], Field(min_length=1), Frozen]
ByReference: TypeAlias = Annotated[Mapping[str, T], Frozen]  # values by the names of other parts


# --- Values of several kinds


@dataclass(frozen=True)
class Told:
    """Tells the members of a union apart by the looks of a value: ``which`` gives the place of one.

    Where it is none, ``which`` raises `wrong`. ``also`` is what may stand there beside a word.
    """

    which: Callable[[Any], int]
    also: str = ""

    def __get_pydantic_core_schema__(self, union: Any, handler: Any) -> core_schema.CoreSchema:
        members = get_args(union)
        own = [getattr(member, "__origin__", member) for member in members]
        tags = [f"{TAG}{k}{self.also}" for k in range(len(members))]

        def tag(value: object) -> str:
            built = isinstance(value, Part) and type(value) in own
            return tags[own.index(type(value)) if built else self.which(value)]

        def told(value: object) -> object:
            tag(value)
            return value

        choices = {t: handler.generate_schema(m) for t, m in zip(tags, members, strict=True)}
        schema = core_schema.tagged_union_schema(choices, tag)
        return core_schema.no_info_before_validator_function(told, schema)


OneOrList: TypeAlias = Annotated[
    T | L, Told(lambda value: isinstance(value, (tuple, list)), "a list")
]
NumberOr: TypeAlias = Annotated[  # a number or a word, such as auto
    T | L, Told(lambda value: isinstance(value, str), "a whole number")
]
ValueOr: TypeAlias = Annotated[T | L, Told(lambda value: isinstance(value, Mapping))]


# A share of 1, such as a damping ratio, or the least and the most that it may be
Share: TypeAlias = Annotated[float, Quantity(DIMENSIONS["fraction"], at_least=0, below=1)]
ShareRange: TypeAlias = Annotated[
    tuple[Share, Share], must(lambda ends: ends[0] <= ends[1], "is least, then most")
]
ShareOrRange: TypeAlias = OneOrList[Share, ShareRange]


def mapping(value: object) -> Mapping[str, object]:
    """``value``, or the error that it is no mapping."""
    if isinstance(value, Mapping):
        return value
    raise wrong(f"expected a mapping, got {shown(value)}{unspaced(value)}")


@dataclass(frozen=True)
class KindBy:
    """Tells the models of a union apart by one key: ``Annotated[A | B, KindBy("type")]``.

    The kinds are the words that the models allow for that key: a new kind is a new model in the
    union, and nothing else.
    """

    key: str
    default: str | None = None

    def kinds(self, union: object) -> dict[str, type[Part]]:
        """Models of the union by the word that stands for each."""
        return {get_args(m.model_fields[self.key].annotation)[0]: m for m in get_args(union)}

    def __get_pydantic_core_schema__(self, union: Any, handler: Any) -> core_schema.CoreSchema:
        known = [*self.kinds(union)]

        def which(value: object) -> int:
            kind = mapping(value).get(self.key, self.default)
            if kind is None:
                raise wrong(f"required key is missing: one of {listed(known)}", self.key)
            if not isinstance(kind, str):
                raise wrong(f"expected one of {listed(known)}, got {shown(kind)}", self.key)
            if kind not in known:
                raise wrong(unknown(self.key, kind, known), self.key)
            return known.index(kind)

        return Told(which).__get_pydantic_core_schema__(union, handler)


LENGTH = quantity("length", above=0)
ANGLE = quantity("angle")
PLACE = quantity("length")
_SHORTEST = 1e-30  # component of a direction; squares of less end in 0
_AXES = {"planar": "xy", "spatial": "xyz"}
_ROUND_OFF = 1e-12  # of the trace: a thin rod's zero inertia computed elsewhere


def space_of(info: ValidationInfo) -> str | None:
    """planar or spatial; None where the file does not say, or there is no file."""
    space = info.context and info.context["space"]
    return space if space in ("planar", "spatial") else None


def only_in(space: str, message: str, neutral: object = None) -> Any:
    """Validator of a key that belongs to one space; in the other it may be ``neutral`` or 0."""

    def belongs(value: object, info: ValidationInfo) -> object:
        if value not in (neutral, 0.0) and space_of(info) not in (None, space):
            raise wrong(message)
        return value

    return BeforeValidator(belongs) if neutral is None else AfterValidator(belongs)


IN_PLANE = only_in("planar", "is for planar mechanisms: in space write orientation: [rx, ry, rz]")
IN_SPACE = only_in("spatial", "is for spatial mechanisms: in a plane write angle")


class Placed(Part):
    """What stands at a node, and is not turned, where the file is silent."""

    place: ClassVar[str] = ""  # the key that says how far from the node it stands

    @model_validator(mode="before")
    @classmethod
    def _is_at_its_node(cls, value: Any, info: ValidationInfo) -> Any:
        space = space_of(info)
        if space is None or not isinstance(value, Mapping):
            return value
        default: dict[str, object] = {cls.place: (0.0,) * len(_AXES[space])} if cls.place else {}
        if space == "spatial" and "orientation" in cls.model_fields:
            default["orientation"] = (0.0, 0.0, 0.0)
        return {**default, **value}


def _one_for_each_axis(value: Any, info: ValidationInfo) -> Any:
    space = space_of(info) or ""
    axes = _AXES.get(space)
    if axes and isinstance(value, tuple) and len(value) != len(axes):
        needed = f"{space}: needs {len(axes)} components ({', '.join(axes)})"
        raise wrong(f"{needed}, got {len(value)}{f'; {COMMA}' * (len(value) > len(axes))}")
    return value


Components: TypeAlias = Annotated[  # two in a plane, three in space
    tuple[T, ...], Field(min_length=2, max_length=3), BeforeValidator(_one_for_each_axis)
]
Vector: TypeAlias = Components[Annotated[float, PLACE]]
Angle: TypeAlias = Annotated[float, ANGLE]
Orientation: TypeAlias = tuple[Angle, Angle, Angle]  # rad, about x, y, z: R = Rz Ry Rx


Direction: TypeAlias = Annotated[
    Components[Annotated[float, Quantity()]],
    must(
        lambda direction: any(abs(v) >= _SHORTEST for v in direction),
        "has no direction: all components are zero",
    ),
]


def parallel(a: Sequence[float], b: Sequence[float]) -> bool:
    """True for directions that agree within a millionth of a radian."""
    n = max(len(a), len(b), 3)
    x, y = [[*v, *([0.0] * (n - len(v)))] for v in (a, b)]
    cross = (x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0])
    norms = sum(v * v for v in x) * sum(v * v for v in y)
    return sum(c * c for c in cross) <= 1e-12 * norms


# --- Inertia tensors


def tensor(inertia: Sequence[float]) -> list[list[float]]:
    """(Ixx, Iyy, Izz[, Ixy, Ixz, Iyz]) as a matrix; the products are its entries, −∫xy dm."""
    xx, yy, zz, xy, xz, yz = (*inertia, 0.0, 0.0, 0.0)[:6]
    return [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]


def semidefinite(a: list[list[float]]) -> bool:
    """True where no direction has a negative value: every principal minor is at least zero."""
    scale = sum(abs(a[i][i]) for i in range(3)) or max(abs(v) for row in a for v in row)
    if scale == 0.0:
        return True
    b = [[v / scale for v in row] for row in a]
    pairs = ((0, 1), (0, 2), (1, 2))
    minors = [b[i][i] for i in range(3)]
    minors += [b[i][i] * b[j][j] - b[i][j] ** 2 for i, j in pairs]
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = b
    determinant = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
    return min(*minors, determinant) >= -_ROUND_OFF


def spread(inertia: Sequence[float]) -> list[list[float]]:
    """tr(J)/2 1 − J = ∫ x xᵀ dm, which no body has negative: the triangle inequality."""
    J = tensor(inertia)
    half = (J[0][0] + J[1][1] + J[2][2]) / 2
    return [[half * (i == j) - J[i][j] for j in range(3)] for i in range(3)]


def _is_inertia(
    inertia: float | tuple[float, ...], info: ValidationInfo
) -> float | tuple[float, ...]:
    if isinstance(inertia, tuple):
        if space_of(info) == "planar":
            raise wrong("planar: one number, about the axis out of the plane, got a list")
        if len(inertia) not in (3, 6):
            message = "expected 3 (Ixx, Iyy, Izz) or 6 (… Ixy, Ixz, Iyz) entries, got "
            raise wrong(f"{message}{len(inertia)}")
        if not semidefinite(tensor(inertia)):
            raise wrong("not positive: turning about some axis would take no energy")
    elif inertia != 0 and space_of(info) == "spatial":
        raise wrong("spatial: needs [Ixx, Iyy, Izz] or [Ixx, Iyy, Izz, Ixy, Ixz, Iyz]")
    return inertia


Inertia: TypeAlias = Annotated[
    OneOrList[
        Annotated[float, quantity("rotary inertia", at_least=0)],
        tuple[Annotated[float, quantity("rotary inertia")], ...],
    ],
    AfterValidator(_is_inertia),
]
