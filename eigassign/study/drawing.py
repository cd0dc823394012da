"""The mechanism in a few of the poses that it passes through, as polylines to draw."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from eigassign.case import CaseFile
from eigassign.mechanism.trajectories import Trajectories
from eigassign.modal.model import Model
from eigassign.study.findings import Poses

Floats = NDArray[np.float64]
POSES = 7  # drawn, first and last sample included


def draw_poses(
    file: CaseFile, model: Model, trajectory: Trajectories, y: Floats, count: int = POSES
) -> Poses:
    """Poses at samples evenly spread over the trajectory's length in q, at design y."""
    chosen = spread_samples(trajectory.q, count)
    lines = model.poses.lines(model.x(trajectory.q, y))[..., :2]  # (n_t, n_links, 2 ends, 2)
    links = model.poses.links
    return Poses(
        time_s=_frozen(trajectory.time_s[chosen]),
        of=tuple(trajectory.name_of(k) for k in chosen) if trajectory.several else (),
        lines=tuple(tuple(_frozen(line) for line in lines[k]) for k in chosen),
        link_names=links,
        bodies=_bodies(file, links, lines[chosen]),
        tip_path=_tip_path(trajectory, lines),
    )


def rest_pose(file: CaseFile, model: Model, q: Floats, y: Floats) -> Poses:
    """The one pose of a case without a trajectory."""
    lines = model.poses.lines(model.x(q, y))[..., :2]
    drawn = (tuple(_frozen(line) for line in lines[0]),)
    links = model.poses.links
    return Poses(np.zeros(1), drawn, links, _bodies(file, links, lines), None)


def spread_samples(q: Floats, count: int) -> list[int]:
    """At most ``count`` samples, evenly spread over the distance travelled; first and last too."""
    steps = np.linalg.norm(np.diff(q, axis=0), axis=1)
    travelled = np.concatenate([[0.0], np.cumsum(steps)])
    if travelled[-1] == 0.0:
        return [0]
    wanted = np.linspace(0.0, travelled[-1], count)
    return sorted({int(np.abs(travelled - distance).argmin()) for distance in wanted})


def _tip_path(trajectory: Trajectories, lines: Floats) -> Floats:
    """The path that the case gives, else the one of the last link's end; NaN between two."""
    path = lines[:, -1, 1] if trajectory.tip is None else trajectory.tip
    seams = [rows.stop for rows in trajectory.rows[:-1]]
    return _frozen(np.insert(path, seams, np.nan, axis=0))


def _bodies(
    file: CaseFile, links: tuple[str, ...], lines: Floats
) -> tuple[tuple[str, Floats], ...]:
    """Name and position per pose (n_poses, 2) of every body."""
    placed = []
    for name, body in file.mechanism.bodies.items():
        link, _, node = body.at.partition(".")
        end = 1 if node == "end" else 0
        placed.append((name, _frozen(lines[:, links.index(link), end])))
    return tuple(placed)


def _frozen(array: Floats) -> Floats:
    array = np.ascontiguousarray(array)
    array.setflags(write=False)
    return array
