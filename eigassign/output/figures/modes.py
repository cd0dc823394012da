"""Mode shapes."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from eigassign.facts import number
from eigassign.output.figures import graph, style
from eigassign.output.figures.graph import BLUE, GREY, FigurePlan, short
from eigassign.output.figures.mechanism import (
    Drawing,
    Extent,
    draw,
    draw_bearings,
    extent,
    of_roles,
    points_of,
)
from eigassign.output.figures.scene import parts, scale_words
from eigassign.study.results import ModePictures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_REST = "#d4d4d4"


def _note(figure: Figure, text: str, x: float = 0.1, y: float = 0.2) -> Any:
    """Small grey text, ``x`` and ``y`` inches from the lower right."""
    width, height = figure.get_size_inches()
    return figure.text(
        1.0 - x / width, y / height, text,
        ha="right", va="center", size=style.SMALL_PT, color=GREY,
    )  # fmt: skip


# --- Mode shapes: the rigid links in grey, the deformed mechanism in colour, the other phase thin


def mode_figures(pictures: ModePictures) -> tuple[FigurePlan, ...]:
    """One figure a mode, all at one scale."""
    held = _held(pictures)
    caption = (
        "Grey: the rigid links. Blue: the mode, its largest displacement drawn as "
        f"{100 * pictures.amplitude:.0f} % of the mechanism's extent; light: half a period later. "
        f"{scale_words(pictures.rest)}"
    ).strip()
    return tuple(
        FigurePlan(
            f"mode_{k + 1}",
            f"Mode {k + 1}: {hz:.5g} Hz",
            caption,
            f"Mode {k + 1} of the mechanism at {hz:.5g} Hz, deformed over undeformed.",
            partial(_draw_mode, pictures, held, k),
        )
        for k, hz in enumerate(pictures.frequencies_hz)
    )


def _held(pictures: ModePictures) -> Extent:
    """One extent for all modes, so that they can be compared."""
    opposite = [
        2.0 * line - moved
        for lines in pictures.deformed.lines
        for line, moved in zip(pictures.rest.lines[0], lines, strict=True)
    ]
    return extent(pictures.rest, [points_of(pictures.deformed), *opposite])


def _draw_mode(pictures: ModePictures, held: Extent, mode: int) -> Figure:
    """One mode with its frequency, the axes, a scale, and q and y, cut where the scale begins."""
    title = f"{short(pictures.title, 60)}: mode {mode + 1}, {pictures.frequencies_hz[mode]:.5g} Hz"
    foot = 0.95 if held.view.spatial else 0.75  # for the axes and the joints' feet
    wide = style.WIDTH_IN - 0.6
    height = float(np.clip(wide * held.size[1] / held.size[0], 1.6, 5.2))
    figure = style.new_figure(title, foot + height + 0.46)
    drawing = held.drawing(figure, (0.3, foot, wide, height))
    draw_bearings(figure, drawing, 0.1, 0.08)
    _draw_shape(drawing, pictures, mode)
    values = [
        f"{short(name, 16)} = {number(value)} {unit}".rstrip()
        for name, value, unit in (*pictures.q, *pictures.y)
    ]
    text = _note(figure, ", ".join(values))
    while len(values) > 1 and text.get_window_extent().x0 < 2.5 * figure.dpi:
        values = [*values[:-2], "…"]
        text.set_text(", ".join(values))
    return figure


def _draw_shape(drawing: Drawing, pictures: ModePictures, mode: int) -> None:
    """One mode over the mechanism at rest."""
    rest, deformed = pictures.rest, pictures.deformed
    drawing.axes.set_axis_off()
    still, moving = parts(rest), parts(deformed)
    draw(drawing, of_roles(still, "ground"), 0, GREY)
    draw(drawing, of_roles(still, "link", "rigid", "slide", "pivot"), 0, _REST)
    for line, moved in zip(rest.lines[0], deformed.lines[mode], strict=True):
        drawing.line(drawing.view.flat(2.0 * line - moved), graph.SKY, 1.0)
    draw(drawing, [part for part in moving if part.role != "ground"], mode, BLUE)


def thumbnail(pictures: ModePictures) -> bytes:
    """A small picture of the first mode, for a gallery; PNG."""
    width, height = 3.2, 2.1
    with style.applied():
        figure = style.new_figure("", height, width)
        box = (0.16, 0.42, width - 0.32, height - 0.54)
        _draw_shape(_held(pictures).drawing(figure, box, grain=0.75), pictures, 0)
        _note(figure, f"mode 1: {pictures.frequencies_hz[0]:.4g} Hz", 0.06, 0.11)
        return style.encoded(figure, "png")
