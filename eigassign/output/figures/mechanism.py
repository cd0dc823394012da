"""The mechanism drawn: poses with the path of the tip (the paper's Figures 1 and 2), mode shapes.

From the bottom up: a parallel projection of a plane or of space on the sheet; the parts of the
scene on it as curves, at one scale in all directions; the figures. Symbols are measured in inches
on the sheet, places in m; `scene` has both.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise, product
from textwrap import wrap

import numpy as np
from numpy.typing import NDArray

from eigassign.arrays import Floats
from eigassign.output.figures import graph, scene
from eigassign.output.figures.graph import (
    BLACK,
    BLUE,
    GREY,
    Curve,
    FigurePlan,
    Graph,
    Look,
    Panel,
    short,
)
from eigassign.output.figures.scene import LARGEST, SYMBOL_IN, Part, Shape, parts, scale_words
from eigassign.study.results import DrawnPoses, ModePictures

# --- A parallel projection

_ELEVATIONS = np.radians([22.0, 50.0])
# of the viewer; along an axis what lies on one sheet with it would seem to be plane
_AZIMUTHS = np.radians([-60.0, -30.0, -75.0, -120.0, -15.0, -150.0])


def view_of(points: Floats) -> Floats:
    """The sheet's directions across and up (2, d), in world axes, that show ``points`` (n, d) best.

    A plane as it is; space with z upright, by a viewer far away who faces the motion.

    The first view that shows 85 % of the best one's area; what is nearly a line on the sheet counts
    by its length. From high above only what is flat on the floor is seen better.
    """
    if points.shape[1] == 2:
        return np.eye(2)
    views, seen = [], []
    for elevation, azimuth in product(_ELEVATIONS, _AZIMUTHS):
        c, s = np.cos(azimuth), np.sin(azimuth)
        high, low = np.cos(elevation), np.sin(elevation)
        views.append(np.array([[-s, c, 0.0], [-low * c, -low * s, high]]))
        flat = points @ views[-1].T
        long, wide = np.linalg.svd(flat - flat.mean(axis=0), compute_uv=False)
        seen.append(long * max(wide, 0.2 * long))
    return next(v for v, area in zip(views, seen, strict=True) if area >= 0.85 * max(seen))


# --- A drawing at one scale in all directions

THINNEST, CASING = 1.3, 1.6  # points of the thinnest line; of what is left free around it
WIDE = graph.WIDTH - graph.LEFT - graph.RIGHT  # inches of the sheet
MARGIN, FOOT = 0.3, 0.5  # around all places, for symbols; below, for the axes' directions
LOOK = {"body": graph.VERMILLION, "spring": graph.GREEN, "ground": GREY}  # others: as the pose
_GROUND = "#e6e6e6"


@dataclass(frozen=True)
class Extent:
    """The box in a parallel projection that holds some points; never without width and height."""

    directions: Floats  # (2, d) of the sheet, as `view_of` returns them
    middle: Floats  # (2,) in m
    size: Floats  # (2,) width and height, m
    thick: float  # of the thickest link, m

    def flat(self, points: Floats) -> Floats:
        """(…, d) → (…, 2) in the same unit."""
        return np.asarray(points @ self.directions.T)

    @property
    def spatial(self) -> bool:
        """True of a view of space."""
        return bool(self.directions.shape[1] == 3)

    @cached_property
    def height(self) -> float:
        """That of the sheet, inches."""
        tall = (WIDE - 2.0 * MARGIN) * self.size[1] / self.size[0]
        return float(np.clip(tall, 1.6, 4.6)) + 2.0 * MARGIN

    @cached_property
    def per_inch(self) -> float:
        """m of an inch of the sheet."""
        return float(np.max(self.size / (np.array([WIDE, self.height]) - 2.0 * MARGIN)))

    @cached_property
    def larger(self) -> float:
        """How many times as large symbols are beside thick links."""
        return float(np.clip(self.thick / self.per_inch / SYMBOL_IN, 1.0, LARGEST))

    @property
    def inch(self) -> float:
        """An inch of a symbol, m."""
        return self.per_inch * self.larger

    def heading(self, direction: Floats) -> Floats:
        """Unit vector on the sheet of a direction; across where it points at the viewer."""
        flat = self.flat(direction)
        length = float(np.linalg.norm(flat))
        return flat / length if length > 0.05 * np.linalg.norm(direction) else np.array([1.0, 0.0])

    def graph(
        self,
        title: str,
        marks: Iterable[Curve],
        key: Sequence[tuple[str, Look]] = (),
        bare: bool = True,
        note: str = "",
    ) -> Graph:
        """The sheet with these marks; a ``bare`` one has the axes' directions and a scale below."""
        foot = FOOT if bare else 0.0
        half = 0.5 * self.per_inch * np.array([WIDE, self.height])
        low, high = self.middle - half - (0.0, foot * self.per_inch), self.middle + half
        marks = (*marks, *(self._bearings(low) if bare else ()))
        ends = (float(low[1]), float(high[1]))
        label = "" if bare else "y [m]"
        panel = Panel(label, marks, self.height + foot, key=tuple(key), within=ends)
        limits = (float(low[0]), float(high[0]))
        note, sheet = note or "x [m]" * (not bare), "bare" if bare else "axes"
        return Graph(title, note, np.zeros(0), (panel,), limits, sheet=sheet)

    def _bearings(self, low: Floats) -> Iterator[Curve]:
        """The axes' directions, and a bar of round length as scale, from the corner ``low``."""
        origin = low + self.per_inch * np.array([0.2, 0.24] if self.spatial else [0.08, 0.12])
        for axis, name in zip(np.eye(self.directions.shape[1]), "xyz", strict=False):
            end = origin + 0.3 * self.per_inch * self.flat(axis)
            yield polyline(np.array([origin, end]), Look(GREY, 1.0), name)
        power = 10.0 ** np.floor(np.log10(self.per_inch))
        length = max(n * power for n in (1.0, 2.0, 5.0) if n * power <= self.per_inch * 1.000001)
        start = low + self.per_inch * np.array([0.85, 0.12])
        bar = np.array([start, start + np.array([length, 0.0])])
        yield polyline(bar, Look(BLACK, 1.0, marker="|", size=4.5), f"{length:.6g} m")


