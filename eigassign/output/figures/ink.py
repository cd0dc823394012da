"""A sheet to draw on, in inches from its lower left corner, and how its strokes look.

It drives matplotlib's Agg renderer directly. A report needs a handful of plain charts whose
layout is known beforehand; through figures and axes the same pixels cost several times as long
to draw and half as long again to import. Nothing here depends on the user's matplotlib settings.
"""

from __future__ import annotations

import contextlib
import unicodedata
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib
import numpy as np
from matplotlib.path import Path
from matplotlib.transforms import Affine2D, Bbox, IdentityTransform
from numpy.typing import NDArray

from eigassign.output.figures.lettering import (
    DPI,
    FONT_PT,
    font,
    is_plain,
    renderer,
    stamp,
    text_width,
    word,
)

Floats = NDArray[np.float64]
Box = tuple[float, float, float, float]  # left, bottom, width, height

EM_IN = FONT_PT / 72.0
LINE_IN = 1.65 * EM_IN
_CAP = 0.36  # half the height of capital letters, in em

# Okabe and Ito: told apart with every kind of colour vision
BLACK, ORANGE, SKY, GREEN = "#1a1a1a", "#E69F00", "#56B4E9", "#009E73"
BLUE, VERMILLION, PURPLE, GREY = "#0072B2", "#D55E00", "#CC79A7", "#8c8c8c"
GRID = "#e3e3e3"
SERIES = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, BLACK, GREY)
DASHES: tuple[tuple[float, ...], ...] = ((), (5.0, 1.6), (1.4, 1.4), (6.0, 1.5, 1.4, 1.5))
# cividis: grows evenly in lightness, the same for every kind of colour vision
_RAMP = (
    "#00224e", "#1f386d", "#434e6c", "#62646f", "#7d7c78", "#9b9476", "#bbaf6d", "#decb5a",
    "#fee838",
)  # fmt: skip


_SETTINGS = ("agg.", "font.", "path.", "text.")  # all that the renderer reads


@dataclass(frozen=True)
class Stroke:
    """How a curve is drawn; width, dashes and dot diameter in points."""

    colour: str
    width: float = 1.5
    dashes: tuple[float, ...] = ()
    dot: float = 0.0


