"""What is said of a fact once: what it is, its unit, its digits; and numbers as people read them.

A fact is a field or a property of a dataclass. What its name does not say stands in a `Fact` in its
type, as in ``Annotated[float, Fact("of the answer", unit="Hz")]``. Tables, the files of results and
the JSON Schema of these are walks over facts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from itertools import chain
from types import UnionType
from typing import Annotated, Any, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

# --- What is declared

Getter = TypeVar("Getter", bound=Callable[..., Any])

OF_ROW = "that of the row"  # the unit of numbers whose row has a field for it


@dataclass(frozen=True)
class Fact:
    """What is declared of a fact; of several in one type the outer ones say what they say.

    ``words`` say what its name does not, ``heading`` heads its column, ``unit`` is that of its
    numbers. ``digits`` is a format, or makes the text of a cell, which ``says_unit`` or does not;
    ``absent`` is that of None. In files it has another ``name`` where one is given; there None is
    left out of what is ``optional``, a number that is not finite is null where it ``may_lack``,
    rows are a mapping ``by`` one of their fields, what is ``flat`` stands among the facts of its
    owner, and what is ``unwritten`` is left out: a key, or what is for figures and tables alone.
    """

    words: str = ""
    heading: str = ""
    unit: str = ""
    digits: str | Callable[[Any], str] = ""
    absent: str = ""
    says_unit: bool = False
    name: str = ""
    optional: bool = False
    may_lack: bool = False
    by: str = ""
    flat: bool = False
    unwritten: bool = False

    @property
    def column(self) -> str:
        """The heading of its column, with the unit where the cells do not say it."""
        stated = self.unit in ("", OF_ROW) or self.says_unit
        return self.heading if stated else f"{self.heading} [{self.unit}]"

    def text(self, value: Any) -> str:
        """The value as people read it."""
        if value is None:
            return self.absent
        if callable(self.digits):
            return self.digits(value)
        return f"{value + 0.0:{self.digits}}" if self.digits else str(value)


def told(name: str = "", optional: bool = False) -> Callable[[Getter], Getter]:
    """Files have this property, by its name or another; its docstring says what it is."""

    def marked(getter: Getter) -> Getter:
        words = str(getter.__doc__).partition(".")[0]
        words = words[:1].lower() + words[1:]
        getter.fact = Fact(words, name=name or getter.__name__, optional=optional)  # type: ignore[attr-defined]
        return getter

    return marked


@cache
def hints(row: Any) -> dict[str, Any]:
    """The types of all fields and properties, with what they are annotated with."""
    found = get_type_hints(row, include_extras=True)
    own_and_inherited = chain.from_iterable(vars(base).items() for base in reversed(row.__mro__))
    for name, own in own_and_inherited:
        if isinstance(own, property):
            kind = get_type_hints(own.fget, include_extras=True)["return"]
            found[name] = Annotated[kind, getattr(own.fget, "fact", Fact())]
    return found


@cache
def written(row: Any) -> dict[str, Fact]:
    """The facts of a row that files have: its fields, and properties with a ``name`` for it."""
    told = {name: fact(row, name) for name in hints(row)}
    own = {field.name for field in fields(row)}
    return {k: one for k, one in told.items() if (k in own or one.name) and not one.unwritten}


@cache
def fact(row: Any, name: str) -> Fact:
    """What is declared of a field or property, or behind a dot of one of its own.

    Its heading is its name without another.
    """
    own, _, below = name.partition(".")
    kind = hints(row)[own]
    told: dict[str, Any] = {"heading": own.removesuffix("_hz").replace("_", " ")}
    if below:
        row_below: Any = next(filter(is_dataclass, (kind, *_parts(kind))))
        told = vars(fact(row_below, below))
    for one in _parts(kind):
        if isinstance(one, Fact):
            told = {**told, **{k: v for k, v in vars(one).items() if v}}
    return Fact(**told)


def _parts(kind: Any) -> Iterator[Any]:
    """The parts of an optional or annotated type, declarations too, the innermost first."""
    if get_origin(kind) in (Annotated, Union, UnionType):
        for part in get_args(kind):
            yield from _parts(part)
            yield part


# --- Numbers as people read them


def capital(text: str) -> str:
    """The text with its first letter as a sentence or a heading has it; but names of nodes."""
    return text if "." in text.partition(" ")[0].rstrip(".") else text[:1].upper() + text[1:]


def verdict_word(word: str) -> str:
    """The word of a verdict as people read it, wherever it stands: ``Do not use``."""
    return capital(word.replace("_", " "))


def number(value: float) -> str:
    """Four significant digits: ``0.2287``, and 15430 rather than 1.543e+04; no sign on a zero."""
    return f"{float(f'{value:.4g}') + 0.0:.7g}"


def priced(price: float, whole: bool = False) -> str:
    """A price in words: ``12.4`` of a ``whole`` design, ``6.9 below the initial design``."""
    size = number(abs(price))
    if whole or size == "0":
        return number(price) if whole else "that of the initial design"
    return f"{size} {'below' if price < 0.0 else 'above'} the initial design"


def percent(fraction: float) -> str:
    """Three significant digits: ``1.55 %`` for 0.0155; ``n/a`` where there is no number."""
    if not math.isfinite(fraction):
        return "n/a"
    if fraction == 0.0:
        return "0 %"
    return f"{100.0 * fraction:#.3g}".rstrip(".") + " %"


def about(fraction: float, how: str = "about") -> str:
    """A share that was measured, rounded up to two digits: ``about 0.031 %``, ``below 0.001 %``."""
    if not math.isfinite(fraction):
        return "an unknown amount"
    if fraction < 1e-5:
        return "below 0.001 %"
    digits = 1 - math.floor(math.log10(100.0 * fraction))
    step = 10.0**-digits
    amount = math.ceil(100.0 * fraction / step - 1e-9) * step
    return f"{how} {amount:.{max(digits, 0)}f} %".lstrip()


def seconds(value: float) -> str:
    """``12.3 ms`` below a second, ``4.56 s`` above."""
    return f"{1000.0 * value:.3g} ms" if abs(value) < 1.0 else f"{value:.3g} s"


def time_in_words(value: float) -> str:
    """Three digits, however short: ``12.3 µs``."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6), ("ns", 1e-9)):
        if value >= size or (unit == "ns" and value > 0.0):
            return f"{value / size:.3g} {unit}"
    return "0"


def positive_percent(fraction: float) -> str:
    """Per cents of what counts above round-off, 1e-8, only: a violation, or room."""
    return percent(fraction if fraction > 1e-8 else 0.0)


# --- Kinds of facts, each with its unit and digits

T = TypeVar("T")
Unwritten = Annotated[T, Fact(unwritten=True)]
Key = Unwritten[str]
Share = Annotated[float, Fact(unit="fraction", digits=percent, says_unit=True)]
Violation = Annotated[Share, Fact("relative to the limit, 0 where it is kept")]
Hertz = Annotated[float, Fact(unit="Hz", digits=number)]
Seconds = Annotated[float, Fact(unit="s", digits=seconds, says_unit=True)]
Residual = Annotated[float, Fact(digits=lambda left: f"{left:.1e}" if left else "0")]
InUnit = Annotated[float, Fact(unit=OF_ROW, digits=number)]
Curve = Annotated[NDArray[np.float64], Fact(unit="Hz")]