def polyline(points: Floats, look: Look, end: str = "") -> Curve:
    """A curve through flat points (n, 2), m; NaN interrupts it."""
    return Curve(points[:, 1], look, x=points[:, 0], end=end)


def extent(poses: DrawnPoses, others: Iterable[Floats] = ()) -> Extent:
    """The extent of these poses and other points in the view that suits the poses."""
    shown = points_of(poses)
    view = view_of(shown)
    flat = np.concatenate([shown, *others]) @ view.T
    low, high = flat.min(axis=0), flat.max(axis=0)
    thick = max((thick for part in scene.links(poses) for thick in part.ends), default=0.0)
    size = high - low + thick
    size = np.maximum(size, 0.02 * float(np.max(size)) or 1.0)
    return Extent(view, 0.5 * (low + high), size, thick)


def points_of(poses: DrawnPoses) -> Floats:
    """Everything that a drawing of these poses has to hold, (n, d)."""
    parts = [line for lines in poses.lines for line in lines]
    parts += [body.places for body in poses.bodies]
    parts += [joint.places for joint in poses.joints]
    parts += [] if poses.tip_path is None else [poses.tip_path]
    parts += [solid.places.reshape(-1, solid.places.shape[2]) for solid in poses.solids]
    every = np.concatenate(parts)
    return every[np.isfinite(every).all(axis=1)]


