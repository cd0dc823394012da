"""The mechanism as a drawing, whoever draws it: figures and pages show the same parts.

A part has places in m, which move, and shapes in inches, which lie on the sheet as they are. Links
are as thick as their sections; of a mechanism whose sections would be hairs, they are drawn some
times as thick, and that is said.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from eigassign.arrays import Floats
from eigassign.study.results import DrawnJoint, DrawnPoses

Kind = Literal["line", "stamp", "spring", "rail", "solid"]
LEAST_SHARE = 1.0 / 45.0  # of the extent: so thick is the thickest section at least
MOST_SHARE = 0.25  # and at most
NOMINAL_SHARE = 1.0 / 70.0  # of the extent: a link without a section
SYMBOL_IN, LARGEST = 0.12, 2.2  # of links thicker than that symbols grow, so many times at most
TIMES = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)

_ACROSS, _DOWN = np.array([1.0, 0.0]), np.array([0.0, -1.0])
_TURN = np.linspace(0.0, 4.5 * np.pi, 60)
_SPIRAL = ((0.05 + 0.08 * _TURN / _TURN[-1]) * np.array([np.cos(_TURN), np.sin(_TURN)])).T


@dataclass(frozen=True, eq=False)
class Shape:
    """A polyline or polygon (n, 2) in inches around its place, or a dot; ``fill`` is own or page.

    A polygon is filled with the colour of its part, or with that of the page.
    """

    points: Floats = field(default_factory=lambda: np.zeros((1, 2)))
    fill: str = ""  # own | page | ground; none of a line
    width: float = 0.8  # of the line, points
    dot: float = 0.0  # diameter, points


@dataclass(frozen=True, eq=False)
class Part:
    """One thing in n poses, at ``places`` (n, k, d) in m.

    A line runs through them, as thick as ``ends`` say, m; a stamp has its shapes at the one place,
    turned so that they lie along ``axes`` (n, d), or upright without; a spring is between two; a
    rail lies beside the way from one to the other; of a solid the outline of its ``faces``.
    """

    kind: Kind
    role: str  # ground | spring | link | rigid | slide | body | pivot | driven: its colour
    name: str
    places: Floats
    axes: Floats | None = None
    ends: tuple[float, float] = (0.0, 0.0)
    shapes: tuple[Shape, ...] = ()
    faces: NDArray[np.intp] | None = None


def box(half: float, tall: float) -> Floats:
    """Corners of a box ``half`` inches to both sides and ``tall`` up and down."""
    return np.array([(-half, -tall), (half, -tall), (half, tall), (-half, tall)])


def hatched(half: float) -> Floats:
    """A line ``half`` inches to both sides with short strokes below it; NaN between them."""
    feet = np.linspace(-0.76, 1.0, max(2, round(2.0 * half / 0.055)))[:, None] * half * _ACROSS
    gap = np.full_like(feet, np.nan)
    strokes = np.stack([feet, feet + 0.06 * _DOWN - 0.05 * _ACROSS, gap], axis=1)
    return np.vstack([-half * _ACROSS, half * _ACROSS, gap[:1], strokes.reshape(-1, 2)])


_BELOW = hatched(0.14) + 0.14 * _DOWN
_FOOT = Shape(np.array([(0.0, 0.0), (-0.08, -0.14), (0.08, -0.14)]), "ground")
_WALL = Shape(hatched(0.13)[:, ::-1])
_SYMBOLS = {
    "turning": (Shape(dot=5.6, fill="page"),),
    "sliding": (Shape(box(0.09, 0.055), "page"),),
    "fixed": (Shape(box(0.028, 0.028), "own"),),
}


def thickening(poses: DrawnPoses) -> float:
    """How many times as thick as to scale sections are drawn, that they can be seen."""
    most = max((depth for pair in poses.depths for depth in pair), default=0.0)
    if most <= 0.0:
        return 1.0
    extent = extent_of(poses)
    least = next((n for n in TIMES if n * most >= LEAST_SHARE * extent), TIMES[-1])
    return min(float(least), MOST_SHARE * extent / most)


def extent_of(poses: DrawnPoses) -> float:
    """The diagonal of the box around the links in the first pose, m."""
    every = np.concatenate(poses.lines[0]) if poses.lines[0] else np.zeros((1, 2))
    return float(np.linalg.norm(np.ptp(every, axis=0))) or 1.0


def scale_words(poses: DrawnPoses) -> str:
    """What a caption says of how thick sections are."""
    if not any(depth > 0.0 for pair in poses.depths for depth in pair):
        return ""
    times = thickening(poses)
    if times < 1.0:
        return "Sections thinner than they are."
    return "Sections to scale." if times == 1 else f"Sections {times:g} times as thick as they are."


def parts(poses: DrawnPoses) -> tuple[Part, ...]:
    """All parts, those that lie on top last."""
    return (*ground(poses), *_springs(poses), *links(poses), *_joints(poses))


def ground(poses: DrawnPoses) -> Iterator[Part]:
    """Yield the feet of joints on the ground, and rails beside the ways of those that slide."""
    for joint in (joint for joint in poses.joints if joint.grounded):
        place = joint.places[:1, None]
        if joint.kind == "turning":
            yield Part("stamp", "ground", joint.name, place, shapes=(_FOOT, Shape(_BELOW)))
        elif joint.kind == "sliding":
            way = (joint.places - joint.places[0]) @ joint.axes[0]
            ends = joint.places[0] + np.array([[way.min()], [way.max()]]) * joint.axes[0]
            yield Part("rail", "ground", joint.name, ends[None], joint.axes[:1])
        else:
            yield Part("stamp", "ground", joint.name, place, joint.axes[:1], shapes=(_WALL,))


def _springs(poses: DrawnPoses) -> Iterator[Part]:
    for spring in poses.springs:
        if spring.turning:
            spiral = Shape(_SPIRAL, width=1.1)
            yield Part("stamp", "spring", spring.name, spring.starts[:, None], shapes=(spiral,))
        elif spring.grounded:
            zigzag = zigzagged(np.array([0.16, -0.3]))
            foot = hatched(0.09) + zigzag[-1]
            shapes = (Shape(zigzag, width=1.1), Shape(foot))
            yield Part("stamp", "spring", spring.name, spring.starts[:, None], shapes=shapes)
        else:
            ends = np.stack([spring.starts, spring.ends], axis=1)
            yield Part("spring", "spring", spring.name, ends)


def zigzagged(along: Floats) -> Floats:
    """A zigzag from the origin to ``along`` (2,), inches; a spiral where that is too near."""
    length = float(np.linalg.norm(along))
    if length < 0.05:
        return np.asarray(_SPIRAL)
    across = 0.05 * np.array([-along[1], along[0]]) / length
    at = np.concatenate([[0.0, 0.2], np.linspace(0.25, 0.75, 6), [0.8, 1.0]])
    side = np.array([0.0, 0.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 0.0, 0.0])
    return np.asarray(at[:, None] * along + side[:, None] * across)


def links(poses: DrawnPoses) -> Iterator[Part]:
    """Yield the links: solids, the others as lines as thick as they are drawn."""
    times, nominal = thickening(poses), NOMINAL_SHARE * extent_of(poses)
    depths = poses.depths or ((0.0, 0.0),) * len(poses.line_links)
    for solid in poses.solids:
        yield Part("solid", "link", solid.link, solid.places, faces=solid.faces)
    outlined = {solid.link for solid in poses.solids}
    for k, (name, pair) in enumerate(zip(poses.line_links, depths, strict=True)):
        if name in outlined:
            continue
        places = np.stack([lines[k] for lines in poses.lines])
        known = any(pair)
        ends = (times * pair[0], times * pair[1]) if known else (nominal, nominal)
        yield Part("line", "link" if known else "rigid", name, places, ends=ends)


def _joints(poses: DrawnPoses) -> Iterator[Part]:
    """Yield boxes and squares, then bodies, then rings, and a dot where a coordinate moves them."""
    for joint in poses.joints:
        if joint.kind == "sliding" or (joint.kind == "fixed" and not joint.grounded):
            yield _symbol(joint, "slide")
    heaviest = max((body.mass for body in poses.bodies), default=0.0)
    for body in poses.bodies:
        share = max(body.mass, 0.0) / heaviest if heaviest > 0.0 else 0.0
        shape = Shape(fill="own" if body.mass > 0.0 else "page", dot=6.0 + 6.0 * np.cbrt(share))
        yield Part("stamp", "body", body.name, body.places[:, None], shapes=(shape,))
    yield from (_symbol(joint, "pivot") for joint in poses.joints if joint.kind == "turning")


def _symbol(joint: DrawnJoint, role: str) -> Part:
    dot = (Shape(dot=1.6, fill="own"),) if joint.driven else ()
    shapes = (*_SYMBOLS[joint.kind], *dot)
    axes = None if joint.kind == "turning" else joint.axes
    return Part("stamp", role, joint.name, joint.places[:, None], axes, shapes=shapes)
