"""What a graph shows, whoever draws it: curves, shades and points over a common abscissa.

A figure is described once. `paper` draws it with matplotlib as a file, `screen` writes it for a
browser; what can be read off it, its limits and the words on it are settled here.
"""

from __future__ import annotations

import math
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from operator import itemgetter

import numpy as np

from eigassign.arrays import Floats

Dash = str  # solid | dashed | dotted | dash-dotted | fine
DASHES: tuple[Dash, ...] = ("solid", "dashed", "dotted", "dash-dotted")

# Okabe and Ito: can be distinguished with every kind of colour vision
BLACK, ORANGE, SKY, GREEN = "#1a1a1a", "#E69F00", "#56B4E9", "#009E73"
BLUE, VERMILLION, PURPLE, GREY = "#0072B2", "#D55E00", "#CC79A7", "#8c8c8c"
WIDTH = 8.0  # inches: 880 pixels at 110 dpi, the width of the text in a report
LEFT, RIGHT = 0.8, 0.15  # beside the panels
SERIES = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, BLACK, GREY)


@dataclass(frozen=True)
class Look:
    """A line and its points: colour, width in points of print, dashes; the points' shape."""

    colour: str
    width: float = 1.4
    dash: Dash = "solid"
    marker: str = ""  # o, s; none
    size: float = 6.0  # of the marker
    filled: bool = True
    area: str = ""  # the colour inside a closed line