def drawn(
    held: Extent, shown: Iterable[Part], pose: int, colour: str, look: Mapping[str, str] = LOOK
) -> Iterator[Curve]:
    """The parts in one pose, in ``colour`` but for the roles in ``look``."""
    for part in shown:
        own, at = look.get(part.role, colour), min(pose, len(part.places) - 1)
        places = held.flat(part.places[at])
        if part.faces is not None:
            yield polyline(silhouette(places, part.faces), Look(own, 1.0))
        elif part.kind == "line":
            yield from _thick(held, places, part.ends, own)
        elif part.kind == "spring":
            zigzag = scene.zigzagged((places[1] - places[0]) / held.inch)
            yield polyline(places[0] + held.inch * zigzag, Look(own, 1.1))
        elif part.axes is not None and part.kind == "rail":
            along = held.heading(part.axes[0])
            along = -along if along[0] < 0.0 else along  # so that the strokes are below it
            half = 0.5 * float(np.linalg.norm(places[1] - places[0])) / held.inch + 0.2
            rail = _aligned(scene.hatched(half) + np.array([0.0, -0.09]), along)
            yield polyline(places.mean(axis=0) + held.inch * rail, Look(own, 0.8))
        else:
            turned = None if part.axes is None else held.heading(part.axes[at])
            yield from (_stamp(held, places[0], shape, turned, own) for shape in part.shapes)


def silhouette(flat: Floats, faces: NDArray[np.intp]) -> Floats:
    """Where faces (m, 4) of ``flat`` points (n, 2) turn away: segments (3 k, 2), NaN between."""
    a, b, c = (flat[faces[:, k]] for k in range(3))
    front = np.linalg.det(np.stack([b - a, c - a], axis=1)) > 0.0
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2), axis=2).reshape(-1, 2)
    apart = edges[:, 0] != edges[:, 1]  # a triangle has three
    pairs, which = np.unique(edges[apart], axis=0, return_inverse=True)
    seen = np.bincount(which.ravel(), np.repeat(front, 4)[apart])
    ends = flat[pairs[(seen > 0) & (seen < np.bincount(which.ravel()))]]
    return np.concatenate([ends, np.full((len(ends), 1, 2), np.nan)], axis=1).reshape(-1, 2)


def _stamp(held: Extent, at: Floats, shape: Shape, along: Floats | None, colour: str) -> Curve:
    if shape.dot:
        size = shape.dot * held.larger
        return polyline(at[None], Look(colour, 0.0, "solid", "o", size, shape.fill == "own"))
    points = shape.points if along is None else _aligned(shape.points, along)
    points = np.vstack([points, points[:1]]) if shape.fill else points
    fill = {"own": colour, "page": "white", "ground": _GROUND, "": ""}[shape.fill]
    return polyline(at + held.inch * points, Look(colour, shape.width, area=fill))


def _aligned(points: Floats, along: Floats) -> Floats:
    """Points (n, 2), their first direction turned to a unit vector."""
    return np.asarray(points @ np.array([along, [-along[1], along[0]]]))


