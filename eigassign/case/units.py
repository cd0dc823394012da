"""Quantities as people write them (`30 mm`, `69 GPa`, `104.1 deg`) → SI numbers, dimension-checked.

A bare number is SI already. Angles and cycles are dimensions of their own, so that nothing converts
between rad/s, 1/s and Hz silently: 5 rpm is neither 5 Hz nor 0.52 Hz here, it is an error.

Field types of the case file: physical quantities, names, and immutable mappings.

One value of the file → SI number, where the schema cannot know its dimension.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError, core_schema

from eigassign.case.reader import Finding, KeyPath
from eigassign.case.suggestions import shown, suggestion

# --- Quantities as people write them (`30 mm`, `69 GPa`, `104.1 deg`) → SI numbers, dimension-c

Exponents = tuple[int, int, int, int, int]  # of kg, m, s, rad, cycle


class QuantityError(ValueError):
    """A quantity that cannot be read; the message says what was expected and what was found."""


@dataclass(frozen=True)
class Dimension:
    """A physical dimension: its name, its SI unit, and other units worth mentioning."""

    name: str
    exponents: Exponents
    si: str
    examples: str

    def __str__(self) -> str:
        unit = f"in {self.si}" if self.si else "a plain number"
        return f"{self.name} ({unit} when bare; or {self.examples})"


@dataclass(frozen=True)
class Unit:
    """``factor = numerator / denominator · π^pi`` SI units; integers keep the rounding to one."""

    numerator: int
    denominator: int
    pi: int
    exponents: Exponents

    def power(self, n: int) -> Unit:
        """Unit to the integer power ``n``."""
        top, bottom = (self.numerator, self.denominator)[:: 1 if n > 0 else -1]
        k = tuple(n * e for e in self.exponents)
        return Unit(top ** abs(n), bottom ** abs(n), n * self.pi, (k[0], k[1], k[2], k[3], k[4]))

    def times(self, other: Unit) -> Unit:
        """Product of two units, in lowest terms."""
        top = self.numerator * other.numerator
        bottom = self.denominator * other.denominator
        k = tuple(a + b for a, b in zip(self.exponents, other.exponents, strict=True))
        g = math.gcd(top, bottom)
        pi = self.pi + other.pi
        return Unit(top // g, bottom // g, pi, (k[0], k[1], k[2], k[3], k[4]))

    def to_si(self, value: float) -> float:
        """``value`` in SI."""
        return value * self.numerator / self.denominator * math.pi**self.pi

    def decimal_to_si(self, number: str) -> float:
        """Decimal ``number`` in SI, rounded once (a second time where π is involved).

        `30 mm` is the very float 0.03; a min, a max and an initial value written in different
        units then compare as their author expects.
        """
        digits, _, exponent = number.lower().partition("e")
        whole, _, decimals = digits.partition(".")
        shift = int(exponent or 0) - len(decimals)
        if abs(shift) > _LARGEST_SHIFT:
            return float(number)  # 0 or infinite, in any unit
        top = int(whole + decimals) * self.numerator * 10 ** max(shift, 0)
        bottom = self.denominator * 10 ** max(-shift, 0)
        try:
            return float(top / bottom * math.pi**self.pi)
        except OverflowError:
            return math.inf


_DIMENSIONS = (
    Dimension("length", (0, 1, 0, 0, 0), "m", "mm, cm, km"),
    Dimension("area", (0, 2, 0, 0, 0), "m2", "mm2, cm2"),
    Dimension("second moment of area", (0, 4, 0, 0, 0), "m4", "mm4, cm4"),
    Dimension("mass", (1, 0, 0, 0, 0), "kg", "g, t"),
    Dimension("density", (1, -3, 0, 0, 0), "kg/m3", "g/cm3"),
    Dimension("rotary inertia", (1, 2, 0, 0, 0), "kg m2", "g cm2, kg mm2"),
    Dimension("pressure or modulus", (1, -1, -2, 0, 0), "Pa", "MPa, GPa, N/mm2"),
    Dimension("angle", (0, 0, 0, 1, 0), "rad", "deg, mrad"),
    Dimension("rotational stiffness", (1, 2, -2, -1, 0), "N m/rad", "kN m/rad, N m/deg"),
    Dimension("stiffness", (1, 0, -2, 0, 0), "N/m", "kN/m, N/mm"),
    Dimension("time", (0, 0, 1, 0, 0), "s", "ms, min"),
    Dimension("frequency", (0, 0, -1, 0, 1), "Hz", "kHz"),
    Dimension("fraction", (0, 0, 0, 0, 0), "", "%"),
    # never asked for; known so that a mistake can be called by its name
    Dimension("angular rate", (0, 0, -1, 1, 0), "rad/s", "deg/s"),
    Dimension("force", (1, 1, -2, 0, 0), "N", "kN"),
    Dimension("torque or energy", (1, 2, -2, 0, 0), "N m", "kN m"),
    Dimension("velocity", (0, 1, -1, 0, 0), "m/s", "mm/s"),
    Dimension("volume", (0, 3, 0, 0, 0), "m3", "cm3"),
    Dimension("mass per length", (1, -1, 0, 0, 0), "kg/m", "g/mm"),
)
DIMENSIONS = {d.name: d for d in _DIMENSIONS}
_BY_EXPONENTS = {d.exponents: d for d in _DIMENSIONS}

_KG: Exponents = (1, 0, 0, 0, 0)
_M: Exponents = (0, 1, 0, 0, 0)
_S: Exponents = (0, 0, 1, 0, 0)
_RAD: Exponents = (0, 0, 0, 1, 0)
_N: Exponents = (1, 1, -2, 0, 0)
_NM: Exponents = (1, 2, -2, 0, 0)
_PA: Exponents = (1, -1, -2, 0, 0)
_HZ: Exponents = (0, 0, -1, 0, 1)
UNITS: dict[str, Unit] = {
    "nm": Unit(1, 10**9, 0, _M),
    "um": Unit(1, 10**6, 0, _M),
    "µm": Unit(1, 10**6, 0, _M),  # micro sign
    "μm": Unit(1, 10**6, 0, _M),  # Greek mu
    "mm": Unit(1, 1000, 0, _M),
    "cm": Unit(1, 100, 0, _M),
    "m": Unit(1, 1, 0, _M),
    "km": Unit(1000, 1, 0, _M),
    "mg": Unit(1, 10**6, 0, _KG),
    "g": Unit(1, 1000, 0, _KG),
    "kg": Unit(1, 1, 0, _KG),
    "t": Unit(1000, 1, 0, _KG),
    "us": Unit(1, 10**6, 0, _S),
    "µs": Unit(1, 10**6, 0, _S),
    "μs": Unit(1, 10**6, 0, _S),
    "ms": Unit(1, 1000, 0, _S),
    "s": Unit(1, 1, 0, _S),
    "min": Unit(60, 1, 0, _S),
    "h": Unit(3600, 1, 0, _S),
    "mN": Unit(1, 1000, 0, _N),
    "N": Unit(1, 1, 0, _N),
    "kN": Unit(1000, 1, 0, _N),
    "MN": Unit(10**6, 1, 0, _N),
    "Nm": Unit(1, 1, 0, _NM),
    "kNm": Unit(1000, 1, 0, _NM),
    "Pa": Unit(1, 1, 0, _PA),
    "kPa": Unit(1000, 1, 0, _PA),
    "MPa": Unit(10**6, 1, 0, _PA),
    "GPa": Unit(10**9, 1, 0, _PA),
    "TPa": Unit(10**12, 1, 0, _PA),
    "mHz": Unit(1, 1000, 0, _HZ),
    "Hz": Unit(1, 1, 0, _HZ),
    "kHz": Unit(1000, 1, 0, _HZ),
    "MHz": Unit(10**6, 1, 0, _HZ),
    "mrad": Unit(1, 1000, 0, _RAD),
    "rad": Unit(1, 1, 0, _RAD),
    "deg": Unit(1, 180, 1, _RAD),
    "°": Unit(1, 180, 1, _RAD),
    "%": Unit(1, 100, 0, (0, 0, 0, 0, 0)),
}
_TURNS = (
    "rpm and turns are not converted: write a frequency in Hz (one cycle per turn is rpm / 60), "
    "an angle in deg or rad"
)

_NUMBER = re.compile(r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?")
_FACTOR = re.compile(r"([^\W\d_]+|[%°])(?:(?:\^|\*\*)?([-+]?[1-9]))?")
_SUPERSCRIPTS = str.maketrans("⁻¹²³⁴⁵⁶⁷⁸⁹", "-123456789")
_LARGEST_SHIFT = 1000  # decimal places
_LONGEST = 60  # characters of a quantity; keeps the integers of a nonsense unit small


def read(value: object, dimension: Dimension | None) -> float:
    """``value`` (number, or text with a unit) in SI units of ``dimension``.

    ``None`` as dimension: whatever unit is written is accepted (used where an error elsewhere has
    left the dimension unknown). Raises QuantityError for anything that is not a finite quantity.
    """
    if isinstance(value, str):
        number, unit = _split(value, dimension)
        si = _checked(value, unit, dimension).decimal_to_si(number) if unit else float(number)
    elif isinstance(value, bool) or not isinstance(value, (int, float)):
        raise QuantityError(f"{_expected(dimension)}, got {shown(value)}")
    else:
        si = _to_float(value)
    if not math.isfinite(si):
        raise QuantityError(f"must be a finite number, got {shown(value)}")
    return si


def _expected(dimension: Dimension | None) -> str:
    if dimension is None:
        return "expected a number"
    article = "an" if dimension.name[0] in "aeiou" else "a"
    return f"expected {article} {dimension}"


def _to_float(value: int | float) -> float:
    try:
        return float(value)
    except OverflowError:
        return math.inf


def _split(text: str, dimension: Dimension | None) -> tuple[str, str]:
    """``"30 mm"`` → ``("30", "mm")``."""
    stripped = text.strip()
    match = _NUMBER.match(stripped)
    if match is None or len(stripped) > _LONGEST:
        raise QuantityError(f"{_expected(dimension)}, got text {shown(text)}")
    rest = stripped[match.end() :].strip()
    if re.match(r",\d", rest):
        raise QuantityError(f"decimals take a point, not a comma: {shown(text)}")
    return match.group(), rest


def _checked(text: str, unit_text: str, dimension: Dimension | None) -> Unit:
    unit = parse_unit(unit_text, dimension)
    if dimension is None or unit.exponents == dimension.exponents:
        return unit
    found = _BY_EXPONENTS.get(unit.exponents)
    name = found.name if found else f"of dimension {_spelt(unit.exponents)}"
    hint = ""
    if dimension.name == "frequency" and name == "angular rate":
        hint = "; an angular rate is never converted silently: divide by 2π and write Hz"
    raise QuantityError(f"{_expected(dimension)}, got {shown(text)}, which is {name}{hint}")


def _spelt(exponents: Exponents) -> str:
    names = zip(("kg", "m", "s", "rad", "cycle"), exponents, strict=True)
    return " ".join(f"{n}^{e}" for n, e in names if e) or "1"


def parse_unit(text: str, dimension: Dimension | None = None) -> Unit:
    """Unit of ``factor [factor...][/factor...]``: `N m/rad`, `kg/m3`, `cm^2`, `g·cm²`.

    Every ``/`` divides by the one factor behind it; a product behind a slash is refused, since
    people read `kg/m s` in two ways. Raises QuantityError.
    """
    over, *under = (part.strip() for part in text.translate(_SUPERSCRIPTS).split("/"))
    factors = [(f, 1) for f in re.split(r"(?<!\*)\*(?!\*)|[\s·⋅]+", over)] + [
        (f, -1) for f in under
    ]
    product = Unit(1, 1, 0, (0, 0, 0, 0, 0))
    for factor, sign in factors:
        product = product.times(_factor(factor, text, dimension).power(sign))
    return product


def _factor(factor: str, text: str, dimension: Dimension | None) -> Unit:
    match = _FACTOR.fullmatch(factor)
    symbol = match.group(1) if match else factor
    if match is None or symbol not in UNITS:
        raise QuantityError(_unknown(symbol, text, dimension))
    return UNITS[symbol].power(int(match.group(2) or 1))


def _unknown(symbol: str, text: str, dimension: Dimension | None) -> str:
    if symbol.lower() in {"rpm", "rev", "turn", "turns"}:
        return _TURNS
    splits = ((symbol[:i], symbol[i:]) for i in range(1, len(symbol)))
    pairs = (f"{a} {b}" for a, b in splits if a in UNITS and b in UNITS)
    folded = next(pairs, None) or {u.lower(): u for u in UNITS}.get(symbol.lower())
    hint = f"; did you mean {folded!r}?" if folded else suggestion(symbol, UNITS)
    allowed = f"; {_expected(dimension)}" if dimension else ""
    return f"unknown unit {shown(symbol or text)}{hint}{allowed}"


# --- Field types of the case file: physical quantities, names, and immutable mappings

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


# --- One value of the file → SI number, where the schema cannot know its dimension


def si(
    value: object,
    quantity: Quantity | None,
    path: KeyPath,
    findings: list[Finding],
    harmless: float = 0.0,
) -> object:
    """``value`` in SI; ``harmless``, and a finding, if it is not such a quantity.

    Lists and mappings are left as they are. None as quantity: no unit can be meant.
    """
    if isinstance(value, bool) or not isinstance(value, (str, int, float)):
        return value
    try:
        if quantity is None:
            return _bare(value)
        return quantity.checked(read(value, quantity.dimension), shown(value))
    except QuantityError as error:
        findings.append((path, str(error)))
        return harmless


def _bare(value: object) -> float:
    if isinstance(value, str):
        raise QuantityError(
            f"terms of different dimensions: give a plain number in SI units, got {shown(value)}"
        )
    return read(value, None)
