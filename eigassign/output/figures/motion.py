"""The mechanism by itself, and in motion: along its trajectory, or swinging in one mode.

An animation is drawn frame by frame on one canvas and encoded by Pillow, which matplotlib brings:
GIF, which everything shows, or animated PNG, which has all colours.
"""

from __future__ import annotations

import io
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from eigassign.output.figures import graph, style
from eigassign.output.figures.graph import BLUE, FigurePlan, short
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
from eigassign.study.results import DrawnPoses, ModePictures

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from PIL.Image import Image

Floats = NDArray[np.float64]

KINDS_OF_FILE = ("gif", "png")
_PAUSE_MS = 40  # between two frames: GIF knows hundredths of a second, and browsers slow 10 ms down
_PERIOD = 32  # frames of a period of a mode
_WIDTH_IN, _TALLEST_IN, _LOWEST_IN = 5.0, 4.0, 1.4
_SIDE_IN, _FOOT_IN, _HEAD_IN = 0.3, 0.75, 0.46
_GHOST = "#c4c4c4"


@dataclass(frozen=True)
class Animation:
    """``moving`` in its n poses over what stays, ``captions`` (n,) below; it begins anew forever.

    ``still``: poses that are drawn in grey under all frames.
    """

    title: str
    moving: DrawnPoses
    still: DrawnPoses
    captions: tuple[str, ...]


def along_trajectory(title: str, poses: DrawnPoses) -> Animation:
    """Poses evenly spread in time, with the time of each; it takes as long as they have frames."""
    names = poses.of or ("",) * len(poses.lines)
    times = zip(names, poses.time_s, strict=True)
    captions = tuple(f"{short(name, 16)} t = {t:.3g} s".strip() for name, t in times)
    return Animation(short(title, 60), poses, _one_pose(poses, 0), captions)


def swinging(pictures: ModePictures, mode: int) -> Animation:
    """One period of a mode (0 is the lowest) over the mechanism at rest."""
    phase = np.linspace(0.0, 2.0 * np.pi, _PERIOD, endpoint=False)
    hz = pictures.frequencies_hz[mode]
    return Animation(
        f"{short(pictures.title, 44)}: mode {mode + 1}, {hz:.5g} Hz",
        _scaled(pictures.rest, pictures.deformed, mode, np.cos(phase)),
        pictures.rest,
        ("",) * _PERIOD,
    )


def _one_pose(poses: DrawnPoses, pose: int) -> DrawnPoses:
    """That pose alone, without symbols but for the joints, which stand on the ground."""
    joints = tuple(
        replace(joint, places=joint.places[[pose]], axes=joint.axes[[pose]])
        for joint in poses.joints
    )
    nothing: dict[str, Any] = {"bodies": (), "springs": (), "of": poses.of[pose : pose + 1]}
    lines, times = poses.lines[pose : pose + 1], poses.time_s[pose : pose + 1]
    return replace(poses, lines=lines, time_s=times, joints=joints, **nothing)


def _scaled(rest: DrawnPoses, deformed: DrawnPoses, mode: int, factors: Floats) -> DrawnPoses:
    """Poses that are moved by ``factors`` (n,) of what a mode moves them by."""

    def places(still: Floats, moved: Floats) -> Floats:
        return np.asarray(still[0] + factors[:, None] * (moved[mode] - still[0]))

    lines = [
        still + factors[:, None, None] * (moved - still)
        for still, moved in zip(rest.lines[0], deformed.lines[mode], strict=True)
    ]
    joints = [
        replace(a, places=places(a.places, b.places), axes=np.repeat(a.axes, len(factors), axis=0))
        for a, b in zip(rest.joints, deformed.joints, strict=True)
    ]
    bodies = [
        replace(a, places=places(a.places, b.places))
        for a, b in zip(rest.bodies, deformed.bodies, strict=True)
    ]
    springs = [
        replace(a, starts=places(a.starts, b.starts), ends=places(a.ends, b.ends))
        for a, b in zip(rest.springs, deformed.springs, strict=True)
    ]
    return replace(
        rest,
        time_s=np.zeros(len(factors)),
        lines=tuple(tuple(line[k] for line in lines) for k in range(len(factors))),
        joints=tuple(joints),
        bodies=tuple(bodies),
        springs=tuple(springs),
    )