def series_stroke(number: int) -> Stroke:
    """The ``number``-th of any count of like curves: no two differ by colour alone."""
    dashes = DASHES[(number // len(SERIES) + number) % len(DASHES)]
    return Stroke(SERIES[number % len(SERIES)], dashes=dashes)


def ramp(fraction: float) -> tuple[float, float, float]:
    """Colour for a magnitude between 0 (dark) and 1 (light)."""
    at = min(max(fraction, 0.0), 1.0) * (len(_RAMP) - 1)
    low = min(int(at), len(_RAMP) - 2)
    dark, light = (np.array(rgb(_RAMP[low + i])) for i in (0, 1))
    red, green, blue = dark + (at - low) * (light - dark)
    return float(red), float(green), float(blue)


def rgb(colour: str) -> tuple[float, float, float]:
    """``#rrggbb`` as fractions."""
    red, green, blue = (int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5))
    return red, green, blue


@contextlib.contextmanager
def settings() -> Iterator[None]:
    """Draw with these settings, whatever the user's own are."""
    ours = {
        name: value
        for name, value in matplotlib.rcParamsDefault.items()
        if name.startswith(_SETTINGS)
    } | {"text.hinting": "no_hinting"}
    with matplotlib.rc_context(ours), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        yield


def short(text: str, length: int = 34) -> str:
    """A user's name, without control characters and shortened in its middle."""
    clean = "".join(c if unicodedata.category(c)[0] != "C" else " " for c in text).strip()
    if len(clean) <= length:
        return clean
    head = length * 2 // 3
    return f"{clean[:head]}…{clean[head + 1 - length :]}"


class Sheet:
    """A white sheet of ``width`` by ``height`` inches."""

    def __init__(self, width: float, height: float) -> None:
        self.width, self.height = width, height
        self._renderer = renderer(round(width * DPI), round(height * DPI))
        self._pixels: NDArray[np.uint8] = np.asarray(self._renderer.buffer_rgba())
        self._pixels.fill(255)  # white, and opaque

    def line(self, points: Floats, stroke: Stroke, clip: Box | None = None) -> None:
        """A polyline through ``points`` (n, 2); NaN interrupts it; one point is a dot."""
        context = self._context(stroke.colour, clip)
        context.set_linewidth(stroke.width)
        context.set_joinstyle("round")
        if stroke.dashes:
            context.set_dashes(0.0, [dash * stroke.width for dash in stroke.dashes])
        else:
            context.set_capstyle("round" if stroke.width > 1.0 else "butt")
        if len(points) > 1:
            self._renderer.draw_path(context, Path(points * DPI), IdentityTransform())
        diameter = stroke.dot or (2.5 + 1.6 * stroke.width if len(points) == 1 else 0.0)
        fill = rgb("#ffffff" if stroke.dashes else stroke.colour)
        for point in points if diameter else ():
            self.dot((point[0], point[1]), diameter, fill, stroke.colour)

    def segments(self, pieces: Sequence[Floats], stroke: Stroke) -> None:
        """Separate straight lines in one go: grids and ticks."""
        broken = [part for piece in pieces for part in (piece, np.full((1, 2), np.nan))]
        if broken:
            self.line(np.concatenate(broken), stroke)

    def dot(
        self,
        centre: tuple[float, float],
        diameter: float,
        fill: tuple[float, float, float],
        edge: str = "",
    ) -> None:
        """A filled circle, ``diameter`` in points."""
        place = Affine2D().scale(diameter / 144.0).translate(*centre)
        self.area(Path.unit_circle().transformed(place), fill, edge)

    def area(
        self,
        outline: Path,
        fill: tuple[float, float, float],
        edge: str = "",
        clip: Box | None = None,
    ) -> None:
        """A filled outline, in inches."""
        context = self._context(edge or BLACK, clip)
        context.set_linewidth(0.8 if edge else 0.0)
        self._renderer.draw_path(context, outline, Affine2D().scale(DPI), fill)

    def text(
        self,
        left: float,
        middle: float,
        text: str,
        *,
        align: str = "left",
        colour: str = BLACK,
        points: float = FONT_PT,
        bold: bool = False,
        upright: bool = False,
    ) -> None:
        """One line of text whose capitals are centred on the height ``middle``.

        ``align`` says which part of it is at ``left``; ``upright`` turns it to read upwards, and
        (left, middle) is then the centre.
        """
        width = text_width(text, points, bold=bold)
        drop = _CAP * points / 72.0
        if upright:
            x, y = left + drop, middle - width / 2.0
        else:
            x = left - width * {"left": 0.0, "center": 0.5, "right": 1.0}[align]
            y = middle - drop
        x, y = x * DPI, self._renderer.height - y * DPI
        if is_plain(text):
            ink = word(text, points, bold)
            stamp(self._pixels, ink, round(x), round(y), rgb(colour), upright=upright)
        else:
            angle, style = 90.0 if upright else 0.0, font(points, bold)
            self._renderer.draw_text(self._context(colour), x, y, text, style, angle, False)

    def pixels(self) -> NDArray[np.uint8]:
        """What was drawn, (height, width, 4): red, green, blue and full opacity."""
        return self._pixels

    def _context(self, colour: str, clip: Box | None = None) -> Any:
        context = self._renderer.new_gc()
        context.set_foreground(colour)
        if clip is not None:
            context.set_clip_rectangle(Bbox.from_bounds(*(DPI * value for value in clip)))
        return context


def rectangle(box: Box) -> Path:
    """Outline of a box."""
    left, bottom, width, height = box
    right, top = left + width, bottom + height
    return Path([(left, bottom), (right, bottom), (right, top), (left, top), (left, bottom)])
