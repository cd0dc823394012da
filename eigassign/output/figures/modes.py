"""Mode shapes: the rigid links in grey, the deformed mechanism in colour, the other phase thin."""

from __future__ import annotations

from collections.abc import Iterator

from eigassign.output.figures.frame import TITLE_IN, WIDTH_IN, titled_sheet
from eigassign.output.figures.ink import (
    BLUE,
    GREEN,
    GREY,
    SKY,
    VERMILLION,
    Box,
    Sheet,
    Stroke,
    short,
)
from eigassign.output.figures.lettering import text_width
from eigassign.output.figures.mechanism import (
    KINDS,
    Canvas,
    Extent,
    draw_bearings,
    draw_bodies,
    draw_ground,
    draw_joints,
    draw_lines,
    draw_springs,
    extent,
    points_of,
)
from eigassign.output.figures.plan import FigurePlan
from eigassign.output.formats import number
from eigassign.study.results import ModePictures

_MODE_TALL_IN = (1.6, 5.2)
_MODE_FOOT_IN = {False: 0.75, True: 0.95}  # in a plane, in space: for the axes and the joints' feet
_SIDE_IN = 0.3
_REST = "#c4c4c4"
_OTHER = Stroke(SKY, 1.0)
_SMALL_IN = (3.2, 2.1)  # a thumbnail


def plan_modes(pictures: ModePictures) -> tuple[FigurePlan, ...]:
    """One figure a mode."""
    return tuple(_plans(pictures))


def _plans(pictures: ModePictures) -> Iterator[FigurePlan]:
    held = _held(pictures)
    for k, hz in enumerate(pictures.frequencies_hz):
        yield FigurePlan(
            f"mode_{k + 1}.png",
            f"Mode {k + 1}: {hz:.5g} Hz",
            _caption(pictures),
            f"Mode {k + 1} of the mechanism at {hz:.5g} Hz, deformed over undeformed.",
            lambda k=k: _figure(pictures, held, k),  # type: ignore[misc]
        )


def _caption(pictures: ModePictures) -> str:
    return (
        "Grey: the rigid links. Blue: the mode, its largest displacement drawn as "
        f"{100 * pictures.amplitude:.0f} % of the mechanism's extent; light: half a period later."
    )


def _held(pictures: ModePictures) -> Extent:
    """One extent for all modes, so that they can be compared."""
    opposite = [
        2.0 * line - moved
        for lines in pictures.deformed.lines
        for line, moved in zip(pictures.rest.lines[0], lines, strict=True)
    ]
    return extent(pictures.rest, [points_of(pictures.deformed), *opposite])


def _figure(pictures: ModePictures, held: Extent, mode: int) -> Sheet:
    width = WIDTH_IN - 2.0 * _SIDE_IN
    foot = _MODE_FOOT_IN[held.view.spatial]
    tall = min(max(width * held.box[3] / held.box[2], _MODE_TALL_IN[0]), _MODE_TALL_IN[1])
    hz = pictures.frequencies_hz[mode]
    title = f"{short(pictures.title, 60)}: mode {mode + 1}, {hz:.5g} Hz"
    sheet = titled_sheet(foot + tall + TITLE_IN + 0.1, title)
    canvas = held.on(sheet, (_SIDE_IN, foot, width, tall))
    draw_mode(canvas, pictures, mode)
    draw_bearings(canvas, 0.1, 0.08)
    where = _where(pictures, WIDTH_IN - 2.6)
    sheet.text(WIDTH_IN - 0.1, 0.2, where, align="right", points=8.0, colour=GREY)
    return sheet


def _where(pictures: ModePictures, width: float) -> str:
    """``q1 = 1.817 rad, …``, cut where the sheet ends."""
    values = [
        f"{short(name, 16)} = {number(value)} {unit}".rstrip()
        for name, value, unit in (*pictures.q, *pictures.y)
    ]
    shown = len(values)
    while shown and text_width(_joined(values, shown), 8.0) > width:
        shown -= 1
    return _joined(values, shown)


def _joined(values: list[str], shown: int) -> str:
    return ", ".join([*values[:shown], *(["…"] if shown < len(values) else [])])


def draw_mode(canvas: Canvas, pictures: ModePictures, mode: int) -> None:
    """One mode over the mechanism at rest."""
    rest, deformed = pictures.rest, pictures.deformed
    draw_ground(canvas, rest.joints)
    draw_lines(canvas, rest, 0, _REST)
    draw_joints(canvas, rest.joints, 0, _REST, KINDS)
    for line, moved in zip(rest.lines[0], deformed.lines[mode], strict=True):
        canvas.sheet.line(canvas.place(2.0 * line - moved), _OTHER)
    draw_springs(canvas, deformed.springs, mode, GREEN)
    draw_lines(canvas, deformed, mode, BLUE)
    draw_joints(canvas, deformed.joints, mode, BLUE, ("sliding", "fixed"))
    draw_bodies(canvas, deformed.bodies, mode, VERMILLION)
    draw_joints(canvas, deformed.joints, mode, BLUE, ("turning",))


def thumbnail(pictures: ModePictures, mode: int = 0) -> Sheet:
    """A small picture of one mode, for a gallery."""
    width, height = _SMALL_IN
    sheet = Sheet(width, height)
    box: Box = (0.16, 0.42, width - 0.32, height - 0.54)
    canvas = _held(pictures).on(sheet, box, grain=0.75)
    draw_mode(canvas, pictures, mode)
    text = f"mode {mode + 1}: {pictures.frequencies_hz[mode]:.4g} Hz"
    sheet.text(width - 0.06, 0.11, text, align="right", points=8.0, colour=GREY)
    return sheet