# --- Drawing


def mechanism_plan(title: str, poses: DrawnPoses) -> FigurePlan:
    """The first of these poses, the others behind it in grey, with the path of the tip."""
    text = f"Line drawing of the mechanism in {len(poses.lines)} poses, the first in colour."
    return FigurePlan("mechanism", "Mechanism", "", text, partial(_drawn, title, poses))


def _drawn(title: str, poses: DrawnPoses) -> Figure:
    figure, drawing = _sheet(short(title, 60), extent(poses))
    draw_ground(drawing, poses.joints)
    for pose in range(len(poses.lines) - 1, 0, -1):
        draw_links(drawing, poses, pose, _GHOST)
    _draw_pose(drawing, poses, 0)
    return figure


def _sheet(title: str, held: Extent) -> tuple[Figure, Drawing]:
    """A figure with axes that hold everything, and its scale."""
    width = _WIDTH_IN - 2.0 * _SIDE_IN
    tall = float(np.clip(width * held.size[1] / held.size[0], _LOWEST_IN, _TALLEST_IN))
    figure = style.new_figure(title, _FOOT_IN + tall + _HEAD_IN, _WIDTH_IN, layout=None)
    drawing = held.drawing(figure, (_SIDE_IN, _FOOT_IN, width, tall), room=1.06)
    drawing.axes.set_axis_off()
    draw_bearings(figure, drawing, 0.1, 0.08)
    return figure, drawing


def _draw_pose(drawing: Drawing, poses: DrawnPoses, pose: int) -> None:
    if poses.tip_path is not None:
        drawing.line(drawing.view.flat(poses.tip_path), graph.VERMILLION, 1.2)
    draw_springs(drawing, poses.springs, pose, graph.GREEN)
    draw_links(drawing, poses, pose, BLUE)
    draw_joints(drawing, poses.joints, pose, BLUE, ("sliding", "fixed"))
    draw_bodies(drawing, poses.bodies, pose, graph.VERMILLION)
    draw_joints(drawing, poses.joints, pose, BLUE, ("turning",))


def encode(animation: Animation, kind: str) -> bytes:
    """The animation as a file of one of `KINDS_OF_FILE`, the same bytes every time."""
    frames = _frames(animation)
    looping: dict[str, Any] = {"save_all": True, "duration": _PAUSE_MS, "loop": 0}
    data = io.BytesIO()
    if kind == "gif":
        palette = frames[0].quantize(64)
        frames = [frame.quantize(palette=palette, dither=_PLAIN) for frame in frames]
        looping |= {"disposal": 1, "optimize": False}
    frames[0].save(data, format=kind.upper(), append_images=frames[1:], **looping)
    return data.getvalue()


_PLAIN: Any = 0  # Pillow's Dither.NONE


def _frames(animation: Animation) -> list[Image]:
    """Each pose drawn over what stays: that is drawn once, and takes longest."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from PIL import Image

    moving, frames = animation.moving, []
    with style.applied():
        held = extent(animation.still, [points_of(moving)])
        figure, drawing = _sheet(animation.title, held)
        note = figure.text(
            1.0 - 0.1 / _WIDTH_IN, 0.2 / figure.get_size_inches()[1], "",
            ha="right", va="center", size=style.SMALL_PT, color=graph.GREY,
        )  # fmt: skip
        canvas: Any = FigureCanvasAgg(figure)
        draw_ground(drawing, moving.joints)
        draw_links(drawing, animation.still, 0, _GHOST)
        draw_joints(drawing, animation.still.joints, 0, _GHOST, KINDS)
        canvas.draw()
        staying, artists = canvas.copy_from_bbox(figure.bbox), drawing.axes.get_children()
        for pose, caption in enumerate(animation.captions):
            canvas.restore_region(staying)
            _draw_pose(drawing, moving, pose)
            for artist in drawing.axes.get_children():
                if artist not in artists:
                    drawing.axes.draw_artist(artist)
                    artist.remove()
            note.set_text(caption)
            figure.draw_artist(note)
            frames.append(Image.fromarray(np.asarray(canvas.buffer_rgba()).copy()).convert("RGB"))
    return frames