def series(number: int) -> Look:
    """The ``number``-th of any count of like curves: no two neighbours differ by colour alone."""
    dash = DASHES[(number // len(SERIES) + number) % len(DASHES)]
    return Look(SERIES[number % len(SERIES)], 1.4, dash)


@dataclass(frozen=True, eq=False)
class Curve:
    """``y`` over the graph's abscissa, or over its own ``x``; ``end`` stands at its end."""

    y: Floats
    look: Look
    label: str = ""  # in the legend
    x: Floats | None = None
    end: str = ""
    names: tuple[str, ...] = ()  # of its points, where each has one
    marks: tuple[str, ...] = ()  # written at its points
    hover: str = ""  # its name under the pointer, where it has no other


@dataclass(frozen=True, eq=False)
class Shade:
    """The area between two curves; None where it reaches the panel's edge."""

    low: Floats | None
    high: Floats | None
    colour: str
    label: str = ""
    opacity: float = 0.15
    x: Floats | None = None  # its own abscissa; else the graph's


@dataclass(frozen=True)
class Rule:
    """A straight line across the panel at this height, or ``upright`` at this abscissa.

    ``label`` is for the legend, ``note`` is written at its right end.
    """

    at: float
    look: Look
    label: str = ""
    upright: bool = False
    note: str = ""


@dataclass(frozen=True, eq=False)
class Heat:
    """Colours of values ``z`` (n_y, n_x) over the graph's abscissa and ``y`` (n_y,)."""

    y: Floats
    z: Floats
    key: str  # what the values are
    label: str = ""


Mark = Curve | Shade | Rule | Heat


@dataclass(frozen=True, eq=False)
class Panel:
    """One ordinate over the graph's abscissa. Later marks lie above earlier ones.

    On a ``logarithmic`` one whole decades are shown, at most ``decades``; what is below them lies
    on the edge. ``holds`` are values that the ordinate has to hold besides the curves'; ``key``
    are entries of the legend that no mark has. ``names`` are those of the ordinates 0, −1, −2, ….
    Where only part of the curves matters, the ordinate ends where ``within`` says.
    """

    label: str
    marks: tuple[Mark, ...]
    height: float = 2.0  # inches
    logarithmic: bool = False
    decades: int | None = 5  # of errors: what is smaller is as good as nothing
    holds: tuple[Floats, ...] = ()
    key: tuple[tuple[str, Look], ...] = ()
    names: tuple[str, ...] = ()
    within: tuple[float, float] | None = None

    @property
    def curves(self) -> tuple[Curve, ...]:
        """The curves among the marks."""
        return tuple(mark for mark in self.marks if isinstance(mark, Curve))

    @cached_property
    def limits(self) -> tuple[float, float]:
        """The ends of the ordinate."""
        if self.logarithmic:
            return decades(self._values, self.decades)
        return self.whole if self.within is None else self.within

    @property
    def _values(self) -> list[Floats]:
        edges = (e for m in self.marks if isinstance(m, Shade) for e in (m.low, m.high))
        return [*(c.y for c in self.curves), *self.holds, *(e for e in edges if e is not None)]

    @cached_property
    def whole(self) -> tuple[float, float]:
        """The ends of an ordinate that all curves lie in."""
        low, high = bounds(self._values)
        margin = 0.05 * (high - low)
        return low - margin, high + margin

    @cached_property
    def cut(self) -> bool:
        """True where values lie below the decades that are shown."""
        return self.logarithmic and any(bool(np.any(c.y < self.limits[0])) for c in self.curves)

    def shown(self, curve: Curve) -> Floats:
        """A curve's ordinates, what is below a logarithmic axis lifted to its edge."""
        return np.maximum(curve.y, self.limits[0]) if self.logarithmic else curve.y

    def edges(self, shade: Shade, x: Floats) -> tuple[Floats, Floats]:
        """The lower and upper edge of a shade over ``x``, the panel's own where it has none."""
        low, high = (
            np.full(x.size, limit) if edge is None else edge
            for edge, limit in zip((shade.low, shade.high), self.limits, strict=True)
        )
        return low, high

    def ends(self) -> list[tuple[str, float, str]]:
        """The names at the curves' ends, where they do not overlap, and their colours.

        Of a curve that leaves the panel it stands at the edge that it leaves through.
        """
        low, high = self.limits
        inside = (c for c in self.curves if c.end and np.any((low <= c.y) & (c.y <= high)))
        ends = sorted(((float(np.clip(c.y[-1], low, high)), c) for c in inside), key=itemgetter(0))
        named = [c for _, c in ends]
        places = spread([at for at, _ in ends], 0.15 * (high - low) / self.height)
        return [(c.end, at, c.look.colour) for c, at in zip(named, places, strict=True)]


@dataclass(frozen=True, eq=False)
class Graph:
    """Panels one above the other over a common abscissa."""

    title: str
    x_label: str
    x: Floats
    panels: tuple[Panel, ...]
    x_limits: tuple[float, float] | None = None
    x_logarithmic: bool = False
    beside: bool = False  # where the legend stands; else above
    sheet: str = ""  # on paper only, at one scale in all directions: with axes, or bare
    clock: str | None = None  # the trajectory whose time the abscissa is, "" of a single one


@dataclass(frozen=True)
class FigurePlan:
    """One figure: its file's name without ending, heading, caption, alternative text, content.

    ``section`` is that of the page that it stands in.
    """

    name: str
    heading: str
    caption: str
    alt: str
    shows: Graph
    section: str = "appendix"


def segments(
    at: Floats, low: Floats, high: Floats, look: Look, label: str = "", lying: bool = False
) -> Curve:
    """Lines from low to high, upright or lying."""
    gap = np.full(at.size, np.nan)
    ends, places = (np.stack(parts, axis=1).ravel() for parts in ((low, high, gap), (at, at, at)))
    return Curve(places, look, label, ends) if lying else Curve(ends, look, label, places)


# --- Limits and places


def bounds(values: Sequence[Floats]) -> tuple[float, float]:
    """Smallest and largest finite value; apart even where all are equal but for round-off.

    A relative spread below 1e-6 is drawn as a level line, not as enlarged round-off.
    """
    found = _finite(values)
    low, high = (float(found.min()), float(found.max())) if found.size else (0.0, 1.0)
    size = max(abs(low), abs(high))
    if high - low > 1e-6 * size:
        return low, high
    middle, half = (low + high) / 2.0, 0.02 * size or 0.5
    return middle - half, middle + half


def decades(values: Sequence[Floats], most: int | None = None) -> tuple[float, float]:
    """Whole decades that hold all positive ``values``, or the ``most`` highest of them."""
    found = _finite(values)
    found = found[found > 0.0]
    if not found.size:
        return 1e-11, 1e-10
    top = math.ceil(math.log10(found.max()) + 0.02)
    bottom = min(math.floor(math.log10(found.min()) - 0.02), top - 1)
    if most is not None:
        bottom = max(bottom, top - most)
    return 10.0**bottom, 10.0**top


def _finite(values: Sequence[Floats]) -> Floats:
    found = np.concatenate([np.ravel(v) for v in values] or [np.zeros(0)])
    return np.asarray(found[np.isfinite(found)])


def spread(wanted: Floats | Sequence[float], gap: float) -> list[float]:
    """Ascending places nearest to the ascending ``wanted`` ones with ``gap`` between them."""
    clusters: list[tuple[float, int]] = []  # mean place, how many
    for place in wanted:
        mean, count = float(place), 1
        while clusters and clusters[-1][0] + gap * (clusters[-1][1] + count) / 2.0 > mean:
            other, size = clusters.pop()
            mean, count = (other * size + mean * count) / (size + count), size + count
        clusters.append((mean, count))
    return [mean + gap * (i - (count - 1) / 2.0) for mean, count in clusters for i in range(count)]


def power(value: float) -> str:
    """A power of ten as people read it: ``0.01``, ``10⁻⁷``."""
    exponent = round(math.log10(value))
    if -3 <= exponent <= 4:
        return f"{10.0**exponent:g}"
    return "10" + str(exponent).translate(str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻"))


def labelled(quantity: str, unit: str) -> str:
    """``frequency [Hz]``."""
    return f"{quantity} [{unit}]" if unit else quantity


def short(text: str, length: int = 34) -> str:
    """A user's name, without control characters and shortened in its middle."""
    clean = "".join(c if unicodedata.category(c)[0] != "C" else " " for c in text).strip()
    if len(clean) <= length:
        return clean
    head = length * 2 // 3
    return f"{clean[:head]}…{clean[head + 1 - length :]}"
