"""Quantities as people write them (`30 mm`, `69 GPa`, `104.1 deg`) → SI numbers, dimension-checked.

A bare number is SI already. Angles and cycles are dimensions of their own, so that nothing converts
between rad/s, 1/s and Hz silently. 5 rpm is a frequency of 1/12 Hz, and no angular rate.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from fractions import Fraction
from functools import lru_cache
from typing import NamedTuple, Self

from eigassign.case.reader import COMMA, NUMBER, shown, suggestion

SHOWN = 8  # values of a pose or design that are named
Exponents = tuple[int, ...]  # of kg, m, s, rad, cycle


class QuantityError(ValueError):
    """A quantity that cannot be read; the message says what was expected and what was found."""


class Dimension(NamedTuple):
    """A physical dimension: its name, its SI unit, and other units worth mentioning.

    ``smallest`` and ``largest`` (SI) enclose every mechanism, from nanotubes to bridges, and keep
    products of a dozen quantities far from where floating-point numbers end. What may be negative
    is a difference of such quantities: it may be smaller.
    """

    name: str
    exponents: Exponents
    si: str
    examples: str
    smallest: float = 1e-30
    largest: float = 1e30

    def __str__(self) -> str:
        unit = f"in {self.si}" if self.si else "a plain number"
        return f"{self.name} ({unit} when bare; or {self.examples})"


class Unit(NamedTuple):
    """``factor · π^pi`` SI units; the exact fraction keeps a conversion to one rounding."""

    factor: Fraction
    exponents: Exponents
    pi: int = 0

    def times(self, other: Unit, n: int) -> Unit:
        """Its product with the ``n``-th power of another."""
        pairs = zip(self.exponents, other.exponents, strict=True)
        exponents = tuple(a + n * b for a, b in pairs)
        return Unit(self.factor * other.factor**n, exponents, self.pi + n * other.pi)

    def to_si(self, value: float) -> float:
        """``value`` in SI."""
        return value * self.factor.numerator / self.factor.denominator * math.pi**self.pi

    def decimal_to_si(self, number: str) -> float:
        """Decimal ``number`` in SI, rounded once (a second time where π is involved).

        `30 mm` is the very float 0.03; a min, a max and an initial value written in different
        units then compare as their author expects.
        """
        if self.factor == 1:
            return float(number) * math.pi**self.pi
        exponent = number.lower().partition("e")[2]
        if abs(int(exponent or 0)) > 1000:
            return float(number)  # 0 or infinite, in any unit
        try:
            return float(Fraction(number) * self.factor) * math.pi**self.pi
        except OverflowError:
            return math.inf


_DIMENSIONS = (
    Dimension("length", (0, 1, 0, 0, 0), "m", "mm, cm, km", 1e-12, 1e6),
    Dimension("area", (0, 2, 0, 0, 0), "m2", "mm2, cm2", 1e-24, 1e12),
    Dimension("second moment of area", (0, 4, 0, 0, 0), "m4", "mm4, cm4", 1e-48, 1e24),
    Dimension("mass", (1, 0, 0, 0, 0), "kg", "g, t", 1e-30, 1e15),
    Dimension("density", (1, -3, 0, 0, 0), "kg/m3", "g/cm3", 1e-30, 1e12),
    Dimension("rotary inertia", (1, 2, 0, 0, 0), "kg m2", "g cm2, kg mm2", 1e-30, 1e24),
    Dimension("pressure or modulus", (1, -1, -2, 0, 0), "Pa", "MPa, GPa, N/mm2", 1e-6, 1e24),
    Dimension("angle", (0, 0, 0, 1, 0), "rad", "deg, mrad", 1e-12, 1e6),
    Dimension(
        *("rotational stiffness", (1, 2, -2, -1, 0), "N m/rad"),
        *("kN m/rad, N m/arcmin, kgf m/arcmin", 1e-24, 1e24),
    ),
    Dimension("stiffness", (1, 0, -2, 0, 0), "N/m", "kN/m, N/mm, N/um", 1e-24, 1e24),
    Dimension("compliance", (-1, 0, 2, 0, 0), "m/N", "mm/N, um/N", 1e-24, 1e24),
    Dimension("transmission", (0, -1, 0, 1, 0), "rad/m", "rad/mm, deg/mm", 1e-12, 1e12),
    Dimension("time", (0, 0, 1, 0, 0), "s", "ms, min", 1e-12, 1e12),
    Dimension("frequency", (0, 0, -1, 0, 1), "Hz", "kHz, rpm", 1e-12, 1e15),
    Dimension("acceleration", (0, 1, -2, 0, 0), "m/s2", "mm/s2", 1e-12, 1e9),
    Dimension("fraction", (0, 0, 0, 0, 0), "", "%"),
    Dimension("force", (1, 1, -2, 0, 0), "N", "kN", 1e-24, 1e24),
    Dimension("torque or energy", (1, 2, -2, 0, 0), "N m", "kN m", 1e-24, 1e24),
    # never asked for; known so that a mistake can be called by its name
    Dimension("angular rate", (0, 0, -1, 1, 0), "rad/s", "deg/s"),
    Dimension("velocity", (0, 1, -1, 0, 0), "m/s", "mm/s"),
    Dimension("volume", (0, 3, 0, 0, 0), "m3", "cm3"),
    Dimension("mass per length", (1, -1, 0, 0, 0), "kg/m", "g/mm"),
)
DIMENSIONS = {d.name: d for d in _DIMENSIONS}
PLAIN = DIMENSIONS["fraction"]
_BY_EXPONENTS = {d.exponents: d for d in _DIMENSIONS}

_HANDY = {  # units that people read, the largest first
    "kg": {"kg": 1.0, "g": 1e-3},
    "m": {"m": 1.0, "mm": 1e-3},
    "m2": {"m2": 1.0, "cm2": 1e-4, "mm2": 1e-6},
    "m4": {"m4": 1.0, "cm4": 1e-8, "mm4": 1e-12},
    "Pa": {"GPa": 1e9, "MPa": 1e6, "Pa": 1.0},
    "N/m": {"MN/m": 1e6, "kN/m": 1e3, "N/m": 1.0},
    "m/N": {"mm/N": 1e-3, "µm/N": 1e-6, "nm/N": 1e-9},
    "N m/rad": {"MN m/rad": 1e6, "kN m/rad": 1e3, "N m/rad": 1.0},
    "kg m2": {"kg m2": 1.0, "kg cm2": 1e-4},
    "N": {"MN": 1e6, "kN": 1e3, "N": 1.0},
    "N m": {"MN m": 1e6, "kN m": 1e3, "N m": 1.0},
}


class Given(float):
    """A number in SI with the ``text`` that gives it in the case file."""

    __slots__ = ("text",)
    text: str | float

    def __new__(cls, value: float, text: str | float = math.nan) -> Self:
        """``value`` in SI, written as ``text``."""
        self = super().__new__(cls, value)
        self.text = text
        return self


class SI(str):
    """The SI unit of a quantity, and the one that its amounts are ``answered`` in.

    That is its own, else the first that ``given`` have: numbers of the case file, other units, the
    name of one. Without any it is a handy one, by the amount.
    """

    __slots__ = ("answered",)
    answered: str

    def __new__(cls, unit: str, *given: object) -> Self:
        """SI ``unit`` of what is answered as one of ``given`` is written."""
        self = super().__new__(cls, unit)
        own = getattr(unit, "answered", "")
        self.answered = next(filter(None, (own, *map(_unit_of, given))), "")
        return self


def _unit_of(given: object) -> str:
    if isinstance(given, Given):
        text = " ".join(str(given.text).split())
        return text[match.end() :].lstrip() if (match := NUMBER.match(text)) else ""
    return getattr(given, "answered", given if isinstance(given, str) else "")


LEFT_OUT = {  # by what a bare number is in: the unit that is easily left out, and its size
    "m": ("mm", 1e-3),
    "kg": ("g", 1e-3),
    "Pa": ("GPa", 1e9),
    "N/m": ("kN/m", 1e3),
    "N m/rad": ("kN m/rad", 1e3),
}


def handy_unit(unit: str, *values: float) -> tuple[str, float]:
    """The unit that amounts in SI ``unit`` are answered in, and its size in SI.

    Else the largest that makes the largest of ``values`` at least 1, or the smallest if none does;
    where there is nothing but zeros, ``unit`` itself.
    """
    if answered := getattr(unit, "answered", ""):
        return answered, parse_unit(answered).to_si(1.0)
    most = max((abs(value) for value in values), default=0.0)
    units = _HANDY.get(unit, {unit: 1.0}) if most else {unit: 1.0}
    return next(((n, size) for n, size in units.items() if most >= size), [*units.items()][-1])


def handy(amount: float, unit: str, digits: int = 3) -> str:
    """An amount in SI ``unit``, in the unit that it is answered in: ``2 kN m/rad``, ``35 mm``."""
    name, size = handy_unit(SI(unit, amount), amount)
    return f"{float(f'{amount / size:.{digits}g}'):.12g} {name}".rstrip()  # 1000, not 1e+03


def written(amount: float, unit: str = "", *others: float) -> str:
    """An amount in the unit that the file has for it, or for ``others``; else in SI ``unit``."""
    name, size = handy_unit(SI(unit, amount, *others))
    return f"{amount / size:.12g} {name}".rstrip()


def slip(amount: float, si: str) -> str:
    """A hint at the unit that may have been left out: of a number that has one, none."""
    meant = LEFT_OUT.get(si, ("", 0.0))[0]
    if not meant or SI("", amount).answered:
        return ""
    return f"; {amount:g} is {amount:g} {si} without a unit; did you mean {amount:g} {meant}?"


def shown_point(names: Iterable[str], values: Iterable[float], units: Iterable[str]) -> str:
    """``"q1 = 1.817 rad, q2 = 5.312 rad"``; of many the first."""
    each = zip(names, values, units, strict=False)
    shown = [f"{name} = {handy(value, unit, 6)}" for name, value, unit in each]
    rest = f" and {len(shown) - SHOWN} more" if len(shown) > SHOWN else ""
    return (", ".join(shown[:SHOWN]) or "none") + rest


_PREFIXES = {"n": -9, "u": -6, "µ": -6, "μ": -6, "m": -3, "c": -2, "k": 3, "M": 6, "G": 9, "T": 12}
ONE = Unit(Fraction(1), (0, 0, 0, 0, 0))
UNITS: dict[str, Unit] = {
    "t": Unit(Fraction(1000), (1, 0, 0, 0, 0)),
    "min": Unit(Fraction(60), (0, 0, 1, 0, 0)),
    "h": Unit(Fraction(3600), (0, 0, 1, 0, 0)),
    "deg": Unit(Fraction(1, 180), (0, 0, 0, 1, 0), pi=1),
    "°": Unit(Fraction(1, 180), (0, 0, 0, 1, 0), pi=1),
    "arcmin": Unit(Fraction(1, 10_800), (0, 0, 0, 1, 0), pi=1),
    "in": Unit(Fraction(254, 10**4), (0, 1, 0, 0, 0)),
    "kgf": Unit(Fraction(980_665, 10**5), (1, 1, -2, 0, 0)),
    "rpm": Unit(Fraction(1, 60), (0, 0, -1, 0, 1)),
    "%": Unit(Fraction(1, 100), ONE.exponents),
}
for _unit, _prefixes, _own in (  # the µ of two: micro sign, Greek mu
    ("g", "m k", Unit(Fraction(1, 1000), (1, 0, 0, 0, 0))),
    ("m", "n u µ μ m c k", Unit(Fraction(1), (0, 1, 0, 0, 0))),
    ("s", "n u µ μ m", Unit(Fraction(1), (0, 0, 1, 0, 0))),
    ("N", "m k M", Unit(Fraction(1), (1, 1, -2, 0, 0))),
    ("Nm", "k", Unit(Fraction(1), (1, 2, -2, 0, 0))),
    ("Pa", "k M G T", Unit(Fraction(1), (1, -1, -2, 0, 0))),
    ("Hz", "m k M", Unit(Fraction(1), (0, 0, -1, 0, 1))),
    ("rad", "m", Unit(Fraction(1), (0, 0, 0, 1, 0))),
):
    UNITS[_unit] = _own
    for _p in _prefixes.split():
        UNITS[_p + _unit] = Unit(Fraction(10) ** _PREFIXES[_p] * _own.factor, _own.exponents)

TWO_TURNS = 4 * math.pi  # rad: a bare number beyond was probably meant in degrees

_FACTOR = re.compile(r"([^\W\d_]+|[%°])(?:(?:\^|\*\*)?([-+]?[1-9]))?")
_BETWEEN = re.compile(r"(?<!\*)\*(?!\*)|[\s·⋅]+")
_SUPERSCRIPTS = str.maketrans("⁻¹²³⁴⁵⁶⁷⁸⁹", "-123456789")


def read_quantity(value: object, dimension: Dimension | None) -> float:
    """``value`` (number, or text with a unit) in SI units of ``dimension``.

    ``None`` as dimension: whatever unit is written is accepted (used where an error elsewhere has
    left the dimension unknown). Raises QuantityError for anything that is not a finite quantity,
    or too large to calculate with.
    """
    if isinstance(value, str):
        number, unit = _split(value, dimension)
        si = _checked(value, unit, dimension).decimal_to_si(number) if unit else float(number)
    elif isinstance(value, bool) or not isinstance(value, (int, float)):
        raise QuantityError(f"{_expected(dimension)}, got {shown(value)}")
    else:
        si = float(value) if abs(value) < 1.7e308 else math.inf
    require_size(si, dimension, value)
    return si


def require_size(si: float, dimension: Dimension | None, given: object) -> None:
    """Raises QuantityError for a number that is not finite, or too large to calculate with."""
    if not math.isfinite(si):
        raise QuantityError(f"must be a finite number, got {shown(given)}")
    known = dimension or PLAIN
    if abs(si) > known.largest:
        most = f"{known.largest:g} {known.si}".rstrip()
        raise QuantityError(f"too large to calculate with, got {shown(given)}; at most {most}")


def number_and_unit(value: object) -> tuple[Fraction, str]:
    """``"180 Hz"`` → (180, "Hz"), 0.1 → (1/10, ""): the number exactly as its decimals say.

    Raises QuantityError for anything that is not a number, with or without a unit.
    """
    si = read_quantity(value, None)
    if not isinstance(value, str):
        return Fraction(repr(value)), ""
    number, unit = _split(value, None)
    return (Fraction(number) if si else Fraction(0)), unit


def is_bare(text: str) -> bool:
    """True for the text of a number without a unit."""
    return NUMBER.fullmatch(text.strip()) is not None


def read_rate(value: object, dimension: Dimension | None) -> float:
    """``value`` for one SI unit of ``dimension``: a bare number, or text such as `3 / kg`.

    Raises QuantityError as `read_quantity` does.
    """
    if not isinstance(value, str):
        return read_quantity(value, None)
    amount, slash, unit_text = value.partition("/")
    number, rest = _split(amount, None)
    if not slash or rest:
        si = dimension.si if dimension and dimension.si else "kg"
        raise QuantityError(f"expected an amount per unit, such as 3 / {si}, got {shown(value)}")
    unit = _checked(value, unit_text.strip(), dimension)
    return read_quantity(float(number) / unit.to_si(1.0), None)


def _expected(dimension: Dimension | None) -> str:
    if dimension is None:
        return "expected a number"
    article = "an" if dimension.name[0] in "aeiou" else "a"
    return f"expected {article} {dimension}"


def _split(text: str, dimension: Dimension | None) -> tuple[str, str]:
    """``"30 mm"`` → ``("30", "mm")``."""
    stripped = text.strip()
    match = NUMBER.match(stripped)
    if match is None or len(stripped) > 60:  # keeps the integers of a nonsense unit small
        raise QuantityError(f"{_expected(dimension)}, got text {shown(text)}")
    rest = stripped[match.end() :].strip()
    if re.match(r",\d", rest):
        raise QuantityError(f"{COMMA}: write {text.replace(',', '.', 1)}")
    return match.group(), rest


def _checked(text: str, unit_text: str, dimension: Dimension | None) -> Unit:
    unit = parse_unit(unit_text, dimension)
    if dimension is None or unit.exponents == dimension.exponents:
        return unit
    found = _BY_EXPONENTS.get(unit.exponents)
    names = zip(("kg", "m", "s", "rad", "cycle"), unit.exponents, strict=True)
    spelt = " ".join(f"{n}^{e}" for n, e in names if e) or "1"
    name = found.name if found else f"of dimension {spelt}"
    hint = ""
    if dimension.name == "frequency" and name == "angular rate":
        hint = "; an angular rate is never converted silently: divide by 2π and write Hz"
    raise QuantityError(f"{_expected(dimension)}, got {shown(text)}, which is {name}{hint}")


@lru_cache(maxsize=256)  # the same few units in every row of a sweep or table: 0.1 ms each
def parse_unit(text: str, dimension: Dimension | None = None) -> Unit:
    """Unit of ``factor [factor...][/factor...]``: `N m/rad`, `kg/m3`, `cm^2`, `g·cm²`.

    Every ``/`` divides by the one factor behind it; a product behind a slash is refused, since
    people read `kg/m s` in two ways. Raises QuantityError.
    """
    over, *under = (part.strip() for part in text.translate(_SUPERSCRIPTS).split("/"))
    product = ONE
    for factor, sign in [*((f, 1) for f in _BETWEEN.split(over)), *((f, -1) for f in under)]:
        match = _FACTOR.fullmatch(factor)
        symbol = match.group(1) if match else factor
        if match is None or symbol not in UNITS:
            raise QuantityError(_unknown(symbol, text, dimension))
        product = product.times(UNITS[symbol], sign * int(match.group(2) or 1))
    return product


def _unknown(symbol: str, text: str, dimension: Dimension | None) -> str:
    splits = ((symbol[:i], symbol[i:]) for i in range(1, len(symbol)))
    pairs = (f"{a} {b}" for a, b in splits if a in UNITS and b in UNITS)
    folded = next(pairs, None) or {u.lower(): u for u in UNITS}.get(symbol.lower())
    hint = f"; did you mean {folded!r}?" if folded else suggestion(symbol, UNITS)
    allowed = f"; {_expected(dimension)}" if dimension else ""
    return f"unknown unit {shown(symbol or text)}{hint}{allowed}"
