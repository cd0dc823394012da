"""Mode shapes: the rigid links in grey, the deformed mechanism in colour, the other phase thin."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from eigassign.output.figures import graph, style
from eigassign.output.figures.graph import BLUE, GREY, FigurePlan, short
from eigassign.output.figures.mechanism import (
    KINDS,
    Drawing,
    Extent,
    draw_bearings,
    draw_bodies,
    draw_ground,
    draw_joints,
    draw_links,
    draw_springs,
    extent,
    points_of,
)
from eigassign.output.formats import number
from eigassign.study.results import ModePictures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LOWEST_IN, _TALLEST_IN = 1.6, 5.2
_FOOT_IN = {False: 0.75, True: 0.95}  # in a plane, in space: for the axes and the joints' feet
_SIDE_IN = 0.3
_REST = "#c4c4c4"


def mode_figures(pictures: ModePictures) -> tuple[FigurePlan, ...]:
    """One figure a mode, all at one scale."""
    held = _held(pictures)
    caption = (
        "Grey: the rigid links. Blue: the mode, its largest displacement drawn as "
        f"{100 * pictures.amplitude:.0f} % of the mechanism's extent; light: half a period later."
    )
    return tuple(
        FigurePlan(
            f"mode_{k + 1}",
            f"Mode {k + 1}: {hz:.5g} Hz",
            caption,
            f"Mode {k + 1} of the mechanism at {hz:.5g} Hz, deformed over undeformed.",
            partial(draw_mode, pictures, held, k),
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


def draw_mode(pictures: ModePictures, held: Extent, mode: int) -> Figure:
    """One mode with its frequency, the axes, a scale, and q and y."""
    width, foot = style.WIDTH_IN - 2.0 * _SIDE_IN, _FOOT_IN[held.view.spatial]
    tall = float(np.clip(width * held.size[1] / held.size[0], _LOWEST_IN, _TALLEST_IN))
    title = f"{short(pictures.title, 60)}: mode {mode + 1}, {pictures.frequencies_hz[mode]:.5g} Hz"
    figure = style.new_figure(title, foot + tall + 0.46, layout=None)
    drawing = held.drawing(figure, (_SIDE_IN, foot, width, tall))
    _draw_shape(drawing, pictures, mode)
    draw_bearings(figure, drawing, 0.1, 0.08)
    _write_point(figure, pictures)
    return figure


def _write_point(figure: Figure, pictures: ModePictures) -> None:
    """``q1 = 1.817 rad, …`` at the lower right, cut where the scale begins."""
    values = [
        f"{short(name, 16)} = {number(value)} {unit}".rstrip()
        for name, value, unit in (*pictures.q, *pictures.y)
    ]
    text = figure.text(
        1.0 - 0.1 / style.WIDTH_IN, 0.2 / figure.get_size_inches()[1], ", ".join(values),
        ha="right", va="center", size=style.SMALL_PT, color=GREY,
    )  # fmt: skip
    while len(values) > 1 and text.get_window_extent().x0 < 2.5 * figure.dpi:
        values = [*values[:-2], "…"]
        text.set_text(", ".join(values))


def _draw_shape(drawing: Drawing, pictures: ModePictures, mode: int) -> None:
    """One mode over the mechanism at rest."""
    rest, deformed = pictures.rest, pictures.deformed
    drawing.axes.set_axis_off()
    draw_ground(drawing, rest.joints)
    draw_links(drawing, rest, 0, _REST)
    draw_joints(drawing, rest.joints, 0, _REST, KINDS)
    for line, moved in zip(rest.lines[0], deformed.lines[mode], strict=True):
        drawing.line(drawing.view.flat(2.0 * line - moved), graph.SKY, 1.0)
    draw_springs(drawing, deformed.springs, mode, graph.GREEN)
    draw_links(drawing, deformed, mode, BLUE)
    draw_joints(drawing, deformed.joints, mode, BLUE, ("sliding", "fixed"))
    draw_bodies(drawing, deformed.bodies, mode, graph.VERMILLION)
    draw_joints(drawing, deformed.joints, mode, BLUE, ("turning",))


def thumbnail(pictures: ModePictures, mode: int = 0) -> Figure:
    """A small picture of one mode, for a gallery."""
    width, height = 3.2, 2.1
    figure = style.new_figure("", height, width, layout=None)
    box = (0.16, 0.42, width - 0.32, height - 0.54)
    _draw_shape(_held(pictures).drawing(figure, box, grain=0.75), pictures, mode)
    text = f"mode {mode + 1}: {pictures.frequencies_hz[mode]:.4g} Hz"
    place = (1.0 - 0.06 / width, 0.11 / height)
    figure.text(*place, text, ha="right", va="center", size=style.SMALL_PT, color=GREY)
    return figure
