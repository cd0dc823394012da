"""From places in a plane or in space to places on a sheet, at one scale in all directions."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from eigassign.output.ink import BLACK, GREY, Box, Sheet, Stroke
from eigassign.output.ticks import power_of_ten
from eigassign.study.pictures import Poses

Floats = NDArray[np.float64]
ELEVATION = np.radians(22.0)
AZIMUTHS = np.radians([-60.0, -30.0, -120.0])  # of the viewer
_ENOUGH = 0.7  # of the area seen from the best side
_THIN = Stroke(GREY, 1.0)


@dataclass(frozen=True)
class View:
    """A parallel projection: rows are the sheet's directions across and up, in world axes."""

    directions: Floats  # (2, d)

    def flat(self, points: Floats) -> Floats:
        """(…, d) → (…, 2) in the same unit."""
        return np.asarray(points @ self.directions.T)

    @property
    def spatial(self) -> bool:
        """Whether it is a view of space."""
        return bool(self.directions.shape[1] == 3)


def view_of(points: Floats) -> View:
    """A plane as it is; space from above, from the first side that hides little."""
    if points.shape[1] == 2:
        return View(np.eye(2))
    views = [View(_axonometry(azimuth)) for azimuth in AZIMUTHS]
    seen = [_seen(view.flat(points)) for view in views]
    return next(v for v, area in zip(views, seen, strict=True) if area >= _ENOUGH * max(seen))


def _axonometry(azimuth: float) -> Floats:
    """What a viewer far away at this azimuth, above the x-y plane, sees with z upright."""
    c, s = np.cos(azimuth), np.sin(azimuth)
    low, high = np.sin(ELEVATION), np.cos(ELEVATION)
    return np.array([[-s, c, 0.0], [-low * c, -low * s, high]])


def _seen(flat: Floats) -> float:
    """About the area that points take on the sheet; what is nearly a line counts by its length."""
    long, short = np.linalg.svd(flat - flat.mean(axis=0), compute_uv=False)
    return float(long * max(short, 0.2 * long))


def points_of(poses: Poses) -> Floats:
    """Everything that a drawing of these poses has to hold, (n, d)."""
    parts = [line for lines in poses.lines for line in lines]
    parts += [body.places for body in poses.bodies]
    parts += [joint.places for joint in poses.joints]
    parts += [] if poses.tip_path is None else [poses.tip_path]
    every = np.concatenate(parts)
    return every[np.isfinite(every).all(axis=1)]


@dataclass(frozen=True)
class Canvas:
    """A sheet on which places are drawn; ``grain`` is the size of symbols, 1 in a full figure."""

    sheet: Sheet
    view: View
    middle: tuple[float, float]  # of the drawing, in the view's m
    centre: tuple[float, float]  # on the sheet, inches
    per_inch: float  # m
    grain: float = 1.0

    def place(self, points: Floats) -> Floats:
        """Points (n, 2) on the sheet in inches."""
        return (self.view.flat(points) - self.middle) / self.per_inch + self.centre

    def heading(self, direction: Floats) -> Floats:
        """Unit vector on the sheet of a direction; across where it points at the viewer."""
        flat = self.view.flat(direction)
        length = float(np.linalg.norm(flat))
        return flat / length if length > 0.05 * np.linalg.norm(direction) else np.array([1.0, 0.0])


@dataclass(frozen=True)
class Extent:
    """The box in the view that holds some points."""

    view: View
    points: Floats

    @cached_property
    def box(self) -> tuple[float, float, float, float]:
        """Middle across and up, width and height, in m; never without width and height both."""
        flat = self.view.flat(self.points)
        low, high = flat.min(axis=0), flat.max(axis=0)
        across, up = map(float, high - low)
        some = max(across, up) or 1.0
        x, y = map(float, 0.5 * (low + high))
        return x, y, max(across, 0.02 * some), max(up, 0.02 * some)

    def per_inch(self, width: float, height: float) -> float:
        """The scale, m per inch, at which it fits into ``width`` by ``height`` inches."""
        return max(self.box[2] / width, self.box[3] / height)

    def on(self, sheet: Sheet, box: Box, grain: float = 1.0) -> Canvas:
        """A canvas that shows it in the middle of ``box``."""
        left, bottom, width, height = box
        centre = (left + width / 2.0, bottom + height / 2.0)
        scale = self.per_inch(width, height)
        return Canvas(sheet, self.view, self.box[:2], centre, scale, grain)


def extent(poses: Poses, others: Iterable[Floats] = ()) -> Extent:
    """The extent of these poses and other points in the view that suits the poses."""
    shown = points_of(poses)
    return Extent(view_of(shown), np.concatenate([shown, *others]))


def draw_bearings(canvas: Canvas, left: float, bottom: float) -> None:
    """The axes' directions, and a bar of round length as scale, from (left, bottom) inches."""
    size = 0.3 * canvas.grain
    inset = (0.2, 0.24) if canvas.view.spatial else (0.08, 0.12)
    origin = np.add((left, bottom), inset)
    for axis, name in zip(np.eye(canvas.view.directions.shape[1]), "xyz", strict=False):
        end = origin + size * canvas.view.flat(axis)
        canvas.sheet.line(np.array([origin, end]), _THIN)
        x, y = end + 0.09 * canvas.heading(axis)
        canvas.sheet.text(x, y, name, align="center", points=8.0, colour=BLACK)
    _draw_scale(canvas, left + 0.75, bottom + 0.12)


def _draw_scale(canvas: Canvas, left: float, y: float) -> None:
    length = round_length(canvas.per_inch)
    right = left + length / canvas.per_inch
    ends = [np.array([(x, y - 0.03), (x, y + 0.03)]) for x in (left, right)]
    canvas.sheet.segments([np.array([(left, y), (right, y)]), *ends], Stroke(BLACK, 1.0))
    canvas.sheet.text(right + 0.08, y, length_label(length), points=8.0)


def round_length(most: float) -> float:
    """1, 2 or 5 times a power of ten, not above ``most``."""
    power = 10.0 ** np.floor(np.log10(most))
    return float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= most * 1.000001))


def length_label(length: float) -> str:
    """``0.2 m``, ``50 mm``."""
    if 1e-3 <= length < 0.1:
        return f"{1e3 * length:.6g} mm"
    exponent = round(np.floor(np.log10(length)))
    if -3 <= exponent <= 3:
        return f"{length:.6g} m"
    return f"{length / 10.0**exponent:.0f}·{power_of_ten(int(exponent))} m"