def _thick(held: Extent, flat: Floats, ends: tuple[float, float], colour: str) -> Iterator[Curve]:
    """A line as thick as its section, a taper in eight; white around it where links cross."""
    if len(flat) < 2 or not np.ptp(flat, axis=0).any():
        return
    start, end = (max(72.0 * thick / held.per_inch, THINNEST) for thick in ends)
    own, count = np.linspace(0.0, 1.0, len(flat)), 1 if start == end else 8
    for paint, wider in (("white", CASING), (colour, 0.0)):
        for low, high in pairwise(np.linspace(0.0, 1.0, count + 1)):
            at = np.linspace(low, high, 1 + max(1, len(flat) // count)) if count > 1 else own
            piece = np.column_stack([np.interp(at, own, column) for column in flat.T])
            yield polyline(piece, Look(paint, start + (end - start) * 0.5 * (low + high) + wider))


def of_roles(shown: Iterable[Part], *roles: str) -> list[Part]:
    """The parts of these roles."""
    return [part for part in shown if part.role in roles]


# --- The poses along the trajectory

_BODIES = (graph.BLUE, graph.GREEN, graph.PURPLE, graph.SKY)
_TIP = Look(graph.VERMILLION, 1.8)
# of poses from first to last, from dark to light: matplotlib's cividis up to 0.9
_TIMES = ("#00224e", "#243c6e", "#4f576c", "#727274", "#948e77", "#bcae6c", "#e5cf52")


def poses(title: str, shown: DrawnPoses) -> FigurePlan:
    """The mechanism at samples of the trajectory, or in one pose, and the path of its tip.

    Links are coloured by the time of the pose.
    """
    links, count = ", ".join(shown.link_names), len(shown.lines)
    several = f"{count} poses" if count > 1 else "one pose"
    tip = "" if shown.tip_path is None else ", and the path of the tip"
    held, every = extent(shown), parts(shown)
    colours = [_TIMES[round(6.0 * k / max(count - 1, 1))] for k in range(count)]
    marks = [] if shown.tip_path is None else [polyline(held.flat(shown.tip_path), _TIP)]
    marks += drawn(held, of_roles(every, "ground"), 0, GREY)
    moving = of_roles(every, "spring", "link", "rigid", "slide", "pivot")
    bodies = of_roles(every, "body")
    for pose, colour in enumerate(colours):
        marks += drawn(held, moving, pose, colour, {"spring": GREY})
    key = [] if shown.tip_path is None else [("tip path", _TIP)]
    for at, body in enumerate(bodies):
        look = Look(_BODIES[at % len(_BODIES)], 0.0, marker="o")
        key += [(short(body.name, 22), look)] * (at < 6)
        for pose in range(count):
            marks += drawn(held, [body], pose, look.colour, {})
    for at, (colour, time) in enumerate(zip(colours, shown.time_s, strict=True)):
        whose = f"{short(shown.of[at], 12)} " if shown.of else ""
        key += [(f"{whose}at {time:.3g} s", Look(colour, 2.6))] * (count > 1)
    heading = f"{short(title, 60)}{': poses along the trajectory' * (count > 1)}"
    return FigurePlan(
        "mechanism",
        "Mechanism",
        f"The links ({links}) in {several}{tip}. {scale_words(shown)}".strip(),
        f"Line drawing of the mechanism with links {links} in {several}.",
        held.graph(heading, marks, key, bare=held.spatial),
        "answer",
    )


# --- Mode shapes: the rigid links in grey, the deformed mechanism in colour, the other phase thin

_REST = "#d4d4d4"


def mode_figures(pictures: ModePictures) -> tuple[FigurePlan, ...]:
    """One figure a mode, all at one scale, with q and y."""
    rest, deformed = pictures.rest, pictures.deformed
    opposite = [
        [2.0 * line - moved for line, moved in zip(rest.lines[0], lines, strict=True)]
        for lines in deformed.lines
    ]
    held = extent(rest, [points_of(deformed), *(line for lines in opposite for line in lines)])
    still, moving = parts(rest), [part for part in parts(deformed) if part.role != "ground"]
    below = [*drawn(held, of_roles(still, "ground"), 0, GREY)]
    below += drawn(held, of_roles(still, "link", "rigid", "slide", "pivot"), 0, _REST)
    caption = (
        "Grey: the rigid links. Blue: the mode, its largest displacement drawn as "
        f"{100 * pictures.amplitude:.0f} % of the mechanism's extent; light: half a period later. "
        f"{scale_words(rest)}"
    ).strip()

    def figure(k: int, hz: float) -> FigurePlan:
        other = [polyline(held.flat(line), Look(graph.SKY, 1.0)) for line in opposite[k]]
        title = f"{short(pictures.title, 60)}: mode {k + 1}, {hz:.5g} Hz"
        marks = (*below, *other, *drawn(held, moving, k, BLUE))
        return FigurePlan(
            f"mode_{k + 1}",
            f"Mode {k + 1}: {hz:.5g} Hz",
            caption,
            f"Mode {k + 1} of the mechanism at {hz:.5g} Hz, deformed over undeformed.",
            held.graph(title, marks, note="\n".join(wrap(pictures.where, 105)[:2])),
        )

    return tuple(figure(k, hz) for k, hz in enumerate(pictures.frequencies_hz))
