"""Text as pixels, every letter drawn once and then copied.

A report's figures repeat some hundred letters in over two hundred labels. Having the renderer
shape and rasterise each label anew is most of the time a figure takes; from a set of letters it
is a few additions. Scripts whose letters join or stack are left to the renderer.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import RendererAgg
from matplotlib.font_manager import FontProperties
from numpy.typing import NDArray

DPI = 110
FONT_PT = 9.0
_LEFT_EM, _UP_EM, _DOWN_EM, _RIGHT_EM = 0.4, 1.1, 0.4, 1.6  # a letter's cell around its origin


@dataclass(frozen=True)
class Word:
    """How much of each pixel ``coverage`` (height, width) 0–255 the ink takes; origin in it."""

    coverage: NDArray[np.uint8]
    left: int  # columns before the origin
    above: int  # rows above the baseline


def renderer(width: int, height: int, dpi: float = DPI) -> Any:
    """An empty Agg renderer, which is untyped in matplotlib, and so is what it hands out."""
    make: Any = RendererAgg
    return make(width, height, dpi)


@functools.lru_cache(maxsize=8)
def font(points: float, bold: bool) -> FontProperties:
    """The font that comes with matplotlib, the same everywhere."""
    return FontProperties(family="DejaVu Sans", size=points, weight="bold" if bold else "normal")


def is_plain(text: str) -> bool:
    """Whether letters can be set one after the other: Latin, Greek, Cyrillic and symbols."""
    return all(c < "\u0300" or "\u0370" <= c < "\u0590" or "\u2010" <= c < "\u2300" for c in text)


def text_width(text: str, points: float = FONT_PT, *, bold: bool = False) -> float:
    """Width of ``text`` in inches."""
    if is_plain(text):
        return sum(_letter(character, points, bold)[1] for character in text) / DPI
    width, _, _ = renderer(1, 1).get_text_width_height_descent(text, font(points, bold), False)
    return float(width) / DPI


@functools.lru_cache(maxsize=4096)
def _letter(character: str, points: float, bold: bool) -> tuple[NDArray[np.uint8], float]:
    """The cell of one plain letter and its advance in pixels."""
    em = points * DPI / 72.0
    width, height = math.ceil((_LEFT_EM + _RIGHT_EM) * em), math.ceil((_UP_EM + _DOWN_EM) * em)
    cell = renderer(width, height)
    style = font(points, bold)
    place = (math.ceil(_LEFT_EM * em), math.ceil(_UP_EM * em))
    cell.draw_text(cell.new_gc(), *place, character, style, 0.0, False)
    ink = np.asarray(cell.buffer_rgba())[:, :, 3].copy()
    return ink, _advance(character, bold) * em


@functools.lru_cache(maxsize=1024)
def _advance(character: str, bold: bool) -> float:
    """Width of a letter in em, measured large: the renderer gives whole pixels of its ink."""
    ruler, large = renderer(1, 1, 720.0), font(100.0, bold)
    around, _, _ = ruler.get_text_width_height_descent(f"|{character}|", large, False)
    bars, _, _ = ruler.get_text_width_height_descent("||", large, False)
    return float(around - bars) / 1000.0


@functools.lru_cache(maxsize=1024)
def word(text: str, points: float, bold: bool) -> Word:
    """The pixels of a plain ``text``."""
    em = points * DPI / 72.0
    letters = [_letter(character, points, bold) for character in text]
    total = sum(advance for _, advance in letters)
    height = math.ceil((_UP_EM + _DOWN_EM) * em)
    width = math.ceil(total + (_LEFT_EM + _RIGHT_EM) * em) + 1
    coverage = np.zeros((height, width), dtype=np.uint8)
    at = 0.0
    for ink, advance in letters:
        part = coverage[:, round(at) : round(at) + ink.shape[1]]
        np.maximum(part, ink, out=part)
        at += advance
    return _trimmed(coverage, math.ceil(_LEFT_EM * em), math.ceil(_UP_EM * em))


def _trimmed(coverage: NDArray[np.uint8], left: int, above: int) -> Word:
    """Without the empty rows and columns around the ink: most of a short label's cells."""
    rows, columns = (np.flatnonzero(coverage.any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return Word(coverage[:0, :0], left, above)
    top, start = int(rows[0]), int(columns[0])
    ink = coverage[top : int(rows[-1]) + 1, start : int(columns[-1]) + 1]
    return Word(np.ascontiguousarray(ink), left - start, above - top)


def stamp(
    pixels: NDArray[np.uint8], ink: Word, x: int, y: int, rgb: tuple[float, ...], *, upright: bool
) -> None:
    """Print ``ink`` with its origin at column ``x``, row ``y`` of ``pixels`` (height, width, 4).

    ``upright`` turns it a quarter left around the origin. What falls outside is lost.
    """
    coverage, left, above = ink.coverage, ink.left, ink.above
    if upright:
        coverage, left, above = np.rot90(coverage), above, coverage.shape[1] - ink.left
    row, column = y - above, x - left
    top, bottom = max(0, row), min(pixels.shape[0], row + coverage.shape[0])
    start, end = max(0, column), min(pixels.shape[1], column + coverage.shape[1])
    if top >= bottom or start >= end:
        return
    part = pixels[top:bottom, start:end, :3]
    inside = coverage[top - row : bottom - row, start - column : end - column, None]
    alpha = inside.astype(np.float32) / np.float32(255.0)
    colour = np.array(rgb, dtype=np.float32) * np.float32(255.0)
    part[...] = np.rint(part + (colour - part) * alpha)
